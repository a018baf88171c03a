// The law of the edges: where each of them advances, recedes, or is held.
//
// Edges are numbered along the profile: 2k and 2k + 1 are the left and the right end of gap k.
// Motions are outwards of the contact: a left end of a gap moves to the right.
//
// The contract
// ------------
// A law of adhesion is an `Adhesion`. It states for a place θ of the profile the work of adhesion w
// of an edge that advances there and of one that recedes, each with its slope, and both integrals;
// w is that of a projected length over the γ of the problem, which is a unit and nothing else. All
// the rest follows from it, and field, flow and continuation ask for no other threshold:
//
// - threshold: an edge moves where its opening C is C_c = critical sqrt(w), Griffith's condition.
//   Its slope ∂C_c/∂θ is part of the tangent of its gap, hence of stability and folds, and of the
//   Hessian of a descent;
// - side and memory: an edge ahead of its place in the state before advances, one behind it
//   recedes, and at that place it is held while C lies between both thresholds. So a path depends
//   on its past, and within a descent an edge that ran too far comes back as it went. The memory
//   of a descent is where it began; after a touch, or where a patch or gap has vanished, anew;
// - what begins next: of an edge that is held the share of C between both thresholds and the rate
//   of that share, from which a branch predicts where the edge begins to move;
// - energy: that of the contact is the integral of w of advancing edges over its patches. An edge
//   that recedes dissipates the integral of the difference: friction, in a column of its own.
//
// What a law of adhesion has to keep. Points 1, 2, 3 and 5 of a law of one's own are checked at
// some places, before a path is followed (adhesion.py):
//
// 1. w is positive, of period 2π, and smooth over the shortest wave that `StressSource.top` states:
//    steps of a descent are a twentieth of that wave, and predictors are of third order.
// 2. w of an edge that recedes is nowhere less than that of one that advances. If they differ
//    anywhere `pins` is true; else edges have no memory, and the costs of one are saved.
// 3. `work_up_to` is the integral of `work`: or the loop integral differs from the sum of drops and
//    friction, which the audit shows. A wrong slope shows in no audit but as failing steps.
// 4. w depends on the place alone. It is asked at any time, in any order, from any thread. A law of
//    speed, or of other edges, is none of this kind, and one that acts over a range has more
//    unknowns than edges.
// 5. `least` and `largest` bound w where the profile is flat: seeds and lengths that count as
//    nothing are set by the least, bounds of how fast gaps close by the largest. Where they differ
//    steps are those of a varying γ.
// 6. λ_min is that of the problem, of its profile and pattern. Equal parts and mirror axes of the
//    problem that a law of one's own does not share, at the same places, count as none.
//
// What remains of one γ are scales, not thresholds: `critical` in the tolerances below, the
// accuracy of the field and the density of states by the strength of adhesion beside roughness.
#pragma once

#include <memory>

#include "model.hpp"
#include "tolerances.hpp"

namespace adhesis {

class Adhesion {
 public:
  const bool pins;              // whether edges are held between two thresholds
  const double least, largest;  // bounds of w where the profile is flat

  Adhesion(bool pins, double least, double largest) : pins(pins), least(least), largest(largest) {}
  Adhesion(const Adhesion&) = delete;
  virtual ~Adhesion() = default;

  // w and dw/dθ of an edge at θ.
  virtual std::pair<double, double> work(double theta, bool recedes) const = 0;

  // Integrate w dθ from 0 to θ, which may lie outside of [0, 2π).
  virtual double work_up_to(double theta, bool recedes) const = 0;
};

// γ along the profile, in the measure of the problem, and a constant ratio γ_open/γ.
class ProfileAdhesion : public Adhesion {
 public:
  ProfileAdhesion(std::shared_ptr<const Panels> panels, double ratio, double least, double largest)
      : Adhesion(ratio > 1, least, ratio * largest), panels_(std::move(panels)), ratio_(ratio) {}

  std::pair<double, double> work(double theta, bool recedes) const override {
    const auto [value, slope] = measure_at(theta, *panels_);
    if (!recedes) return {value, slope};
    return {ratio_ * value, ratio_ * slope};
  }

  double work_up_to(double theta, bool recedes) const override {
    return (recedes ? ratio_ : 1) * length_up_to(theta, *panels_);
  }

 private:
  const std::shared_ptr<const Panels> panels_;
  const double ratio_;
};

// Integrate w over the patches between gaps with these ends.
double contact_work(const Vector& ends, bool recedes, const Adhesion& adhesion);

// The law by which the edges move, with the tolerances of one problem; lengths in θ.
struct EdgeLaw {
  std::shared_ptr<const Adhesion> adhesion;
  double critical;          // critical opening where w = 1
  double newton_tolerance;  // a correction this small ends Newton's iteration
  double field_error;       // largest displacement of an equilibrium by the error of the field
  double rest_step;         // a descent with shorter steps is left to Newton's iteration
  double longest_step;      // longest short step of an edge in a descent
  double smallest;          // narrower patches and gaps are removed
  double rough_rate;        // of an opening over a shortest wave, by roughness or by C_c
  double force_error;       // a force C_c² - C² this small is the error of the field
  Vector memory = {};       // ends at the last state; empty unless edges are pinned

  bool pins() const { return adhesion->pins; }
};

inline double outwards(int edge) { return edge % 2 == 0 ? 1 : -1; }

// C_c at θ of an edge that advances or recedes, and its derivative.
inline ValueAndSlope critical_opening(double theta, const EdgeLaw& law, bool recedes = false) {
  const auto [work, slope] = law.adhesion->work(theta, recedes);
  const double root = std::sqrt(work);
  return {law.critical * root, law.critical * slope / (2 * root)};
}

// By how much C_c at θ of an edge that recedes is larger, and the derivative of that.
inline ValueAndSlope pinning_range(double theta, const EdgeLaw& law) {
  const ValueAndSlope advances = critical_opening(theta, law);
  const ValueAndSlope recedes = critical_opening(theta, law, true);
  return {recedes.value - advances.value, recedes.slope - advances.slope};
}

// How far an edge has advanced from its memory; exactly 0 where it may be pinned.
inline double way_from_memory(int edge, double theta, const EdgeLaw& law) {
  const double way = outwards(edge) * (theta - law.memory[edge]);
  return std::abs(way) > 0.5 * law.newton_tolerance ? way : 0;
}

// C_c of an edge with the opening C, and its derivative by θ; of a pinned edge it is C.
struct CriticalOpening {
  double value, slope;
  bool pinned;
};

CriticalOpening critical_of(int edge, double theta, double opening, const EdgeLaw& law);

// Which edges are held, and which of the others recede.
struct EdgeStates {
  Flags held, recedes;
};

// Hold the edges within a length of their memory; none where edges are not pinned.
EdgeStates states_at(const Vector& ends, const EdgeLaw& law, double within);
inline EdgeStates states_at(const Vector& ends, const EdgeLaw& law) {
  return states_at(ends, law, 0.5 * law.newton_tolerance);
}

inline Vector move_edges(const Vector& ends, const Vector& motion) {
  Vector out(ends);
  for (int e = 0; e < int(ends.size()); ++e) out[e] += outwards(e) * motion[e];
  return out;
}

// Find the length of the shortest gap or patch; NaN if an edge is.
inline double shortest_length(const Vector& ends) {
  double least = std::min(2 * pi, ends.front() + 2 * pi - ends.back());
  for (size_t e = 1; e < ends.size(); ++e) {
    const double length = ends[e] - ends[e - 1];
    if (!(length >= least)) least = length;
    if (std::isnan(least)) break;
  }
  return least;
}

// Longest step that counts as rest: less where gaps or patches are short.
inline double rest_within(const Vector& ends, const EdgeLaw& law) {
  return law.rest_step * std::min(1.0, CLOSING_SHARE * shortest_length(ends) / law.longest_step);
}

// Limit the motion of an edge: `longest`, or a share of the gap or patch that it may close.
inline double motion_limit(const Gap& gap, int side, double longest, double share) {
  return std::min(longest, share * std::min(gap.length(), gap.patch[side]));
}

}  // namespace adhesis
