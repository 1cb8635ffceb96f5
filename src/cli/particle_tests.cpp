#include "cli/particle_tests.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <numbers>

#include "calibration/soil_file.h"
#include "calibration/soil_tests.h"
#include "cli/terminal.h"
#include "recording/result_file.h"
#include "scenario/particle_tests.h"

namespace terrode::cli {
namespace {

using scenario::ParticleCurve;
using scenario::ParticleTest;

constexpr const char* file_type = "terrode soil tests";

struct Kind {
  const char *name, *x, *y, *y_unit;
};
constexpr Kind kinds[] = {{"direct_shear", "shear_displacement", "shear_stress", "Pa"},
                          {"pressure_sinkage", "sinkage", "pressure", "Pa"},
                          {"angle_of_repose", "distance", "height", "m"}};

const Kind& kind_of(const std::string& name) {
  for (const Kind& k : kinds)
    if (name == k.name) return k;
  return kinds[0];
}

void write_columns(recording::Hdf5File& file, const std::string& group, const std::vector<std::pair<std::string, const std::vector<double>*>>& columns,
                   const Kind& kind) {
  for (const auto& [name, values] : columns) {
    file.write(group + "/" + name, *values);
    file.set_attribute(group + "/" + name, "unit", name == kind.x ? "m" : kind.y_unit);
  }
}

void write_fit(recording::Hdf5File& file, const std::string& group, const calibration::Fit& fit) {
  file.create_group(group);
  for (const calibration::Estimate& e : fit.estimates) {
    file.set_attribute(group, e.name, e.value);
    file.set_attribute(group, e.name + "_std", e.std);
    file.set_attribute(group, e.name + "_unit", e.unit);
  }
}

// Results of an earlier run of the same file.
std::vector<ParticleTest> read_known(const std::string& path, const recording::ResultHeader& header) {
  std::vector<ParticleTest> out;
  if (path.empty() || !std::filesystem::exists(path)) return out;
  const auto file = recording::Hdf5File::open(path);
  const recording::ResultHeader old = recording::read_header(file);
  if (old.filetype != header.filetype || old.scenario_resolved != header.scenario_resolved)
    throw InputError({path, 0, 0, {}, fmt::format("holds results of another scenario ({}, {})", old.scenario_file, old.created),
                      "another name after -o, or --overwrite"});
  for (const Kind& kind : kinds) {
    const std::string group = std::string("/") + kind.name;
    if (!file.is_group(group)) continue;
    for (const std::string& name : file.children(group)) {
      const std::string at = group + "/" + name;
      ParticleTest t;
      t.kind = kind.name;
      t.seed = static_cast<int>(file.number_attribute(at, "seed").value_or(0));
      t.normal_stress = file.number_attribute(at, "normal_stress").value_or(0.0);
      t.rate = file.number_attribute(at, "rate").value_or(0.0);
      t.angle = file.number_attribute(at, "angle").value_or(0.0);
      t.cpu_seconds = file.number_attribute(at, "cpu_seconds").value_or(0.0);
      t.x = file.read<double>(at + "/" + kind.x).values;
      t.y = file.read<double>(at + "/" + kind.y).values;
      out.push_back(std::move(t));
    }
  }
  return out;
}

void write_results(const std::string& path, const recording::ResultHeader& header, const std::vector<ParticleTest>& tests,
                   const calibration::SoilTestFits* fits) {
  recording::write_atomically(path, false, [&](recording::Hdf5File& file) {
    recording::write_header(file, header);
    std::size_t number = 0;
    for (const ParticleTest& t : tests) {
      if (!t.error.empty()) continue;
      const Kind& kind = kind_of(t.kind);
      const std::string group = fmt::format("/{}/test_{:03}", t.kind, number++);
      file.create_group(group);
      file.set_attribute(group, "seed", t.seed);
      file.set_attribute(group, "cpu_seconds", t.cpu_seconds);
      if (t.kind == "direct_shear") file.set_attribute(group, "normal_stress", t.normal_stress);
      if (t.kind == "angle_of_repose")
        file.set_attribute(group, "angle", t.angle);
      else
        file.set_attribute(group, "rate", t.rate);
      write_columns(file, group, {{kind.x, &t.x}, {kind.y, &t.y}}, kind);
    }
    number = 0;
    for (const ParticleCurve& c : scenario::mean_curves(tests)) {
      const Kind& kind = kind_of(c.kind);
      const std::string group = fmt::format("/mean/{}_{:03}", c.kind, number++);
      file.create_group(group);
      file.set_attribute(group, "test", c.kind);
      file.set_attribute(group, "repeats", c.repeats);
      if (c.kind == "direct_shear") file.set_attribute(group, "normal_stress", c.normal_stress);
      file.set_attribute(group, "rate", c.rate);
      write_columns(file, group, {{kind.x, &c.curve.at}, {kind.y, &c.curve.mean}, {std::string(kind.y) + "_std", &c.curve.deviation}}, kind);
    }
    if (fits && fits->shear) write_fit(file, "/fit/direct_shear", *fits->shear);
    if (fits && fits->sinkage) {
      write_fit(file, "/fit/pressure_sinkage", *fits->sinkage);
      file.set_attribute("/fit/pressure_sinkage", "plate_width", fits->sinkage->plate_width);
    }
  });
}

std::string csv_of(const std::vector<ParticleTest>& tests) {
  std::string out = "test,normal_stress [Pa],rate [m/s],seed,displacement [m],stress [Pa],deviation [Pa],height [m]\n";
  const auto line = [&](const std::string& kind, double normal_stress, double rate, const std::string& seed, double x, double y,
                        const std::string& deviation) {
    const bool shear = kind == "direct_shear", heap = kind == "angle_of_repose";
    out += fmt::format("{},{},{},{},{},{},{},{}\n", kind, shear ? fmt::format("{}", normal_stress) : "", heap ? "" : fmt::format("{}", rate), seed,
                       x, heap ? "" : fmt::format("{}", y), deviation, heap ? fmt::format("{}", y) : "");
  };
  for (const ParticleTest& t : tests)
    for (std::size_t k = 0; t.error.empty() && k < t.x.size(); ++k)
      line(t.kind, t.normal_stress, t.rate, std::to_string(t.seed), t.x[k], t.y[k], "");
  for (const ParticleCurve& c : scenario::mean_curves(tests))
    for (std::size_t k = 0; k < c.curve.at.size(); ++k)
      line(c.kind, c.normal_stress, c.rate, "mean", c.curve.at[k], c.curve.mean[k], fmt::format("{}", c.curve.deviation[k]));
  return out;
}

// Mean of the last half of a curve and of its deviation between repeats: the residual stress, and how repeatable it is.
struct Late {
  double mean = 0.0, deviation = 0.0;
};
Late late_of(const dem::CurveScatter& c) {
  Late out;
  const std::size_t from = c.at.size() / 2;
  for (std::size_t k = from; k < c.at.size(); ++k) {
    out.mean += c.mean[k] / static_cast<double>(c.at.size() - from);
    out.deviation += c.deviation[k] / static_cast<double>(c.at.size() - from);
  }
  return out;
}

}  // namespace

void run_particle_tests(const std::string& path, const std::string& output, const std::string& csv, const std::string& soil, bool overwrite,
                        Common& common) {
  scenario::ParticleTests tests = scenario::load_particle_tests(path);
  if (common.seed_given()) tests.seed = static_cast<int>(common.seed);
  recording::ResultHeader header = recording::ResultHeader::now(file_type);
  header.title = tests.title;
  header.scenario_file = tests.file;
  header.scenario_text = tests.text;
  header.scenario_resolved = scenario::to_yaml(tests);
  header.command = common.command_line;
  header.seed = tests.seed;
  const std::vector<ParticleTest> known = overwrite ? std::vector<ParticleTest>{} : read_known(output, header);
  // A place that cannot be written is known before the work, not after it.
  if (!output.empty()) write_results(output, header, known, nullptr);

  std::vector<ParticleTest> results;
  {
    const Progress progress = show_progress(common);
    try {
      results = scenario::run_particle_tests(tests, known, common.threads, progress, [&](const std::vector<ParticleTest>& ended) {
        if (!output.empty()) write_results(output, header, ended, nullptr);
      });
    } catch (const Interrupted& e) {
      throw Interrupted(std::string(e.what()) + (output.empty() ? " Nothing was written." : " Those that had are in " + output + "; the same command goes on."));
    }
  }
  for (const ParticleTest& t : results)
    if (!t.error.empty()) {
      note(common, fmt::format("{} with seed {}: {}", t.kind, t.seed, t.error));
      common.status = 1;
    }

  // A fit needs a displacement that got somewhere: too short a test says so, and the others are fitted.
  calibration::SoilTestFits fits;
  const recording::Recording recording = scenario::as_recording(tests, results);
  std::vector<std::string> warnings;
  try {
    if (!recording.direct_shear.empty()) fits.shear = calibration::fit_direct_shear(recording.direct_shear);
    if (!recording.pressure_sinkage.empty()) fits.sinkage = calibration::fit_pressure_sinkage(recording.pressure_sinkage);
  } catch (const InputError& e) {
    warnings.push_back(std::string("no fit: ") + e.what());
  }
  const calibration::Fit* const fitted[] = {fits.shear ? &*fits.shear : nullptr, fits.sinkage ? &*fits.sinkage : nullptr};
  for (const calibration::Fit* fit : fitted)
    for (std::size_t k = 0; fit && k < fit->warnings.size(); ++k) warnings.push_back(fit->warnings[k].text);
  for (const std::string& w : warnings) note(common, w);
  if (!output.empty()) write_results(output, header, results, &fits);
  if (!csv.empty()) write_text_atomically(csv, csv_of(results));
  if (!soil.empty()) {
    recording::SoilBelief belief;
    belief.name = tests.title.empty() ? "particles" : tests.title;
    if (tests.grains.bulk_density > 0.0) belief.bulk_density = tests.grains.bulk_density;
    calibration::apply(fits, belief);
    write_text_atomically(soil, calibration::soil_yaml(belief, "Fitted to soil tests on particles of " + tests.file));
  }

  const std::vector<ParticleCurve> means = scenario::mean_curves(results);
  std::vector<std::vector<std::string>> rows = {{"test", "condition", "rate [mm/s]", "repeats", "late mean [Pa]", "deviation [Pa]"}};
  Json curves = Json::array();
  for (const ParticleCurve& c : means) {
    const Late late = late_of(c.curve);
    rows.push_back({c.kind, c.kind == "direct_shear" ? fmt::format("{:.6g} Pa", c.normal_stress) : "", fmt::format("{:.4g}", 1e3 * c.rate),
                    std::to_string(c.repeats), fmt::format("{:.5g}", late.mean), c.repeats > 1 ? fmt::format("{:.3g}", late.deviation) : ""});
    Json curve = {{"test", c.kind}, {"rate", c.rate}, {"repeats", c.repeats}, {"late_mean", number(late.mean)}, {"late_deviation", number(late.deviation)}};
    if (c.kind == "direct_shear") curve["normal_stress"] = c.normal_stress;
    const Kind& kind = kind_of(c.kind);
    curve[kind.x] = c.curve.at;
    curve["mean"] = c.curve.mean;
    curve["deviation"] = c.curve.deviation;
    curves.push_back(std::move(curve));
  }
  std::vector<double> angles;
  double cpu = 0.0;
  for (const ParticleTest& t : results) {
    cpu += t.cpu_seconds;
    if (t.kind == "angle_of_repose" && t.error.empty()) angles.push_back(t.angle);
  }
  double angle = 0.0, angle_std = 0.0;
  for (const double a : angles) angle += a / static_cast<double>(angles.size());
  for (const double a : angles) angle_std += (a - angle) * (a - angle);
  angle_std = angles.size() > 1 ? std::sqrt(angle_std / static_cast<double>(angles.size() - 1)) : 0.0;
  if (common.json) {
    Json document = {{"scenario", tests.file}, {"curves", curves}, {"fit", Json::object()}, {"warnings", warnings}, {"cpu_seconds", cpu}, {"errors", Json::array()}};
    for (const calibration::Fit* fit : fitted)
      for (std::size_t k = 0; fit && k < fit->estimates.size(); ++k) {
        const calibration::Estimate& e = fit->estimates[k];
        document["fit"][e.name] = {{"value", number(e.value)}, {"std", number(e.std)}, {"unit", e.unit}};
      }
    if (fits.sinkage) document["fit"]["plate_width"] = {{"value", fits.sinkage->plate_width}, {"unit", "m"}};
    if (!angles.empty()) document["angle_of_repose"] = {{"mean", angle}, {"std", angle_std}, {"repeats", angles.size()}, {"unit", "rad"}};
    for (const ParticleTest& t : results)
      if (!t.error.empty()) document["errors"].push_back({{"test", t.kind}, {"seed", t.seed}, {"error", t.error}});
    print_json(document);
    return;
  }
  if (rows.size() > 1) std::fputs(aligned(rows).c_str(), stdout);
  if (!angles.empty())
    std::printf("angle of repose: %.1f +- %.1f deg of %zu\n", angle * 180 / std::numbers::pi, angle_std * 180 / std::numbers::pi, angles.size());
  rows = {{"fitted", "value", "+-", "unit"}};
  for (const calibration::Fit* fit : fitted)
    for (std::size_t k = 0; fit && k < fit->estimates.size(); ++k) {
      const calibration::Estimate& e = fit->estimates[k];
      rows.push_back({e.name, fmt::format("{:.5g}", e.value), fmt::format("{:.2g}", e.std), e.unit});
    }
  if (rows.size() > 1) std::fputs(("\n" + aligned(rows)).c_str(), stdout);
  std::printf("%.1f CPU s\n", cpu);
}

}  // namespace terrode::cli
