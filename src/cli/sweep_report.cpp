#include "cli/sweep_report.h"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <map>
#include <tuple>

#include "analysis/steady_state.h"

namespace terrode::cli {
namespace {

namespace channel = recording::channel;

// Points of one load, speed and pass: what one curve holds.
using Setting = std::tuple<double, double, int>;
Setting setting_of(const SweepPoint& p) { return {p.at.normal_load, p.at.angular_velocity, p.at.pass}; }

report::SweepPoint report_point(const SweepPoint& p) {
  report::SweepPoint out;
  out.slip = p.at.slip_given;
  out.drawbar_pull = p.drawbar_pull;
  out.driving_torque = p.driving_torque;
  out.sinkage = p.sinkage;
  out.drawbar_pull_sem = p.drawbar_pull_sem;
  out.driving_torque_sem = p.driving_torque_sem;
  out.sinkage_sem = p.sinkage_sem;
  out.drawbar_pull_std = p.drawbar_pull_std;
  out.driving_torque_std = p.driving_torque_std;
  out.sinkage_std = p.sinkage_std;
  out.cpu_seconds = p.cpu_seconds;
  out.simulated_seconds = p.simulated_seconds;
  out.steady = p.steady;
  out.error = p.error;
  return out;
}

}  // namespace

std::vector<SweepPoint> measured_points(const scenario::Scenario& s) {
  std::vector<SweepPoint> out;
  if (!s.measured) return out;
  const auto& runs = s.measured->runs;
  for (const analysis::Replicates& group : analysis::group_replicates(runs)) {
    SweepPoint point;
    point.at.slip = group.condition.slip;
    point.at.slip_given = bekker::from_wong_reece(group.condition.slip, s.slip_convention());
    point.at.normal_load = group.condition.normal_load.value_or(s.rig.normal_load.value_or(0.0));
    point.at.angular_velocity = group.condition.angular_velocity.value_or(s.rig.angular_velocity);
    point.at.pass = group.condition.pass;
    std::map<std::string, std::vector<analysis::SteadyState>> states;
    for (const std::size_t i : group.runs) {
      try {
        for (auto& [name, state] : analysis::steady_states(runs[i])) states[name].push_back(state);
      } catch (const InputError& e) {
        point.remarks.push_back(fmt::format("{}: {}", runs[i].id, e.what()));
      }
    }
    const auto take = [&](const char* name, double& mean, double& std, double& sem) {
      const auto found = states.find(name);
      if (found == states.end()) return;
      const analysis::ReplicateScatter scatter = analysis::replicate_scatter(found->second);
      mean = scatter.mean;
      std = scatter.count > 1 ? scatter.between_std : found->second.front().std;
      if (std == 0.0) std = SweepPoint::kUnknown;
      // A row of a table tells its scatter alone.
      sem = scatter.sem > 0.0 ? scatter.sem : std > 0.0 ? std : SweepPoint::kUnknown;
    };
    take(channel::drawbar_pull, point.drawbar_pull, point.drawbar_pull_std, point.drawbar_pull_sem);
    take(channel::driving_torque, point.driving_torque, point.driving_torque_std, point.driving_torque_sem);
    take(channel::sinkage, point.sinkage, point.sinkage_std, point.sinkage_sem);
    out.push_back(std::move(point));
  }
  return out;
}

report::SweepReport sweep_report(const scenario::Scenario& s, const std::vector<MethodResult>& results,
                                 const std::vector<SweepPoint>& measured, const std::string& command) {
  report::SweepReport out;
  out.title = s.title.empty() ? "Slip sweep" : s.title;
  out.command = command;
  out.scenario_name = std::filesystem::path(s.file).filename().string();
  out.scenario_text = s.text;
  out.slip_convention = s.rig.slip_convention;
  out.facts.emplace_back("Wheel", fmt::format("{:g} x {:g} mm", s.wheel.radius * 1e3, s.wheel.width * 1e3));
  if (!s.soil.name.empty()) out.facts.emplace_back("Soil", s.soil.name);

  std::vector<Setting> settings;
  const auto note_setting = [&settings](const SweepPoint& p) {
    for (const Setting& known : settings)
      if (known == setting_of(p)) return;
    settings.push_back(setting_of(p));
  };
  for (const MethodResult& r : results)
    for (const SweepPoint& p : r.points) note_setting(p);
  for (const SweepPoint& p : measured) note_setting(p);
  bool loads = false, speeds = false, passes = false;
  for (const auto& [load, speed, pass] : settings) {
    loads = loads || load != std::get<0>(settings.front());
    speeds = speeds || speed != std::get<1>(settings.front());
    passes = passes || pass != std::get<2>(settings.front());
  }
  if (!settings.empty() && !loads) out.facts.emplace_back("Load", fmt::format("{:g} N", std::get<0>(settings.front())));
  const auto add = [&](const std::string& name, const std::vector<SweepPoint>& points, bool is_measured) {
    for (const Setting& setting : settings) {
      report::SweepCurve curve;
      curve.name = name;
      if (loads) curve.name += fmt::format(", {:g} N", std::get<0>(setting));
      if (speeds) curve.name += fmt::format(", {:.3g} rad/s", std::get<1>(setting));
      if (passes) curve.name += fmt::format(", pass {}", std::get<2>(setting));
      curve.measured = is_measured;
      for (const SweepPoint& p : points)
        if (setting_of(p) == setting) curve.points.push_back(report_point(p));
      if (!curve.points.empty()) out.curves.push_back(std::move(curve));
    }
  };
  for (const MethodResult& r : results) add(r.method, r.points, false);
  add("measured", measured, true);
  if (s.measured && !s.measured->source.empty()) out.notes.push_back("Measured: " + s.measured->source);
  for (const std::string& n : s.notes) out.notes.push_back(n);
  std::map<std::string, int> remarks;
  for (const MethodResult& r : results)
    for (const SweepPoint& p : r.points)
      for (const std::string& remark : p.remarks) ++remarks[r.method + ": " + remark];
  for (const auto& [text, count] : remarks)
    out.notes.push_back(count > 1 ? fmt::format("{} ({} points)", text, count) : text);
  return out;
}

}  // namespace terrode::cli
