#include "scenario/particle_tests.h"

#include <time.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <mutex>
#include <set>

#include "core/parallel.h"
#include "dem/law/parts.h"

namespace terrode::scenario {
namespace {

template <class Family>
std::vector<std::string> names_of() {
  return {std::begin(Family::names), std::end(Family::names)};
}

Table<TestGrains> grains_table() {
  using G = TestGrains;
  Table<G> t;
  t.number("smallest", "m", above(0), &G::smallest, "diameter")
      .number("largest", "m", above(0), &G::largest, "diameter")
      .choice("distribution", {"uniform", "linear"}, &G::distribution, "density of diameters: constant or proportional to the diameter")
      .choice("by", {"number", "mass"}, &G::by, "what the distribution is a share of")
      .numbers("diameters", "m", above(0), &G::diameters, "listed instead of smallest to largest")
      .numbers("shares", "-", above(0), &G::shares, "of the listed diameters")
      .number("density", "kg/m^3", above(0), &G::density, "of the grains while settling")
      .number("bulk_density", "kg/m^3", at_least(0), &G::bulk_density, "the grains' density is scaled to it; 0: it is not")
      .number("young_modulus", "Pa", above(0), &G::young_modulus, "of grains and walls")
      .number("poisson_ratio", "-", from_to(0, 0.5), &G::poisson_ratio, "of grains and walls");
  t.choice("normal", names_of<dem::NormalParts>(), &G::normal, "part of the law along the normal")
      .choice("tangential", names_of<dem::TangentialParts>(), &G::tangential, "part of the law along the contact")
      .choice("rolling", names_of<dem::RollingParts>(), &G::rolling, "part of the law against rolling")
      .choice("cohesion", names_of<dem::CohesionParts>(), &G::cohesion, "part of the law that attracts");
  t.number("restitution", "-", {0, 1, true, false}, &G::restitution, "of grain on grain")
      .number("friction", "-", at_least(0), &G::friction, "of grain on grain")
      .number("rolling_friction", "-", at_least(0), &G::rolling_friction, "mu_r")
      .number("settling_friction", "-", at_least(0), &G::settling_friction,
              "of grain on grain while the bed settles: low for a dense bed; absent: friction")
      .number("settling_rolling_friction", "-", at_least(0), &G::settling_rolling_friction,
              "mu_r while the bed settles; absent: rolling_friction")
      .number("rolling_rate", "s^2/m^2", at_least(0), &G::rolling_rate, "mu_r = min(rolling_rate v_t^2, 1) (Eq. 23); 0: constant mu_r")
      .number("rolling_damping", "-", at_least(0), &G::rolling_damping, "share of the critical dashpot")
      .number("cohesion_energy_density", "Pa", at_least(0), &G::cohesion_energy_density, "of cohesion area")
      .flag("printed_shear_modulus", &G::printed_shear_modulus, "G_eff as Eq. 17 is printed instead of Mindlin's")
      .number("wall_restitution", "-", {0, 1, true, false}, &G::wall_restitution, "of grain on wall")
      .number("wall_friction", "-", at_least(0), &G::wall_friction, "of grain on wall");
  return t;
}

Table<DirectShearSpec> shear_table() {
  using S = DirectShearSpec;
  Table<S> t;
  t.number("width", "m", above(0), &S::width, "of the box, along the travel")
      .number("length", "m", above(0), &S::length, "of the box, across")
      .number("height", "m", above(0), &S::height, "of the soil")
      .numbers("normal_stress", "Pa", above(0), &S::normal_stress, "at the lid; each is a test")
      .numbers("rate", "m/s", above(0), &S::rate, "of the upper half; each is a test")
      .number("travel", "m", above(0), &S::travel, "of the upper half")
      .number("seating", "s", at_least(0), &S::seating, "for the lid to come to rest")
      .number("lid_mass", "kg", at_least(0), &S::lid_mass, "0: the dead weight of the normal stress; else a force presses it")
      .number("lid_damping", "-", at_least(0), &S::lid_damping, "dashpot's share of the normal force where the lid rises at the rate")
      .integer("samples", 4, 100000, &S::samples, "along the travel");
  return t;
}

Table<PressureSinkageSpec> sinkage_table() {
  using S = PressureSinkageSpec;
  Table<S> t;
  t.number("prism", "m", above(0), &S::prism, "side of the settled prism that is repeated")
      .number("height", "m", above(0), &S::height, "of the bed")
      .integer("tiles_x", 1, 1000, &S::tiles_x, "prisms along the plate's short side")
      .integer("tiles_y", 1, 1000, &S::tiles_y, "prisms along its long side")
      .number("plate_width", "m", above(0), &S::plate_width, "short side")
      .number("plate_length", "m", above(0), &S::plate_length, "long side")
      .number("plate_thickness", "m", above(0), &S::plate_thickness, "")
      .numbers("rate", "m/s", above(0), &S::rate, "of the plate; each is a test")
      .number("sinkage", "m", above(0), &S::sinkage, "at which the test ends")
      .integer("samples", 4, 100000, &S::samples, "along the sinkage")
      .flag("rough_plate", &S::rough_plate, "as rough as grains instead of as smooth as walls");
  return t;
}

Table<ReposeSpec> repose_table() {
  using S = ReposeSpec;
  Table<S> t;
  t.number("width", "m", above(0), &S::width, "of the heap along the slope, before a wall is taken away")
      .number("length", "m", above(0), &S::length, "of the heap across the slope")
      .number("height", "m", above(0), &S::height, "of the heap");
  return t;
}

Table<ParticleTests> tests_table() {
  using T = ParticleTests;
  Table<T> t;
  t.integer("repeats", 1, 1000, &T::repeats, "tests of every condition, with seeds one after another")
      .number("gravity", "m/s^2", {0, 1e5, true, false}, &T::gravity, "")
      .number("time_step", "s", at_least(0), &T::time_step, "0: suggested from the Rayleigh time")
      .number("settling_drag", "N s/m", at_least(0), &T::settling_drag, "on every grain while a bed settles")
      .section("grains", &T::grains, grains_table(), "sizes, material and contact law")
      .section("direct_shear", &T::direct_shear, shear_table(), "a shear box under a lid")
      .section("pressure_sinkage", &T::pressure_sinkage, sinkage_table(), "a plate pressed into a bed")
      .section("angle_of_repose", &T::angle_of_repose, repose_table(), "a heap whose one wall is taken away");
  return t;
}

Table<ParticleTests> file_table() {
  using T = ParticleTests;
  Table<T> t;
  t.text("title", &T::title, "what the file is about").integer("seed", 0, 1L << 30, &T::seed, "of the first repeat");
  t.group("particle_tests", tests_table(), "soil tests on particles").required();
  return t;
}

dem::BedRecipe recipe_of(const ParticleTests& t, int seed) {
  const TestGrains& g = t.grains;
  dem::BedRecipe r;
  r.sizes.smallest = g.smallest;
  r.sizes.largest = g.largest;
  r.sizes.shape = g.diameters.empty() ? g.distribution : "listed";
  r.sizes.by = g.by;
  r.sizes.diameters = g.diameters;
  r.sizes.shares = g.shares;
  r.grain_density = g.density;
  r.bulk_density = g.bulk_density;
  r.grain.young_modulus = g.young_modulus;
  r.grain.poisson_ratio = g.poisson_ratio;
  dem::Interaction& c = r.contact;
  c.normal = g.normal, c.tangential = g.tangential, c.rolling = g.rolling, c.cohesion = g.cohesion;
  c.restitution = g.restitution, c.friction = g.friction;
  c.rolling_friction = g.rolling_friction, c.rolling_rate = g.rolling_rate, c.rolling_damping = g.rolling_damping;
  c.cohesion_energy_density = g.cohesion_energy_density;
  c.printed_shear_modulus = g.printed_shear_modulus;
  r.settling_friction = g.settling_friction, r.settling_rolling_friction = g.settling_rolling_friction;
  r.floor.normal = g.normal;
  r.floor.restitution = g.wall_restitution;
  r.floor.friction = g.wall_friction;
  r.gravity = t.gravity;
  r.viscous = t.settling_drag;
  r.seed = static_cast<std::uint64_t>(seed);
  return r;
}

dem::DirectShearSettings shear_settings(const ParticleTests& t, double normal_stress, double rate, int seed) {
  const DirectShearSpec& s = *t.direct_shear;
  dem::DirectShearSettings out;
  out.soil = recipe_of(t, seed);
  out.soil.width = s.width, out.soil.length = s.length, out.soil.height = s.height;
  out.soil.walls = true;
  out.normal_stress = normal_stress;
  out.rate = rate;
  out.travel = s.travel;
  out.seating = s.seating;
  out.lid_mass = s.lid_mass;
  out.lid_damping = s.lid_damping;
  out.samples = s.samples;
  out.time_step = t.time_step;
  return out;
}

dem::PressureSinkageSettings sinkage_settings(const ParticleTests& t, double rate, int seed) {
  const PressureSinkageSpec& s = *t.pressure_sinkage;
  dem::PressureSinkageSettings out;
  out.prism = recipe_of(t, seed);
  out.prism.width = out.prism.length = s.prism;
  out.prism.height = s.height;
  out.tiles_x = s.tiles_x, out.tiles_y = s.tiles_y;
  out.plate_width = s.plate_width, out.plate_length = s.plate_length, out.plate_thickness = s.plate_thickness;
  out.rate = rate;
  out.sinkage = s.sinkage;
  out.samples = s.samples;
  out.rough_plate = s.rough_plate;
  out.time_step = t.time_step;
  return out;
}

dem::ReposeSettings repose_settings(const ParticleTests& t, int seed) {
  const ReposeSpec& s = *t.angle_of_repose;
  dem::ReposeSettings out;
  out.soil = recipe_of(t, seed);
  out.soil.width = s.width, out.soil.length = s.length, out.soil.height = s.height;
  out.soil.walls = true;
  out.time_step = t.time_step;
  return out;
}

// What the settings themselves say of the values, for one test of each kind, as problems of the file.
Problems check(const ParticleTests& t) {
  Problems out;
  std::set<std::string> said;
  const auto add = [&](const char* section, Problems problems) {
    for (Problem& p : problems) {
      p.file = t.file;
      const bool grain = p.key != "travel" && p.key != "plate_width" && p.key != "width" && p.key != "length" && p.key != "height";
      p.key = std::string("particle_tests.") + (grain ? "grains" : section) + "." + p.key;
      if (said.insert(p.text()).second) out.push_back(p);
    }
  };
  if (t.direct_shear && !t.direct_shear->normal_stress.empty() && !t.direct_shear->rate.empty())
    add("direct_shear", shear_settings(t, t.direct_shear->normal_stress.front(), t.direct_shear->rate.front(), t.seed).validate());
  if (t.pressure_sinkage && !t.pressure_sinkage->rate.empty())
    add("pressure_sinkage", sinkage_settings(t, t.pressure_sinkage->rate.front(), t.seed).validate());
  if (t.angle_of_repose) add("angle_of_repose", repose_settings(t, t.seed).validate());
  return out;
}

double thread_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

void run_one(const ParticleTests& t, ParticleTest& test, const Progress& progress) {
  const double before = thread_seconds();
  if (test.kind == "direct_shear") {
    recording::DirectShearTest r = dem::direct_shear(shear_settings(t, test.normal_stress, test.rate, test.seed), progress);
    test.x = std::move(r.shear_displacement);
    test.y = std::move(r.shear_stress);
  } else if (test.kind == "pressure_sinkage") {
    recording::PressureSinkageTest r = dem::pressure_sinkage(sinkage_settings(t, test.rate, test.seed), progress);
    test.x = std::move(r.sinkage);
    test.y = std::move(r.pressure);
  } else {
    dem::Repose r = dem::angle_of_repose(repose_settings(t, test.seed), progress);
    test.x = std::move(r.x);
    test.y = std::move(r.height);
    test.angle = r.angle;
  }
  test.cpu_seconds = thread_seconds() - before;
}

dem::BedRecipe bed_of(const ParticleTests& t, const ParticleTest& test) {
  if (test.kind == "direct_shear") return shear_settings(t, test.normal_stress, test.rate, test.seed).soil;
  if (test.kind == "pressure_sinkage") return sinkage_settings(t, test.rate, test.seed).prism;
  return repose_settings(t, test.seed).soil;
}

}  // namespace

bool is_particle_tests(const std::string& path) {
  const std::string extension = std::filesystem::path(path).extension().string();
  if (extension != ".yaml" && extension != ".yml") return false;
  try {
    return read_yaml(path).find("particle_tests") != nullptr;
  } catch (const InputError&) {
    return false;
  }
}

ParticleTests parse_particle_tests(const std::string& text, const std::string& file) {
  ParticleTests out;
  out.file = file;
  out.text = text;
  const Node root = parse_yaml(text, file);
  Source source;
  source.file = file;
  MapReader map(root, "", source);
  file_table().read(map, out);
  const Node* section = root.find("particle_tests");
  if (section && !out.direct_shear && !out.pressure_sinkage && !out.angle_of_repose && source.problems.empty())
    source.problem(*section, "particle_tests", "holds no test", "direct_shear, pressure_sinkage or angle_of_repose");
  if (source.problems.empty()) {
    for (Problem p : check(out)) {
      // The place of the nearest key that stands in the file.
      std::string path = p.key;
      const Node* at = root.at(path);
      while (!at && path.find('.') != std::string::npos) {
        path.erase(path.rfind('.'));
        at = root.at(path);
      }
      if (at) p.line = at->line, p.column = at->column;
      source.problems.push_back(p);
    }
  }
  throw_if_any(source.problems);
  return out;
}

ParticleTests load_particle_tests(const std::string& path) { return parse_particle_tests(read_text_file(path, ReadLimits{}.bytes), path); }

std::string to_yaml(const ParticleTests& tests) { return to_yaml(file_table().write(tests)); }

std::string particle_tests_schema() {
  Json schema = {{"$schema", "https://json-schema.org/draft/2020-12/schema"}, {"title", "terrode soil tests on particles"}};
  schema.update(file_table().schema());
  return schema.dump(2) + "\n";
}

bool ParticleTest::same_as(const ParticleTest& o) const {
  return kind == o.kind && normal_stress == o.normal_stress && rate == o.rate && seed == o.seed;
}

std::vector<ParticleTest> planned(const ParticleTests& t) {
  std::vector<ParticleTest> out;
  const auto add = [&](const char* kind, double normal_stress, double rate) {
    for (int k = 0; k < t.repeats; ++k) {
      ParticleTest test;
      test.kind = kind;
      test.normal_stress = normal_stress;
      test.rate = rate;
      test.seed = t.seed + k;
      out.push_back(test);
    }
  };
  if (t.direct_shear)
    for (const double rate : t.direct_shear->rate)
      for (const double stress : t.direct_shear->normal_stress) add("direct_shear", stress, rate);
  if (t.pressure_sinkage)
    for (const double rate : t.pressure_sinkage->rate) add("pressure_sinkage", 0.0, rate);
  if (t.angle_of_repose) add("angle_of_repose", 0.0, 0.0);
  return out;
}

std::vector<ParticleTest> run_particle_tests(const ParticleTests& t, const std::vector<ParticleTest>& known, int threads,
                                             const Progress& progress,
                                             const std::function<void(const std::vector<ParticleTest>&)>& done) {
  std::vector<ParticleTest> tests = planned(t);
  std::vector<std::size_t> open;
  std::vector<bool> has(tests.size(), false);
  for (std::size_t k = 0; k < tests.size(); ++k) {
    for (const ParticleTest& old : known)
      if (old.error.empty() && !old.x.empty() && old.same_as(tests[k])) {
        tests[k] = old;
        has[k] = true;
      }
    if (!has[k]) open.push_back(k);
  }
  std::mutex mutex;
  std::vector<double> part(open.size(), 0.0);
  constexpr double settling_share = 0.1;  // of the progress shown
  const auto report = [&](double base, double scale, std::size_t job, double fraction, const std::string& what) {
    const std::lock_guard lock(mutex);
    part[job] = fraction;
    double sum = 0.0;
    for (const double p : part) sum += p;
    progress.report(base + scale * sum / static_cast<double>(part.size()), what);
  };
  // Each bed is settled once, before the tests that share it.
  std::map<std::string, dem::BedRecipe> recipes;
  for (const std::size_t k : open) {
    dem::BedRecipe r = bed_of(t, tests[k]);
    recipes.emplace(r.text(), r);
  }
  std::vector<dem::BedRecipe> beds;
  for (const auto& [text, recipe] : recipes) beds.push_back(recipe);
  parallel_for(beds.size(), threads, [&](std::size_t b) {
    Progress inner = progress;
    inner.report = [&, b](double f, const std::string& what) { report(0.0, settling_share, std::min(b, part.size() - 1), f, what); };
    try {
      dem::cached_bed(beds[b], {}, 1, inner);
    } catch (const RunError&) {
      // The tests on this bed will say why.
    }
  });
  std::fill(part.begin(), part.end(), 0.0);
  bool stopped = false;
  parallel_for(open.size(), threads, [&](std::size_t job) {
    ParticleTest test = tests[open[job]];
    Progress inner = progress;
    inner.report = [&](double f, const std::string& what) { report(settling_share, 1.0 - settling_share, job, f, what); };
    try {
      if (progress.stop_requested()) throw Interrupted("stopped");
      run_one(t, test, inner);
    } catch (const Interrupted&) {
      const std::lock_guard lock(mutex);
      stopped = true;
      return;
    } catch (const RunError& e) {
      test.error = e.what();
    }
    const std::lock_guard lock(mutex);
    tests[open[job]] = std::move(test);
    has[open[job]] = true;
    if (!done) return;
    std::vector<ParticleTest> ended;
    for (std::size_t k = 0; k < tests.size(); ++k)
      if (has[k]) ended.push_back(tests[k]);
    done(ended);
  });
  if (stopped) throw Interrupted("The soil tests had not all ended.");
  return tests;
}

recording::Recording as_recording(const ParticleTests& t, const std::vector<ParticleTest>& results) {
  recording::Recording out;
  out.title = t.title;
  for (const ParticleTest& r : results) {
    if (!r.error.empty() || r.x.empty()) continue;
    if (r.kind == "direct_shear") {
      recording::DirectShearTest test;
      test.normal_stress = r.normal_stress;
      test.rate = r.rate;
      test.shear_displacement = r.x;
      test.shear_stress = r.y;
      out.direct_shear.push_back(test);
    } else if (r.kind == "pressure_sinkage" && t.pressure_sinkage) {
      recording::PressureSinkageTest test;
      test.plate_width = std::min(t.pressure_sinkage->plate_width, t.pressure_sinkage->plate_length);
      test.plate_length = std::max(t.pressure_sinkage->plate_width, t.pressure_sinkage->plate_length);
      test.rate = r.rate;
      test.sinkage = r.x;
      test.pressure = r.y;
      out.pressure_sinkage.push_back(test);
    }
  }
  return out;
}

std::vector<ParticleCurve> mean_curves(const std::vector<ParticleTest>& results) {
  std::vector<ParticleCurve> out;
  std::vector<std::vector<std::vector<double>>> xs, ys;
  for (const ParticleTest& r : results) {
    if (!r.error.empty() || r.x.empty() || r.kind == "angle_of_repose") continue;
    std::size_t k = 0;
    while (k < out.size() && !(out[k].kind == r.kind && out[k].normal_stress == r.normal_stress && out[k].rate == r.rate)) ++k;
    if (k == out.size()) {
      out.push_back({r.kind, r.normal_stress, r.rate, 0, {}});
      xs.emplace_back();
      ys.emplace_back();
    }
    ++out[k].repeats;
    xs[k].push_back(r.x);
    ys[k].push_back(r.y);
  }
  for (std::size_t k = 0; k < out.size(); ++k) out[k].curve = dem::scatter_of(xs[k], ys[k]);
  return out;
}

}  // namespace terrode::scenario
