#include "dem/bed.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <sstream>

#include "core/environment.h"
#include "core/version.h"
#include "recording/checkpoint.h"
#include "recording/hdf5_file.h"

namespace terrode::dem {

namespace {

double sphere_volume(double r) { return 4.0 / 3.0 * std::numbers::pi * r * r * r; }

// Number density of diameters, up to a factor.
double number_density(const SizeDistribution& s, double d) {
  return (s.shape == "linear" ? d : 1.0) / (s.by == "mass" ? d * d * d : 1.0);
}

// Random positions without overlap in a column, largest grains first; each grain is tried at growing heights.
void fill_column(Simulation& sim, const BedRecipe& recipe, int material, double solid_volume) {
  Random random = Random::stream(recipe.seed, 0);
  std::vector<double> radii;
  for (double volume = 0.0; volume < solid_volume;) {
    radii.push_back(0.5 * recipe.sizes.sample(random));
    volume += sphere_volume(radii.back());
  }
  std::sort(radii.rbegin(), radii.rend());
  constexpr double loose_fraction = 0.33;  // what random placing of these sizes still reaches quickly
  double top = solid_volume / (recipe.width * recipe.length * loose_fraction);
  const double cell = 2.0 * radii.front();
  const auto nx = std::max(1, static_cast<int>(recipe.width / cell)),
             ny = std::max(1, static_cast<int>(recipe.length / cell));
  std::vector<std::vector<Grain>> cells;
  const auto cell_of = [&](int i, int j, int k) { return (std::size_t(k) * std::size_t(ny) + std::size_t(j)) * std::size_t(nx) + std::size_t(i); };
  const auto wrap = [](int k, int n) { return (k % n + n) % n; };
  const auto at = [&](const Vec3& x) {
    return std::array<int, 3>{std::min(nx - 1, static_cast<int>(x.x() / recipe.width * nx)),
                              std::min(ny - 1, static_cast<int>(x.y() / recipe.length * ny)),
                              static_cast<int>(x.z() / cell)};
  };
  const auto nearest = [](double d, double period) { return d - period * std::nearbyint(d / period); };
  for (const double r : radii) {
    for (int attempt = 0;; ++attempt) {
      if (attempt > 0 && attempt % 400 == 0) top *= 1.02;
      const double margin = recipe.walls ? r : 0.0;
      const Vec3 x(random.uniform(margin, recipe.width - margin), random.uniform(margin, recipe.length - margin),
                   random.uniform(r, top));
      const auto c = at(x);
      bool free = true;
      const auto layers = std::size_t(c[2] + 2) * std::size_t(nx) * std::size_t(ny);
      if (cells.size() < layers) cells.resize(layers);
      for (int dz = -1; dz <= 1 && free; ++dz)
        for (int dy = -1; dy <= 1 && free; ++dy)
          for (int dx = -1; dx <= 1 && free; ++dx) {
            if (c[2] + dz < 0) continue;
            for (const Grain& g : cells[cell_of(wrap(c[0] + dx, nx), wrap(c[1] + dy, ny), c[2] + dz)]) {
              Vec3 d = x - g.position;
              if (!recipe.walls) d = Vec3(nearest(d.x(), recipe.width), nearest(d.y(), recipe.length), d.z());
              if (d.squaredNorm() < (r + g.radius) * (r + g.radius)) free = false;
            }
          }
      if (!free) continue;
      cells[cell_of(c[0], c[1], c[2])].push_back({r, x});
      sim.add_particle({x, r, recipe.grain_density, Vec3::Zero(), Vec3::Zero(), material});
      break;
    }
  }
}

void measure(Bed& bed) {
  double volume = 0.0;
  for (const Grain& g : bed.grains) volume += sphere_volume(g.radius);
  bed.solid_fraction = volume / (bed.width * bed.length * bed.height);
  bed.bulk_density = bed.solid_fraction * bed.grain_density;
}

constexpr const char* bed_format = "terrode-bed/1";
constexpr int preparation = 2;  // raised when the same recipe comes to give another bed, so that no old one is used

}  // namespace

Problems SizeDistribution::validate() const {
  Problems problems;
  if (shape != "uniform" && shape != "linear" && shape != "listed")
    problems.push_back({{}, 0, 0, "shape", "is \"" + shape + "\"", "uniform, linear or listed"});
  if (by != "number" && by != "mass") problems.push_back({{}, 0, 0, "by", "is \"" + by + "\"", "number or mass"});
  if (shape == "listed") {
    if (diameters.empty() || diameters.size() != shares.size())
      problems.push_back({{}, 0, 0, "diameters", "and shares differ in number or are empty", "one share a diameter"});
    for (const double d : diameters) require(problems, "diameters", d, "m", d > 0.0, "above 0");
    for (const double s : shares) require(problems, "shares", s, "-", s > 0.0, "above 0");
  } else {
    require(problems, "smallest", smallest, "m", smallest > 0.0, "above 0");
    require(problems, "largest", largest, "m", largest >= smallest, "at least the smallest");
  }
  return problems;
}

double SizeDistribution::sample(Random& random) const {
  if (shape == "listed") {
    double total = 0.0;
    const auto share = [&](std::size_t k) {
      return shares[k] / (by == "mass" ? diameters[k] * diameters[k] * diameters[k] : 1.0);
    };
    for (std::size_t k = 0; k < shares.size(); ++k) total += share(k);
    double at = random.uniform(0.0, total);
    for (std::size_t k = 0; k + 1 < shares.size(); ++k) {
      if (at < share(k)) return diameters[k];
      at -= share(k);
    }
    return diameters.back();
  }
  const double peak = std::max(number_density(*this, smallest), number_density(*this, largest));
  for (;;) {
    const double d = random.uniform(smallest, largest);
    if (random.uniform(0.0, peak) <= number_density(*this, d)) return d;
  }
}

double SizeDistribution::mean_volume() const {
  double sum = 0.0, weight = 0.0;
  if (shape == "listed") {
    for (std::size_t k = 0; k < shares.size(); ++k) {
      const double w = shares[k] / (by == "mass" ? std::pow(diameters[k], 3) : 1.0);
      weight += w;
      sum += w * sphere_volume(0.5 * diameters[k]);
    }
    return sum / weight;
  }
  constexpr int n = 1000;
  for (int k = 0; k < n; ++k) {
    const double d = smallest + (largest - smallest) * (k + 0.5) / n;
    weight += number_density(*this, d);
    sum += number_density(*this, d) * sphere_volume(0.5 * d);
  }
  return sum / weight;
}

Problems BedRecipe::validate() const {
  Problems problems = sizes.validate();
  const auto positive = [&](const char* key, double value, const char* unit) {
    require(problems, key, value, unit, value > 0.0, "above 0");
  };
  positive("width", width, "m");
  positive("length", length, "m");
  positive("height", height, "m");
  positive("grain_density", grain_density, "kg/m3");
  require(problems, "bulk_density", bulk_density, "kg/m3", bulk_density >= 0.0, "0 (unscaled) or more");
  positive("gravity", gravity, "m/s2");
  positive("time_step_fraction", time_step_fraction, "-");
  positive("settled_energy", settled_energy, "-");
  positive("settled_force", settled_force, "-");
  positive("longest_settling", longest_settling, "s");
  require(problems, "viscous", viscous, "N s/m", viscous >= 0.0, "0 or more");
  if (settling_friction) require(problems, "settling_friction", *settling_friction, "-", *settling_friction >= 0.0, "0 or more");
  if (settling_rolling_friction)
    require(problems, "settling_rolling_friction", *settling_rolling_friction, "-", *settling_rolling_friction >= 0.0, "0 or more");
  for (const Problems& more : {grain.validate(), contact.validate(), floor.validate()})
    problems.insert(problems.end(), more.begin(), more.end());
  return problems;
}

Interaction BedRecipe::settling_contact() const {
  Interaction out = contact;
  out.friction = settling_friction.value_or(contact.friction);
  out.rolling_friction = settling_rolling_friction.value_or(contact.rolling_friction);
  return out;
}

std::string BedRecipe::text() const {
  std::string out = fmt::format("format {}, preparation {}\n", bed_format, preparation);
  const auto number = [&](const char* key, double v) { out += fmt::format("{} {:.17g}\n", key, v); };
  number("width", width), number("length", length), number("height", height);
  out += fmt::format("sizes {} by {}\n", sizes.shape, sizes.by);
  number("smallest", sizes.smallest), number("largest", sizes.largest);
  for (std::size_t k = 0; k < sizes.diameters.size(); ++k)
    out += fmt::format("listed {:.17g} {:.17g}\n", sizes.diameters[k], sizes.shares[k]);
  number("young_modulus", grain.young_modulus), number("poisson_ratio", grain.poisson_ratio);
  const Interaction settling = settling_contact();  // the bed does not know what friction it is given afterwards
  for (const Interaction* i : {&settling, &floor}) {
    out += fmt::format("law {} {} {} {} {}\n", i->normal, i->tangential, i->rolling, i->cohesion,
                       i->printed_shear_modulus ? "printed" : "mindlin");
    number("restitution", i->restitution), number("friction", i->friction);
    number("rolling_friction", i->rolling_friction), number("rolling_rate", i->rolling_rate);
    number("rolling_damping", i->rolling_damping), number("cohesion", i->cohesion_energy_density);
  }
  number("grain_density", grain_density), number("bulk_density", bulk_density), number("gravity", gravity);
  number("walls", walls), number("viscous", viscous), number("time_step_fraction", time_step_fraction);
  number("settled_energy", settled_energy), number("settled_force", settled_force);
  number("longest_settling", longest_settling);
  out += fmt::format("seed {}\n", seed);
  return out;
}

bool settle(Simulation& sim, double energy_limit, double force_limit, double longest, const Progress& progress) {
  return settle_since(sim.time(), sim, energy_limit, force_limit, longest, progress, [] {});
}

bool settle_since(double start, Simulation& sim, double energy_limit, double force_limit, double longest,
                  const Progress& progress, const std::function<void()>& between) {
  double mean_diameter = 0.0;
  const std::vector<int> ids = sim.ids();
  for (const int id : ids) mean_diameter += 2.0 * sim.radius(id) / static_cast<double>(ids.size());
  const double scale = sim.total_mass() * sim.settings().gravity.norm() * mean_diameter;
  while (sim.time() - start < longest) {
    if (progress.stop_requested()) throw Interrupted("stopped while a bed settled");
    sim.run(500);
    const double kinetic = sim.energy().kinetic() / scale, force = sim.unbalanced_force();
    progress.report((sim.time() - start) / longest, fmt::format("settling: {} grains, kinetic energy {:.1e} of {:.0e}, "
                                                                "unbalanced force {:.3f} of {:.3f}",
                                                                ids.size(), kinetic, energy_limit, force, force_limit));
    if (kinetic < energy_limit && force < force_limit) return true;
    between();
  }
  return false;
}

Bed prepare_bed(const BedRecipe& recipe, int threads, const Progress& progress, const BedCheckpoint& checkpoint) {
  throw_if_any(recipe.validate());
  Settings settings;
  settings.gravity = Vec3(0.0, 0.0, -recipe.gravity);
  if (!recipe.walls) settings.period = Vec3(recipe.width, recipe.length, 0.0);
  settings.threads = threads;
  Simulation sim(settings);
  const int grain = sim.add_material(recipe.grain);
  const int wall = sim.add_material({"wall", recipe.grain.young_modulus, recipe.grain.poisson_ratio});
  sim.set_interaction(grain, grain, recipe.settling_contact());
  sim.set_interaction(grain, wall, recipe.floor);
  const int floor = sim.add_body({});
  sim.add_surface(floor, make_plane(Vec3::UnitZ(), 0.0), wall);
  if (recipe.walls) {
    sim.add_surface(floor, make_plane(Vec3::UnitX(), 0.0), wall);
    sim.add_surface(floor, make_plane(-Vec3::UnitX(), -recipe.width), wall);
    sim.add_surface(floor, make_plane(Vec3::UnitY(), 0.0), wall);
    sim.add_surface(floor, make_plane(-Vec3::UnitY(), -recipe.length), wall);
  }
  // Where the work is: grains are poured (steps done), settle, are cut and settle again (since a time).
  constexpr double pouring = 0.0, settling = 1.0, cut = 2.0;
  double phase = pouring, steps = 0.0, since = 0.0;
  const std::string work = fmt::format("bed by terrode {} ({}), kernel {}\n{}", version(), commit(), sim.kernel_name(), recipe.text());
  const auto keep = [&] {
    recording::Checkpoint c;
    c.work = work;
    c.numbers["place"] = {phase, steps, since};
    std::ostringstream state;
    sim.save(state);
    const std::string bytes = std::move(state).str();
    c.bytes["particles"].assign(bytes.begin(), bytes.end());
    recording::write_atomically(checkpoint.path, false, [&](recording::Hdf5File& file) {
      file.set_attribute("/", "filetype", "terrode unfinished bed");
      recording::write_checkpoint(file, c);
    });
  };
  recording::Regularly regularly(checkpoint.seconds);
  const auto between = [&] {
    if (checkpoint.path.empty() || !regularly.due()) return;
    try {
      keep();
    } catch (const RunError&) {
      // A state that cannot be kept costs time after a kill, not the bed.
    }
    regularly.done();
  };
  const auto stop = [&](const char* doing) {
    if (checkpoint.path.empty()) throw Interrupted(fmt::format("stopped while a bed {}; nothing is kept", doing));
    keep();
    throw Interrupted(fmt::format("stopped while a bed {}; its state is kept and the same command goes on from there", doing));
  };
  std::optional<recording::Checkpoint> kept;
  std::error_code error;
  if (!checkpoint.path.empty() && std::filesystem::exists(checkpoint.path, error)) {
    try {
      kept = recording::read_checkpoint(recording::Hdf5File::open(checkpoint.path));
    } catch (const InputError&) {
      // Damaged: begun again.
    }
  }
  const bool resumed = kept && kept->work == work;
  if (resumed) {
    const auto& place = kept->number("place");
    const auto& bytes = kept->byte("particles");
    if (place.size() != 3) throw InputError({checkpoint.path, 0, 0, "/checkpoint", "is of another bed", "no such file"});
    std::istringstream state(std::string(bytes.begin(), bytes.end()));
    sim.load(state);
    phase = place[0], steps = place[1], since = place[2];
  }

  // Poured beds of these laws reach a solid fraction of 0.5 to 0.6; what stands above the height is cut off.
  constexpr double overfill = 1.06, densest = 0.60;
  if (!resumed) {
    fill_column(sim, recipe, grain, overfill * densest * recipe.width * recipe.length * recipe.height);
    sim.set_time_step(recipe.time_step_fraction * sim.rayleigh_time());
    double highest = 0.0;
    for (const int id : sim.ids()) highest = std::max(highest, sim.position(id).z());
    since = std::sqrt(2.0 * std::max(0.0, highest - recipe.height) / recipe.gravity);  // s of free fall
  }
  if (phase == pouring) {
    const double fall = since, all = std::floor(fall / sim.time_step());
    while (steps < all) {
      if (progress.stop_requested()) stop("was poured");
      const double n = std::min(1000.0, all - steps);
      sim.run(static_cast<std::int64_t>(n));
      steps += n;
      progress.report(0.0, fmt::format("pouring: {:.2f} of {:.2f} s", sim.time(), fall));
      between();
    }
    phase = settling;
    since = sim.time();
  }
  sim.set_viscous(recipe.viscous);
  const auto require_rest = [&](bool rest) {
    if (rest) return;
    int restless = -1;
    double most = -1.0;
    for (const int id : sim.ids()) {
      const double e = sim.mass(id) * (sim.velocity(id).squaredNorm() +
                                       0.4 * std::pow(sim.radius(id), 2) * sim.spin(id).squaredNorm());
      if (e > most) {
        most = e;
        restless = id;
      }
    }
    const Vec3 x = sim.position(restless), v = sim.velocity(restless), w = sim.spin(restless);
    throw RunError(
        fmt::format("the bed still moves after {} s (unbalanced force {:.3f}), most of all a grain of radius "
                    "{:.2g} m at ({:.4f}, {:.4f}, {:.4f}) m with {:.2g} m/s and {:.2g} rad/s: allow a longer "
                    "settling, more damping or a smaller step",
                    recipe.longest_settling, sim.unbalanced_force(), sim.radius(restless), x.x(), x.y(), x.z(),
                    v.norm(), w.norm()));
  };
  const auto settle_now = [&] {
    try {
      require_rest(settle_since(since, sim, recipe.settled_energy, recipe.settled_force, recipe.longest_settling,
                                progress, between));
    } catch (const Interrupted&) {
      stop("settled");
    }
  };
  if (phase == settling) {
    settle_now();
    sim.remove_particles([&](const Vec3& x, double) { return x.z() > recipe.height; });
    phase = cut;
    since = sim.time();
  }
  settle_now();

  Bed bed;
  bed.width = recipe.width;
  bed.length = recipe.length;
  bed.height = recipe.height;
  bed.grain_density = recipe.grain_density;
  bed.grain = recipe.grain;
  bed.walls = recipe.walls;
  bed.coordination = sim.coordination();
  bed.recipe = recipe.text();
  for (const int id : sim.ids()) {
    Vec3 x = sim.position(id);
    if (!recipe.walls) {
      x.x() -= recipe.width * std::floor(x.x() / recipe.width);
      x.y() -= recipe.length * std::floor(x.y() / recipe.length);
    }
    bed.grains.push_back({sim.radius(id), x});
  }
  measure(bed);
  if (recipe.bulk_density > 0.0) bed.grain_density *= recipe.bulk_density / bed.bulk_density;
  measure(bed);
  return bed;
}

Bed tile(const Bed& bed, int nx, int ny) {
  if (nx < 1 || ny < 1) throw InputError("a bed is tiled at least once along each side");
  Bed out = bed;
  out.width *= nx;
  out.length *= ny;
  out.grains.clear();
  out.grains.reserve(bed.grains.size() * std::size_t(nx * ny));
  for (int x = 0; x < nx; ++x)
    for (int y = 0; y < ny; ++y)
      for (const Grain& g : bed.grains)
        out.grains.push_back({g.radius, g.position + Vec3(x * bed.width, y * bed.length, 0.0)});
  return out;
}

void save_bed(const Bed& bed, const std::string& path) {
  recording::write_atomically(path, false, [&](recording::Hdf5File& file) {
    file.set_attribute("/", "filetype", bed_format);
    file.set_attribute("/", "generator", std::string("terrode ") + version());
    file.create_group("/h5md");
    file.set_attribute("/h5md", "version", std::vector<double>{1, 1});
    file.create_group("/h5md/author");
    file.set_attribute("/h5md/author", "name", "unknown");
    file.create_group("/h5md/creator");
    file.set_attribute("/h5md/creator", "name", "terrode");
    file.set_attribute("/h5md/creator", "version", version());
    std::vector<double> position, radius;
    for (const Grain& g : bed.grains) {
      position.insert(position.end(), g.position.data(), g.position.data() + 3);
      radius.push_back(g.radius);
    }
    file.create_group("/particles/soil/box");
    file.set_attribute("/particles/soil/box", "dimension", 3);
    file.set_attribute("/particles/soil/box", "boundary",
                       bed.walls ? "none,none,none" : "periodic,periodic,none");
    file.write("/particles/soil/box/edges", std::vector<double>{bed.width, bed.length, bed.height});
    file.write_grid("/particles/soil/position", position, {bed.grains.size(), 3});
    file.set_attribute("/particles/soil/position", "unit", "m");
    file.write("/particles/soil/radius", radius);
    file.set_attribute("/particles/soil/radius", "unit", "m");
    std::vector<double> mass;
    for (const double r : radius) mass.push_back(bed.grain_density * sphere_volume(r));
    file.write("/particles/soil/mass", mass);
    file.set_attribute("/particles/soil/mass", "unit", "kg");
    file.create_group("/parameters");
    file.set_attribute("/parameters", "grain_density", bed.grain_density);
    file.set_attribute("/parameters", "bulk_density", bed.bulk_density);
    file.set_attribute("/parameters", "solid_fraction", bed.solid_fraction);
    file.set_attribute("/parameters", "coordination", bed.coordination);
    file.set_attribute("/parameters", "young_modulus", bed.grain.young_modulus);
    file.set_attribute("/parameters", "poisson_ratio", bed.grain.poisson_ratio);
    file.set_attribute("/parameters", "walls", bed.walls ? 1 : 0);
    file.set_attribute("/parameters", "recipe", bed.recipe);
  });
}

Bed load_bed(const std::string& path) {
  const auto file = recording::Hdf5File::open(path);
  if (file.text_attribute("/", "filetype").value_or("") != bed_format)
    throw InputError(Problem{path, 0, 0, {}, "is not a bed", std::string("an HDF5 file of type ") + bed_format});
  Bed bed;
  const auto edges = file.read<double>("/particles/soil/box/edges").values;
  const auto position = file.read<double>("/particles/soil/position").values;
  const auto radius = file.read<double>("/particles/soil/radius").values;
  if (edges.size() != 3 || position.size() != 3 * radius.size())
    throw InputError(Problem{path, 0, 0, "/particles/soil", "has arrays of different lengths", "a whole bed"});
  bed.width = edges[0];
  bed.length = edges[1];
  bed.height = edges[2];
  const auto number = [&](const char* name) {
    const auto v = file.number_attribute("/parameters", name);
    if (!v) throw InputError(Problem{path, 0, 0, std::string("/parameters/") + name, "is missing", "a number"});
    return *v;
  };
  bed.grain_density = number("grain_density");
  bed.bulk_density = number("bulk_density");
  bed.solid_fraction = number("solid_fraction");
  bed.coordination = number("coordination");
  bed.grain.young_modulus = number("young_modulus");
  bed.grain.poisson_ratio = number("poisson_ratio");
  bed.walls = file.number_attribute("/parameters", "walls").value_or(0.0) != 0.0;
  bed.recipe = file.text_attribute("/parameters", "recipe").value_or("");
  for (std::size_t k = 0; k < radius.size(); ++k)
    bed.grains.push_back({radius[k], Vec3(position[3 * k], position[3 * k + 1], position[3 * k + 2])});
  return bed;
}

std::string default_cache_folder() {
  if (const std::string own = environment("TERRODE_CACHE"); !own.empty()) return own;
  if (const std::string xdg = environment("XDG_CACHE_HOME"); !xdg.empty()) return xdg + "/terrode";
  if (const std::string home = environment("HOME"); !home.empty()) return home + "/.cache/terrode";
  return (std::filesystem::temp_directory_path() / "terrode").string();
}

Bed cached_bed(const BedRecipe& recipe, const std::string& folder, int threads, const Progress& progress) {
  throw_if_any(recipe.validate());
  const std::string text = recipe.text();
  std::uint64_t hash = 1469598103934665603ull;  // FNV-1a
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ull;
  const std::filesystem::path path =
      std::filesystem::path(folder.empty() ? default_cache_folder() : folder) / fmt::format("bed-{:016x}.h5", hash);
  std::error_code error;
  if (std::filesystem::exists(path, error)) {
    try {
      Bed bed = load_bed(path.string());
      if (bed.recipe == text) return bed;
    } catch (const std::exception&) {
      // A damaged entry is made again.
    }
  }
  std::filesystem::create_directories(path.parent_path(), error);
  const std::string unfinished = path.string() + ".unfinished";
  Bed bed = prepare_bed(recipe, threads, progress, {error ? std::string() : unfinished});
  if (!error) {
    try {
      save_bed(bed, path.string());
    } catch (const RunError&) {
      // A cache that cannot be written costs time, not the result.
    }
  }
  std::filesystem::remove(unfinished, error);
  return bed;
}

void add_bed(Simulation& sim, const Bed& bed, int material, const Vec3& origin) {
  for (const Grain& g : bed.grains)
    sim.add_particle({origin + g.position, g.radius, bed.grain_density, Vec3::Zero(), Vec3::Zero(), material});
}

}  // namespace terrode::dem
