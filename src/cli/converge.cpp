// `terrode converge`: repeats one operating point while one numerical choice is refined, and says what is converged.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <optional>

#include "cli/commands.h"
#include "cli/converge_against.h"
#include "cli/input.h"
#include "cli/sweep_result.h"
#include "cli/terminal.h"
#include "core/parallel.h"
#include "scenario/dem_file.h"
#include "scenario/methods.h"
#include "scenario/scenario.h"
#include "vehicle/slip_sweep.h"

namespace terrode::cli {
namespace {

using scenario::Scenario;

// What can be refined: by which methods, how a scenario takes it, and where the study begins, as a multiple of the
// scenario's own value.
struct Choice {
  std::string name, unit;
  std::vector<std::string> methods;
  double start, factor;  // coarsest over own; from level to level
  std::function<double(const Scenario&)> get;
  std::function<void(Scenario&, double)> set;
};

double window(const Scenario& s) {
  const dem::DemWindow w = scenario::particle_window(s);
  return w.ahead + w.behind;
}

const std::vector<Choice>& choices() {
  static const std::vector<std::string> nodes = {"node-spring"}, grains = {"dem", "mpi"};
  static const std::vector<Choice> list = {
      {"time_step", "s", nodes, 2.0, 0.5, [](const Scenario& s) { return s.rig.time_step; },
       [](Scenario& s, double v) { s.rig.time_step = v; }},
      {"node_spacing", "m", nodes, 4.0, 0.5, [](const Scenario& s) { return s.terrain.node_spacing; },
       [](Scenario& s, double v) { s.terrain.node_spacing = v; }},
      // The ground has no edges; what stands for its size is the length that the wheel travels on it.
      {"domain", "m", nodes, 0.5, 1.4142135623730951, [](const Scenario& s) { return s.rig.travel; },
       [](Scenario& s, double v) { s.rig.travel = v; }},
      // The particles' own step; the rig's stays.
      {"time_step", "of the Rayleigh time", grains, 1.0, 0.5, [](const Scenario& s) { return s.particles.time_step_fraction; },
       [](Scenario& s, double v) {
         s.particles.time_step.reset();
         s.particles.time_step_fraction = v;
       }},
      // The rig's step; the particles' stays, so that this is how often the two exchange force and motion.
      {"coupling", "s", grains, 4.0, 0.5, [](const Scenario& s) { return s.rig.time_step; },
       [](Scenario& s, double v) { s.rig.time_step = v; }},
      // The length of soil that moves, its parts ahead of and behind the axle in the scenario's proportion.
      {"domain", "m", {"dem"}, 0.5, 1.4142135623730951, window,
       [](Scenario& s, double v) {
         const dem::DemWindow w = scenario::particle_window(s);
         s.particles.window_ahead = w.ahead * v / (w.ahead + w.behind);
         s.particles.window_behind = w.behind * v / (w.ahead + w.behind);
       }},
      // The largest diameter, the others in proportion; bed and window stay.
      {"particles", "m", grains, 1.4142135623730951, 0.7071067811865476,
       [](const Scenario& s) { return scenario::particle_sizes(s).largest; },
       [](Scenario& s, double v) {
         const dem::SizeDistribution d = scenario::particle_sizes(s);
         s.particles.smallest = d.smallest * v / d.largest;
         s.particles.largest = v;
       }},
  };
  return list;
}

struct ConvergeArguments {
  std::string scenario, over, against, slip, method = "node-spring";
  std::optional<double> from, node_spacing, time_step, travel;
  int levels = 5;
  double tolerance = 0.01;
};

struct Quantity {
  const char *name, *unit;
  double SweepPoint::*value;
  double SweepPoint::*sem;
};
constexpr Quantity kQuantities[] = {{"drawbar_pull", "N", &SweepPoint::drawbar_pull, &SweepPoint::drawbar_pull_sem},
                                    {"driving_torque", "N m", &SweepPoint::driving_torque, &SweepPoint::driving_torque_sem},
                                    {"sinkage", "m", &SweepPoint::sinkage, &SweepPoint::sinkage_sem}};

// The order p of f(h) = f0 + c h^p from three levels whose steps shrink by `factor`, and f0; nothing where the three do
// not approach a limit in one way.
struct Limit {
  std::optional<double> order, value;
};
Limit limit_of(double a, double b, double c, double factor) {
  const double first = b - a, second = c - b;
  if (!(std::abs(second) > 0) || !(first / second > 1)) return {};
  const double order = std::log(first / second) / -std::log(factor);
  return {order, c + second / (first / second - 1)};
}

// The scenario's own value against the last level: they agree where they differ by no more than two standard errors of
// the difference (a chance of one in twenty for equal means).
std::string scatter_verdict(const Choice& choice, const Quantity& q, const std::vector<double>& values,
                            const std::vector<SweepPoint>& points, double own, double scale, Json& converged) {
  std::size_t mine = 0;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (std::abs(values[i] - own) < std::abs(values[mine] - own)) mine = i;
  if (mine + 1 == values.size() || points[mine].failed() || points.back().failed()) {
    converged[q.name] = nullptr;
    return fmt::format("{}: no verdict: {}\n", q.name,
                       mine + 1 == values.size() ? "no level beyond the scenario's own" : "a level failed");
  }
  const SweepPoint &a = points[mine], &b = points.back();
  const double difference = a.*q.value - b.*q.value, error = std::hypot(a.*q.sem, b.*q.sem);
  const bool same = std::abs(difference) <= 2.0 * error;
  converged[q.name] = {{"value", values[mine]}, {"against", values.back()}, {"difference", number(difference)},
                       {"standard_error", number(error)}, {"relative_error", number(error / scale)}, {"within_scatter", same}};
  return fmt::format("{}: at {} = {:.4g} {} it differs from that at {:.4g} by {:+.3g} {}, standard error {:.2g} ({:.2g} % of {:.4g}): {}\n",
                     q.name, choice.name, values[mine], choice.unit, values.back(), difference, q.unit, error,
                     100.0 * error / scale, scale, same ? "no change beyond scatter" : "CHANGES beyond scatter");
}

// Nodes that carry the wheel, over the second half of the run.
double contacts(const SweepPoint& p) {
  const recording::Channel* c = p.series ? p.series->find("contact_count") : nullptr;
  if (!c || c->values.size() < 2) return SweepPoint::kUnknown;
  double sum = 0.0;
  const std::size_t half = c->values.size() / 2;
  for (std::size_t i = half; i < c->values.size(); ++i) sum += c->values[i];
  return sum / static_cast<double>(c->values.size() - half);
}

void converge(const ConvergeArguments& arguments, Common& common) {
  Scenario base = load_input(arguments.scenario, common);
  scenario::set_if(base.terrain.node_spacing, arguments.node_spacing);
  scenario::set_if(base.rig.time_step, arguments.time_step);
  scenario::set_if(base.rig.travel, arguments.travel);
  const std::vector<double> slips = arguments.slip.empty() ? std::vector<double>{} : scenario::parse_slips(arguments.slip);
  if (arguments.over.empty() == arguments.against.empty())
    throw InputError({{}, 0, 0, "--over, --against", "are both given or both missing", "one of them"});
  if (arguments.against == "steady") return against_steady(base, slips, arguments.tolerance, common);
  if (arguments.against == "pull_ramp") return against_pull_ramp(base, slips, arguments.tolerance, common);
  if (slips.size() > 1) throw InputError({{}, 0, 0, "--slip", fmt::format("is '{}'", arguments.slip), "one slip with --over"});
  const Choice* choice = nullptr;
  std::string possible;
  for (const Choice& c : choices()) {
    if (std::find(c.methods.begin(), c.methods.end(), arguments.method) == c.methods.end()) continue;
    if (c.name == arguments.over) choice = &c;
    possible += (possible.empty() ? "" : ", ") + c.name;
  }
  if (!choice)
    throw InputError(Problem{{}, 0, 0, "--over", fmt::format("{} cannot be refined for method {}", arguments.over, arguments.method),
                             possible.empty() ? "another method: steady has no such choice" : possible});
  if (choice->name == "domain" && arguments.method == "dem" && base.particles.bed == "full")
    throw InputError(Problem{base.file, 0, 0, "particles.bed", "is full, which has no window", "moving"});
  const auto at = base.operating_points({slips.empty() ? base.rig.slip : slips.front()}).front();

  std::vector<double> values;
  double value = arguments.from.value_or(choice->start * choice->get(base));
  for (int i = 0; i < arguments.levels; ++i, value *= choice->factor) values.push_back(value);
  if (choice->factor > 1)
    for (double& v : values) v = arguments.from.value_or(choice->start * choice->get(base)) *
                                 std::pow(choice->factor, static_cast<double>(&v - values.data()));

  std::vector<Scenario> scenarios(values.size(), base);
  std::vector<vehicle::SweepMethod> methods;
  for (std::size_t i = 0; i < values.size(); ++i) {
    choice->set(scenarios[i], values[i]);
    scenario::MethodSettings settings;
    settings.progress = show_progress(common);
    methods.push_back(scenario::make_method(arguments.method, scenarios[i], settings));
    methods.back().name = fmt::format("{} {}", arguments.method, values[i]);
  }
  // Finest first: it takes longest.
  std::vector<vehicle::SweepMethod> order(methods.rbegin(), methods.rend());
  vehicle::SweepOptions options;
  options.threads = common.threads;
  const auto found = vehicle::sweep(order, {scenario::condition_of(at, base.wheel.radius)}, options, show_progress(common));
  std::vector<SweepPoint> points;
  for (std::size_t i = 0; i < values.size(); ++i)
    points.push_back(summarise(found[values.size() - 1 - i], at, scenario::averaging_period(arguments.method, scenarios[i], at)));

  const bool nodes = arguments.method == "node-spring";
  // Where a result scatters, levels are compared by their standard errors instead of by an order.
  const bool scatters = arguments.method == "dem" || arguments.method == "mpi";
  const bool refines = choice->factor < 1 && !scatters;
  const auto last = points.size() - 1;
  Json document = {{"scenario", base.file}, {"over", choice->name}, {"unit", choice->unit}, {"method", arguments.method},
                   {"slip", at.slip_given}, {"slip_convention", base.rig.slip_convention}, {"tolerance", arguments.tolerance}};
  Json levels = Json::array();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const SweepPoint& p = points[i];
    Json level = {{choice->name, values[i]}};
    if (p.failed()) level["error"] = p.error;
    else
      for (const Quantity& q : kQuantities) {
        level[q.name] = number(p.*q.value);
        if (scatters) level[std::string(q.name) + "_sem"] = number(p.*q.sem);
      }
    if (nodes) level["nodes"] = number(contacts(p));
    level["cpu_seconds"] = number(p.cpu_seconds);
    level["simulated_seconds"] = number(p.simulated_seconds);
    if (!p.failed()) level["steady"] = p.steady;
    levels.push_back(level);
  }
  document["levels"] = levels;

  std::vector<std::vector<std::string>> rows = {{fmt::format("{} [{}]", choice->name, choice->unit)}};
  for (const Quantity& q : kQuantities) {
    rows[0].push_back(fmt::format("{} [{}]", q.name, q.unit));
    if (scatters) rows[0].push_back("+-");
  }
  if (nodes) rows[0].push_back("nodes");
  rows[0].push_back("CPU s per simulated s");
  for (std::size_t i = 0; i < points.size(); ++i) {
    const SweepPoint& p = points[i];
    std::vector<std::string> row = {fmt::format("{:.4g}", values[i])};
    for (const Quantity& q : kQuantities) {
      row.push_back(p.failed() ? "failed" : fmt::format("{:.5g}", p.*q.value));
      if (scatters) row.push_back(p.failed() ? "-" : fmt::format("{:.2g}", p.*q.sem));
    }
    if (nodes) row.push_back(fmt::format("{:.0f}", contacts(p)));
    row.push_back(p.simulated_seconds > 0 ? fmt::format("{:.3g}", p.cpu_seconds / p.simulated_seconds) : "-");
    rows.push_back(row);
  }

  // A level is converged where it and all finer ones lie within the tolerance of the finest; pull and torque are
  // measured by the load, since the pull passes through zero.
  std::string verdict;
  Json converged = Json::object(), order_json = Json::object(), limits = Json::object();
  for (const Quantity& q : kQuantities) {
    const double best = points[last].*q.value;
    double scale = std::abs(best);
    if (std::string(q.name) == "drawbar_pull") scale = at.normal_load;
    if (std::string(q.name) == "driving_torque") scale = at.normal_load * base.wheel.radius;
    if (scatters) {
      verdict += scatter_verdict(*choice, q, values, points, choice->get(base), scale, converged);
      continue;
    }
    std::optional<double> from;
    for (std::size_t i = points.size(); i-- > 0;) {
      if (points[i].failed() || !(std::abs(points[i].*q.value - best) <= arguments.tolerance * scale)) break;
      from = values[i];
    }
    const bool alone = from && *from == values[last];
    converged[q.name] = from && !alone ? Json(*from) : Json(nullptr);
    verdict += from && !alone
                   ? fmt::format("{}: within {:.2g} % of the finest from {} = {:.4g} {} on", q.name, 100 * arguments.tolerance,
                                 choice->name, *from, choice->unit)
                   : fmt::format("{}: not converged within {:.2g} %", q.name, 100 * arguments.tolerance);
    if (refines && points.size() >= 3) {
      const Limit l = limit_of(points[last - 2].*q.value, points[last - 1].*q.value, best, choice->factor);
      order_json[q.name] = l.order ? Json(*l.order) : Json(nullptr);
      limits[q.name] = l.value ? Json(*l.value) : Json(nullptr);
      if (l.order) verdict += fmt::format("; order {:.1f}, limit {:.5g} {}", *l.order, *l.value, q.unit);
      else verdict += "; no order: the differences do not shrink steadily";
    }
    verdict += "\n";
  }
  document["converged_from"] = converged;
  if (refines) {
    document["order"] = order_json;
    document["limit"] = limits;
  }
  if (common.json) {
    print_json(document);
  } else {
    std::fputs(aligned(rows).c_str(), stdout);
    std::fputs(verdict.c_str(), stdout);
  }
  for (std::size_t i = 0; i < points.size(); ++i)
    if (points[i].failed()) {
      std::fprintf(stderr, "terrode: %s = %g failed: %s\n", choice->name.c_str(), values[i], points[i].error.c_str());
      common.status = 1;
    }
}

}  // namespace

void add_converge(Command& app, Common& common) {
  Command* command =
      app.add_subcommand("converge", "repeat a run while refining one numerical choice; value and cost at each, order of convergence");
  const auto a = std::make_shared<ConvergeArguments>();
  const std::vector<std::string> over = {"time_step", "node_spacing", "domain", "particles", "coupling"};
  command->add_option("SCENARIO", a->scenario, "scenario file, or a recording")->required()->type_name("");
  command->add_option("--over", a->over, "what to refine: time_step, node_spacing, domain, particles, coupling")
      ->check(is_member(over))
      ->type_name("CHOICE");
  command->add_option("--method", a->method, "the method to study (default: node-spring)")
      ->check(is_member(scenario::method_names()))
      ->type_name("NAME");
  const std::vector<std::string> against = {"steady", "pull_ramp"};
  command->add_option("--against", a->against,
                      "in place of --over: the node-spring rig slip by slip against the steady wheel, or against one run whose pull rises")
      ->check(is_member(against))
      ->type_name("WHAT");
  command->add_option("--slip", a->slip, "slip (with --against: slips), by the convention of the scenario (default: the scenario's)")
      ->type_name("S");
  command->add_option("--node-spacing", a->node_spacing, "in place of the scenario's [m]")->check(positive_number())->type_name("X");
  command->add_option("--time-step", a->time_step, "of the rig, in place of the scenario's [s]")->check(positive_number())->type_name("X");
  command->add_option("--travel", a->travel, "of the rig, in place of the scenario's [m]")->check(positive_number())->type_name("X");
  command->add_option("--from", a->from, "coarsest value, SI (default: from the scenario's own)")
      ->check(positive_number())
      ->type_name("X");
  command->add_option("--levels", a->levels, "how many values (default: 5)")->check(range(3, 12))->type_name("N");
  command->add_option("--tolerance", a->tolerance, "what counts as converged, relative (default: 0.01)")
      ->check(range(1e-9, 1.0))
      ->type_name("X");
  add_common(*command, common, false);
  common.words["converge --over"] = over;
  common.words["converge --against"] = against;
  common.words["converge --method"] = scenario::method_names();
  command->callback([a, &common] { converge(*a, common); });
}

}  // namespace terrode::cli
