#include "grid.hpp"

namespace adhesis {

double total(Numbers values) {
  const int n = int(values.size());
  Four even = {}, odd = {};
  int i = 0;
  for (; i + 8 <= n; i += 8) {
    even += load_four(&values[i]);
    odd += load_four(&values[i + 4]);
  }
  const Four both = even + odd;
  double out = (both[0] + both[1]) + (both[2] + both[3]);
  for (; i < n; ++i) out += values[i];
  return out;
}

bool restrict_inside(Changed values, Numbers inside) {
  bool was = true;
  for (size_t i = 0; i < values.size(); ++i) {
    if (inside[i] == 0 && values[i] != 0) {
      values[i] = 0;
      was = false;
    }
  }
  return was;
}

double residual_inside(Numbers target, Numbers displacement, Numbers inside, Changed out) {
  double most = 0;
  for (size_t i = 0; i < out.size(); ++i) {
    out[i] = (target[i] - displacement[i]) * inside[i];
    most = std::max(most, std::abs(out[i]));
  }
  return most;
}

void update_direction(Changed direction, Numbers inside, Numbers correction, double factor) {
  for (size_t i = 0; i < direction.size(); ++i)
    direction[i] = inside[i] * correction[i] + factor * direction[i];
}

double advance(Changed stress, Changed displacement, Changed residual, Numbers direction,
               Numbers response, Numbers inside, double step) {
  double most = 0;
  for (size_t i = 0; i < stress.size(); ++i) {
    stress[i] += step * direction[i];
    displacement[i] += step * response[i];
    residual[i] -= step * response[i] * inside[i];
    most = std::max(most, std::abs(residual[i]));
  }
  return most;
}

}  // namespace adhesis
