// Speed of the particle engine, and of LIGGGHTS and LAMMPS on the same bed in the same run.
//
//   build/bench/dem_bench [--repeats 5] [--steps 1500] [--no-peers] [--threads 2]
//
// The bed: a settled periodic prism of the paper's grains (cached), tiled 3 x 8: about 30,000 spheres of 2.5 to 10 mm,
// time step 3e-6 s, Hertz-Mindlin with history and epsd2 rolling resistance, positions without contact history, 500
// steps to warm up. Programs take turns, so that a busy machine slows all. Peers are what is installed (Debian:
// packages liggghts and lammps, generic -O2 builds); where they are not, the row says absent.
#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>
#include <vector>

#include "dem/bed.h"

namespace {

using namespace terrode;
using namespace terrode::dem;

constexpr int warm_up = 500;
constexpr double time_step = 3e-6, skin = 8e-4;

double median(std::vector<double> v) {
  std::sort(v.begin(), v.end());
  return v.empty() ? 0.0 : v[v.size() / 2];
}
double best(const std::vector<double>& v) { return v.empty() ? 0.0 : *std::max_element(v.begin(), v.end()); }

Simulation make(const Bed& bed, int threads, const std::string& kernel, const Interaction& law) {
  Settings s;
  s.time_step = time_step;
  s.period = Vec3(bed.width, bed.length, 0);
  s.threads = threads;
  s.skin = skin;
  s.kernel = kernel;
  Simulation sim(s);
  const int soil = sim.add_material(bed.grain), wall = sim.add_material({"wall"});
  sim.set_interaction(soil, soil, law);
  sim.set_interaction(soil, wall, Interaction::smooth_wall());
  sim.add_surface(sim.add_body({}), make_plane(Vec3::UnitZ(), 0), wall);
  for (const Grain& g : bed.grains) sim.add_particle({g.position, g.radius, 3090});
  return sim;
}

struct Rate {
  std::vector<double> rate;  // million particle-steps per second of wall time
  double coordination = 0.0, bytes = 0.0;
  std::string note;
};

void ours(const Bed& bed, int threads, const std::string& kernel, const Interaction& law, int steps, Rate& out) {
  Simulation sim = make(bed, threads, kernel, law);
  sim.run(warm_up);
  const auto t0 = std::chrono::steady_clock::now();
  sim.run(steps);
  const double t = std::chrono::duration<double>(std::chrono::steady_clock::now() - t0).count();
  out.rate.push_back(static_cast<double>(bed.grains.size()) * steps / t / 1e6);
  out.coordination = sim.coordination();
  out.bytes = static_cast<double>(sim.memory_bytes()) / static_cast<double>(bed.grains.size());
  out.note = sim.kernel_name();
}

bool installed(const std::string& program) {
  return std::system(("command -v " + program + " > /dev/null 2>&1").c_str()) == 0;
}

void peer(const std::string& program, const Bed& bed, int steps, const std::filesystem::path& folder, Rate& out) {
  if (!installed(program)) {
    out.note = "absent";
    return;
  }
  const bool lammps = program == "lmp";
  std::ofstream in(folder / "in");
  in << "units si\natom_style " << (lammps ? "sphere" : "granular") << "\nboundary p p f\nnewton off\n"
     << (lammps ? "comm_modify mode single vel yes\n" : "communicate single vel yes\n")
     << "read_data bed.data\nneighbor " << skin << " bin\nneigh_modify delay 0\n";
  if (lammps) {
    // 0.25775 makes the polynomial of `damping tsuji` equal to this law's damping at e = 0.4.
    const std::string law =
        "hertz/material 7.0e7 0.25775 0.35 tangential mindlin NULL 0.8876 {} rolling sds 8000.0 0.0 {} damping tsuji";
    in << "pair_style granular\npair_coeff * * " << fmt::format(fmt::runtime(law), 0.86, 1.0)
       << "\nfix wz all wall/gran granular " << fmt::format(fmt::runtime(law), 0.0, 0.0) << " zplane 0.0 NULL\n";
  } else {
    in << "fix m1 all property/global youngsModulus peratomtype 7.0e7 7.0e7\n"
          "fix m2 all property/global poissonsRatio peratomtype 0.35 0.35\n"
          "fix m3 all property/global coefficientRestitution peratomtypepair 2 0.4 0.06 0.06 0.06\n"
          "fix m4 all property/global coefficientFriction peratomtypepair 2 0.86 0.0 0.0 0.0\n"
          "fix m5 all property/global coefficientRollingFriction peratomtypepair 2 1.0 0.0 0.0 0.0\n"
          "fix m6 all property/global coefficientRollingViscousDamping peratomtypepair 2 0.3 0.0 0.0 0.0\n"
          "pair_style gran model hertz tangential history rolling_friction epsd2\npair_coeff * *\n"
          "fix wz all wall/gran model hertz tangential history rolling_friction epsd2 primitive type 2 zplane 0.0\n";
  }
  in << "timestep 3e-6\nfix gr all gravity 9.81 vector 0 0 -1\nfix integ all nve/sphere\ncompute cc all contact/atom\n"
        "compute csum all reduce sum c_cc\nthermo 100000\nthermo_style custom step atoms ke c_csum\n"
     << "run " << warm_up << "\nrun " << steps << "\n";
  in.close();
  const std::string command = "cd " + folder.string() +
                              " && OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 " + program +
                              " -in in -log log.txt > run.txt 2>&1";
  if (std::system(command.c_str()) != 0) {
    out.note = "failed";
    return;
  }
  std::ifstream log(folder / "log.txt");
  double loop = 0.0;
  std::string previous;
  for (std::string line; std::getline(log, line); previous = line)
    if (line.starts_with("Loop time of ")) {
      loop = std::atof(line.c_str() + std::strlen("Loop time of "));
      std::istringstream row(previous);
      double step = 0, atoms = 0, ke = 0, contacts = 0;
      if (row >> step >> atoms >> ke >> contacts && atoms > 0) out.coordination = contacts / atoms;
    }
  if (loop > 0.0) out.rate.push_back(static_cast<double>(bed.grains.size()) * steps / loop / 1e6);
}

}  // namespace

int main(int argc, char** argv) {
  int repeats = 5, steps = 1500, threads = 2;
  bool peers = true;
  for (int k = 1; k < argc; ++k) {
    const std::string a = argv[k];
    if (a == "--repeats" && k + 1 < argc)
      repeats = std::atoi(argv[++k]);
    else if (a == "--steps" && k + 1 < argc)
      steps = std::atoi(argv[++k]);
    else if (a == "--threads" && k + 1 < argc)
      threads = std::atoi(argv[++k]);
    else if (a == "--no-peers")
      peers = false;
    else {
      std::cerr << "usage: dem_bench [--repeats N] [--steps N] [--threads N] [--no-peers]\n";
      return 2;
    }
  }
  BedRecipe recipe;
  const Bed bed = tile(cached_bed(recipe), 3, 8);
  fmt::print("{} grains, solid fraction {:.3f}, {} steps, {} repeats\n", bed.grains.size(), bed.solid_fraction, steps,
             repeats);
  const auto folder = std::filesystem::temp_directory_path() / ("terrode_dem_bench_" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  {
    std::ofstream data(folder / "bed.data");
    data.precision(12);
    data << "bed\n\n"
         << bed.grains.size() << " atoms\n2 atom types\n\n0 " << bed.width << " xlo xhi\n0 " << bed.length
         << " ylo yhi\n-0.01 0.22 zlo zhi\n\nAtoms\n\n";
    std::size_t id = 0;
    for (const Grain& g : bed.grains)
      data << ++id << " 1 " << 2 * g.radius << " 3090 " << g.position.x() << " " << g.position.y() << " "
           << g.position.z() << "\n";
  }
  Interaction epsd2, epsd, none;
  epsd2.rolling = "epsd2";
  epsd.rolling_damping = 0.3;
  none.rolling = "none";
  Rate one, one_epsd, one_none, many, generic, avx2, liggghts, lammps;
  for (int r = 0; r < repeats; ++r) {
    ours(bed, 1, "", epsd2, steps, one);
    if (peers) peer("liggghts", bed, steps, folder, liggghts);
    ours(bed, threads, "", epsd2, steps, many);
    if (peers) peer("lmp", bed, steps, folder, lammps);
    ours(bed, 1, "", epsd, steps, one_epsd);
    ours(bed, 1, "", none, steps, one_none);
    ours(bed, 1, "generic", epsd2, steps, generic);
    try {
      kernels("avx2");
      ours(bed, 1, "avx2", epsd2, steps, avx2);
    } catch (const InputError&) {
      avx2.note = "absent";
    }
  }
  std::filesystem::remove_all(folder);
  fmt::print("{:34} {:>8} {:>8} {:>10} {:>9}\n", "million particle-steps/s (wall)", "median", "best", "contacts",
             "B/grain");
  const auto row = [&](const std::string& name, const Rate& r) {
    if (r.rate.empty())
      fmt::print("{:34} {}\n", name, r.note.empty() ? "not run" : r.note);
    else
      fmt::print("{:34} {:8.2f} {:8.2f} {:10.2f} {:>9}\n", name, median(r.rate), best(r.rate), r.coordination,
                 r.bytes > 0 ? fmt::format("{:.0f}", r.bytes) : "");
  };
  row("terrode epsd2, 1 thread, " + one.note, one);
  row("terrode epsd, 1 thread", one_epsd);
  row("terrode no rolling, 1 thread", one_none);
  row("terrode epsd2, avx2", avx2);
  row("terrode epsd2, generic (SSE2)", generic);
  row(fmt::format("terrode epsd2, {} threads", threads), many);
  row("LIGGGHTS epsd2, 1 process", liggghts);
  row("LAMMPS granular mindlin + sds", lammps);
  if (!liggghts.rate.empty())
    fmt::print("ratio to LIGGGHTS: median {:.2f}, best {:.2f}\n", median(one.rate) / median(liggghts.rate),
               best(one.rate) / best(liggghts.rate));
  if (!lammps.rate.empty())
    fmt::print("ratio to LAMMPS:   median {:.2f}, best {:.2f}\n", median(one.rate) / median(lammps.rate),
               best(one.rate) / best(lammps.rate));
  fmt::print("efficiency on {} threads: median {:.2f}, best {:.2f}\n", threads,
             median(many.rate) / median(one.rate) / threads, best(many.rate) / best(one.rate) / threads);
  return 0;
}
