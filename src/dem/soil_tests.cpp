#include "dem/soil_tests.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace terrode::dem {

namespace {

void positive(Problems& problems, const char* key, double value, const char* unit) {
  require(problems, key, value, unit, value > 0.0, "above 0");
}

void stop_if_asked(const Progress& progress, const char* test) {
  if (progress.stop_requested()) throw Interrupted(std::string("stopped within the ") + test + "; nothing is kept");
}

// Materials 0 (soil) and 1 (smooth wall) with the recipe's laws.
struct Materials {
  int soil, wall;
};
Materials add_materials(Simulation& sim, const BedRecipe& recipe) {
  const int soil = sim.add_material(recipe.grain);
  const int wall = sim.add_material({"wall", recipe.grain.young_modulus, recipe.grain.poisson_ratio});
  sim.set_interaction(soil, soil, recipe.contact);
  sim.set_interaction(soil, wall, recipe.floor);
  return {soil, wall};
}

}  // namespace

DirectShearSettings::DirectShearSettings() {
  soil.width = soil.length = soil.height = 0.06;
  soil.walls = true;
}

Problems DirectShearSettings::validate() const {
  Problems problems = soil.validate();
  positive(problems, "normal_stress", normal_stress, "Pa");
  positive(problems, "rate", rate, "m/s");
  positive(problems, "travel", travel, "m");
  positive(problems, "samples", samples, "-");
  require(problems, "lid_mass", lid_mass, "kg", lid_mass >= 0.0, "0 or more");
  require(problems, "lid_damping", lid_damping, "-", lid_damping >= 0.0, "0 or more");
  require(problems, "seating", seating, "s", seating >= 0.0, "0 or more");
  if (!(travel < 0.5 * soil.width)) problems.push_back({{}, 0, 0, "travel", "is half the box or more", "less"});
  return problems;
}

recording::DirectShearTest direct_shear(const DirectShearSettings& in, const Progress& progress) {
  throw_if_any(in.validate());
  BedRecipe recipe = in.soil;
  recipe.walls = true;
  const Bed bed = cached_bed(recipe, in.cache, in.threads, progress);
  Settings settings;
  settings.time_step = in.time_step;
  settings.gravity = Vec3(0.0, 0.0, -recipe.gravity);
  settings.threads = in.threads;
  settings.viscous = recipe.viscous;
  Simulation sim(settings);
  const Materials m = add_materials(sim, recipe);
  add_bed(sim, bed, m.soil);

  const double w = recipe.width, l = recipe.length, h = recipe.height, half = 0.5 * h;
  const double flange = in.travel + 0.2 * w;  // keeps grains in while the halves are apart
  // The halves of the box, in the axes of their bodies (origin at the box's corner). Side walls along y are as long
  // as both halves together ever are.
  const auto side = [&](int body, double z0, double z1) {
    const Vec3 up(0, 0, 0.5 * (z1 - z0));
    const double zc = 0.5 * (z0 + z1);
    sim.add_surface(body, make_plate(Vec3(0, 0.5 * l, zc), Vec3(0, 0.5 * l, 0), up), m.wall);
    sim.add_surface(body, make_plate(Vec3(w, 0.5 * l, zc), Vec3(0, 0.5 * l, 0), up), m.wall);
    sim.add_surface(body, make_plate(Vec3(0.5 * w, 0, zc), Vec3(0.5 * w, 0, 0), up), m.wall);
    sim.add_surface(body, make_plate(Vec3(0.5 * w, l, zc), Vec3(0.5 * w, 0, 0), up), m.wall);
  };
  const int lower = sim.add_body({}), upper = sim.add_body({});
  side(lower, 0.0, half);
  sim.add_surface(lower, make_plane(Vec3::UnitZ(), 0.0), m.wall);
  sim.add_surface(
      lower, make_plate(Vec3(w + 0.5 * flange, 0.5 * l, half), Vec3(0.5 * flange, 0, 0), Vec3(0, 0.5 * l, 0)), m.wall);
  side(upper, half, 3.0 * h);
  sim.add_surface(upper, make_plate(Vec3(-0.5 * flange, 0.5 * l, half), Vec3(0.5 * flange, 0, 0), Vec3(0, 0.5 * l, 0)),
                  m.wall);

  // The lid: one layer of spheres, just above the highest grain.
  double top = 0.0, mean_radius = 0.0;
  for (const Grain& g : bed.grains) {
    top = std::max(top, g.position.z() + g.radius);
    mean_radius += g.radius / static_cast<double>(bed.grains.size());
  }
  const double r = 0.8 * mean_radius;
  Body lid_body;
  lid_body.name = "lid";
  lid_body.position = Vec3(0.5 * w, 0.5 * l, top + r);
  lid_body.free_translation = {false, false, true};
  const double normal_force = in.normal_stress * w * l;
  lid_body.mass = in.lid_mass > 0.0 ? in.lid_mass : normal_force / recipe.gravity;
  const int lid = sim.add_body(lid_body);
  std::vector<Member> members;
  const int nx = std::max(2, static_cast<int>(std::ceil((w - 2 * r) / (1.5 * r)))) + 1;
  const int ny = std::max(2, static_cast<int>(std::ceil((l - 2 * r) / (1.5 * r)))) + 1;
  constexpr double clearance = 1e-5;  // m between lid and box walls
  for (int y = 0; y < ny; ++y)
    for (int x = 0; x < nx; ++x)
      members.push_back({Vec3(-0.5 * w + r + clearance + (w - 2 * r - 2 * clearance) * x / (nx - 1),
                              -0.5 * l + r + clearance + (l - 2 * r - 2 * clearance) * y / (ny - 1), 0.0),
                         r});
  sim.add_members(lid, members, m.soil);

  // What presses the lid beside its weight, set anew every few steps: the lid's motion is slow against them. While it
  // seats itself a dashpot brings it to rest within a few hundredths of a second.
  constexpr double seating_time = 5e-3;  // s, mass over dashpot
  constexpr std::int64_t stride = 10;
  bool seated = false;
  const auto press = [&] {
    Body& b = sim.body(lid);
    double drag = in.lid_damping * normal_force / in.rate;
    if (!seated) drag = std::max(drag, normal_force / recipe.gravity / seating_time);
    const double interval = static_cast<double>(stride) * sim.time_step();
    if (interval > 0.0) drag = std::min(drag, 0.5 * lid_body.mass / interval);  // stable although taken explicitly
    b.applied_force.z() = lid_body.mass * recipe.gravity - normal_force - drag * b.velocity.z();
  };
  press();
  sim.run(1);
  const double dt = sim.time_step();
  const auto run_for = [&](double duration, const char* what, double from, double to) {
    const auto steps = std::max<std::int64_t>(1, std::llround(duration / dt));
    for (std::int64_t k = 0; k < steps; k += stride) {
      stop_if_asked(progress, "direct shear test");
      press();
      sim.run(std::min<std::int64_t>(stride, steps - k));
      progress.report(from + (to - from) * static_cast<double>(k) / static_cast<double>(steps), what);
    }
  };
  run_for(in.seating, "direct shear: seating the lid", 0.0, 0.05);
  sim.set_viscous(0.0);
  run_for(0.2 * in.seating, "direct shear: seating the lid", 0.05, 0.06);

  seated = true;
  recording::DirectShearTest test;
  test.normal_stress = in.normal_stress;
  test.rate = in.rate;
  for (const int b : {upper, lid}) sim.body(b).velocity.x() = in.rate;
  const auto total = std::llround(in.travel / in.rate / dt);
  const auto samples = static_cast<std::int64_t>(in.samples);
  test.shear_displacement.push_back(0.0);
  test.shear_stress.push_back(-(sim.body(upper).force.x() + sim.body(lid).force.x()) / (w * l));
  std::int64_t done = 0;
  for (std::int64_t s = 1; s <= samples; ++s) {
    stop_if_asked(progress, "direct shear test");
    // The mean over the sample by every tenth step: contact forces ring at a hundred steps and more.
    const std::int64_t until = total * s / samples;
    double sum = 0.0;
    std::int64_t count = 0;
    while (done < until) {
      const std::int64_t n = std::min<std::int64_t>(10, until - done);
      press();
      sim.run(n);
      done += n;
      sum -= sim.body(upper).force.x() + sim.body(lid).force.x();
      ++count;
    }
    if (count == 0) continue;
    test.shear_displacement.push_back(static_cast<double>(until) * dt * in.rate);
    test.shear_stress.push_back(sum / static_cast<double>(count) / (w * l));
    progress.report(0.06 + 0.94 * static_cast<double>(s) / static_cast<double>(samples),
                    fmt::format("direct shear at {:.0f} Pa: {:.2f} of {:.2f} mm, {:.0f} Pa", in.normal_stress,
                                1e3 * test.shear_displacement.back(), 1e3 * in.travel, test.shear_stress.back()));
  }
  return test;
}

Problems PressureSinkageSettings::validate() const {
  Problems problems = prism.validate();
  positive(problems, "plate_width", plate_width, "m");
  positive(problems, "plate_length", plate_length, "m");
  positive(problems, "plate_thickness", plate_thickness, "m");
  positive(problems, "rate", rate, "m/s");
  positive(problems, "sinkage", sinkage, "m");
  positive(problems, "samples", samples, "-");
  if (plate_width > prism.width * tiles_x || plate_length > prism.length * tiles_y)
    problems.push_back({{}, 0, 0, "plate_width", "or length exceeds the bin", "a plate that fits"});
  return problems;
}

recording::PressureSinkageTest pressure_sinkage(const PressureSinkageSettings& in, const Progress& progress) {
  throw_if_any(in.validate());
  const Bed bed = tile(cached_bed(in.prism, in.cache, in.threads, progress), in.tiles_x, in.tiles_y);
  Settings settings;
  settings.time_step = in.time_step;
  settings.gravity = Vec3(0.0, 0.0, -in.prism.gravity);
  settings.period = Vec3(bed.width, bed.length, 0.0);
  settings.threads = in.threads;
  Simulation sim(settings);
  const Materials m = add_materials(sim, in.prism);
  add_bed(sim, bed, m.soil);
  sim.add_surface(sim.add_body({}), make_plane(Vec3::UnitZ(), 0.0), m.wall);
  double top = 0.0;
  for (const Grain& g : bed.grains) {
    const Vec3 d = (g.position - Vec3(0.5 * bed.width, 0.5 * bed.length, 0)).cwiseAbs();
    if (d.x() < 0.5 * in.plate_width && d.y() < 0.5 * in.plate_length) top = std::max(top, g.position.z() + g.radius);
  }
  Body plate;
  plate.name = "plate";
  plate.position = Vec3(0.5 * bed.width, 0.5 * bed.length, top + 0.5 * in.plate_thickness + 1e-4);
  plate.velocity = Vec3(0, 0, -in.rate);
  const int p = sim.add_body(plate);
  sim.add_surface(p, make_block(0.5 * Vec3(in.plate_width, in.plate_length, in.plate_thickness)),
                  in.rough_plate ? m.soil : m.wall);
  recording::PressureSinkageTest test;
  test.plate_width = std::min(in.plate_width, in.plate_length);
  test.plate_length = std::max(in.plate_width, in.plate_length);
  test.rate = in.rate;
  sim.run(1);
  const double dt = sim.time_step();
  double first = 0.0;
  bool touched = false;
  std::int64_t since = 0, count = 0;
  double sum = 0.0;
  const auto interval = std::max<std::int64_t>(10, std::llround(in.sinkage / in.samples / in.rate / dt));
  for (;;) {
    sim.run(10);
    const double z = sim.body(p).position.z();
    if (!touched) {
      if (sim.body(p).force.z() <= 0.0) continue;
      touched = true;
      first = z;
      test.sinkage.push_back(0.0);
      test.pressure.push_back(0.0);
    }
    sum += sim.body(p).force.z();
    ++count;
    since += 10;
    if (since >= interval) {
      stop_if_asked(progress, "pressure-sinkage test");
      // The mean stands for the middle of its interval.
      test.sinkage.push_back(first - z - 0.5 * in.rate * dt * static_cast<double>(since));
      test.pressure.push_back(sum / static_cast<double>(count) / (in.plate_width * in.plate_length));
      progress.report((first - z) / in.sinkage, fmt::format("pressure-sinkage: {:.1f} of {:.1f} mm, {:.0f} Pa",
                                                            1e3 * (first - z), 1e3 * in.sinkage, test.pressure.back()));
      since = count = 0;
      sum = 0.0;
    }
    if (first - z >= in.sinkage) break;
  }
  return test;
}

Problems ReposeSettings::validate() const { return soil.validate(); }

Repose angle_of_repose(const ReposeSettings& in, const Progress& progress) {
  throw_if_any(in.validate());
  BedRecipe recipe = in.soil;
  recipe.walls = true;
  const Bed bed = cached_bed(recipe, in.cache, in.threads, progress);
  Settings settings;
  settings.time_step = in.time_step;
  settings.gravity = Vec3(0.0, 0.0, -recipe.gravity);
  settings.threads = in.threads;
  Simulation sim(settings);
  const Materials m = add_materials(sim, recipe);
  add_bed(sim, bed, m.soil);
  const int ground = sim.add_body({});
  sim.add_surface(ground, make_plane(Vec3::UnitZ(), 0.0), m.soil);
  sim.add_surface(ground, make_plane(Vec3::UnitX(), 0.0), m.wall);
  sim.add_surface(ground, make_plane(Vec3::UnitY(), 0.0), m.wall);
  sim.add_surface(ground, make_plane(-Vec3::UnitY(), -recipe.length), m.wall);
  // The open end drains for the time of a free fall from the top, several times, before rest is looked for.
  sim.run(1);
  const double fall = std::sqrt(2.0 * recipe.height / recipe.gravity);
  for (int k = 0; k < 8; ++k) {
    stop_if_asked(progress, "angle of repose test");
    sim.run(std::llround(fall / sim.time_step()));
    // What rolls away over the rough ground is no part of the heap.
    sim.remove_particles([&](const Vec3& x, double) { return x.x() > 2.5 * recipe.width; });
    progress.report(0.1 * k, "angle of repose: the heap drains");
  }
  constexpr double creep = 10.0;  // of the bed's limits: single grains may still roll at the foot
  if (!settle(sim, creep * recipe.settled_energy, creep * recipe.settled_force, recipe.longest_settling, progress))
    throw RunError("the heap did not come to rest");

  Repose out;
  double mean_radius = 0.0, reach = 0.0;
  for (const int id : sim.ids()) {
    mean_radius += sim.radius(id) / static_cast<double>(sim.free_count());
    reach = std::max(reach, sim.position(id).x());
  }
  const double bin = 2.0 * mean_radius;
  std::vector<double> top(static_cast<std::size_t>(reach / bin) + 1, 0.0);
  for (const int id : sim.ids()) {
    const Vec3 x = sim.position(id);
    auto& t = top[static_cast<std::size_t>(std::max(0.0, x.x()) / bin)];
    t = std::max(t, x.z() + sim.radius(id));
  }
  const double highest = *std::max_element(top.begin(), top.end());
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (std::size_t k = 0; k < top.size(); ++k) {
    out.x.push_back((static_cast<double>(k) + 0.5) * bin);
    out.height.push_back(top[k]);
    if (top[k] > 0.8 * highest || top[k] < 0.2 * highest) continue;
    n += 1, sx += out.x[k], sy += top[k], sxx += out.x[k] * out.x[k], sxy += out.x[k] * top[k];
  }
  const double spread = n * sxx - sx * sx;
  if (n < 3 || spread <= 0.0) throw RunError("the heap is too small for a slope: take more or smaller grains");
  out.angle = std::atan(-(n * sxy - sx * sy) / spread);
  return out;
}

CurveScatter scatter_of(const std::vector<std::vector<double>>& at, const std::vector<std::vector<double>>& values) {
  if (at.empty() || at.size() != values.size()) throw InputError("scatter of curves that are not there");
  CurveScatter out;
  const auto interpolate = [](const std::vector<double>& x, const std::vector<double>& y, double where) {
    const auto up = std::upper_bound(x.begin(), x.end(), where);
    if (up == x.begin()) return y.front();
    if (up == x.end()) return y.back();
    const auto k = static_cast<std::size_t>(up - x.begin());
    return y[k - 1] + (y[k] - y[k - 1]) * (where - x[k - 1]) / (x[k] - x[k - 1]);
  };
  for (const double where : at.front()) {
    double sum = 0.0, square = 0.0;
    for (std::size_t c = 0; c < at.size(); ++c) sum += interpolate(at[c], values[c], where);
    const double mean = sum / static_cast<double>(at.size());
    for (std::size_t c = 0; c < at.size(); ++c) {
      const double d = interpolate(at[c], values[c], where) - mean;
      square += d * d;
    }
    out.at.push_back(where);
    out.mean.push_back(mean);
    out.deviation.push_back(at.size() > 1 ? std::sqrt(square / static_cast<double>(at.size() - 1)) : 0.0);
  }
  return out;
}

}  // namespace terrode::dem
