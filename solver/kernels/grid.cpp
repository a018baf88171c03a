#include "grid.hpp"

namespace adhesis {

double total(const double* values, int n) {
  Four even = {}, odd = {};
  int i = 0;
  for (; i + 8 <= n; i += 8) {
    even += load_four(values + i);
    odd += load_four(values + i + 4);
  }
  const Four both = even + odd;
  double out = (both[0] + both[1]) + (both[2] + both[3]);
  for (; i < n; ++i) out += values[i];
  return out;
}

bool restrict_inside(double* values, const double* inside, int n) {
  bool was = true;
  for (int i = 0; i < n; ++i) {
    if (inside[i] == 0 && values[i] != 0) {
      values[i] = 0;
      was = false;
    }
  }
  return was;
}

double residual_inside(const double* target, const double* displacement, const double* inside,
                       double* out, int n) {
  double most = 0;
  for (int i = 0; i < n; ++i) {
    out[i] = (target[i] - displacement[i]) * inside[i];
    most = std::max(most, std::abs(out[i]));
  }
  return most;
}

void update_direction(double* direction, const double* inside, const double* correction,
                      double factor, int n) {
  for (int i = 0; i < n; ++i) direction[i] = inside[i] * correction[i] + factor * direction[i];
}

double advance(GridState state, const double* direction, const double* response,
               const double* inside, double step, int n) {
  double most = 0;
  for (int i = 0; i < n; ++i) {
    state.stress[i] += step * direction[i];
    state.displacement[i] += step * response[i];
    state.residual[i] -= step * response[i] * inside[i];
    most = std::max(most, std::abs(state.residual[i]));
  }
  return most;
}

double inverse_form(double* matrix, const double* vector, int n) {
  double sum = 0;
  Vector y(n);
  for (int i = 0; i < n; ++i) {
    double* row = matrix + i * n;
    for (int j = 0; j < i; ++j) row[j] = (row[j] - dot(row, matrix + j * n, j)) / matrix[j * n + j];
    row[i] = std::sqrt(row[i] - dot(row, row, i));
    y[i] = (vector[i] - dot(row, y.data(), i)) / row[i];
    sum += y[i] * y[i];
  }
  return sum;
}

}  // namespace adhesis
