// What Python sees of the kernels: functions of arrays, and objects whose fields it reads.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/shared_ptr.h>

#include "clearance.hpp"
#include "descent.hpp"
#include "edge_model.hpp"
#include "newton.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace adhesis {

namespace {

using Array = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
using IntegerArray = nb::ndarray<const int64_t, nb::c_contig, nb::device::cpu>;
using Values = nb::object;  // an array of floats
using Whole = nb::object;   // of integers
using Truth = nb::ndarray<nb::numpy, bool, nb::ndim<1>, nb::c_contig>;

Vector vector_of(const Array& array) { return {array.data(), array.data() + array.size()}; }

Integers integers_of(const IntegerArray& array) {
  return {array.data(), array.data() + array.size()};
}

// Hand numbers over to numpy, without a copy.
template <class Number>
nb::object array_of(std::vector<Number> values, std::initializer_list<size_t> shape) {
  auto* kept = new std::vector<Number>(std::move(values));
  nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<Number>*>(p); });
  return nb::cast(nb::ndarray<nb::numpy, Number>(kept->data(), shape, owner));
}

Values array_of(const Vector& values) { return array_of<double>(values, {values.size()}); }

Values pairs_of(const Vector& values) { return array_of<double>(values, {values.size() / 2, 2}); }

Whole array_of(const Integers& values) {
  return array_of<int64_t>(std::vector<int64_t>(values.begin(), values.end()), {values.size()});
}

// The table of gaps that Python knows: ends, patches, α.
Values table_of(const std::vector<Gap>& gaps) {
  Vector out;
  for (const Gap& gap : gaps)
    out.insert(out.end(), {gap.end[0], gap.end[1], gap.patch[0], gap.patch[1], gap.alpha});
  return array_of<double>(out, {gaps.size(), 5});
}

std::vector<Gap> gaps_of(const Array& table) {
  std::vector<Gap> out(table.shape(0));
  for (size_t k = 0; k < out.size(); ++k) {
    const double* row = table.data() + 5 * k;
    out[k] = {{row[0], row[1]}, {row[2], row[3]}, row[4]};
  }
  return out;
}

Values slopes_of(const Nodes& nodes) {
  Vector out;
  for (auto& slope : nodes.slope) out.insert(out.end(), slope.begin(), slope.end());
  return array_of<double>(out, {nodes.slope.size(), 2});
}

std::shared_ptr<GaussRules> make_rules(const IntegerArray& counts, const Array& eta,
                                       const Array& weights, const Array& end_values,
                                       const Array& crack, const Array& modes) {
  auto rules = std::make_shared<GaussRules>();
  const double *x = eta.data(), *w = weights.data(), *low = end_values.data();
  const double *high = low + eta.size(), *straight = crack.data(), *u = modes.data();
  for (int m : integers_of(counts)) {
    GaussRule rule;
    rule.count = m;
    rule.eta.assign(x, x + m);
    rule.weights.assign(w, w + m);
    rule.end_values = {Vector(low, low + m), Vector(high, high + m)};
    rule.crack.assign(straight, straight + m * m);
    rule.modes.assign(u, u + m * m);
    rule.derivative = derivative_matrix(rule.eta, rule.weights);
    rules->push_back(rule);
    x += m, w += m, low += m, high += m, straight += m * m, u += m * m;
  }
  return rules;
}

std::shared_ptr<Panels> make_panels(double width, int finest_count, const Array& x, const Array& w,
                                    const Array& stress, const Array& slope, const Array& tilt,
                                    const Array& half_plane, const Array& weights,
                                    const IntegerArray& level_start, const Array& end_x,
                                    const Array& end_w, int short_count) {
  const double* half = half_plane.data() + half_plane.size() / 2;
  const double* of_slope = weights.data() + weights.size() / 2;
  return std::make_shared<Panels>(Panels{
      width, finest_count, vector_of(x), vector_of(w), vector_of(stress), vector_of(slope),
      vector_of(tilt),
      {Vector(half_plane.data(), half), Vector(half, half + half_plane.size() / 2)},
      {Vector(weights.data(), of_slope), Vector(of_slope, of_slope + weights.size() / 2)},
      integers_of(level_start), vector_of(end_x), vector_of(end_w), ShortRule(short_count)});
}

// The field of known openings, for searches.
std::shared_ptr<Field> make_field(const Array& table, const IntegerArray& orders,
                                  const Array& theta, const Array& slope, const Array& f,
                                  const Array& load, const Model& model) {
  auto field = std::make_shared<Field>();
  field->nodes = Nodes(gaps_of(table), integers_of(orders), *model.rules);
  field->nodes.theta = vector_of(theta);
  for (size_t k = 0; k < slope.size() / 2; ++k)
    field->nodes.slope[k] = {slope.data()[2 * k], slope.data()[2 * k + 1]};
  field->scaled_opening = vector_of(f);
  field->equations.load = vector_of(load);
  return field;
}

// Positions, openings and curvatures of minima.
nb::object minima_of(const std::vector<Minimum>& minima) {
  Vector theta, opening, curvature;
  for (const Minimum& minimum : minima) {
    theta.push_back(minimum.theta);
    opening.push_back(minimum.opening);
    curvature.push_back(minimum.curvature);
  }
  return nb::make_tuple(array_of(theta), array_of(opening), array_of(curvature));
}

struct Searched {
  SearchedGaps gaps;
};

std::shared_ptr<LinearResponse> keep(NewResponse&& made) {
  return made.has_field ? std::make_shared<LinearResponse>(std::move(made.response)) : nullptr;
}

}  // namespace

}  // namespace adhesis

NB_MODULE(_kernels, m) {
  using namespace adhesis;

  nb::class_<GaussRules>(m, "GaussRules");
  m.def("make_rules", &make_rules);
  nb::class_<Panels>(m, "Panels");
  m.def("make_panels", &make_panels);
  nb::class_<Model>(m, "Model")
      .def("__init__", [](Model* model, double weight, double compliance, double digits,
                          std::shared_ptr<GaussRules> rules, std::shared_ptr<Panels> panels) {
        new (model) Model{{weight, compliance}, digits, rules, panels};
      });
  nb::class_<EdgeLaw>(m, "EdgeLaw")
      .def("__init__", [](EdgeLaw* law, double critical, double newton_tolerance,
                          double field_error, double rest_step, double longest_step,
                          double smallest, double overlap_limit, double force_error) {
        new (law) EdgeLaw{critical, newton_tolerance, field_error, rest_step,
                          longest_step, smallest, overlap_limit, force_error};
      });

  nb::class_<Field>(m, "Field")
      .def_prop_ro("table", [](const Field& f) { return table_of(f.nodes.gaps); })
      .def_prop_ro("orders", [](const Field& f) { return array_of(f.nodes.orders); })
      .def_prop_ro("offset", [](const Field& f) { return array_of(f.nodes.offset); })
      .def_prop_ro("theta", [](const Field& f) { return array_of(f.nodes.theta); })
      .def_prop_ro("weight", [](const Field& f) { return array_of(f.nodes.weight); })
      .def_prop_ro("slope", [](const Field& f) { return slopes_of(f.nodes); })
      .def_prop_ro("load", [](const Field& f) { return array_of(f.equations.load); })
      .def_prop_ro("unit_solved", [](const Field& f) { return array_of(f.solved[1]); })
      .def_prop_ro("scaled_opening", [](const Field& f) { return array_of(f.scaled_opening); })
      .def_prop_ro("opening", [](const Field& f) { return array_of(f.opening); })
      .def_ro("unit_mean", &Field::unit_mean)
      .def_ro("resistance", &Field::resistance)
      .def_ro("pressure", &Field::pressure)
      .def_ro("separation", &Field::separation);
  m.def("solve_field", [](const Array& gaps, double prescribed, const IntegerArray& orders,
                          const Model& model) {
    const Vector ends = vector_of(gaps);
    const Integers own = integers_of(orders);
    nb::gil_scoped_release release;
    return std::make_shared<Field>(solve_field(ends, prescribed, own, 1, model).field);
  });
  m.def("solve_separately", [](const Array& gaps, const Array& table, const IntegerArray& orders,
                               const Array& potential, double pressure, double prescribed,
                               const Model& model) {
    const Vector ends = vector_of(gaps), outer = vector_of(potential);
    const std::vector<Gap> known = gaps_of(table);
    const Integers own = integers_of(orders);
    nb::gil_scoped_release release;
    return std::make_shared<Field>(
        solve_separately(ends, known, own, outer, pressure, prescribed, model));
  });

  nb::class_<LinearResponse>(m, "LinearResponse")
      .def_prop_ro("gap_count", &LinearResponse::gap_count)
      .def_prop_ro("table", [](const LinearResponse& r) { return table_of(r.nodes.gaps); })
      .def_prop_ro("orders", [](const LinearResponse& r) { return array_of(r.nodes.orders); })
      .def_prop_ro("opening",
                   [](const LinearResponse& r) {
                     Vector out;
                     for (const Edge& edge : r.edges) out.push_back(edge.opening);
                     return array_of(out);
                   })
      .def_prop_ro("softness", [](const LinearResponse& r) { return array_of(r.softness); });
  m.def("set_up_response",
        [](const Array& gaps, double prescribed, const IntegerArray& orders, const EdgeLaw& law,
           const Model& model) {
          const Vector ends = vector_of(gaps);
          const Integers own = integers_of(orders);
          nb::gil_scoped_release release;
          return keep(set_up_response(ends, prescribed, own, law, model));
        });
  m.def("update_response",
        [](const LinearResponse& known, const Array& gaps, double prescribed,
           const IntegerArray& least, const EdgeLaw& law, const Model& model) {
          const Vector ends = vector_of(gaps);
          const Integers own = integers_of(least);
          nb::gil_scoped_release release;
          return keep(update_response(known, ends, prescribed, own, law, model));
        });
  m.def("count_unknown", [](const LinearResponse& known, const Array& gaps, const EdgeLaw& law,
                            const Model& model) {
    return count_unknown(known, vector_of(gaps), law, model);
  });
  m.def("settle_response", [](LinearResponse& response, const Array& gaps, double prescribed,
                              const EdgeLaw& law, const Model& model) {
    const Vector ends = vector_of(gaps);
    nb::gil_scoped_release release;
    return settle_response(response, ends, prescribed, law, model);
  });
  m.def("tangent_between", [](LinearResponse& response, const Array& gaps,
                              const IntegerArray& edges, double prescribed, const EdgeLaw& law,
                              const Model& model) {
    const Vector ends = vector_of(gaps);
    const Integers some = integers_of(edges);
    Flags held(ends.size());
    for (int e : some) held[e] = true;
    condense_gaps(response, hold_edges(response, ends, held), model);
    const ResponseSolution now = response.solve(prescribed, law, model.device);
    const Matrix tangent = HeldEdges(response, some, now, model.device).tangent();
    return array_of<double>(tangent.values, {edges.size(), edges.size()});
  });

  nb::class_<Equilibrium>(m, "Equilibrium")
      .def_ro("found", &Equilibrium::found)
      .def_ro("is_outgrown", &Equilibrium::is_outgrown)
      .def_ro("corrections", &Equilibrium::corrections)
      .def_prop_ro("gaps", [](const Equilibrium& e) { return pairs_of(e.ends); })
      .def_prop_ro("potential", [](const Equilibrium& e) { return array_of(e.potential); })
      .def_prop_ro("rate", [](const Equilibrium& e) { return array_of(e.at.rate); })
      .def_prop_ro("pressure", [](const Equilibrium& e) { return e.at.pressure; })
      .def_prop_ro("separation", [](const Equilibrium& e) { return e.at.separation; })
      .def_prop_ro("slope", [](const Equilibrium& e) { return e.at.slope; });
  m.def("find_equilibrium",
        [](LinearResponse& response, const Array& gaps, double prescribed, double reach,
           bool strict, const EdgeLaw& law, const Model& model) {
          Vector ends = vector_of(gaps);
          nb::gil_scoped_release release;
          return find_equilibrium(response, ends, prescribed, reach, strict, law, model);
        });

  nb::class_<Descent>(m, "Descent")
      .def_prop_ro("event", [](const Descent& d) { return int(d.event); })
      .def_prop_ro("gaps", [](const Descent& d) { return pairs_of(d.ends); })
      .def_ro("steps", &Descent::steps)
      .def_ro("reach", &Descent::reach)
      .def_ro("raced", &Descent::raced);
  m.def("descend", [](LinearResponse& response, const Array& gaps, double prescribed, int most,
                      bool equal_speeds, Truth runs, const Array& start, double reach,
                      const EdgeLaw& law, const Model& model) {
    Vector ends = vector_of(gaps);
    Running running = {{runs.data(), runs.data() + runs.size()}, vector_of(start), reach};
    Descent out;
    {
      nb::gil_scoped_release release;
      out = descend(response, ends, prescribed, most, equal_speeds, running, law, model);
    }
    std::copy(running.edges.begin(), running.edges.end(), runs.data());
    return out;
  });

  nb::class_<SearchLengths>(m, "SearchLengths")
      .def("__init__", [](SearchLengths* lengths, double max_displacement,
                          double closing_per_motion, double surface, double narrowest,
                          double widest, int top) {
        new (lengths) SearchLengths{max_displacement, closing_per_motion, surface,
                                    narrowest, widest, top};
      });
  nb::class_<Searched>(m, "Searched").def(nb::init<>());
  m.def("make_field", &make_field);
  m.def("search", [](const Field& field, const Searched& searched, const SearchLengths& lengths,
                     const Model& model) {
    Search found;
    {
      nb::gil_scoped_release release;
      found = search(field, searched.gaps, lengths, model);
    }
    return nb::make_tuple(found.least, found.count, minima_of(found.minima),
                          Searched{found.searched});
  });
  m.def("clearance_left", [](const Field& field, const Searched& searched,
                             const SearchLengths& lengths, const Model& model) {
    return array_of(clearance_left(field, searched.gaps, lengths, model).clearance);
  });
  m.def("search_gaps", [](const Field& field, const IntegerArray& gaps,
                          const SearchLengths& lengths, const Model& model) {
    const std::vector<Minimum> minima = find_minima(field, integers_of(gaps), lengths.top, model);
    return nb::make_tuple(minima_of(minima),
                          array_of(least_clearances(minima, field.nodes.gap_count(), lengths)));
  });
  m.def("open_gap", [](const Field& field, int k, int count, const Model& model) {
    const FineOpening fine =
        open_gap(field.nodes, k, field.scaled_opening, Circle(count + 1), model);
    return nb::make_tuple(array_of(fine.theta), array_of(fine.theta_by_t), array_of(fine.opening),
                          array_of(fine.modes));
  });
  m.def("work_of_gaps", &work_of_gaps);
  m.def("edge_openings", [](const Field& field, const Array& f, const Model& model) {
    Vector out(2 * field.nodes.gap_count());
    for (int e = 0; e < int(out.size()); ++e) {
      const int k = e / 2, side = e % 2;
      const Vector& end_values = (*model.rules)[field.nodes.orders[k]].end_values[side];
      out[e] = std::sqrt(2 * field.nodes.slope[k][side]) *
               dot(end_values.data(), f.data() + field.nodes.offset[k], field.nodes.size_of(k));
    }
    return array_of(out);
  });
  nb::class_<LengthRule>(m, "LengthRule")
      .def("__init__", [](LengthRule* rule, const Array& nodes, const Array& weights,
                          const Array& before) {
        new (rule) LengthRule{vector_of(nodes), vector_of(weights), vector_of(before)};
      });
  // the length of the profile over all patches
  m.def("contact_length", [](const Array& gaps, const Panels& panels, const LengthRule& rule) {
    double total = length_up_to(2 * pi, panels, rule);
    const Vector ends = vector_of(gaps);
    for (size_t e = 0; e < ends.size(); ++e)
      total += (e % 2 == 0 ? 1 : -1) * length_up_to(ends[e], panels, rule);
    return total;
  });
  m.def("map_gaps", [](const Array& gaps) { return table_of(map_gaps(vector_of(gaps))); });
  m.def("choose_orders", [](const Array& table, double digits, const GaussRules& rules) {
    Integers out;
    for (const Gap& gap : gaps_of(table)) out.push_back(choose_order(gap, digits, rules));
    return array_of(out);
  });
  m.def("shortest_length", [](const Array& gaps) { return shortest_length(vector_of(gaps)); });

  // Single parts, for tests.
  m.def("gap_moments", [](const Array& table, int k, const Model& model, int modes, int fields) {
    Vector s(modes * fields);
    std::array<std::array<double, 2>, 2> ends = {};
    gap_moments(gaps_of(table)[k], *model.panels, modes, fields, s.data(), ends);
    Vector loads = {ends[0][0], ends[0][1], ends[1][0], ends[1][1]};
    return nb::make_tuple(array_of<double>(s, {size_t(modes), size_t(fields)}),
                          array_of<double>(loads, {2, 2}));
  });
  m.def("nothing", [](double x) { return x; });
}
