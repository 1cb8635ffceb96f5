#include "cli/replay.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "cli/sweep_result.h"
#include "scenario/methods.h"
#include "vehicle/slip_sweep.h"

namespace terrode::cli {

using diagnosis::kChannels;

scenario::Scenario corrected_scenario(const recording::Recording& recording, const bekker::Soil& soil, const bekker::ContactAngles& angles,
                                      const std::map<std::string, std::map<std::string, double>>& effects) {
  scenario::Scenario s = scenario::scenario_of(recording);
  s.soil.cohesion = soil.cohesion;
  s.soil.friction_angle = soil.friction_angle;
  s.soil.shear_modulus = soil.shear_modulus;
  s.soil.n = soil.n;
  s.soil.k = soil.k;
  s.soil.plate_width = soil.plate_width;
  s.soil.kc.reset();
  s.soil.kphi.reset();
  s.soil.a0 = angles.a0;
  s.soil.a1 = angles.a1;
  s.soil.theta_r = angles.theta_r;
  s.effects.clear();
  for (const auto& [id, values] : effects) s.effects.push_back({id, values});
  s.measured.reset();
  return s;
}

ReplayResult replay(const recording::Recording& recording, const diagnosis::Diagnosis& d, const Common& common) {
  ReplayResult out;
  if (d.replay.held_out.empty()) return out;
  const double radius = d.wheel.radius;
  std::vector<scenario::OperatingPoint> at;
  std::vector<recording::Condition> conditions;
  std::vector<std::array<int, kChannels>> counts;
  for (const std::size_t r : d.replay.runs) {
    const diagnosis::RunComparison& run = d.runs[r];
    const auto same = std::find_if(out.points.begin(), out.points.end(), [&](const ReplayPoint& p) { return p.condition == run.condition; });
    const auto i = static_cast<std::size_t>(same - out.points.begin());
    if (same == out.points.end()) {
      out.points.push_back({run.condition, {}, {}, {}, {}});
      counts.emplace_back();
      at.push_back({run.condition.slip, run.condition.slip, run.condition.normal_load, run.condition.angular_velocity, run.condition.pass});
      conditions.push_back(scenario::condition_of(at.back(), radius));
      conditions.back().extra["point"] = std::to_string(i);
    }
    for (std::size_t c = 0; c < kChannels; ++c)
      if (run.has[c]) {
        out.points[i].has[c] = true;
        out.points[i].measured[c] += run.observed[c];
        ++counts[i][c];
      }
  }
  for (std::size_t i = 0; i < out.points.size(); ++i)
    for (std::size_t c = 0; c < kChannels; ++c)
      if (counts[i][c]) out.points[i].measured[c] /= counts[i][c];

  std::vector<char> good(out.points.size(), 1);
  for (const bool late : {false, true}) {
    const scenario::Scenario s = late ? corrected_scenario(recording, d.replay.soil_after, d.replay.angles_after, d.replay.effects)
                                      : corrected_scenario(recording, d.replay.soil_before, d.replay.angles_before, {});
    const std::vector<vehicle::SweepMethod> methods = {scenario::make_method("node-spring", s)};
    vehicle::SweepOptions options;
    options.threads = common.threads;
    for (const vehicle::SweepPoint& p : vehicle::sweep(methods, conditions, options)) {
      const std::size_t i = std::stoul(p.condition.extra.at("point"));
      const SweepPoint mean = summarise(p, at[i], scenario::averaging_period("node-spring", s, at[i]));
      if (mean.failed()) good[i] = 0;
      (late ? out.points[i].after : out.points[i].before) = {mean.drawbar_pull, mean.driving_torque, mean.sinkage};
    }
  }
  std::array<int, kChannels> n{};
  std::vector<ReplayPoint> kept;
  for (std::size_t i = 0; i < out.points.size(); ++i) {
    if (!good[i]) {
      ++out.failed;
      continue;
    }
    const ReplayPoint& p = out.points[i];
    for (std::size_t c = 0; c < kChannels; ++c)
      if (p.has[c]) {
        out.rmse_before[c] += std::pow(p.measured[c] - p.before[c], 2);
        out.rmse_after[c] += std::pow(p.measured[c] - p.after[c], 2);
        ++n[c];
      }
    kept.push_back(p);
  }
  out.points = std::move(kept);
  for (std::size_t c = 0; c < kChannels; ++c)
    if (n[c]) {
      out.rmse_before[c] = std::sqrt(out.rmse_before[c] / n[c]);
      out.rmse_after[c] = std::sqrt(out.rmse_after[c] / n[c]);
    }
  return out;
}

}  // namespace terrode::cli
