// Two grains, and a grain on a wall, against LIGGGHTS and LAMMPS from Debian's packages: the same impacts, step by
// step. Skipped where the programs are not installed.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <sstream>

#include "dem/simulation.h"

namespace terrode::dem {
namespace {

// Both sides take the same steps with the same formulas; what is left is rounding and the order of operations.
constexpr double same_law = 1e-7;
// LIGGGHTS scales a grain's spin against a wall by arm over distance, some overlap/radius more than this law's.
constexpr double wall_spin = 5e-3;
// LAMMPS takes the whole radius as the lever of the relative velocity, this law and LIGGGHTS radius - overlap/2.
constexpr double lever_arm = 5e-3;

struct Grain {
  double radius;
  Vec3 x, v, w;
};

bool installed(const std::string& program) {
  return std::system(("command -v " + program + " > /dev/null 2>&1").c_str()) == 0;
}

constexpr double time_step = 1e-7;
constexpr int steps = 10000;

std::vector<Grain> ours(const std::vector<Grain>& grains, const Interaction& law, bool wall) {
  Settings s;
  s.time_step = time_step;
  s.gravity.setZero();
  Simulation sim(s);
  const int m = sim.add_material({});
  sim.set_interaction(m, m, law);
  for (const Grain& g : grains) sim.add_particle({g.x, g.radius, 3090, g.v, g.w, m});
  if (wall) sim.add_surface(sim.add_body({}), make_plane(Vec3::UnitZ(), 0.0), m);
  sim.run(steps);
  std::vector<Grain> out;
  for (const int id : sim.ids()) out.push_back({sim.radius(id), sim.position(id), sim.velocity(id), sim.spin(id)});
  return out;
}

std::vector<Grain> theirs(const std::string& program, const std::string& styles, const std::vector<Grain>& grains) {
  static int count = 0;
  const auto folder = std::filesystem::temp_directory_path() /
                      ("terrode_peers_" + std::to_string(::getpid()) + "_" + std::to_string(count++));
  std::filesystem::create_directories(folder);
  std::ofstream data(folder / "grains.data");
  data.precision(17);
  data << "grains\n\n"
       << grains.size()
       << " atoms\n1 atom types\n\n-0.05 0.05 xlo xhi\n-0.05 0.05 ylo yhi\n-0.01 0.05 zlo zhi\n\nAtoms\n\n";
  for (std::size_t k = 0; k < grains.size(); ++k)
    data << k + 1 << " 1 " << 2 * grains[k].radius << " 3090 " << grains[k].x.transpose() << "\n";
  data << "\nVelocities\n\n";
  for (std::size_t k = 0; k < grains.size(); ++k)
    data << k + 1 << " " << grains[k].v.transpose() << " " << grains[k].w.transpose() << "\n";
  data.close();
  std::ofstream(folder / "in")
      << "atom_style " << (program == "lmp" ? "sphere" : "granular") << "\nboundary f f f\nnewton off\n"
      << (program == "lmp" ? "comm_modify mode single vel yes\n" : "communicate single vel yes\n")
      << "units si\nread_data grains.data\nneighbor 0.002 bin\n"
      << styles << "fix integ all " << (program == "lmp" ? "nve/sphere" : "nve/sphere")
      << "\ntimestep 1e-7\nthermo 10000\n"
         "dump d all custom "
      << steps
      << " out.txt id radius x y z vx vy vz omegax omegay omegaz\n"
         "dump_modify d sort id format "
      << (program == "lmp" ? "float %.16g\n" : "\"%d %.16g %.16g %.16g %.16g %.16g %.16g %.16g %.16g %.16g %.16g\"\n")
      << "run " << steps << "\n";
  const std::string command = "cd " + folder.string() +
                              " && OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 " + program +
                              " -in in > run.txt 2>&1";
  std::vector<Grain> out;
  if (std::system(command.c_str()) != 0) {
    std::ifstream log(folder / "run.txt");
    std::stringstream text;
    text << log.rdbuf();
    ADD_FAILURE() << program << " failed: " << text.str();
    return out;
  }
  std::ifstream in(folder / "out.txt");
  std::string line;
  while (std::getline(in, line))
    if (line.starts_with("ITEM: ATOMS")) {
      out.clear();
      for (std::size_t k = 0; k < grains.size(); ++k) {
        int id = 0;
        Grain g{};
        in >> id >> g.radius;
        for (Vec3* v : {&g.x, &g.v, &g.w}) in >> v->x() >> v->y() >> v->z();
        out.push_back(g);
      }
    }
  std::filesystem::remove_all(folder);
  return out;
}

void expect_same(const std::vector<Grain>& a, const std::vector<Grain>& b, const std::vector<Grain>& start,
                 double tolerance) {
  ASSERT_EQ(a.size(), b.size());
  double dv = 0.0, dw = 0.0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    dv = std::max(dv, (a[k].v - start[k].v).norm());
    dw = std::max(dw, (a[k].w - start[k].w).norm());
  }
  EXPECT_GT(dv, 0.1) << "no impact";
  for (std::size_t k = 0; k < a.size(); ++k) {
    EXPECT_LT((a[k].v - b[k].v).norm(), tolerance * dv)
        << k << ": " << a[k].v.transpose() << " / " << b[k].v.transpose();
    EXPECT_LT((a[k].w - b[k].w).norm(), tolerance * dw)
        << k << ": " << a[k].w.transpose() << " / " << b[k].w.transpose();
    EXPECT_LT((a[k].x - b[k].x).norm(), tolerance * 1e-2) << k;
  }
}

std::vector<Grain> oblique_pair() {
  return {{0.003, Vec3(-0.0031, 0, 0.01), Vec3(0.5, 0.2, 0.1), Vec3(30, -20, 60)},
          {0.002, Vec3(0.0021, 0.0005, 0.0105), Vec3(-0.4, -0.3, 0.0), Vec3(-10, 40, 20)}};
}
std::vector<Grain> grain_on_wall() { return {{0.003, Vec3(0, 0, 0.0031), Vec3(0.3, 0.1, -0.5), Vec3(20, -50, 30)}}; }

std::string liggghts_law(double mu, double mu_r, const std::string& rolling, bool wall) {
  std::ostringstream s;
  s << "fix m1 all property/global youngsModulus peratomtype 7.0e7\n"
       "fix m2 all property/global poissonsRatio peratomtype 0.35\n"
       "fix m3 all property/global coefficientRestitution peratomtypepair 1 0.4\n"
       "fix m4 all property/global coefficientFriction peratomtypepair 1 "
    << mu
    << "\n"
       "fix m5 all property/global coefficientRollingFriction peratomtypepair 1 "
    << mu_r
    << "\n"
       "fix m6 all property/global coefficientRollingViscousDamping peratomtypepair 1 0.7\n";
  const std::string model = "model hertz tangential history" + (rolling.empty() ? "" : " rolling_friction " + rolling);
  s << "pair_style gran " << model << "\npair_coeff * *\n";
  if (wall) s << "fix wz all wall/gran " << model << " primitive type 1 zplane 0.0\n";
  return s.str();
}

class Liggghts : public ::testing::TestWithParam<std::string> {};

TEST_P(Liggghts, SameImpactOfTwoGrainsAndOnAWall) {
  if (!installed("liggghts")) GTEST_SKIP() << "liggghts is not installed (Debian package liggghts)";
  const std::string rolling = GetParam();
  for (const double mu : {0.1, 0.86})
    for (const bool wall : {false, true}) {
      SCOPED_TRACE(rolling + (wall ? " wall" : " pair") + " mu " + std::to_string(mu));
      Interaction law;
      law.friction = mu;
      law.rolling = rolling.empty() ? "none" : rolling + "_unprojected";
      law.rolling_friction = 0.3;
      law.rolling_damping = 0.7;
      const auto start = wall ? grain_on_wall() : oblique_pair();
      expect_same(ours(start, law, wall), theirs("liggghts", liggghts_law(mu, 0.3, rolling, wall), start), start,
                  wall && !rolling.empty() ? wall_spin : same_law);
    }
}
INSTANTIATE_TEST_SUITE_P(Rolling, Liggghts, ::testing::Values("", "epsd", "epsd2"));

TEST(LiggghtsShearModulus, IsMindlinsNotThePrintedOne) {
  if (!installed("liggghts")) GTEST_SKIP() << "liggghts is not installed (Debian package liggghts)";
  Interaction mindlin, printed;
  mindlin.rolling = printed.rolling = "none";
  printed.printed_shear_modulus = true;
  const auto start = oblique_pair();
  const auto peer = theirs("liggghts", liggghts_law(0.86, 0, "", false), start);
  const auto a = ours(start, mindlin, false), b = ours(start, printed, false);
  ASSERT_EQ(peer.size(), 2u);
  EXPECT_LT((a[0].w - peer[0].w).norm(), 1e-6 * peer[0].w.norm());
  EXPECT_GT((b[0].w - peer[0].w).norm(), 1e-3 * peer[0].w.norm());
}

TEST(Lammps, SameImpactOfTwoGrainsWithTheCapOnTheSum) {
  if (!installed("lmp")) GTEST_SKIP() << "lmp is not installed (Debian package lammps)";
  // 0.25775 makes LAMMPS' polynomial for the damping equal to this law's at e = 0.4; x_gammat 0.887625 gives its
  // tangential dashpot.
  for (const double mu : {5.0, 0.86}) {
    Interaction law;
    law.tangential = "mindlin_capped_sum";
    law.rolling = "none";
    law.friction = mu;
    std::ostringstream styles;
    styles << "pair_style granular\npair_coeff * * hertz/material 7.0e7 0.25775 0.35 tangential mindlin NULL 0.887625 "
           << mu << " damping tsuji\n";
    const auto start = oblique_pair();
    expect_same(ours(start, law, false), theirs("lmp", styles.str(), start), start, lever_arm);
  }
}

}  // namespace
}  // namespace terrode::dem
