#include "calibration/dem_tests.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace terrode::calibration {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Mean of a curve about each of the even displacements at_i, over one step between them.
std::vector<double> averaged(const std::vector<double>& x, const std::vector<double>& y, const std::vector<double>& at) {
  const auto value = [&](double where) {
    const auto up = std::upper_bound(x.begin(), x.end(), where);
    if (up == x.begin()) return y.front();
    if (up == x.end()) return y.back();
    const auto k = static_cast<std::size_t>(up - x.begin());
    return y[k - 1] + (y[k] - y[k - 1]) * (where - x[k - 1]) / (x[k] - x[k - 1]);
  };
  const double step = at.front();
  std::vector<double> out;
  for (const double centre : at) {
    constexpr int kParts = 8;
    double sum = 0.0;
    // The last mean ends with the test.
    const double middle = std::min(centre, at.back() - 0.5 * step);
    for (int i = 0; i < kParts; ++i) sum += value(middle + step * ((i + 0.5) / kParts - 0.5));
    out.push_back(sum / kParts);
  }
  return out;
}

// The way into the soil, without ways back: displacements increase and pressures belong to the deepest point so far.
void advance(const std::vector<double>& x, const std::vector<double>& y, double sign_x, std::vector<double>& out_x, std::vector<double>& out_y) {
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double at = sign_x * x[i];
    if (!std::isfinite(at) || !std::isfinite(y[i]) || at < 0.0) continue;
    if (!out_x.empty() && at <= out_x.back()) continue;
    out_x.push_back(at);
    out_y.push_back(sign_x * y[i]);
  }
}

struct Group {
  TestTarget target;
  std::vector<std::vector<double>> x, y;
};

void finish(Group& g, const TargetOptions& o, double longest, std::vector<std::string>& notes) {
  double travel = longest;
  for (const auto& x : g.x) travel = std::min(travel, x.back());
  for (int i = 1; i <= o.points; ++i) g.target.at.push_back(travel * i / o.points);
  g.target.repeats = static_cast<int>(g.x.size());
  g.target.measured.assign(g.target.at.size(), 0.0);
  std::vector<std::vector<double>> curves;
  for (std::size_t r = 0; r < g.x.size(); ++r) {
    curves.push_back(averaged(g.x[r], g.y[r], g.target.at));
    for (std::size_t i = 0; i < g.target.at.size(); ++i) g.target.measured[i] += curves.back()[i] / g.target.repeats;
  }
  double square = 0.0;
  for (const double v : g.target.measured) square += v * v;
  g.target.scale = std::sqrt(square / static_cast<double>(g.target.at.size()));
  if (!(g.target.scale > 0)) throw InputError(g.target.name() + ": the mean stress is 0");
  // Repeats against their mean: in level and tilt, by least squares with the stress as weight.
  double level = 0.0, tilt = 0.0;
  for (const auto& c : curves) {
    double ss = 0, sd = 0, gg = 0, gd = 0;
    for (std::size_t i = 0; i < c.size(); ++i) {
      const double m = g.target.measured[i], t = m * (2.0 * g.target.at[i] / travel - 1.0), d = c[i] - m;
      ss += m * m, sd += m * d, gg += t * t, gd += t * d;
    }
    level += std::pow(sd / ss, 2);
    tilt += std::pow(gd / gg, 2);
  }
  const double free = g.target.repeats - 1.0, w = o.repeatability_weight, n = g.target.repeats;
  g.target.level_deviation = std::sqrt((level + w * o.level_repeatability * o.level_repeatability) / (free + w) / n);
  g.target.tilt_deviation = std::sqrt((tilt + w * o.tilt_repeatability * o.tilt_repeatability) / (free + w) / n);
  g.target.freedom = free + w;
  if (g.target.repeats == 1)
    notes.push_back(fmt::format("{}: one test only; a repeatability of {:.0f} percent is assumed", g.target.name(), 100 * o.level_repeatability));
}

double narrowest_plate(const std::vector<TestTarget>& all) {
  double out = 0.0;
  for (const TestTarget& t : all)
    if (t.test == "pressure_sinkage" && (out == 0.0 || t.plate_width < out)) out = t.plate_width;
  return out > 0.0 ? out : 0.05;
}

// Beds of soil tests on few grains are at rest for the tests sooner than a large one.
constexpr double kSettledForce = 0.05, kSettledEnergy = 5e-4;
// Drag while settling [N s/m] in proportion to a grain's weight over its speed of fall, as 0.05 N s/m is for the paper's
// grains of 6.25 mm.
double settling_drag(double diameter) { return 0.05 * std::pow(diameter / 6.25e-3, 2.5); }

double mean_diameter(const dem::BedRecipe& r) {
  if (r.sizes.shape != "listed") return 0.5 * (r.sizes.smallest + r.sizes.largest);
  double sum = 0.0, shares = 0.0;
  for (std::size_t i = 0; i < r.sizes.diameters.size(); ++i) sum += r.sizes.shares[i] * r.sizes.diameters[i], shares += r.sizes.shares[i];
  return sum / shares;
}

double value_of(const GrainValues& values, const char* name) {
  const auto it = values.find(name);
  return it != values.end() ? it->second : grain_parameter(name).assumed;
}

dem::BedRecipe recipe_of(const std::vector<TestTarget>& all, const DemTestSettings& s, const GrainValues& values, std::uint64_t seed) {
  dem::BedRecipe r;
  r.grain.young_modulus = value_of(values, "young_modulus");
  r.contact.rolling = s.rolling;
  r.contact.friction = value_of(values, "friction");
  r.contact.rolling_friction = value_of(values, "rolling_friction");
  r.contact.restitution = value_of(values, "restitution");
  double d = value_of(values, "grain_size");
  if (!(d > 0.0)) d = narrowest_plate(all) / s.grains_across;
  const double spread = value_of(values, "grain_spread");
  r.sizes.smallest = 2.0 * d / (1.0 + spread);
  r.sizes.largest = spread * r.sizes.smallest;
  r.bulk_density = s.bulk_density;
  r.gravity = s.gravity;
  r.viscous = settling_drag(d);
  r.settled_force = kSettledForce;
  r.settled_energy = kSettledEnergy;
  r.seed = seed;
  return r;
}

// Between the seeds of the beds of one evaluation: far more than the evaluations of a search.
constexpr std::uint64_t kNextBed = 1000003;

// A step for beds whose density is scaled to the bulk density asked for, of a solid fraction of 0.6 at most.
double time_step(const dem::BedRecipe& r) {
  constexpr double kFraction = 0.12;  // of the Rayleigh time
  return kFraction * dem::rayleigh_time(0.5 * r.sizes.smallest, r.bulk_density / 0.6, r.grain);
}

}  // namespace

double GrainParameter::to_unit(double value) const {
  return log ? std::log(value / low) / std::log(high / low) : (value - low) / (high - low);
}

double GrainParameter::from_unit(double share) const {
  return log ? low * std::pow(high / low, share) : low + (high - low) * share;
}

const std::vector<GrainParameter>& grain_parameters() {
  static const std::vector<GrainParameter> all = {
      {"young_modulus", "Pa", true, 3e5, 3e7, 1e7, 1e4, 1e12, "Y of the grains"},
      {"friction", "-", false, 0.1, 1.2, 0.6, 0.0, 5.0, "mu_c, sliding friction between grains"},
      {"rolling_friction", "-", true, 0.02, 1.5, 0.3, 0.0, 10.0, "mu_r, rolling friction between grains"},
      {"restitution", "-", false, 0.1, 0.9, 0.4, 0.01, 1.0, "e, restitution between grains"},
      {"grain_size", "m", true, 3e-3, 9e-3, 0.0, 1e-6, 1.0, "mean diameter"},
      {"grain_spread", "-", false, 1.0, 4.0, 1.4, 1.0, 20.0, "largest over smallest diameter"}};
  return all;
}

const GrainParameter& grain_parameter(const std::string& name) {
  std::string names;
  for (const GrainParameter& p : grain_parameters()) {
    if (p.name == name) return p;
    names += (names.empty() ? "" : ", ") + p.name;
  }
  throw InputError(Problem{{}, 0, 0, "parameter", "is '" + name + "'", "one of " + names});
}

std::string TestTarget::name() const {
  return test == "direct_shear" ? fmt::format("shear at {:.4g} kPa", 1e-3 * normal_stress) : fmt::format("plate of {:.4g} mm", 1e3 * plate_width);
}

std::vector<TestTarget> test_targets(const recording::Recording& recording, const TargetOptions& o, std::vector<std::string>& notes) {
  std::vector<Group> groups;
  const auto group_of = [&](const TestTarget& t) -> Group& {
    for (Group& g : groups)
      if (g.target.test == t.test && std::abs(g.target.normal_stress - t.normal_stress) <= 0.02 * t.normal_stress &&
          std::abs(g.target.plate_width - t.plate_width) <= 0.02 * t.plate_width && std::abs(g.target.plate_length - t.plate_length) <= 0.02 * t.plate_length)
        return g;
    groups.push_back({t, {}, {}});
    return groups.back();
  };
  const auto add = [](Group& g, const std::string& file, const std::vector<double>& x, const std::vector<double>& y) {
    if (x.size() != y.size()) throw InputError(Problem{file, 0, 0, {}, "has displacements and stresses that differ in number", {}});
    double end = 0.0;
    for (const double v : x)
      if (std::isfinite(v) && std::abs(v) > std::abs(end)) end = v;
    std::vector<double> ax, ay;
    advance(x, y, end < 0 ? -1.0 : 1.0, ax, ay);
    if (ax.size() < 4) throw InputError(Problem{file, 0, 0, {}, fmt::format("has {} points on its way", ax.size()), "at least 4"});
    g.x.push_back(std::move(ax));
    g.y.push_back(std::move(ay));
  };
  for (const auto& t : recording.direct_shear) {
    TestTarget target;
    target.test = "direct_shear";
    target.normal_stress = t.normal_stress;
    add(group_of(target), t.file, t.shear_displacement, t.shear_stress);
  }
  bool round = false;
  for (const auto& t : recording.pressure_sinkage) {
    TestTarget target;
    target.test = "pressure_sinkage";
    target.plate_width = t.circular ? 0.5 * std::sqrt(M_PI) * t.plate_width : t.plate_width;
    target.plate_length = t.circular ? target.plate_width : std::max(t.plate_width, t.plate_length);
    round = round || t.circular;
    add(group_of(target), t.file, t.sinkage, t.pressure);
  }
  if (groups.empty()) throw InputError(Problem{recording.folder, 0, 0, "soil_tests", "holds no soil test", "direct_shear and pressure_sinkage tests"});
  if (round) notes.push_back("round plates are simulated as squares of the same area");
  std::stable_sort(groups.begin(), groups.end(), [](const Group& a, const Group& b) { return a.target.test < b.target.test; });
  std::vector<TestTarget> out;
  for (Group& g : groups) {
    finish(g, o, g.target.test == "direct_shear" ? o.longest_shear : o.deepest, notes);
    out.push_back(std::move(g.target));
  }
  return out;
}

std::pair<Index, Index> test_block(const std::vector<TestTarget>& targets, const std::string& test) {
  Index begin = 0, count = 0;
  for (const TestTarget& t : targets) {
    const auto n = static_cast<Index>(t.at.size());
    if (t.test == test) count += n;
    else if (count == 0) begin += n;
  }
  return {begin, count};
}

VectorXd target_vector(const std::vector<TestTarget>& targets, const std::vector<std::vector<double>>& curves) {
  if (curves.size() != targets.size()) throw InputError("as many curves as tests are needed");
  std::map<std::string, double> tests;
  Index size = 0;
  for (const TestTarget& t : targets) tests[t.test] += 1.0, size += static_cast<Index>(t.at.size());
  VectorXd out(size);
  Index i = 0;
  for (std::size_t c = 0; c < targets.size(); ++c) {
    if (curves[c].size() != targets[c].at.size()) throw InputError("a curve has another number of points than its test");
    const double divide = targets[c].scale * std::sqrt(static_cast<double>(targets[c].at.size()) * tests[targets[c].test]);
    for (const double v : curves[c]) out[i++] = v / divide;
  }
  return out;
}

VectorXd target_vector(const std::vector<TestTarget>& targets) {
  std::vector<std::vector<double>> curves;
  for (const TestTarget& t : targets) curves.push_back(t.measured);
  return target_vector(targets, curves);
}

MatrixXd target_covariance(const std::vector<TestTarget>& targets) {
  const VectorXd y = target_vector(targets);
  MatrixXd out = MatrixXd::Zero(y.size(), y.size());
  Index begin = 0;
  for (const TestTarget& t : targets) {
    const auto n = static_cast<Index>(t.at.size());
    const VectorXd level = y.segment(begin, n);
    VectorXd tilt = level;
    for (Index i = 0; i < n; ++i) tilt[i] *= 2.0 * t.at[static_cast<std::size_t>(i)] / t.at.back() - 1.0;
    auto block = out.block(begin, begin, n, n);
    block += t.level_deviation * t.level_deviation * level * level.transpose() + t.tilt_deviation * t.tilt_deviation * tilt * tilt.transpose();
    // Roughness along the curve beside level and tilt: a tenth of a percent of the stress, so that no direction is exact.
    block.diagonal().array() += 1e-6 * level.squaredNorm() / static_cast<double>(n);
    begin += n;
  }
  return out;
}

Problems DemTestSettings::validate() const {
  Problems out;
  require(out, "grains", grains_across, "-", grains_across >= 2.0 && grains_across <= 200.0, "from 2 to 200 grain diameters across the plate");
  if (beds < 1 || beds > 1000) out.push_back({{}, 0, 0, "beds", fmt::format("is {}", beds), "from 1 to 1000"});
  require(out, "box", box, "m", box >= 0.0, "above 0 m");
  require(out, "bulk_density", bulk_density, "kg/m3", bulk_density > 0.0, "above 0 kg/m3");
  require(out, "shear_rate", shear_rate, "m/s", shear_rate >= 0.0, "above 0 m/s");
  require(out, "plate_rate", plate_rate, "m/s", plate_rate >= 0.0, "above 0 m/s");
  require(out, "gravity", gravity, "m/s2", gravity > 0.0, "above 0 m/s2");
  return out;
}

dem::DirectShearSettings shear_settings(const TestTarget& target, const dem::BedRecipe& recipe, double box, const DemTestSettings& s) {
  dem::DirectShearSettings out;
  out.soil = recipe;
  out.soil.width = out.soil.length = out.soil.height = box;
  out.soil.walls = true;
  out.normal_stress = target.normal_stress;
  out.rate = s.shear_rate > 0.0 ? s.shear_rate : 0.2 * std::sqrt(recipe.gravity * mean_diameter(recipe));
  out.travel = target.at.back();
  out.seating = s.seating;
  out.lid_mass = 0.5 * recipe.bulk_density * std::pow(box, 3);
  out.lid_damping = 0.1;
  out.time_step = time_step(recipe);
  out.samples = 8.0 * static_cast<double>(target.at.size());
  out.threads = s.threads;
  out.cache = s.cache;
  return out;
}

dem::PressureSinkageSettings plate_settings(const TestTarget& target, const dem::BedRecipe& recipe, const DemTestSettings& s) {
  dem::PressureSinkageSettings out;
  out.prism = recipe;
  out.prism.walls = false;
  const double b = target.plate_width;
  const double wide = 3.0 * b, long_ = target.plate_length + 2.0 * b;
  out.tiles_x = 2;
  out.tiles_y = std::max(2, static_cast<int>(std::lround(long_ / (1.5 * b))));
  out.prism.width = wide / out.tiles_x;
  out.prism.length = long_ / out.tiles_y;
  out.prism.height = std::max(1.6 * b, 3.2 * target.at.back());
  out.plate_width = b;
  out.plate_length = target.plate_length;
  out.plate_thickness = std::max(0.01, 1.5 * target.at.back());
  out.rate = s.plate_rate > 0.0 ? s.plate_rate : 0.4 * std::sqrt(recipe.gravity * mean_diameter(recipe));
  out.sinkage = target.at.back();
  out.time_step = time_step(recipe);
  out.samples = 4.0 * static_cast<double>(target.at.size());
  out.threads = s.threads;
  out.cache = s.cache;
  return out;
}

dem::BedRecipe recipe_of_ground(const dem::DemTerrainParams& ground, std::uint64_t seed) {
  dem::BedRecipe r;
  std::vector<double> diameters;
  for (const dem::Grain& g : ground.prism.grains) diameters.push_back(2.0 * g.radius);
  if (diameters.size() < 10) throw InputError("the particle ground has too few grains for a bed");
  std::sort(diameters.begin(), diameters.end());
  // Its diameters by ten classes of equal number.
  constexpr std::size_t kClasses = 10;
  r.sizes.shape = "listed";
  for (std::size_t c = 0; c < kClasses; ++c) {
    r.sizes.diameters.push_back(diameters[diameters.size() * (2 * c + 1) / (2 * kClasses)]);
    r.sizes.shares.push_back(1.0);
  }
  r.sizes.smallest = r.sizes.diameters.front();
  r.sizes.largest = r.sizes.diameters.back();
  r.grain = ground.prism.grain;
  r.contact = ground.soil;
  r.settling_friction = ground.settling_friction;
  r.settling_rolling_friction = ground.settling_rolling_friction;
  r.bulk_density = ground.prism.bulk_density;
  r.gravity = ground.gravity;
  r.viscous = settling_drag(mean_diameter(r));
  r.settled_force = kSettledForce;
  r.settled_energy = kSettledEnergy;
  r.seed = seed;
  return r;
}

std::vector<std::vector<double>> simulate_tests(const std::vector<TestTarget>& targets, const DemTestSettings& s, const GrainValues& values,
                                                std::uint64_t seed, const Progress& progress) {
  throw_if_any(s.validate());
  if (s.beds > 1) {
    DemTestSettings one = s;
    one.beds = 1;
    std::vector<std::vector<double>> sum;
    for (int b = 0; b < s.beds; ++b) {
      Progress part = progress;
      part.report = [&](double share, const std::string& what) { progress.report((b + share) / s.beds, what); };
      const auto curves = simulate_tests(targets, one, values, seed + static_cast<std::uint64_t>(b) * kNextBed, part);
      if (sum.empty()) sum.assign(curves.size(), std::vector<double>(curves.front().size(), 0.0));
      for (std::size_t t = 0; t < curves.size(); ++t)
        for (std::size_t i = 0; i < curves[t].size(); ++i) sum[t][i] += curves[t][i] / s.beds;
    }
    return sum;
  }
  const dem::BedRecipe recipe = recipe_of(targets, s, values, seed);
  std::vector<std::vector<double>> out;
  for (std::size_t i = 0; i < targets.size(); ++i) {
    const TestTarget& t = targets[i];
    Progress part = progress;
    part.report = [&](double share, const std::string& what) {
      progress.report((static_cast<double>(i) + share) / static_cast<double>(targets.size()), what);
    };
    if (t.test == "direct_shear") {
      const auto test = dem::direct_shear(shear_settings(t, recipe, s.box > 0.0 ? s.box : 1.2 * narrowest_plate(targets), s), part);
      out.push_back(averaged(test.shear_displacement, test.shear_stress, t.at));
    } else {
      const auto test = dem::pressure_sinkage(plate_settings(t, recipe, s), part);
      out.push_back(averaged(test.sinkage, test.pressure, t.at));
    }
  }
  return out;
}

}  // namespace terrode::calibration
