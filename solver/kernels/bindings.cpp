// What Python sees of the kernels: objects that it owns, functions, and arrays of their numbers.
//
// What they mean is stated where they are declared, and here only where it differs. Long kernels
// run without the interpreter's lock.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/tuple.h>

#include <chrono>

#include "clearance.hpp"
#include "descent.hpp"
#include "edge_model.hpp"
#include "predictor.hpp"

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

template <class Number>
using Output = nb::ndarray<nb::numpy, Number>;
constexpr auto new_array = nb::rv_policy::automatic;  // a property's
using Unlocked = nb::call_guard<nb::gil_scoped_release>;

// Hand numbers over to numpy, without a copy; to one dimension unless a shape is given.
template <class Number>
Output<Number> hand_over(std::vector<Number> values, std::vector<size_t> shape = {}) {
  if (shape.empty()) shape = {values.size()};
  auto* kept = new std::vector<Number>(std::move(values));
  nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<Number>*>(p); });
  return {kept->data(), shape.size(), shape.data(), owner};
}

Output<double> pairs_of(Vector values) {
  const size_t size = values.size();
  return hand_over(std::move(values), {size / 2, 2});
}

}  // namespace

}  // namespace adhesis

// Vectors come from arrays of any shape and become arrays; both are copies.
namespace nanobind::detail {

template <class Vector, class Number>
struct ArrayCaster {
  static constexpr bool is_real = std::is_same_v<Number, double>;
  NB_TYPE_CASTER(Vector, const_name("numpy.typing.NDArray[numpy.") +
                             const_name<is_real>("float64", "int64") + const_name("]"))

  bool from_python(handle from, uint32_t flags, cleanup_list* cleanup) noexcept {
    make_caster<ndarray<const Number, c_contig, device::cpu>> array;
    if (!array.from_python(from, flags, cleanup)) return false;
    value.assign(array.value.data(), array.value.data() + array.value.size());
    return true;
  }

  static handle from_cpp(const Vector& values, rv_policy, cleanup_list* cleanup) noexcept {
    auto out = adhesis::hand_over(std::vector<Number>(values.begin(), values.end()));
    return make_caster<decltype(out)>::from_cpp(out, rv_policy::automatic, cleanup);
  }
};

template <>
struct type_caster<adhesis::Vector> : ArrayCaster<adhesis::Vector, double> {};
template <>
struct type_caster<adhesis::Integers> : ArrayCaster<adhesis::Integers, int64_t> {};

// Square matrices likewise.
template <>
struct type_caster<adhesis::Matrix> {
  NB_TYPE_CASTER(adhesis::Matrix, const_name("numpy.typing.NDArray[numpy.float64]"))

  bool from_python(handle from, uint32_t flags, cleanup_list* cleanup) noexcept {
    make_caster<adhesis::Vector> values;
    if (!values.from_python(from, flags, cleanup)) return false;
    value.n = int(std::lround(std::sqrt(double(values.value.size()))));
    value.values = std::move(values.value);
    return true;
  }

  static handle from_cpp(const adhesis::Matrix& a, rv_policy, cleanup_list* cleanup) noexcept {
    auto out = adhesis::hand_over(a.values, {size_t(a.n), size_t(a.n)});
    return make_caster<decltype(out)>::from_cpp(out, rv_policy::automatic, cleanup);
  }
};

}  // namespace nanobind::detail

namespace adhesis {

namespace {

// One member of every object.
template <class Object, class Member>
auto each(const std::vector<Object>& objects, Member Object::* member) {
  std::vector<Member> out;
  for (const Object& one : objects) out.push_back(one.*member);
  return out;
}

// θ and T at rising θ, the weight of ∫ T g dθ divided by T, and b_n.
std::tuple<Vector, Vector, Vector, Vector> rising(FineOpening fine) {
  const double spacing = pi / double(fine.theta.size() + 1);
  for (double& stretch : fine.theta_by_t) stretch *= spacing;
  for (Vector* values : {&fine.theta, &fine.opening, &fine.theta_by_t})
    std::reverse(values->begin(), values->end());
  return {fine.theta, fine.opening, fine.theta_by_t, fine.modes};
}

// ∂(C_e - C_c)/∂n_f between some edges of these gaps. All others follow, but those at their memory.
Matrix tangent_between(LinearResponse& r, const Vector& ends, const Integers& some,
                       double prescribed, const EdgeLaw& law, const FieldModel& model) {
  EdgeStates states = states_at(ends, law);
  for (int e : some) states.held[e] = true;
  hold_edges(r, ends, states);
  const ResponseSolution now = r.solve(prescribed, law, model.device);
  Matrix out = HeldEdges(r, some, now, model.device).tangent();
  for (int c = 0; c < out.n; ++c) {
    const Edge& edge = r.edges[some[c]];
    if (edge.recedes) out(c, c) -= edge.pinning_range.slope;
  }
  return out;
}

using WorkFunction = nb::typed<nb::callable, std::pair<double, double>(double, bool)>;
using IntegralFunction = nb::typed<nb::callable, double(double, bool)>;

// A law of adhesion of Python functions.
class PythonAdhesion : public Adhesion {
 public:
  const WorkFunction work_function;
  const IntegralFunction integral_function;

  PythonAdhesion(bool pins, double least, double largest, WorkFunction work, IntegralFunction up_to)
      : Adhesion(pins, least, largest), work_function(std::move(work)),
        integral_function(std::move(up_to)) {}

  std::pair<double, double> work(double theta, bool recedes) const override {
    nb::gil_scoped_acquire held;
    return nb::cast<std::pair<double, double>>(work_function(theta, recedes));
  }

  double work_up_to(double theta, bool recedes) const override {
    nb::gil_scoped_acquire held;
    return nb::cast<double>(integral_function(theta, recedes));
  }
};

using PythonAdhesionState = std::tuple<bool, double, double, WorkFunction, IntegralFunction>;

void bind_model(nb::module_& m) {
  nb::class_<Panels>(m, "Panels")
      .def(nb::init<double, int, Vector, Vector, Vector, Vector, Vector, Vector, Pair, Pair,
                    Integers, Vector, Vector, Vector, Vector, Vector, int>(),
           nb::kw_only(), "width"_a, "finest_count"_a, "x"_a, "w"_a, "stress"_a, "slope"_a,
           "tilt"_a, "pattern"_a, "half_plane"_a, "weights"_a, "level_start"_a, "end_x"_a,
           "end_w"_a, "length_x"_a, "length_w"_a, "length_before"_a, "highest_harmonic"_a)
      .def(
          "stress",
          [](const Panels& p, const Vector& theta) {
            Vector out;
            for (double at : theta) out.push_back(evaluate_series(p.stress, at, p).value);
            return out;
          },
          "theta"_a, "Evaluate S at any angles.");
  nb::class_<LoadingDevice>(m, "LoadingDevice")
      .def(nb::init<double, double>(), "separation_weight"_a, "compliance"_a)
      .def_ro("separation_weight", &LoadingDevice::separation_weight)
      .def_ro("compliance", &LoadingDevice::compliance);
  nb::class_<FieldModel>(m, "FieldModel")
      .def(nb::init<LoadingDevice, double, std::shared_ptr<const Panels>>(), "device"_a, "digits"_a,
           "panels"_a)
      .def_ro("device", &FieldModel::device)
      .def_ro("digits", &FieldModel::digits)
      .def_ro("panels", &FieldModel::panels);
  nb::class_<Adhesion>(m, "Adhesion",
                       "Works of adhesion of edges; the contract is in edge_law.hpp.")
      .def_ro("pins", &Adhesion::pins)
      .def_ro("least", &Adhesion::least)
      .def_ro("largest", &Adhesion::largest)
      .def("work", &Adhesion::work, "theta"_a, "recedes"_a)
      .def("work_up_to", &Adhesion::work_up_to, "theta"_a, "recedes"_a)
      .def(
          "contact_work",
          [](const Adhesion& adhesion, const Vector& gaps, bool recedes) {
            return contact_work(gaps, recedes, adhesion);
          },
          "gaps"_a, "recedes"_a = false);
  nb::class_<ProfileAdhesion, Adhesion>(m, "ProfileAdhesion")
      .def(nb::init<std::shared_ptr<const Panels>, double, double, double>(), "panels"_a,
           "ratio"_a = 1.0, "least"_a = 1.0, "largest"_a = 1.0);
  nb::class_<PythonAdhesion, Adhesion>(m, "PythonAdhesion", "A law of Python functions.")
      .def(nb::init<bool, double, double, WorkFunction, IntegralFunction>(), "pins"_a, "least"_a,
           "largest"_a, "work"_a, "work_up_to"_a)
      .def("__getstate__",
           [](const PythonAdhesion& law) {
             return PythonAdhesionState(law.pins, law.least, law.largest, law.work_function,
                                        law.integral_function);
           })
      .def("__setstate__", [](PythonAdhesion& law, const PythonAdhesionState& state) {
        const auto& [pins, least, largest, work, up_to] = state;
        new (&law) PythonAdhesion(pins, least, largest, work, up_to);
      });
  nb::class_<EdgeLaw>(m, "EdgeLaw")
      .def(nb::init<std::shared_ptr<const Adhesion>, double, double, double, double, double, double,
                    double, double>(),
           nb::kw_only(), "adhesion"_a, "critical"_a, "newton_tolerance"_a, "field_error"_a,
           "rest_step"_a, "longest_step"_a, "smallest"_a, "rough_rate"_a, "force_error"_a)
      .def(nb::init<const EdgeLaw&>())
      .def_ro("rest_step", &EdgeLaw::rest_step)
      .def_rw("longest_step", &EdgeLaw::longest_step)
      .def_rw("smallest", &EdgeLaw::smallest)
      .def_prop_rw(
          "memory", [](const EdgeLaw& law) { return pairs_of(law.memory); },
          [](EdgeLaw& law, const Vector& gaps) { law.memory = gaps; }, nb::for_getter(new_array))
      .def(
          "free_edges",
          [](const EdgeLaw& law, const Vector& gaps) {
            Flags free = states_at(gaps, law).held;
            for (char& one : free) one = !one;
            return indices(free);
          },
          "gaps"_a, "Find the edges that are not at their memory; all where edges are not pinned.")
      .def(
          "critical_of",
          [](const EdgeLaw& law, const Vector& gaps, const Vector& opening) {
            Vector out;
            for (int e = 0; e < int(gaps.size()); ++e)
              out.push_back(critical_of(e, gaps[e], opening[e], law).value);
            return out;
          },
          "gaps"_a, "opening"_a, "Compute C_c at every edge with the opening C.");
  m.def("shortest_length", &shortest_length, "gaps"_a);
}

void bind_field(nb::module_& m) {
  nb::class_<Field>(m, "Field")
      .def_ro("pressure", &Field::pressure)
      .def_ro("separation", &Field::separation)
      .def_ro("unit_mean", &Field::unit_mean)
      .def_ro("edge_opening", &Field::edge_opening)
      .def_prop_ro("orders", [](const Field& f) { return f.nodes.orders; })
      .def_prop_ro("offset", [](const Field& f) { return f.nodes.offset; })
      .def_prop_ro("theta", [](const Field& f) { return f.nodes.theta; })
      .def_prop_ro("weight", [](const Field& f) { return f.nodes.weight; })
      .def_prop_ro("load", [](const Field& f) { return f.equations.load; })
      .def(
          "block",
          [](const Field& f, int k) {
            const double* first = &f.equations.blocks[f.nodes.square[k]];
            const size_t n = f.nodes.size_of(k);
            return hand_over(Vector(first, first + n * n), {n, n});
          },
          "k"_a, "Diagonal block of B + G of a gap.")
      .def(
          "edge_openings",
          [](const Field& f, const Vector& scaled) {
            return edge_openings(scaled, f.nodes, f.equations, true);
          },
          "scaled"_a, "Evaluate C at each edge from f at all nodes, of all modes.")
      .def(
          "by_prescribed",
          [](const Field& f) {
            if (std::isnan(f.pressure)) throw std::invalid_argument("there is no field");
            const double rate = -2 * pi / f.resistance;
            Vector out = edge_openings(f.solved[1], f.nodes, f.equations, false);
            for (double& opening : out) opening *= -rate;
            return std::tuple(rate, -f.unit_mean * rate / (2 * pi), out);
          },
          "Differentiate p, q0 s and C by d at fixed edges; ValueError if there is no field.")
      .def(
          "fine_opening",
          [](const Field& f, int k, double per_wave) {
            if (std::isnan(f.pressure)) throw std::invalid_argument("there is no field");
            const int count = count_sine_nodes(f, k, per_wave);
            return rising(open_gap(f, k, *circle_of(count + 1)));
          },
          "k"_a, "per_wave"_a, Unlocked(),
          "Evaluate θ, T and the weight of ∫ T g dθ over T of a gap at fine nodes, and b_n.\n\n"
          "ValueError if there is no field.")
      .def(
          "sum_modes",
          [](const Field& f, int k, Vector at, const Vector& modes) {
            const size_t count = at.size();
            at.resize(count + 3);  // four at once, the last ones for nothing
            for (size_t i = 0; i < count; i += 4) {
              const auto four =
                  sum_modes(f.nodes.gaps[k], {at[i], at[i + 1], at[i + 2], at[i + 3]}, modes);
              std::copy(four.begin(), four.end(), at.begin() + i);
            }
            at.resize(count);
            return at;
          },
          "k"_a, "theta"_a, "modes"_a)
      .def("work_of_gaps", &work_of_gaps, Unlocked());
  m.def(
      "solve_field",
      [](const Vector& gaps, double prescribed, const FieldModel& model,
         const std::optional<Integers>& orders) {
        Integers own;
        for (const Gap& gap : map_gaps(gaps)) own.push_back(choose_order(gap, model.digits));
        return solve_field(gaps, prescribed, orders.value_or(own), model);
      },
      "gaps"_a, "prescribed"_a, "model"_a, "orders"_a = nb::none(), Unlocked(),
      "Solve the field of gaps, shape (L, 2); `orders` are those of their rules.");
}

void bind_response(nb::module_& m) {
  nb::class_<ResponseSolution>(m, "ResponseSolution")
      .def_ro("motion", &ResponseSolution::motion)
      .def_ro("pressure", &ResponseSolution::pressure)
      .def_ro("stable", &ResponseSolution::stable);
  nb::class_<Equilibrium>(m, "Equilibrium")
      .def_ro("found", &Equilibrium::found)
      .def_ro("corrections", &Equilibrium::corrections)
      .def_prop_ro(
          "gaps", [](const Equilibrium& e) { return pairs_of(e.ends); }, new_array)
      .def_prop_ro("rate", [](const Equilibrium& e) { return e.at.rate; })
      .def_prop_ro("pressure", [](const Equilibrium& e) { return e.at.pressure; })
      .def_prop_ro("separation", [](const Equilibrium& e) { return e.at.separation; })
      .def_prop_ro("slope", [](const Equilibrium& e) { return e.at.slope; })
      .def_ro("pinned_share", &Equilibrium::pinned_share)
      .def_ro("pinned_rate", &Equilibrium::pinned_rate);
  nb::enum_<DescentEvent>(m, "DescentEvent")
      .value("AT_REST", DescentEvent::at_rest)
      .value("VANISHED", DescentEvent::vanished)
      .value("NO_FIELD", DescentEvent::no_field);
  nb::class_<Descent>(m, "Descent")
      .def_ro("event", &Descent::event)
      .def_prop_ro(
          "gaps", [](const Descent& d) { return pairs_of(d.ends); }, new_array)
      .def_ro("steps", &Descent::steps)
      .def_ro("raced", &Descent::raced)
      .def_prop_ro("passed", [](const Descent& d) { return pairs_of(d.passed); }, new_array);
  nb::class_<LinearResponse>(m, "LinearResponse")
      .def_prop_ro("gap_count", &LinearResponse::gap_count)
      .def_prop_ro("orders", [](const LinearResponse& r) { return r.nodes.orders; })
      .def_prop_ro(
          "edge_opening", [](const LinearResponse& r) { return each(r.edges, &Edge::opening); },
          "C of every edge in its reference.")
      .def_prop_ro(
          "charges", [](const LinearResponse& r) { return each(r.tree.runs, &Run::rank); },
          "Number of charges of every run of the tree of gaps.")
      .def("settle", &settle_response, "gaps"_a, "prescribed"_a, "law"_a, "model"_a, Unlocked())
      .def(
          "solve",
          [](LinearResponse& r, double prescribed, const EdgeLaw& law, const FieldModel& model) {
            return r.solve(prescribed, law, model.device);
          },
          "prescribed"_a, "law"_a, "model"_a, Unlocked())
      .def("tangent_between", &tangent_between, "gaps"_a, "edges"_a, "prescribed"_a, "law"_a,
           "model"_a,
           "Compute ∂(C_e - C_c)/∂n_f between some edges of these gaps.\n\n"
           "All others follow, but those at their memory, which are pinned.")
      .def("find_equilibrium", &find_equilibrium, "gaps"_a, "prescribed"_a, "reach"_a, "strict"_a,
           "law"_a, "model"_a, Unlocked())
      .def("descend", &descend, "gaps"_a, "start"_a, "prescribed"_a, "most"_a, "equal_speeds"_a,
           "law"_a, "model"_a, Unlocked());
  m.def(
      "set_up_response",
      [](const Vector& gaps, double prescribed, const EdgeLaw& law, const FieldModel& model) {
        return set_up_response(gaps, prescribed, {}, law, model);
      },
      "gaps"_a, "prescribed"_a, "law"_a, "model"_a, Unlocked());
}

void bind_nucleation(nb::module_& m) {
  nb::class_<SearchLengths>(m, "SearchLengths")
      .def(nb::init<double, double, double, double, double, double>(), nb::kw_only(), "wave"_a,
           "closing_per_motion"_a, "surface"_a, "narrowest"_a, "longest_step"_a, "range"_a)
      .def(
          "seed_widths",
          [](const SearchLengths& lengths, Vector curvature) {
            for (double& one : curvature) one = seed_width(one, lengths);
            return curvature;
          },
          "curvature"_a)
      .def(
          "clearances",
          [](const SearchLengths& lengths, Vector opening, const Vector& curvature) {
            for (size_t i = 0; i < opening.size(); ++i)
              opening[i] = clearance_of({0, opening[i], curvature[i], infinity, 0}, lengths);
            return opening;
          },
          "opening"_a, "curvature"_a,
          "Compute the clearances of minima that lie far from all edges.");
  nb::class_<SearchedGaps>(m, "SearchedGaps",
                           "Gaps as they were when they were last searched; a copy has none.")
      .def(nb::init<>())
      .def("__getstate__", [](const SearchedGaps&) { return 0; })
      .def("__setstate__", [](SearchedGaps& s, int) { new (&s) SearchedGaps(); });
  m.def(
      "search",
      [](const Field& field, const SearchedGaps& searched, const SearchLengths& lengths) {
        Search found = search(field, searched, lengths);
        Vector width, clearance;
        for (const Minimum& one : found.minima) {
          width.push_back(seed_width(one.curvature, lengths));
          clearance.push_back(clearance_of(one, lengths));
        }
        return std::tuple(
            found.least, found.count,
            std::tuple(each(found.minima, &Minimum::theta), each(found.minima, &Minimum::opening),
                       std::move(width), each(found.minima, &Minimum::rim), std::move(clearance)),
            std::move(found.searched));
      },
      "field"_a, "searched"_a, "lengths"_a, Unlocked(),
      "Find the minima of the gaps of a field that may have closed.\n\n"
      "Returns the least clearance of the gaps that were not searched, the number of those that "
      "were, their minima (positions, openings, widths of seeds, rims and clearances), and the "
      "updated searched gaps.");
}

void bind_predictor(nb::module_& m) {
  nb::class_<LeadingEdge>(m, "LeadingEdge")
      .def_ro("edge", &LeadingEdge::edge)
      .def_ro("fold_distance", &LeadingEdge::fold_distance);
  nb::class_<Predictor>(m, "Predictor")
      .def(nb::init<double, Vector, Vector, std::optional<std::tuple<double, Vector, Vector>>>(),
           "d"_a, "gaps"_a, "rate"_a, "before"_a.none(),
           "Predict beyond a point of a branch; `before` are d, rates and gaps at the one before.")
      .def_ro("d", &Predictor::d)
      .def_prop_ro(
          "gaps", [](const Predictor& p) { return pairs_of(p.ends); }, new_array)
      .def_prop_ro("rate", [](const Predictor& p) { return p.rate; })
      .def_ro("way", &Predictor::way)
      .def_ro("leading", &Predictor::leading)
      .def("other_leading", &Predictor::other_leading)
      .def(
          "predict_gaps",
          [](const Predictor& p, double at) { return pairs_of(p.predict_ends(at)); }, "at"_a)
      .def("reach", &Predictor::reach, "most"_a, "resolution"_a)
      .def("across", &Predictor::across, "distance"_a, "resolution"_a);
}

// Single parts, for their tests.
void bind_parts(nb::module_& m) {
  m.def(
      "count_negative",
      [](Matrix h, Matrix r) {
        return count_negative(h.values.data(), r.values.data(), h.n).negative;
      },
      "h"_a, "r"_a);
  m.def(
      "local_minima",
      [](const Vector& theta, const Vector& opening) {
        const std::vector<Candidate> found = local_minima(theta, opening);
        return std::tuple(each(found, &Candidate::theta), each(found, &Candidate::opening),
                          each(found, &Candidate::error));
      },
      "theta"_a, "opening"_a, "Find local minima where θ falls: position, value, its error.");
  nb::class_<EdgeModel>(m, "EdgeModel")
      .def(nb::init<const Integers&, const Vector&, const Vector&, const Matrix&, const EdgeLaw&,
                    const Panels&>(),
           "edges"_a, "gaps"_a, "residual"_a, "tangent"_a, "law"_a, "panels"_a,
           nb::keep_alive<1, 6>(), nb::keep_alive<1, 7>())
      .def_prop_ro("opening",
                   [](const EdgeModel& e) { return each(e.edges, &MovingEdge::opening); })
      .def("advance", &EdgeModel::advance, "step"_a);
  m.def("implicit_step", &implicit_step, "hessian"_a, "force"_a, "longest"_a, "equal_speeds"_a);
  m.def("distance_to_minimum", &distance_to_minimum, "hessian"_a, "force"_a);
}

}  // namespace

}  // namespace adhesis

NB_MODULE(_kernels, m) {
  nb::set_leak_warnings(false);  // objects of a module live until the process ends
  m.doc() = "Kernels of the method sharp.";
  m.attr("COMPILER") = ADHESIS_COMPILER;
  m.attr("CLOSING_SHARE") = adhesis::CLOSING_SHARE;
  m.attr("ELSEWHERE") = adhesis::ELSEWHERE;
  m.attr("SHAPE_NODES") = adhesis::SHAPE_NODES;
  m.attr("STEP_GROWTH") = adhesis::STEP_GROWTH;
  m.attr("STEP_REDUCTION") = adhesis::STEP_REDUCTION;
  adhesis::bind_model(m);
  adhesis::bind_field(m);
  adhesis::bind_response(m);
  adhesis::bind_nucleation(m);
  adhesis::bind_predictor(m);
  adhesis::bind_parts(m);
}
