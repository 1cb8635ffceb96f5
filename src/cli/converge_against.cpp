#include "cli/converge_against.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "cli/sweep_result.h"
#include "cli/terminal.h"
#include "scenario/methods.h"
#include "vehicle/slip_sweep.h"

namespace terrode::cli {
namespace {

using scenario::OperatingPoint;
using scenario::Scenario;

std::vector<OperatingPoint> points_of(const Scenario& s, const std::vector<double>& slips) {
  std::vector<OperatingPoint> all = slips.empty() ? s.operating_points() : s.operating_points(slips);
  if (slips.empty()) std::erase_if(all, [](const OperatingPoint& p) { return std::isinf(p.slip) || p.pass != 1; });
  return all;
}

scenario::MethodSettings settings_of(const Common& common) {
  scenario::MethodSettings out;
  out.progress = show_progress(common);
  return out;
}

std::vector<SweepPoint> run_points(const std::string& method, const Scenario& s, const std::vector<OperatingPoint>& points, Common& common) {
  std::vector<recording::Condition> conditions;
  for (const OperatingPoint& p : points) conditions.push_back(scenario::condition_of(p, s.wheel.radius));
  vehicle::SweepOptions options;
  options.threads = common.threads;
  const auto found = vehicle::sweep({scenario::make_method(method, s, settings_of(common))}, conditions, options, show_progress(common));
  std::vector<SweepPoint> out;
  for (std::size_t i = 0; i < points.size(); ++i)
    out.push_back(summarise(found[i], points[i], scenario::averaging_period(method, s, points[i])));
  return out;
}

struct Part {
  const char* name;
  double SweepPoint::*value;
};
constexpr Part kParts[] = {{"drawbar_pull", &SweepPoint::drawbar_pull}, {"driving_torque", &SweepPoint::driving_torque}, {"sinkage", &SweepPoint::sinkage}};

std::string settings_text(const Scenario& s) {
  return fmt::format("nodes {:.4g} mm apart, time step {:.4g} s, travel {:.4g} m", 1e3 * s.terrain.node_spacing, s.rig.time_step, s.rig.travel);
}

// Why a run parts from the steady wheel, of what can be told from the two alone.
std::string reason(const Scenario& s, const SweepPoint& run, const SweepPoint& steady, double tolerance) {
  const double scale = steady.at.normal_load;
  std::string out;
  const auto say = [&out](const std::string& text) { out += (out.empty() ? "" : "; ") + text; };
  const double contact = s.wheel.radius * std::sin(steady.entry_angle);
  const double gone = run.series ? std::abs(run.series->find("position")->values.back()) : 0.0;
  constexpr double enough = 5.0;  // contact lengths after which the rut behind the wheel is its own
  if (!run.steady) say("has not settled");
  if (gone < enough * contact) say(fmt::format("travelled {:.2g} lengths of its contact", gone / contact));
  const double pull_off = std::abs(run.drawbar_pull - steady.drawbar_pull);
  if (pull_off <= tolerance * scale && pull_off > tolerance * std::abs(steady.drawbar_pull))
    say(fmt::format("the pull is small: off by {:.2g} % of the load", 100.0 * pull_off / scale));
  if (steady.at.slip < 0.0) say("braking: shear follows the rim's sliding, not Eq. 9's signs");
  return out.empty() ? "none of the known reasons: refine time_step and node_spacing" : out;
}

// Means over `window` seconds about each sample (less at the ends).
std::vector<double> moving_mean(const std::vector<double>& time, const std::vector<double>& values, double window) {
  std::vector<double> out(values.size());
  double sum = 0.0;
  std::size_t from = 0, to = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    for (; to < values.size() && time[to] <= time[i] + 0.5 * window; ++to) sum += values[to];
    for (; time[from] < time[i] - 0.5 * window; ++from) sum -= values[from];
    out[i] = sum / static_cast<double>(to - from);
  }
  return out;
}

}  // namespace

void against_steady(const Scenario& s, const std::vector<double>& slips, double tolerance, Common& common) {
  const std::vector<OperatingPoint> points = points_of(s, slips);
  const auto steady = run_points("steady", s, points, common), runs = run_points("node-spring", s, points, common);
  std::vector<std::vector<std::string>> rows = {
      {"slip", "pull [N]", "off", "torque [N m]", "off", "sinkage [mm]", "off", ""}};
  Json list = Json::array();
  std::string within, beyond;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const SweepPoint &a = steady[i], &b = runs[i];
    Json entry = {{"slip", points[i].slip_given}};
    std::vector<std::string> row = {fmt::format("{:.4g}", points[i].slip_given)};
    const std::string error = a.failed() ? a.error : b.error;
    bool good = error.empty();
    for (const Part& p : kParts) {
      if (!error.empty()) {
        row.insert(row.end(), {"-", "-"});
        continue;
      }
      const double off = (b.*p.value - a.*p.value) / std::abs(a.*p.value);
      good = good && std::abs(off) <= tolerance;
      row.push_back(fmt::format("{:.5g}", b.*p.value * (p.value == &SweepPoint::sinkage ? 1e3 : 1.0)));
      row.push_back(fmt::format("{:+.2f} %", 100.0 * off));
      entry[p.name] = {{"steady", number(a.*p.value)}, {"node_spring", number(b.*p.value)}, {"off", number(off)}};
    }
    const std::string why = good ? "" : !error.empty() ? "failed: " + error : reason(s, b, a, tolerance);
    if (!error.empty()) common.status = 1;
    entry["within"] = good;
    if (!good) entry["why"] = why;
    list.push_back(entry);
    row.push_back(good ? "" : why);
    rows.push_back(row);
    std::string& side = good ? within : beyond;
    side += (side.empty() ? "" : ", ") + row.front();
  }
  if (common.json) {
    print_json({{"scenario", s.file}, {"against", "steady"}, {"tolerance", tolerance}, {"node_spacing", s.terrain.node_spacing},
                {"time_step", s.rig.time_step}, {"points", list}});
    return;
  }
  std::fputs(aligned(rows).c_str(), stdout);
  std::printf("%s: within %.2g %% of the steady wheel at slips %s%s%s\n", settings_text(s).c_str(), 100.0 * tolerance,
              within.empty() ? "none" : within.c_str(), beyond.empty() ? "" : "; not at ", beyond.c_str());
}

void against_pull_ramp(const Scenario& s, const std::vector<double>& slips, double tolerance, Common& common) {
  const std::vector<OperatingPoint> points = points_of(s, slips);
  const auto runs = run_points("node-spring", s, points, common);
  double highest = 0.0;
  for (const SweepPoint& p : runs) highest = std::max(highest, p.failed() ? 0.0 : p.drawbar_pull);

  Scenario ramp = s;
  ramp.rig.mode = "pull_ramp";
  // A scenario that is no ramp itself: beyond the highest pull of the sweep, along four times the way.
  if (s.rig.mode != "pull_ramp") {
    ramp.rig.pull = 0.0;
    ramp.rig.final_pull = 1.05 * highest;
    ramp.rig.travel = 4.0 * s.rig.travel;
  }
  const auto method = scenario::make_method("node-spring", ramp, settings_of(common));
  const vehicle::PointResult drawn = method.run(scenario::condition_of(points.front(), s.wheel.radius), show_progress(common));
  const auto channel = [&](const char* name) -> const std::vector<double>& { return drawn.run.find(name)->values; };
  const std::vector<double>&time = drawn.run.time, &load = channel("normal_load");
  // A carriage that is free swings on the shear of the soil: means over a second are the curve.
  const std::vector<double> slip = moving_mean(time, channel("slip"), 1.0), pull = moving_mean(time, channel("drawbar_pull"), 1.0);
  const double normal = points.front().normal_load;
  double jolt = 0.0;
  constexpr double first = 0.3;  // s after touchdown
  for (std::size_t i = 0; i < time.size() && time[i] < first; ++i) jolt = std::max(jolt, std::abs(load[i] / normal - 1.0));

  std::vector<std::vector<std::string>> rows = {{"slip", "pull by a run of its own [N]", "by the ramp [N]", "off, of the load"}};
  Json list = Json::array();
  double worst = 0.0;
  int compared = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const SweepPoint& p = runs[i];
    // Between the last sample below this slip and the first one above that comes after it.
    std::optional<double> on_ramp;
    for (std::size_t k = time.size(); k-- > 1;)
      if (time[k - 1] >= ramp.rig.ramp && slip[k - 1] <= points[i].slip && slip[k] > points[i].slip) {
        const double w = (points[i].slip - slip[k - 1]) / (slip[k] - slip[k - 1]);
        on_ramp = (1.0 - w) * pull[k - 1] + w * pull[k];
        break;
      }
    std::vector<std::string> row = {fmt::format("{:.4g}", points[i].slip_given),
                                    p.failed() ? "failed: " + p.error : fmt::format("{:.3f}", p.drawbar_pull),
                                    on_ramp ? fmt::format("{:.3f}", *on_ramp) : "not passed"};
    Json entry = {{"slip", points[i].slip_given}, {"drawbar_pull", number(p.drawbar_pull)},
                  {"by_ramp", on_ramp ? Json(*on_ramp) : Json(nullptr)}};
    if (on_ramp && !p.failed()) {
      const double off = (*on_ramp - p.drawbar_pull) / normal;
      worst = std::max(worst, std::abs(off));
      ++compared;
      row.push_back(fmt::format("{:+.2f} %", 100.0 * off));
      entry["off"] = off;
    } else {
      row.push_back("-");
    }
    list.push_back(entry);
    rows.push_back(row);
  }
  if (common.json) {
    print_json({{"scenario", s.file}, {"against", "pull_ramp"}, {"tolerance", tolerance}, {"seconds", drawn.simulated_seconds},
                {"touchdown_jolt", jolt}, {"compared", compared}, {"largest_difference", worst}, {"events", drawn.events}, {"points", list}});
    return;
  }
  std::fputs(aligned(rows).c_str(), stdout);
  std::printf("one run of %.3g s gives %d of %zu points, %s %.2g %% of the load (largest difference %.2g %%)\n", drawn.simulated_seconds,
              compared, points.size(), worst <= tolerance ? "within" : "NOT within", 100.0 * tolerance, 100.0 * worst);
  std::printf("touchdown: in the first %.1g s the ground's force stays within %.2g %% of the load\n", first, 100.0 * jolt);
  for (const std::string& e : drawn.events) note(common, e);
}

}  // namespace terrode::cli
