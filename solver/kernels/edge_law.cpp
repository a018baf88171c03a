#include "edge_law.hpp"

namespace adhesis {

CriticalOpening critical_of(int edge, double theta, double opening, const EdgeLaw& law,
                            const Panels& panels) {
  const auto [critical, drift] = critical_opening(theta, law, panels);
  if (law.pinning == 0) return {critical, drift, false};
  const double way = way_from_memory(edge, theta, law), receding = critical * (1 + law.pinning);
  if (way == 0 && critical <= opening && opening <= receding) return {opening, 0, true};
  if (way < 0 || (way == 0 && opening > receding))
    return {receding, drift * (1 + law.pinning), false};
  return {critical, drift, false};
}

Flags at_memory(const Vector& ends, const EdgeLaw& law) {
  Flags out(ends.size());
  if (law.pinning > 0)
    for (int e = 0; e < int(ends.size()); ++e) out[e] = way_from_memory(e, ends[e], law) == 0;
  return out;
}

}  // namespace adhesis
