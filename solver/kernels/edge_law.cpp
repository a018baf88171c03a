#include "edge_law.hpp"

namespace adhesis {

double contact_work(const Vector& ends, bool recedes, const Adhesion& adhesion) {
  double total = adhesion.work_up_to(2 * pi, recedes);
  for (int e = 0; e < int(ends.size()); ++e)
    total += outwards(e) * adhesion.work_up_to(ends[e], recedes);
  return total;
}

CriticalOpening critical_of(int edge, double theta, double opening, const EdgeLaw& law) {
  const auto [critical, drift] = critical_opening(theta, law);
  if (!law.pins()) return {critical, drift, false};
  const double way = way_from_memory(edge, theta, law);
  const auto [receding, receding_drift] = critical_opening(theta, law, true);
  if (way == 0 && critical <= opening && opening <= receding) return {opening, 0, true};
  if (way < 0 || (way == 0 && opening > receding)) return {receding, receding_drift, false};
  return {critical, drift, false};
}

EdgeStates states_at(const Vector& ends, const EdgeLaw& law, double within) {
  EdgeStates out = {Flags(ends.size()), Flags(ends.size())};
  for (int e = 0; law.pins() && e < int(ends.size()); ++e) {
    const double way = outwards(e) * (ends[e] - law.memory[e]);
    out.held[e] = std::abs(way) <= within;
    out.recedes[e] = way < 0;
  }
  return out;
}

}  // namespace adhesis
