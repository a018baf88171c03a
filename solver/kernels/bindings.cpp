// What Python sees of the kernels: objects that it owns, functions, and arrays of their numbers.
//
// Long kernels run without the interpreter's lock.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/tuple.h>

#include <chrono>

#include "cholesky.hpp"
#include "clearance.hpp"
#include "descent.hpp"
#include "edge_model.hpp"
#include "grid.hpp"
#include "newton.hpp"
#include "predictor.hpp"
#include "signals.hpp"
#include "step_size.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace adhesis {

void check_signals() {
  using Clock = std::chrono::steady_clock;
  static thread_local Clock::time_point last = Clock::now();
  if (Clock::now() - last < std::chrono::milliseconds(50)) return;
  last = Clock::now();
  nb::gil_scoped_acquire held;
  if (PyErr_CheckSignals() != 0) throw nb::python_error();
}

namespace {

using Array = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
using IntegerArray = nb::ndarray<const int64_t, nb::c_contig, nb::device::cpu>;
using Changed = nb::ndarray<double, nb::c_contig, nb::device::cpu>;  // in place
using Values = nb::ndarray<nb::numpy, double>;
using Whole = nb::ndarray<nb::numpy, int64_t>;
using Truth = nb::ndarray<nb::numpy, bool>;
constexpr auto new_array = nb::rv_policy::automatic;  // a property's

Vector vector_of(const Array& array) { return {array.data(), array.data() + array.size()}; }

Integers integers_of(const IntegerArray& array) {
  return {array.data(), array.data() + array.size()};
}

Integers integers_of(const std::optional<IntegerArray>& array) {
  return array ? integers_of(*array) : Integers();
}

Matrix matrix_of(const Array& array) {
  Matrix out(int(array.shape(0)));
  out.values = vector_of(array);
  return out;
}

// Hand numbers over to numpy, without a copy.
template <class Number>
nb::ndarray<nb::numpy, Number> hand_over(std::vector<Number> values,
                                         std::initializer_list<size_t> shape) {
  auto* kept = new std::vector<Number>(std::move(values));
  nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<Number>*>(p); });
  return {kept->data(), shape, owner};
}

Values array_of(Vector values) {
  const size_t size = values.size();
  return hand_over(std::move(values), {size});
}

Values pairs_of(Vector values) {
  const size_t size = values.size();
  return hand_over(std::move(values), {size / 2, 2});
}

Whole array_of(const Integers& values) {
  return hand_over(std::vector<int64_t>(values.begin(), values.end()), {values.size()});
}

Whole array_of(const Halves& halves) {
  std::vector<int64_t> out;
  for (auto& [one, two] : halves) out.insert(out.end(), {one, two});
  return hand_over(std::move(out), {halves.size(), 2});
}

Values array_of(const Matrix& matrix) {
  return hand_over(matrix.values, {size_t(matrix.n), size_t(matrix.n)});
}

// The table of gaps: both ends, widths of the patches beside them, α.
Values table_of(const std::vector<Gap>& gaps) {
  Vector out;
  for (const Gap& gap : gaps)
    out.insert(out.end(), {gap.end[0], gap.end[1], gap.patch[0], gap.patch[1], gap.alpha});
  return hand_over(std::move(out), {gaps.size(), 5});
}

Gap gap_of(const Array& row) {
  const double* x = row.data();
  return {{x[0], x[1]}, {x[2], x[3]}, x[4]};
}

// A value and a slope at each angle.
template <class Evaluate>
std::pair<Values, Values> evaluate_at(const Array& theta, Evaluate evaluate) {
  Vector values, slopes;
  for (double at : vector_of(theta)) {
    const ValueAndSlope found = evaluate(at);
    values.push_back(found.value);
    slopes.push_back(found.slope);
  }
  return {array_of(values), array_of(slopes)};
}

// Run a kernel without the interpreter's lock.
template <class Kernel>
auto unlocked(Kernel kernel) {
  nb::gil_scoped_release release;
  return kernel();
}

using Minima = std::tuple<Values, Values, Values>;  // positions, openings and curvatures

Minima minima_of(const std::vector<Minimum>& minima) {
  Vector theta, opening, curvature;
  for (const Minimum& minimum : minima) {
    theta.push_back(minimum.theta);
    opening.push_back(minimum.opening);
    curvature.push_back(minimum.curvature);
  }
  return {array_of(theta), array_of(opening), array_of(curvature)};
}

// Gaps as they were when they were last searched for touches.
struct Searched {
  SearchedGaps gaps;
};

Vector pack(const Searched& searched) {
  Vector out;
  for (const auto& gap : searched.gaps) {
    out.insert(out.end(), {gap->end[0], gap->end[1], double(gap->order), gap->clearance,
                           double(gap->theta.size())});
    out.insert(out.end(), gap->theta.begin(), gap->theta.end());
    out.insert(out.end(), gap->opening.begin(), gap->opening.end());
  }
  return out;
}

Searched unpack(const Array& packed) {
  Searched out;
  const double *x = packed.data(), *end = x + packed.size();
  while (x < end) {
    const int count = int(x[4]);
    const double *theta = x + 5, *opening = theta + count;
    out.gaps.push_back(std::make_shared<SearchedGap>(
        SearchedGap{{x[0], x[1]}, int(x[2]), {theta, opening}, {opening, opening + count}, x[3]}));
    x = opening + count;
  }
  return out;
}

std::optional<LinearResponse> keep(NewResponse&& made) {
  if (!made.has_field) return std::nullopt;
  return std::move(made.response);
}

using Openings = std::tuple<Values, Values, Values, Values>;

// θ and T at rising θ, the weight of ∫ T g dθ divided by T, and b_n.
Openings rising(FineOpening fine) {
  const double spacing = pi / double(fine.theta.size() + 1);
  for (double& stretch : fine.theta_by_t) stretch *= spacing;
  for (Vector* values : {&fine.theta, &fine.opening, &fine.theta_by_t})
    std::reverse(values->begin(), values->end());
  return {array_of(fine.theta), array_of(fine.opening), array_of(fine.theta_by_t),
          array_of(fine.modes)};
}

using WorkFunction = nb::typed<nb::callable, std::pair<double, double>(double, bool)>;
using IntegralFunction = nb::typed<nb::callable, double(double, bool)>;

// A law of Python functions.
class PythonAdhesion : public Adhesion {
 public:
  PythonAdhesion(bool pins, double least, double largest, WorkFunction work, IntegralFunction up_to)
      : Adhesion(pins, least, largest), work_(std::move(work)), up_to_(std::move(up_to)) {}

  std::pair<double, double> work(double theta, bool recedes) const override {
    nb::gil_scoped_acquire held;
    return nb::cast<std::pair<double, double>>(work_(theta, recedes));
  }

  double work_up_to(double theta, bool recedes) const override {
    nb::gil_scoped_acquire held;
    return nb::cast<double>(up_to_(theta, recedes));
  }

 private:
  nb::callable work_, up_to_;
};

void bind_model(nb::module_& m) {
  nb::class_<Panels>(m, "Panels", "The full-contact stress of a profile, compressed on panels.")
      .def(
          "__init__",
          [](Panels* panels, double width, int finest_count, const Array& x, const Array& w,
             const Array& stress, const Array& slope, const Array& tilt, const Array& pattern,
             const Array& half_plane, const Array& weights, const IntegerArray& level_start,
             const Array& end_x, const Array& end_w, int short_count, const Array& length_x,
             const Array& length_w, const Array& length_before, int top) {
            const double* half = half_plane.data() + half_plane.size() / 2;
            const double* of_slope = weights.data() + weights.size() / 2;
            new (panels) Panels{
                width,
                finest_count,
                vector_of(x),
                vector_of(w),
                vector_of(stress),
                vector_of(slope),
                vector_of(tilt),
                vector_of(pattern),
                {Vector(half_plane.data(), half), Vector(half, half + half_plane.size() / 2)},
                {Vector(weights.data(), of_slope), Vector(of_slope, of_slope + weights.size() / 2)},
                integers_of(level_start),
                vector_of(end_x),
                vector_of(end_w),
                ShortRule(short_count),
                {vector_of(length_x), vector_of(length_w), vector_of(length_before)},
                top};
          },
          nb::kw_only(), "width"_a, "finest_count"_a, "x"_a, "w"_a, "stress"_a, "slope"_a, "tilt"_a,
          "pattern"_a, "half_plane"_a, "weights"_a, "level_start"_a, "end_x"_a, "end_w"_a,
          "short_count"_a, "length_x"_a, "length_w"_a, "length_before"_a, "top"_a)
      .def(
          "stress",
          [](const Panels& p, const Array& theta) {
            return evaluate_at(theta, [&](double at) {
              return ValueAndSlope{evaluate_series(p.stress, at, p).value,
                                   evaluate_series(p.slope, at, p).value};
            });
          },
          "theta"_a, "Evaluate S and S' at any angles.")
      .def(
          "half_plane_opening",
          [](const Panels& p, const Array& theta, int side) {
            return evaluate_at(theta, [&](double at) { return half_plane_opening(at, side, p); });
          },
          "theta"_a, "side"_a,
          "Evaluate C and dC/dθ of half-plane cracks that begin (side 0) or end (1) at θ.");
  nb::class_<Device>(m, "LoadingDevice",
                     "Device that prescribes the value d = separation_weight·q0 s - compliance·p.")
      .def(nb::init<double, double>(), "separation_weight"_a, "compliance"_a)
      .def_ro("separation_weight", &Device::separation_weight)
      .def_ro("compliance", &Device::compliance);
  nb::class_<Model>(m, "FieldModel", "Inputs of a field besides its gaps and the prescribed value.")
      .def(
          "__init__",
          [](Model* model, const Device& device, double digits,
             std::shared_ptr<const Panels> panels) {
            new (model) Model{device, digits, std::move(panels)};
          },
          "device"_a, "digits"_a, "panels"_a)
      .def_ro("device", &Model::device)
      .def_ro("digits", &Model::digits)
      .def_prop_ro("panels", [](const Model& model) {
        return std::const_pointer_cast<Panels>(model.panels);
      });
  nb::class_<Adhesion>(m, "Adhesion",
                       "Works of adhesion of edges; the contract is in edge_law.hpp.")
      .def_ro("pins", &Adhesion::pins)
      .def_ro("least", &Adhesion::least)
      .def_ro("largest", &Adhesion::largest)
      .def("work", &Adhesion::work, "theta"_a, "recedes"_a,
           "Evaluate w of an edge that advances or recedes at θ, and dw/dθ.")
      .def("work_up_to", &Adhesion::work_up_to, "theta"_a, "recedes"_a,
           "Integrate w dθ from 0 to θ.")
      .def(
          "contact_work",
          [](const Adhesion& adhesion, const Array& gaps, bool recedes) {
            return contact_work(vector_of(gaps), recedes, adhesion);
          },
          "gaps"_a, "recedes"_a = false, "Integrate w dθ over the patches between gaps.");
  nb::class_<ProfileAdhesion, Adhesion>(m, "ProfileAdhesion",
                                        "γ along the profile, and a constant ratio γ_open/γ.")
      .def(nb::init<std::shared_ptr<const Panels>, double, double, double>(), "panels"_a,
           "ratio"_a = 1.0, "least"_a = 1.0, "largest"_a = 1.0);
  nb::class_<PythonAdhesion, Adhesion>(m, "PythonAdhesion", "A law of Python functions.")
      .def(nb::init<bool, double, double, WorkFunction, IntegralFunction>(), "pins"_a, "least"_a,
           "largest"_a, "work"_a, "work_up_to"_a);
  nb::class_<EdgeLaw>(m, "EdgeLaw",
                      "Law by which the edges move, with the tolerances of one problem.")
      .def(
          "__init__",
          [](EdgeLaw* law, std::shared_ptr<const Adhesion> adhesion, double critical,
             double newton_tolerance, double field_error, double rest_step, double longest_step,
             double smallest, double overlap_limit, double force_error) {
            new (law)
                EdgeLaw{std::move(adhesion), critical, newton_tolerance, field_error, rest_step,
                        longest_step,        smallest, overlap_limit,    force_error, {}};
          },
          nb::kw_only(), "adhesion"_a, "critical"_a, "newton_tolerance"_a, "field_error"_a,
          "rest_step"_a, "longest_step"_a, "smallest"_a, "overlap_limit"_a, "force_error"_a)
      .def(nb::init<const EdgeLaw&>())
      .def_rw("critical", &EdgeLaw::critical)
      .def_rw("newton_tolerance", &EdgeLaw::newton_tolerance)
      .def_rw("field_error", &EdgeLaw::field_error)
      .def_rw("rest_step", &EdgeLaw::rest_step)
      .def_rw("longest_step", &EdgeLaw::longest_step)
      .def_rw("smallest", &EdgeLaw::smallest)
      .def_rw("overlap_limit", &EdgeLaw::overlap_limit)
      .def_rw("force_error", &EdgeLaw::force_error)
      .def_prop_rw(
          "memory", [](const EdgeLaw& law) { return pairs_of(law.memory); },
          [](EdgeLaw& law, const Array& gaps) { law.memory = vector_of(gaps); },
          nb::for_getter(new_array), "Gaps at the last state.")
      .def(
          "at_memory",
          [](const EdgeLaw& law, const Array& gaps) {
            const Flags found = at_memory(vector_of(gaps), law);
            auto* kept = new std::vector<char>(found);
            nb::capsule owner(kept,
                              [](void* p) noexcept { delete static_cast<std::vector<char>*>(p); });
            return Truth(reinterpret_cast<bool*>(kept->data()), {kept->size()}, owner);
          },
          "gaps"_a, "Mark the edges at their memory; none where edges are not pinned.")
      .def(
          "critical_of",
          [](const EdgeLaw& law, const Array& gaps, const Array& opening) {
            Vector out, ends = vector_of(gaps);
            for (int e = 0; e < int(ends.size()); ++e)
              out.push_back(critical_of(e, ends[e], opening.data()[e], law).value);
            return array_of(out);
          },
          "gaps"_a, "opening"_a, "Compute C_c at every edge with the opening C.")
      .def(
          "critical_openings",
          [](const EdgeLaw& law, const Array& theta) {
            return evaluate_at(theta, [&](double at) { return critical_opening(at, law); });
          },
          "theta"_a, "Evaluate C_c of edges that advance, and its θ-derivative.");
  m.def(
      "map_gaps", [](const Array& gaps) { return table_of(map_gaps(vector_of(gaps))); }, "gaps"_a,
      "Make the table of gaps: both ends, widths of the patches beside them, α.");
  m.def(
      "shortest_length", [](const Array& gaps) { return shortest_length(vector_of(gaps)); },
      "gaps"_a, "Find the length of the shortest gap or patch.");
}

void bind_field(nb::module_& m) {
  nb::class_<Field>(m, "Field", "Solution of equation (1) of gap_field for given gaps.")
      .def_ro("pressure", &Field::pressure, "p = 2p̄/E*; NaN if there is no solution.")
      .def_ro("separation", &Field::separation, "q0 s.")
      .def_ro("unit_mean", &Field::unit_mean, "Xᵀ (B + G)⁻¹ X.")
      .def_ro("resistance", &Field::resistance, "-2π/resistance is ∂p/∂d at fixed edges.")
      .def_prop_ro(
          "opening", [](const Field& f) { return array_of(f.opening); }, new_array,
          "C at each edge.")
      .def_prop_ro(
          "scaled_opening", [](const Field& f) { return array_of(f.scaled_opening); }, new_array,
          "f: the openings over sqrt(1-η²), at all nodes.")
      .def_prop_ro(
          "orders", [](const Field& f) { return array_of(f.nodes.orders); }, new_array)
      .def_prop_ro(
          "offset", [](const Field& f) { return array_of(f.nodes.offset); }, new_array)
      .def_prop_ro(
          "theta", [](const Field& f) { return array_of(f.nodes.theta); }, new_array)
      .def_prop_ro(
          "weight", [](const Field& f) { return array_of(f.nodes.weight); }, new_array, "X.")
      .def_prop_ro(
          "load", [](const Field& f) { return array_of(f.equations.load); }, new_array, "S~.")
      .def(
          "block",
          [](const Field& f, int k) {
            const auto first = f.equations.blocks.begin() + f.nodes.square[k];
            const size_t n = f.nodes.size_of(k);
            return hand_over(Vector(first, first + n * n), {n, n});
          },
          "k"_a, "Diagonal block of B + G of a gap.")
      .def(
          "edge_openings",
          [](const Field& f, const Array& scaled, bool with_end_terms) {
            return array_of(edge_openings(vector_of(scaled), f.nodes, f.equations, with_end_terms));
          },
          "scaled"_a, "with_end_terms"_a = true,
          "Evaluate C at each edge from f at all nodes, of all modes.")
      .def(
          "openings_by_prescribed",
          [](const Field& f) {
            Vector out = edge_openings(f.solved[1], f.nodes, f.equations, false);
            for (double& opening : out) opening *= 2 * pi / f.resistance;
            return array_of(out);
          },
          "∂C/∂d at fixed edges.")
      .def(
          "fine_opening",
          [](const Field& f, int k, double per_wave) {
            return rising(unlocked([&] {
              const int count = count_sine_nodes(f.nodes.gaps[k], f.nodes.size_of(k),
                                                 f.model.panels->top, per_wave);
              return open_gap(f, k, Circle(count + 1));
            }));
          },
          "k"_a, "per_wave"_a,
          "Evaluate θ, T and the weight of ∫ T g dθ over T of a gap at fine nodes, and b_n.")
      .def(
          "sum_modes",
          [](const Field& f, int k, const Array& theta, const Array& modes) {
            Vector out;
            const Vector b = vector_of(modes);
            for (double at : vector_of(theta)) out.push_back(sum_modes(f.nodes.gaps[k], at, b));
            return array_of(out);
          },
          "k"_a, "theta"_a, "modes"_a, "Sum b_n sin((n+1)t), cos t = η(θ), in gap k.")
      .def(
          "refine_opening",
          [](const Field& f, int k, const Array& modes, int factor) {
            const int count = fast_size(factor * (int(modes.size()) + 1) - 1);
            auto [theta, opening, weight, same] =
                rising(refine_opening(f.nodes.gaps[k], vector_of(modes), count));
            return std::pair(theta, opening);
          },
          "k"_a, "modes"_a, "factor"_a,
          "Evaluate θ and T of gap k at about `factor` times as many nodes as modes.")
      .def(
          "work_of_gaps", [](const Field& f) { return unlocked([&] { return work_of_gaps(f); }); },
          "Integrate S_full T dθ over the gaps.");
  m.def(
      "sum_pull",
      [](const Array& theta, const Array& sine, const Array& cosine, const Array& weight) {
        const Vector at = vector_of(theta), s = vector_of(sine), c = vector_of(cosine);
        const Vector w = vector_of(weight);
        return array_of(unlocked([&] {
          Vector out;
          for (double each : at) out.push_back(sum_pull(each, s, c, w));
          return out;
        }));
      },
      "theta"_a, "sine"_a, "cosine"_a, "weight"_a,
      "Sum weight_j / sin²((θ-φ_j)/2) over j, with sine and cosine of φ_j/2.");
  m.def(
      "solve_field",
      [](const Array& gaps, double prescribed, const Model& model,
         const std::optional<IntegerArray>& orders) {
        const Vector ends = vector_of(gaps);
        const Integers own =
            orders ? integers_of(orders) : choose_orders(map_gaps(ends), model.digits);
        return unlocked([&] { return solve_field(ends, prescribed, own, 1, model).field; });
      },
      "gaps"_a, "prescribed"_a, "model"_a, "orders"_a = nb::none(),
      "Solve the field of gaps, shape (L, 2); `orders` are those of their rules.");
}

void bind_response(nb::module_& m) {
  nb::class_<ResponseSolution>(m, "ResponseSolution",
                               "All edges as a linear response has them at a prescribed value.")
      .def_prop_ro(
          "motion", [](const ResponseSolution& s) { return array_of(s.motion); }, new_array)
      .def_prop_ro(
          "rate", [](const ResponseSolution& s) { return array_of(s.rate); }, new_array)
      .def_ro("pressure", &ResponseSolution::pressure)
      .def_ro("stable", &ResponseSolution::stable);
  nb::class_<Equilibrium>(m, "Equilibrium", "Equilibrium of all edges, if one was found.")
      .def_ro("found", &Equilibrium::found)
      .def_ro("is_outgrown", &Equilibrium::is_outgrown)
      .def_ro("corrections", &Equilibrium::corrections)
      .def_prop_ro(
          "gaps", [](const Equilibrium& e) { return pairs_of(e.ends); }, new_array)
      .def_prop_ro(
          "rate", [](const Equilibrium& e) { return array_of(e.at.rate); }, new_array)
      .def_prop_ro("pressure", [](const Equilibrium& e) { return e.at.pressure; })
      .def_prop_ro("separation", [](const Equilibrium& e) { return e.at.separation; })
      .def_prop_ro("slope", [](const Equilibrium& e) { return e.at.slope; })
      .def_prop_ro(
          "pinned_share", [](const Equilibrium& e) { return array_of(e.pinned_share); }, new_array,
          "Place of C of pinned edges between both critical openings.")
      .def_prop_ro(
          "pinned_rate", [](const Equilibrium& e) { return array_of(e.pinned_rate); }, new_array,
          "Its derivative by d.")
      .def(
          "solve_field",
          [](const Equilibrium& e, double prescribed, const Model& model) {
            return unlocked([&] {
              return solve_separately(e.ends, e.references, e.orders, e.potential, e.at.pressure,
                                      prescribed, model);
            });
          },
          "prescribed"_a, "model"_a, "Solve every gap by itself in the potential of the others.");
  nb::enum_<DescentEvent>(m, "DescentEvent", "Why a descent ended.")
      .value("AT_REST", DescentEvent::at_rest)
      .value("VANISHED", DescentEvent::vanished)
      .value("STEP_LIMIT", DescentEvent::step_limit)
      .value("NO_FIELD", DescentEvent::no_field)
      .value("OUTGROWN", DescentEvent::outgrown);
  nb::class_<Descent>(m, "Descent", "Result of a descent.")
      .def_ro("event", &Descent::event)
      .def_prop_ro(
          "gaps", [](const Descent& d) { return pairs_of(d.ends); }, new_array)
      .def_ro("steps", &Descent::steps)
      .def_ro("raced", &Descent::raced);
  nb::class_<Running>(m, "Running", "What a descent knows of the way that its edges have come.")
      .def(
          "__init__",
          [](Running* running, const Array& start, double reach) {
            new (running) Running{Flags(start.size()), vector_of(start), reach};
          },
          "start"_a, "reach"_a);
  nb::class_<LinearResponse>(m, "LinearResponse", "Linear response of all gaps and their edges.")
      .def_prop_ro("gap_count", &LinearResponse::gap_count)
      .def_prop_ro(
          "orders", [](const LinearResponse& r) { return array_of(r.nodes.orders); }, new_array)
      .def_prop_ro(
          "opening",
          [](const LinearResponse& r) {
            Vector out;
            for (const Edge& edge : r.edges) out.push_back(edge.opening);
            return array_of(out);
          },
          new_array, "C of every edge in its reference.")
      .def_prop_ro(
          "potential",
          [](const LinearResponse& r) {
            Vector out;
            for (const Vector& g : r.potential)
              out.insert(out.end(), g.begin(), g.begin() + r.nodes.size());
            return hand_over(std::move(out), {2, size_t(r.nodes.size())});
          },
          new_array, "Potentials of the last solution, without p and by a unit of p.")
      .def_prop_ro(
          "negative", [](const LinearResponse& r) { return r.tree.runs.back().count.negative; },
          "Number of negative eigenvalues.")
      .def(
          "update",
          [](const LinearResponse& known, const Array& gaps, double prescribed,
             const std::optional<IntegerArray>& least, const EdgeLaw& law, const Model& model) {
            const Vector ends = vector_of(gaps);
            const Integers own = integers_of(least);
            return unlocked(
                [&] { return keep(update_response(known, ends, prescribed, own, law, model)); });
          },
          "gaps"_a, "prescribed"_a, "least"_a.none(), "law"_a, "model"_a,
          "Set up a response of gaps of which most are those of this one.")
      .def(
          "count_unknown",
          [](const LinearResponse& known, const Array& gaps, const EdgeLaw& law,
             const Model& model) { return count_unknown(known, vector_of(gaps), law, model); },
          "gaps"_a, "law"_a, "model"_a, "Count the gaps that `update` would not take over.")
      .def(
          "settle",
          [](LinearResponse& r, const Array& gaps, double prescribed, const EdgeLaw& law,
             const Model& model) {
            const Vector ends = vector_of(gaps);
            return unlocked([&] { return settle_response(r, ends, prescribed, law, model); });
          },
          "gaps"_a, "prescribed"_a, "law"_a, "model"_a,
          "Renew the response for a known equilibrium; False if it is outgrown.")
      .def(
          "solve",
          [](LinearResponse& r, double prescribed, const EdgeLaw& law, const Model& model) {
            return unlocked([&] { return r.solve(prescribed, law, model.device); });
          },
          "prescribed"_a, "law"_a, "model"_a)
      .def(
          "solve_separately",
          [](const LinearResponse& r, const Array& gaps, double pressure, double prescribed,
             const Model& model) {
            return solve_separately(vector_of(gaps), r.nodes.gaps, r.nodes.orders,
                                    r.potential_at(pressure), pressure, prescribed, model);
          },
          "gaps"_a, "pressure"_a, "prescribed"_a, "model"_a,
          "Solve every gap by itself in the potential of the last solution.")
      .def(
          "tangent_between",
          [](LinearResponse& r, const Array& gaps, const IntegerArray& edges, double prescribed,
             const EdgeLaw& law, const Model& model) {
            const Vector ends = vector_of(gaps);
            const Integers some = integers_of(edges);
            return array_of(unlocked([&] {
              Flags held = at_memory(ends, law);
              for (int e : some) held[e] = true;
              condense_gaps(r, hold_edges(r, ends, held, law));
              const ResponseSolution now = r.solve(prescribed, law, model.device);
              Matrix out = HeldEdges(r, some, now, model.device).tangent();
              for (int c = 0; c < out.n; ++c) {
                const Edge& edge = r.edges[some[c]];
                if (edge.recedes) out(c, c) -= edge.pinning_range.slope;
              }
              return out;
            }));
          },
          "gaps"_a, "edges"_a, "prescribed"_a, "law"_a, "model"_a,
          "Compute ∂(C_e - C_c)/∂n_f between some edges of these gaps.\n\n"
          "All others follow, but those at their memory, which are pinned.")
      .def(
          "find_equilibrium",
          [](LinearResponse& r, const Array& gaps, double prescribed, double reach, bool strict,
             const EdgeLaw& law, const Model& model) {
            const Vector ends = vector_of(gaps);
            return unlocked(
                [&] { return find_equilibrium(r, ends, prescribed, reach, strict, law, model); });
          },
          "gaps"_a, "prescribed"_a, "reach"_a, "strict"_a, "law"_a, "model"_a,
          "Find the equilibrium next to these gaps by Newton's iteration.")
      .def(
          "descend",
          [](LinearResponse& r, const Array& gaps, double prescribed, int most, bool equal_speeds,
             Running& running, const EdgeLaw& law, const Model& model) {
            const Vector ends = vector_of(gaps);
            return unlocked([&] {
              return descend(r, ends, prescribed, most, equal_speeds, running, law, model);
            });
          },
          "gaps"_a, "prescribed"_a, "most"_a, "equal_speeds"_a, "running"_a, "law"_a, "model"_a,
          "Descend in energy until an event.");
  m.def(
      "set_up_response",
      [](const Array& gaps, double prescribed, const std::optional<IntegerArray>& least,
         const EdgeLaw& law, const Model& model) {
        const Vector ends = vector_of(gaps);
        const Integers own = integers_of(least);
        return unlocked([&] { return keep(set_up_response(ends, prescribed, own, law, model)); });
      },
      "gaps"_a, "prescribed"_a, "least"_a.none(), "law"_a, "model"_a,
      "Solve the field of these gaps, and linearise about it; None if they have none.");
}

void bind_nucleation(nb::module_& m) {
  nb::class_<SearchLengths>(m, "SearchLengths", "Lengths of a search for touches, in 1/q0.")
      .def(
          "__init__",
          [](SearchLengths* lengths, double max_displacement, double closing_per_motion,
             double surface, double narrowest, double widest) {
            new (lengths)
                SearchLengths{max_displacement, closing_per_motion, surface, narrowest, widest};
          },
          nb::kw_only(), "max_displacement"_a, "closing_per_motion"_a, "surface"_a, "narrowest"_a,
          "widest"_a)
      .def(
          "seed_widths",
          [](const SearchLengths& lengths, const Array& curvature) {
            Vector out;
            for (double each : vector_of(curvature)) out.push_back(seed_width(each, lengths));
            return array_of(out);
          },
          "curvature"_a, "Compute the widths of seeds at touches with these curvatures.")
      .def(
          "clearances",
          [](const SearchLengths& lengths, const Array& opening, const Array& curvature) {
            Vector out;
            for (size_t i = 0; i < opening.size(); ++i)
              out.push_back(clearance_of(opening.data()[i], curvature.data()[i], lengths));
            return array_of(out);
          },
          "opening"_a, "curvature"_a,
          "Compute the opening left at minima before a seed is put; not positive at a touch.");
  nb::class_<Searched>(m, "SearchedGaps", "Gaps as they were when they were last searched.")
      .def(nb::init<>())
      .def("__getstate__", [](const Searched& s) { return array_of(pack(s)); })
      .def("__setstate__",
           [](Searched& s, const Array& packed) { new (&s) Searched(unpack(packed)); });
  m.def(
      "search",
      [](const Field& field, const Searched& searched, const SearchLengths& lengths) {
        Search found = unlocked([&] { return search(field, searched.gaps, lengths); });
        return std::tuple(found.least, found.count, minima_of(found.minima),
                          Searched{std::move(found.searched)});
      },
      "field"_a, "searched"_a, "lengths"_a,
      "Find the least clearance of a field, searching only gaps that may have closed.\n\n"
      "Also returns the number of these gaps, their minima, and the updated searched gaps.");
  m.def(
      "clearance_left",
      [](const Field& field, const Searched& searched, const SearchLengths& lengths) {
        return array_of(clearance_left(field, searched.gaps, lengths).clearance);
      },
      "field"_a, "searched"_a, "lengths"_a, "Bound the clearance left in each gap from below.");
  m.def(
      "least_clearances",
      [](const Field& field, const IntegerArray& gaps, const SearchLengths& lengths) {
        const Integers some = integers_of(gaps);
        const Vector least = unlocked([&] {
          return least_clearances(find_minima(field, some), field.nodes.gap_count(), lengths);
        });
        Vector out;
        for (int k : some) out.push_back(least[k]);
        return array_of(out);
      },
      "field"_a, "gaps"_a, "lengths"_a, "Find the least clearance of some gaps.");
}

void bind_predictor(nb::module_& m) {
  nb::class_<TwoPoints>(m, "TwoPoints", "Two points of a branch, `way` apart in d.")
      .def(
          "__init__",
          [](TwoPoints* points, const Array& gaps, const Array& rate, const Array& gaps_before,
             const Array& rate_before, double way) {
            new (points) TwoPoints{vector_of(gaps), vector_of(rate), vector_of(gaps_before),
                                   vector_of(rate_before), way};
          },
          "gaps"_a, "rate"_a, "gaps_before"_a, "rate_before"_a, "way"_a)
      .def("leading_edge", &leading_edge, "Find the leading edge, and the fold ahead.")
      .def(
          "other_fold",
          [](const TwoPoints& points, int leading) {
            const OtherFold fold = other_fold(points, leading);
            return std::pair(fold.edge, fold.distance);
          },
          "leading"_a, "Find the nearest fold ahead that other gaps lead to: edge and distance.")
      .def(
          "predict_gaps",
          [](const TwoPoints& points, double on, const LeadingEdge& leading) {
            return pairs_of(predict_ends(points, on, leading));
          },
          "on"_a, "leading"_a, "Predict the gaps at a distance `on` in d.");
  nb::class_<LeadingEdge>(m, "LeadingEdge", "The edge that leads, and d along its motion.")
      .def_ro("edge", &LeadingEdge::edge)
      .def_ro("fastest", &LeadingEdge::fastest)
      .def_ro("gone", &LeadingEdge::gone)
      .def_ro("here", &LeadingEdge::here)
      .def_ro("square", &LeadingEdge::square)
      .def_ro("cube", &LeadingEdge::cube)
      .def_ro("fold", &LeadingEdge::fold)
      .def_ro("fold_distance", &LeadingEdge::fold_distance);
}

void bind_grid(nb::module_& m) {
  m.def(
      "dot", [](const Array& a, const Array& b) { return dot(a.data(), b.data(), int(a.size())); },
      "a"_a, "b"_a, "Sum a_i b_i, in an order that depends on their number alone.");
  m.def(
      "total", [](const Array& values) { return total(values.data(), int(values.size())); },
      "values"_a, "Sum the values, in an order that depends on their number alone.");
  m.def(
      "restrict",
      [](Changed values, const Array& inside) {
        return restrict_inside(values.data(), inside.data(), int(values.size()));
      },
      "values"_a.noconvert(), "inside"_a,
      "Set the values outside Ω to zero, in place; returns whether they all were.");
  m.def(
      "residual_inside",
      [](const Array& target, const Array& displacement, const Array& inside, Changed out) {
        return residual_inside(target.data(), displacement.data(), inside.data(), out.data(),
                               int(out.size()));
      },
      "target"_a, "displacement"_a, "inside"_a, "out"_a.noconvert(),
      "Compute the residual on Ω, zero elsewhere; returns the largest absolute one.");
  m.def(
      "update_direction",
      [](Changed direction, const Array& inside, const Array& correction, double factor) {
        update_direction(direction.data(), inside.data(), correction.data(), factor,
                         int(direction.size()));
      },
      "direction"_a.noconvert(), "inside"_a, "correction"_a, "factor"_a,
      "Set the next search direction: the correction on Ω plus `factor` times the last one.");
  m.def(
      "advance",
      [](Changed stress, Changed displacement, Changed residual, const Array& direction,
         const Array& response, const Array& inside, double step) {
        return advance({stress.data(), displacement.data(), residual.data()}, direction.data(),
                       response.data(), inside.data(), step, int(stress.size()));
      },
      "stress"_a.noconvert(), "displacement"_a.noconvert(), "residual"_a.noconvert(), "direction"_a,
      "response"_a, "inside"_a, "step"_a,
      "Take a step along the direction; returns the largest absolute residual on Ω.");
  m.def(
      "inverse_form",
      [](Changed matrix, const Array& vector) {
        return inverse_form(matrix.data(), vector.data(), int(vector.size()));
      },
      "matrix"_a.noconvert(), "vector"_a,
      "Return bᵀA⁻¹b for a symmetric positive definite A; overwrites A.");
}

// Single parts, for their tests.
void bind_parts(nb::module_& m) {
  m.def(
      "gap_moments",
      [](const Array& gap, const Panels& panels, int modes, int fields) {
        Vector s(modes * fields);
        EndTerms ends = {};
        gap_moments(gap_of(gap), panels, modes, fields, s.data(), ends);
        Vector loads;
        for (auto& end : ends) loads.insert(loads.end(), end.begin(), end.begin() + fields);
        return std::pair(hand_over(std::move(s), {size_t(modes), size_t(fields)}),
                         hand_over(std::move(loads), {2, size_t(fields)}));
      },
      "gap"_a, "panels"_a, "modes"_a, "fields"_a,
      "Compute s_n of S, and with two fields of S', and the loads of both ends.");
  m.def(
      "theta_at",
      [](const Array& gap, double eta) {
        const Place place = theta_at(gap_of(gap), eta);
        return std::pair(place.theta, place.stretch);
      },
      "gap"_a, "eta"_a, "Compute θ and dθ/dη at η.");
  m.def("fast_size", &fast_size, "fewest"_a, "Round up a number of nodes of a sine transform.");
  m.def(
      "sine_sums",
      [](const Array& x) {
        Vector out(x.size());
        sine_sums(vector_of(x), Circle(int(x.size()) + 1), out);
        return array_of(out);
      },
      "x"_a, "Compute Σ_j x_j sin(π (j+1)(k+1)/N) of N - 1 numbers.");
  m.def(
      "count_charges",
      [](const Array& gaps, double digits) {
        const std::vector<Gap> table = map_gaps(vector_of(gaps));
        const Tree tree(Nodes(table, choose_orders(table, digits)), pair_runs(int(table.size())),
                        Integers(2 * table.size() - 1), digits);
        Integers out;
        for (const Run& run : tree.runs) out.push_back(run.rank);
        return array_of(out);
      },
      "gaps"_a, "digits"_a, "Count the charges of every run of the tree of gaps.");
  m.def(
      "pair_runs", [](int count) { return array_of(pair_runs(count)); }, "count"_a,
      "Pair neighbouring runs of gaps, level by level: the halves of every run.");
  m.def(
      "pair_again",
      [](const IntegerArray& known, const IntegerArray& source) {
        Halves halves;
        const Integers flat = integers_of(known);
        for (size_t i = 0; i < flat.size(); i += 2) halves.push_back({flat[i], flat[i + 1]});
        const PairedAgain again = pair_again(halves, integers_of(source));
        return std::pair(array_of(again.halves), array_of(again.same));
      },
      "known"_a, "source"_a, "Pair the runs of gaps most of which are those of known halves.");
  m.def(
      "count_negative",
      [](const Array& h, const Array& r) {
        Matrix one = matrix_of(h), two = matrix_of(r);
        return count_negative(one.values.data(), two.values.data(), one.n).negative;
      },
      "h"_a, "r"_a, "Count the negative eigenvalues of [[h, 1], [1, r]].");
  m.def(
      "solve_definite",
      [](const Array& matrix, const Array& load) -> std::optional<Values> {
        Matrix factor = matrix_of(matrix);
        Vector x = vector_of(load);
        if (!factor_rows(factor.values.data(), factor.n, factor.n)) return std::nullopt;
        solve_column(factor.values.data(), factor.n, factor.n, x.data());
        return array_of(x);
      },
      "matrix"_a, "load"_a, "Solve a system; None if its matrix is not positive definite.");
  m.def(
      "invert_definite",
      [](const Array& matrix) -> std::optional<Values> {
        const Matrix of = matrix_of(matrix);
        Matrix inverse(of.n);
        if (!invert_definite(of.values.data(), of.n, inverse.values.data())) return std::nullopt;
        return array_of(inverse);
      },
      "matrix"_a, "Invert a matrix; None if it is not positive definite.");
  m.def(
      "local_minima",
      [](const Array& theta, const Array& opening) {
        Vector position, value, error;
        for (const Candidate& one : local_minima(vector_of(theta), vector_of(opening))) {
          position.push_back(one.theta);
          value.push_back(one.opening);
          error.push_back(one.error);
        }
        return std::tuple(array_of(position), array_of(value), array_of(error));
      },
      "theta"_a, "opening"_a, "Find local minima where θ falls: position, value, its error.");
  m.def(
      "on_new_tree",
      [](const LinearResponse& response, double digits) {
        const Tree& known = response.tree;
        const int count = known.count, n = response.nodes.size();
        Tree tree(response.nodes, pair_runs(count), Integers(known.runs.size()), digits);
        std::copy_n(known.theta.begin(), n, tree.theta.begin());
        std::copy_n(known.stretch.begin(), n, tree.stretch.begin());
        for (int k = 0; k < count; ++k) {
          const int m = response.nodes.size_of(k);
          tree.runs[k].count = known.runs[k].count;
          std::copy_n(&known.response[known.runs[k].response], m * m,
                      &tree.response[tree.runs[k].response]);
        }
        for (int run = count; run < tree.run_count(); ++run) {
          tree.place_charges(run);
          tree.factor(run);
        }
        Vector found;
        for (const Charges& column : response.charges) {
          Charges charges(tree.size());
          Vector potential(tree.size());
          std::copy_n(column.isolated.begin(), n, charges.isolated.begin());
          for (int run = count; run < tree.run_count(); ++run) tree.charge(run, charges);
          tree.pass_down(charges, potential);
          found.insert(found.end(), potential.begin(), potential.begin() + n);
        }
        return std::pair(hand_over(std::move(found), {2, size_t(n)}),
                         tree.runs.back().count.negative);
      },
      "response"_a, "digits"_a,
      "Solve for the potentials of a response on a tree that is built anew, and count its "
      "negative eigenvalues.");
  nb::class_<EdgeModel>(m, "EdgeModel", "Model of the edge openings about solved edges.")
      .def(
          "__init__",
          [](EdgeModel* model, const IntegerArray& edges, const Array& gaps, const Array& residual,
             const Array& tangent, const EdgeLaw& law, const Panels& panels) {
            new (model) EdgeModel(integers_of(edges), vector_of(gaps), vector_of(residual),
                                  matrix_of(tangent), law, panels);
          },
          "edges"_a, "gaps"_a, "residual"_a, "tangent"_a, "law"_a, "panels"_a,
          nb::keep_alive<1, 6>(), nb::keep_alive<1, 7>())
      .def_prop_ro(
          "opening",
          [](const EdgeModel& model) {
            Vector out;
            for (const MovingEdge& edge : model.edges) out.push_back(edge.opening);
            return array_of(out);
          },
          new_array)
      .def_prop_ro(
          "own",
          [](const EdgeModel& model) {
            Vector out;
            for (const MovingEdge& edge : model.edges) out.push_back(edge.own);
            return array_of(out);
          },
          new_array)
      .def_prop_ro(
          "coupling", [](const EdgeModel& model) { return array_of(model.coupling()); }, new_array)
      .def_prop_ro(
          "forces",
          [](const EdgeModel& model) {
            Vector out(model.edges.size());
            model.forces(out);
            return array_of(out);
          },
          new_array)
      .def_prop_ro(
          "hessian",
          [](const EdgeModel& model) {
            Matrix out(int(model.edges.size()));
            model.hessian(out);
            return array_of(out);
          },
          new_array)
      .def(
          "advance", [](EdgeModel& model, const Array& step) { model.advance(vector_of(step)); },
          "step"_a, "Move the edges outwards by these steps.")
      .def(
          "flow",
          [](EdgeModel& model, const Array& limit, bool equal_speeds, bool is_long,
             double strongest, const EdgeLaw& law) {
            return flow_through(model, vector_of(limit), equal_speeds, is_long, strongest, law);
          },
          "limit"_a, "equal_speeds"_a, "is_long"_a, "strongest"_a, "law"_a);
  nb::class_<ModelFlow>(m, "ModelFlow", "Flow through the model.")
      .def(
          "__init__",
          [](ModelFlow* flow, const Array& motion, const Array& opening, const Array& lengths,
             const Array& residuals) {
            new (flow) ModelFlow{vector_of(motion), vector_of(opening), vector_of(lengths), {}};
            const double* row = residuals.data();
            for (size_t i = 0; i < residuals.shape(0); ++i, row += residuals.shape(1))
              flow->residuals.emplace_back(row, row + residuals.shape(1));
          },
          "motion"_a, "opening"_a, "lengths"_a, "residuals"_a)
      .def_prop_ro(
          "motion", [](const ModelFlow& flow) { return array_of(flow.motion); }, new_array)
      .def_prop_ro(
          "lengths", [](const ModelFlow& flow) { return array_of(flow.lengths); }, new_array)
      .def_ro("is_at_limit", &ModelFlow::is_at_limit);
  m.def(
      "implicit_step",
      [](const Array& hessian, const Array& force, double longest, bool equal_speeds) {
        return array_of(implicit_step(matrix_of(hessian), vector_of(force), longest, equal_speeds));
      },
      "hessian"_a, "force"_a, "longest"_a, "equal_speeds"_a, "Take a linearly implicit step.");
  m.def(
      "distance_to_minimum",
      [](const Array& hessian, const Array& force) {
        return distance_to_minimum(matrix_of(hessian), vector_of(force));
      },
      "hessian"_a, "force"_a,
      "Compute the largest motion to the minimum of a quadratic model; infinite without one.");
  m.def(
      "model_error",
      [](const ModelFlow& flow, const Array& residual, const IntegerArray& edges, const Array& gaps,
         const EdgeLaw& law) {
        return model_error(flow, vector_of(residual), integers_of(edges), vector_of(gaps), law);
      },
      "flow"_a, "residual"_a, "edges"_a, "gaps"_a, "law"_a);
  m.def("next_reach", &next_reach, "before"_a, "length"_a, "error"_a);
}

}  // namespace

}  // namespace adhesis

NB_MODULE(_kernels, m) {
  nb::set_leak_warnings(false);  // objects of a module live until the process ends
  m.doc() = "Kernels of the methods sharp and grid.";
  m.attr("COMPILER") = ADHESIS_COMPILER;
  adhesis::bind_model(m);
  adhesis::bind_field(m);
  adhesis::bind_response(m);
  adhesis::bind_nucleation(m);
  adhesis::bind_predictor(m);
  adhesis::bind_grid(m);
  adhesis::bind_parts(m);
}
