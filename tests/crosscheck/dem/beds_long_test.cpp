// A settled bed and a direct shear test against LIGGGHTS from Debian's package, with the same law and the same grains.
// Packings are chaotic: what is compared are means over seeds. Skipped where the program is not installed.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <sstream>

#include "core/random.h"
#include "dem/bed.h"
#include "dem/simulation.h"

namespace terrode::dem {
namespace {

bool installed(const std::string& program) {
  return std::system(("command -v " + program + " > /dev/null 2>&1").c_str()) == 0;
}

constexpr double density = 3090.0;

// LIGGGHTS' epsd does not project the rolling spring on the tangent plane.
Interaction grain_law() {
  Interaction law;
  law.rolling = "epsd_unprojected";
  law.friction = 0.5;
  law.rolling_friction = 0.2;
  law.rolling_damping = 0.3;
  return law;
}

// Type 1: grains; type 2: smooth walls.
std::string liggghts_law() {
  return "fix m1 all property/global youngsModulus peratomtype 7.0e7 7.0e7\n"
         "fix m2 all property/global poissonsRatio peratomtype 0.35 0.35\n"
         "fix m3 all property/global coefficientRestitution peratomtypepair 2 0.4 0.06 0.06 0.06\n"
         "fix m4 all property/global coefficientFriction peratomtypepair 2 0.5 0.0 0.0 0.0\n"
         "fix m5 all property/global coefficientRollingFriction peratomtypepair 2 0.2 0.0 0.0 0.0\n"
         "fix m6 all property/global coefficientRollingViscousDamping peratomtypepair 2 0.3 0.3 0.3 0.3\n"
         "pair_style gran model hertz tangential history rolling_friction epsd\npair_coeff * *\n";
}

class Folder {
 public:
  Folder() {
    static int count = 0;
    path_ = std::filesystem::temp_directory_path() / ("terrode_beds_" + std::to_string(::getpid()) + "_" + std::to_string(count++));
    std::filesystem::create_directories(path_);
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  // Runs LIGGGHTS on `deck`; its output where it failed.
  void run(const std::string& deck) const {
    std::ofstream(path_ / "in") << deck;
    const std::string command = "cd " + path_.string() +
                                " && OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 liggghts -in in > run.txt 2>&1";
    if (std::system(command.c_str()) == 0) return;
    std::ifstream log(path_ / "run.txt");
    std::stringstream text;
    text << log.rdbuf();
    ADD_FAILURE() << "liggghts failed: " << text.str().substr(text.str().size() > 2000 ? text.str().size() - 2000 : 0);
  }

 private:
  std::filesystem::path path_;
};

void write_data(const std::filesystem::path& path, const std::vector<Grain>& grains, const Vec3& lo, const Vec3& hi) {
  std::ofstream data(path);
  data.precision(17);
  data << "grains\n\n" << grains.size() << " atoms\n2 atom types\n\n";
  for (int k = 0; k < 3; ++k) data << lo[k] << " " << hi[k] << " " << "xyz"[k] << "lo " << "xyz"[k] << "hi\n";
  data << "\nAtoms\n\n";
  for (std::size_t k = 0; k < grains.size(); ++k)
    data << k + 1 << " 1 " << 2 * grains[k].radius << " " << density << " " << grains[k].position.transpose() << "\n";
}

// The last frame of a dump with the columns x y z radius.
std::vector<Grain> read_dump(const std::filesystem::path& path, std::size_t n) {
  std::vector<Grain> out;
  std::ifstream in(path);
  for (std::string line; std::getline(in, line);)
    if (line.starts_with("ITEM: ATOMS")) {
      out.assign(n, {});
      for (Grain& g : out) in >> g.position.x() >> g.position.y() >> g.position.z() >> g.radius;
    }
  return out;
}

// A jittered lattice of grains, as they are before they fall.
std::vector<Grain> column(std::uint64_t seed, int across, int layers, double spacing, double smallest, double largest) {
  Random random(seed);
  std::vector<Grain> out;
  for (int z = 0; z < layers; ++z)
    for (int y = 0; y < across; ++y)
      for (int x = 0; x < across; ++x) {
        const double r = 0.5 * random.uniform(smallest, largest), free = 0.5 * spacing - r;
        out.push_back({r, Vec3((x + 0.5) * spacing + random.uniform(-free, free), (y + 0.5) * spacing + random.uniform(-free, free),
                               (z + 0.5) * spacing + random.uniform(-free, free))});
      }
  return out;
}

struct Packing {
  double solid_fraction = 0.0;  // of the slice between a quarter and three quarters of the height
  double coordination = 0.0;    // contacts with grains, of grains in the slice
};

Packing measure(const std::vector<Grain>& grains, double width, double length, bool periodic) {
  double top = 0.0;
  for (const Grain& g : grains) top = std::max(top, g.position.z());
  const double z0 = 0.25 * top, z1 = 0.75 * top;
  Packing out;
  double volume = 0.0, contacts = 0.0, count = 0.0;
  const auto cap = [](double r, double h) { return std::numbers::pi * h * h * (3 * r - h) / 3; };  // of height h, 0 to 2 r
  for (const Grain& g : grains) {
    const double r = g.radius, below1 = cap(r, std::clamp(z1 - g.position.z() + r, 0.0, 2 * r)),
                 below0 = cap(r, std::clamp(z0 - g.position.z() + r, 0.0, 2 * r));
    volume += below1 - below0;
    if (g.position.z() < z0 || g.position.z() > z1) continue;
    count += 1.0;
    for (const Grain& o : grains) {
      if (&o == &g) continue;
      Vec3 d = g.position - o.position;
      if (periodic) {
        d.x() -= width * std::nearbyint(d.x() / width);
        d.y() -= length * std::nearbyint(d.y() / length);
      }
      if (d.norm() < r + o.radius) contacts += 1.0;
    }
  }
  out.solid_fraction = volume / (width * length * (z1 - z0));
  out.coordination = contacts / count;
  return out;
}

TEST(LiggghtsBed, SettlesToTheSamePorosityAndCoordination) {
  if (!installed("liggghts")) GTEST_SKIP() << "liggghts is not installed (Debian package liggghts)";
  // 8 x 8 x 8 grains of 4 to 6 mm fall into a periodic cell on a smooth floor and settle for 0.5 s under their own
  // dissipation.
  constexpr int seeds = 4, across = 8, layers = 8;
  constexpr double spacing = 6.2e-3, width = across * spacing, dt = 1e-5, duration = 0.5;
  constexpr auto steps = static_cast<std::int64_t>(duration / dt + 0.5);
  std::array<std::vector<Packing>, 2> all;
  for (int seed = 1; seed <= seeds; ++seed) {
    const std::vector<Grain> start = column(static_cast<std::uint64_t>(seed), across, layers, spacing, 4e-3, 6e-3);
    Settings s;
    s.time_step = dt;
    s.period = Vec3(width, width, 0);
    Simulation sim(s);
    const int grain = sim.add_material({}), wall = sim.add_material({"wall"});
    sim.set_interaction(grain, grain, grain_law());
    sim.set_interaction(grain, wall, Interaction::smooth_wall());
    sim.add_surface(sim.add_body({}), make_plane(Vec3::UnitZ(), 0), wall);
    for (const Grain& g : start) sim.add_particle({g.position, g.radius, density});
    sim.run(steps);
    std::vector<Grain> settled;
    for (const int id : sim.ids()) settled.push_back({sim.radius(id), sim.position(id)});
    all[0].push_back(measure(settled, width, width, true));

    const Folder folder;
    write_data(folder / "bed.data", start, Vec3(0, 0, -0.01), Vec3(width, width, 0.1));
    std::ostringstream deck;
    deck << "atom_style granular\nboundary p p f\nnewton off\ncommunicate single vel yes\nunits si\nread_data bed.data\n"
            "neighbor 0.001 bin\nneigh_modify delay 0\n"
         << liggghts_law()
         << "fix wz all wall/gran model hertz tangential history rolling_friction epsd primitive type 2 zplane 0.0\n"
         << "timestep " << dt << "\nfix gr all gravity 9.81 vector 0 0 -1\nfix integ all nve/sphere\nthermo 100000\n"
         << "dump d all custom " << steps << " out.txt x y z radius\nrun " << steps << "\n";
    folder.run(deck.str());
    const std::vector<Grain> peer = read_dump(folder / "out.txt", start.size());
    ASSERT_EQ(peer.size(), start.size());
    all[1].push_back(measure(peer, width, width, true));
  }
  // Within what single seeds scatter by (0.011 and 0.08): the means of four, begun from the same grains, differ by less.
  constexpr double fraction_tolerance = 0.01, coordination_tolerance = 0.15;
  const auto compare = [&](double Packing::*what, double tolerance) {
    std::array<double, 2> mean{};
    for (std::size_t p = 0; p < 2; ++p)
      for (const Packing& k : all[p]) mean[p] += k.*what / seeds;
    std::cout << "  " << mean[0] << ", LIGGGHTS " << mean[1] << "\n";
    EXPECT_NEAR(mean[0], mean[1], tolerance);
  };
  std::cout << "solid fraction and coordination, means over " << seeds << " seeds\n";
  compare(&Packing::solid_fraction, fraction_tolerance);
  compare(&Packing::coordination, coordination_tolerance);
}

// A box of 40 mm whose upper half moves at 50 mm/s under a smooth plate that carries 5 kPa.
constexpr double box = 0.04, half = 0.02, rate = 0.05, travel = 5e-3, pressure = 5e3, shear_step = 1e-5, seating = 0.05;
constexpr int samples = 25;
constexpr double lid_drag = 100.0;  // N s/m: the plate moves at its excess of force over this, on both sides

struct Quad {
  Vec3 a, b, c, d;
};
// Side walls of the lower half with the floor, and of the upper half; flanges keep grains in while they are apart.
std::vector<Quad> half_box(bool upper) {
  const double z0 = upper ? half : 0.0, z1 = upper ? 0.08 : half, w = box, f = travel + 0.01;
  std::vector<Quad> q = {{{0, 0, z0}, {0, w, z0}, {0, w, z1}, {0, 0, z1}},
                         {{w, 0, z0}, {w, w, z0}, {w, w, z1}, {w, 0, z1}},
                         {{0, 0, z0}, {w, 0, z0}, {w, 0, z1}, {0, 0, z1}},
                         {{0, w, z0}, {w, w, z0}, {w, w, z1}, {0, w, z1}}};
  if (upper)
    q.push_back({{-f, 0, half}, {0, 0, half}, {0, w, half}, {-f, w, half}});
  else {
    q.push_back({{w, 0, half}, {w + f, 0, half}, {w + f, w, half}, {w, w, half}});
    q.push_back({{0, 0, 0}, {w, 0, 0}, {w, w, 0}, {0, w, 0}});
  }
  return q;
}
std::vector<Quad> lid(double z) {
  const double f = 0.01;
  return {{{-f, -f, z}, {box + f, -f, z}, {box + f, box + f, z}, {-f, box + f, z}}};
}

void write_stl(const std::filesystem::path& path, const std::vector<Quad>& quads) {
  std::ofstream out(path);
  out.precision(9);
  out << "solid a\n";
  const auto triangle = [&](const Vec3& a, const Vec3& b, const Vec3& c) {
    const Vec3 n = (b - a).cross(c - a).normalized();
    out << "facet normal " << n.transpose() << "\nouter loop\n";
    for (const Vec3& v : {a, b, c}) out << "vertex " << v.transpose() << "\n";
    out << "endloop\nendfacet\n";
  };
  for (const Quad& q : quads) {
    triangle(q.a, q.b, q.c);
    triangle(q.a, q.c, q.d);
  }
  out << "endsolid a\n";
}
SurfacePtr mesh_of(const std::vector<Quad>& quads) {
  std::vector<Vec3> vertices;
  std::vector<std::array<int, 3>> triangles;
  for (const Quad& q : quads) {
    const int n = static_cast<int>(vertices.size());
    for (const Vec3& v : {q.a, q.b, q.c, q.d}) vertices.push_back(v);
    triangles.push_back({n, n + 1, n + 2});
    triangles.push_back({n, n + 2, n + 3});
  }
  return make_mesh(vertices, triangles);
}

// The shear stress over the travel [Pa]: the force of the grains on the upper half over the box's area.
std::vector<double> our_shear(const std::vector<Grain>& start, double top) {
  Settings s;
  s.time_step = shear_step;
  Simulation sim(s);
  const int grain = sim.add_material({}), wall = sim.add_material({"wall"});
  sim.set_interaction(grain, grain, grain_law());
  sim.set_interaction(grain, wall, Interaction::smooth_wall());
  sim.add_surface(sim.add_body({}), mesh_of(half_box(false)), wall);
  const int upper = sim.add_body({});
  sim.add_surface(upper, mesh_of(half_box(true)), wall);
  Body plate;
  plate.position = Vec3(0, 0, top);
  const int p = sim.add_body(plate);
  sim.add_surface(p, mesh_of(lid(0.0)), wall);
  sim.set_drive(p, [](double, Body& b) { b.velocity.z() = (b.force.z() - pressure * box * box) / lid_drag; });
  for (const Grain& g : start) sim.add_particle({g.position, g.radius, density});
  sim.run(std::llround(seating / shear_step));
  sim.body(upper).velocity.x() = rate;
  std::vector<double> out;
  const auto per_sample = std::llround(travel / rate / shear_step / samples);
  for (int k = 0; k < samples; ++k) {
    double sum = 0.0;
    for (std::int64_t n = 0; n < per_sample; n += 10) {
      sim.run(10);
      sum -= sim.body(upper).force.x() * 10 / static_cast<double>(per_sample);
    }
    out.push_back(sum / (box * box));
  }
  return out;
}

std::vector<double> liggghts_shear(const std::vector<Grain>& start, double top) {
  const Folder folder;
  write_data(folder / "bed.data", start, Vec3(-0.03, -0.03, -0.01), Vec3(box + 0.03, box + 0.03, 0.1));
  write_stl(folder / "lower.stl", half_box(false));
  write_stl(folder / "upper.stl", half_box(true));
  write_stl(folder / "lid.stl", lid(top));
  const auto seat = std::llround(seating / shear_step);
  const auto per_sample = std::llround(travel / rate / shear_step / samples);
  std::ostringstream deck;
  deck << "atom_style granular\natom_modify map array\nboundary f f f\nnewton off\ncommunicate single vel yes\nunits si\n"
          "read_data bed.data\nneighbor 0.001 bin\nneigh_modify delay 0\n"
       << liggghts_law() << "timestep " << shear_step << "\nfix gr all gravity 9.81 vector 0 0 -1\n"
       << "fix lower all mesh/surface file lower.stl type 2\n"
          "fix upper all mesh/surface/stress file upper.stl type 2\n"
          "fix lid all mesh/surface/stress file lid.stl type 2\n"
       << "variable vz equal (f_lid[3]-" << pressure * box * box << ")/" << lid_drag
       << "\nvariable zero equal 0.\nfix press all move/mesh mesh lid linear/variable v_zero v_zero v_vz\n"
       << "fix walls all wall/gran model hertz tangential history rolling_friction epsd mesh n_meshes 3 meshes lower upper lid\n"
          "fix integ all nve/sphere\nthermo 100000\n"
       << "run " << seat << "\nfix go all move/mesh mesh upper linear " << rate << " 0. 0.\n"
       << "fix out all ave/time 10 " << per_sample / 10 << " " << per_sample
       << " f_upper[1] f_lid[3] file force.txt\nrun " << per_sample * samples << "\n";
  folder.run(deck.str());
  std::vector<double> out;
  std::ifstream in(folder / "force.txt");
  for (std::string line; std::getline(in, line);) {
    std::istringstream row(line);
    double step = 0, fx = 0, fz = 0;
    if (line.empty() || line[0] == '#' || !(row >> step >> fx >> fz)) continue;
    if (step > static_cast<double>(seat)) out.push_back(-fx / (box * box));
  }
  return out;
}

TEST(LiggghtsShear, SameCurveWithAConstantRollingCoefficient) {
  if (!installed("liggghts")) GTEST_SKIP() << "liggghts is not installed (Debian package liggghts)";
  constexpr int seeds = 4;
  std::array<std::vector<double>, 2> late;
  std::vector<double> ours(samples, 0.0), theirs(samples, 0.0);
  for (int seed = 1; seed <= seeds; ++seed) {
    BedRecipe recipe;
    recipe.width = recipe.length = box;
    recipe.height = 2 * half;
    recipe.walls = true;
    recipe.sizes.smallest = 4e-3;
    recipe.sizes.largest = 6e-3;
    recipe.contact = grain_law();
    recipe.bulk_density = 0.0;
    recipe.seed = static_cast<std::uint64_t>(seed);
    const Bed bed = prepare_bed(recipe);
    double top = 0.0;
    for (const Grain& g : bed.grains) top = std::max(top, g.position.z() + g.radius);
    const std::vector<double> a = our_shear(bed.grains, top + 1e-4), b = liggghts_shear(bed.grains, top + 1e-4);
    ASSERT_EQ(a.size(), static_cast<std::size_t>(samples));
    ASSERT_GE(b.size(), static_cast<std::size_t>(samples) - 1);
    double sa = 0.0, sb = 0.0;
    constexpr int from = samples / 2, count = samples - 1 - from;
    for (int k = 0; k < samples - 1; ++k) {
      ours[static_cast<std::size_t>(k)] += a[static_cast<std::size_t>(k)] / seeds;
      theirs[static_cast<std::size_t>(k)] += b[static_cast<std::size_t>(k)] / seeds;
      if (k < from) continue;
      sa += a[static_cast<std::size_t>(k)] / count;
      sb += b[static_cast<std::size_t>(k)] / count;
    }
    late[0].push_back(sa);
    late[1].push_back(sb);
  }
  std::cout << "shear stress [Pa], means over " << seeds << " seeds: ours, LIGGGHTS\n";
  for (int k = 0; k < samples - 1; k += 3)
    std::cout << "  " << 1e3 * travel * (k + 0.5) / samples << " mm: " << ours[static_cast<std::size_t>(k)] << ", "
              << theirs[static_cast<std::size_t>(k)] << "\n";
  // Late stress: the same means within three standard errors of their difference.
  std::array<double, 2> mean{}, error{};
  for (std::size_t p = 0; p < 2; ++p) {
    for (const double v : late[p]) mean[p] += v / seeds;
    for (const double v : late[p]) error[p] += std::pow(v - mean[p], 2) / (seeds * (seeds - 1.0));
  }
  const double bound = 3.0 * std::sqrt(error[0] + error[1]);
  std::cout << "late: " << mean[0] << " +- " << std::sqrt(error[0]) << ", LIGGGHTS " << mean[1] << " +- " << std::sqrt(error[1]) << "\n";
  EXPECT_NEAR(mean[0], mean[1], bound);
  EXPECT_LT(bound, 0.35 * mean[1]);
  EXPECT_GT(mean[0], 0.2 * pressure);
  // The whole curve: its mean distance from the other's, as a share of the late stress. Forces ring, grains rearrange:
  // neighbouring seeds differ by more.
  double distance = 0.0;
  for (int k = 0; k < samples - 1; ++k)
    distance += std::abs(ours[static_cast<std::size_t>(k)] - theirs[static_cast<std::size_t>(k)]) / (samples - 1);
  EXPECT_LT(distance, 0.15 * mean[1]);
}

}  // namespace
}  // namespace terrode::dem
