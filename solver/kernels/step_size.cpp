#include "step_size.hpp"

namespace adhesis {

double model_error(const ModelFlow& flow, const Vector& residual, const Integers& edges,
                   const Vector& ends, const EdgeLaw& law) {
  double worst = 0;
  for (size_t e = 0; e < residual.size(); ++e) {
    const double critical = critical_opening(ends[edges[e]], law).value;
    const double at_end = std::abs(residual[e] + critical - flow.opening[e]);
    for (size_t i = 0; i < flow.lengths.size(); ++i) {
      const double share = flow.lengths[i] / flow.lengths.back();
      const double error = share * share * at_end;
      const double unbalance = std::max(std::abs(flow.residuals[i][e]) - error, 0.0);
      const double allowed = MODEL_ERROR * law.critical + MODEL_SHARE * unbalance;
      // not written as > : an error that is no number is too large
      if (!(error <= worst * allowed)) worst = error / allowed;
    }
  }
  return worst;
}

double next_reach(double before, double length, double error) {
  const double safe = REACH_SAFETY / std::sqrt(std::max(error, 1e-9));
  const double factor = std::min(STEP_GROWTH, std::max(STEP_REDUCTION, safe));
  double reach = length * factor;
  if (error <= 1) reach = std::max(reach, factor >= 1 ? before : 0.0);
  return reach;
}

}  // namespace adhesis
