// Speed of the particle engine, and of LIGGGHTS and LAMMPS on the same bed in the same run.
//
//   build/bench/dem_bench [--repeats 5] [--steps 1000] [--threads 2] [--no-peers]
//
// The bed: a periodic prism of the paper's grains (2.5 to 10 mm), poured with little friction so that it is as dense as
// a wheel's bed, tiled 3 x 8: about 30,000 grains with 3.5 contacts each. Law: Hertz-Mindlin with history, epsd2 rolling
// resistance, mu 0.86, mu_r 1, e 0.4, time step 3e-6 s; every program begins from the same positions without contact
// history and warms up for 500 steps. The decks of the peers are written here. Programs take turns, so that a busy
// machine slows all. Peers are what is installed (Debian: packages liggghts and lammps, generic -O2 builds); where one
// is not, its row says absent.
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <optional>
#include <sstream>
#include <vector>

#include "core/parallel.h"
#include "dem/bed.h"
#include "dem/soil_tests.h"

namespace {

using namespace terrode;
using namespace terrode::dem;

constexpr int warm_up = 500;
constexpr double time_step = 3e-6, skin = 8e-4, density = 3090.0;

double median(std::vector<double> v) {
  std::sort(v.begin(), v.end());
  return v.empty() ? 0.0 : v[v.size() / 2];
}
double best(const std::vector<double>& v) { return v.empty() ? 0.0 : *std::max_element(v.begin(), v.end()); }
double wall_clock() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}
double cpu_clock() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

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
  for (const Grain& g : bed.grains) sim.add_particle({g.position, g.radius, density});
  return sim;
}

struct Rate {
  std::string note;
  std::vector<double> wall, cpu;  // million particle-steps per second of wall and of processor time
  double contacts = 0.0;          // of grains with grains, a grain
  double bytes = 0.0;             // of arrays, a grain
  Times times;                    // a step, of the last run
};

void ours(const Bed& bed, int threads, const std::string& kernel, const Interaction& law, int steps, Rate& out) {
  try {
    Simulation sim = make(bed, threads, kernel, law);
    sim.run(warm_up);
    const Times before = sim.times();
    const double t0 = wall_clock(), c0 = cpu_clock();
    sim.run(steps);
    const double t = wall_clock() - t0, c = cpu_clock() - c0;
    const double n = static_cast<double>(bed.grains.size());
    out.wall.push_back(n * steps / t / 1e6);
    out.cpu.push_back(n * steps / c / 1e6);
    out.contacts = 2.0 * static_cast<double>(sim.pair_contacts().size()) / n;
    out.bytes = static_cast<double>(sim.memory_bytes()) / n;
    out.note = sim.kernel_name();
    const Times& now = sim.times();
    for (const auto& [to, a, b] : {std::tuple(&out.times.lists, now.lists, before.lists),
                                   {&out.times.forces, now.forces, before.forces},
                                   {&out.times.walls, now.walls, before.walls},
                                   {&out.times.motion, now.motion, before.motion},
                                   {&out.times.bodies, now.bodies, before.bodies},
                                   {&out.times.checks, now.checks, before.checks}})
      *to = (a - b) / steps;
  } catch (const InputError& e) {
    out.note = e.what();
  }
}

// Runs a shell command; its processor time [s] and peak memory [B], or nothing when it failed.
struct Used {
  double cpu = 0.0, bytes = 0.0;
};
std::optional<Used> execute(const std::string& command) {
  const pid_t child = ::fork();
  if (child < 0) return std::nullopt;
  if (child == 0) {
    ::execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
    ::_exit(127);
  }
  int status = 0;
  rusage use{};
  if (::wait4(child, &status, 0, &use) != child || !WIFEXITED(status) || WEXITSTATUS(status) != 0) return std::nullopt;
  const auto s = [](const timeval& t) { return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec); };
  return Used{s(use.ru_utime) + s(use.ru_stime), 1024.0 * static_cast<double>(use.ru_maxrss)};
}

bool installed(const std::string& program) {
  return std::system(("command -v " + program + " > /dev/null 2>&1").c_str()) == 0;
}

void write_data(const Bed& bed, const std::filesystem::path& path) {
  std::ofstream data(path);
  data.precision(12);
  data << "bed\n\n"
       << bed.grains.size() << " atoms\n2 atom types\n\n0 " << bed.width << " xlo xhi\n0 " << bed.length
       << " ylo yhi\n-0.01 0.22 zlo zhi\n\nAtoms\n\n";
  std::size_t id = 0;
  for (const Grain& g : bed.grains)
    data << ++id << " 1 " << 2 * g.radius << " " << density << " " << g.position.x() << " " << g.position.y() << " "
         << g.position.z() << "\n";
}

// The peer's program on `data`; the memory it took at its peak [B].
double peer(const std::string& program, const std::string& data, std::size_t grains, int steps,
            const std::filesystem::path& folder, Rate& out) {
  if (!installed(program)) {
    out.note = "absent";
    return 0.0;
  }
  const bool lammps = program == "lmp";
  std::ofstream in(folder / "in");
  in << "units si\natom_style " << (lammps ? "sphere" : "granular") << "\nboundary p p f\nnewton off\n"
     << (lammps ? "comm_modify mode single vel yes\n" : "communicate single vel yes\n") << "read_data " << data
     << "\nneighbor " << skin << " bin\nneigh_modify delay 0\n";
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
  in << "timestep " << time_step
     << "\nfix gr all gravity 9.81 vector 0 0 -1\nfix integ all nve/sphere\ncompute cc all contact/atom\n"
        "compute csum all reduce sum c_cc\nthermo 100000\nthermo_style custom step atoms ke c_csum cpu\n"
     << "run " << warm_up << "\nrun " << steps << "\n";
  in.close();
  const auto used = execute("cd " + folder.string() +
                            " && export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 && exec " + program +
                            " -in in -log log.txt > run.txt 2>&1");
  if (!used) {
    out.note = "failed";
    return 0.0;
  }
  std::ifstream log(folder / "log.txt");
  double loop = 0.0;
  std::string previous;
  for (std::string line; std::getline(log, line); previous = line)
    if (line.starts_with("Loop time of ")) {
      loop = std::atof(line.c_str() + std::strlen("Loop time of "));
      std::istringstream row(previous);
      double step = 0, atoms = 0, ke = 0, contacts = 0;
      if (row >> step >> atoms >> ke >> contacts && atoms > 0) out.contacts = contacts / atoms;
    }
  if (loop > 0.0) out.wall.push_back(static_cast<double>(grains) * steps / loop / 1e6);
  return used->bytes;
}

// How fast the memory behind the caches gives and takes what a step streams: a triad over arrays of the bed's size.
double stream_bandwidth(std::size_t bytes) {
  const std::size_t n = bytes / 3 / sizeof(double);
  std::vector<double> a(n, 1.0), b(n, 2.0), c(n, 3.0);
  double least = 1e9;
  for (int r = 0; r < 10; ++r) {
    const double t0 = wall_clock();
    for (std::size_t k = 0; k < n; ++k) a[k] = b[k] + 0.5 * c[k];
    least = std::min(least, wall_clock() - t0);
    std::swap(a, b);
  }
  return 3.0 * static_cast<double>(n) * sizeof(double) / least;
}

BedRecipe bench_recipe() {
  BedRecipe recipe;
  recipe.contact.rolling = "epsd2";
  recipe.contact.friction = 0.5;
  recipe.contact.rolling_friction = 0.3;
  return recipe;
}

Interaction bench_law(const std::string& rolling) {
  Interaction law;
  law.rolling = rolling;
  law.rolling_damping = 0.3;
  return law;
}

// Peak memory of this program with a bed of nx x ny prisms and nothing else, in a process of its own [B].
double own_memory(const char* program, int nx, int ny) {
  const auto used = execute(fmt::format("exec {} --hold {} {}", program, nx, ny));
  return used ? used->bytes : 0.0;
}

int hold(int nx, int ny) {
  const Bed bed = tile(cached_bed(bench_recipe()), nx, ny);
  Simulation sim = make(bed, 1, "", bench_law("epsd2"));
  sim.run(50);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  int repeats = 5, steps = 1000, threads = 2;
  bool peers = true;
  for (int k = 1; k < argc; ++k) {
    const std::string a = argv[k];
    if (a == "--repeats" && k + 1 < argc)
      repeats = std::max(1, std::atoi(argv[++k]));
    else if (a == "--steps" && k + 1 < argc)
      steps = std::max(1, std::atoi(argv[++k]));
    else if (a == "--threads" && k + 1 < argc)
      threads = std::atoi(argv[++k]);
    else if (a == "--no-peers")
      peers = false;
    else if (a == "--hold" && k + 2 < argc)
      return hold(std::atoi(argv[k + 1]), std::atoi(argv[k + 2]));
    else {
      std::cerr << "usage: dem_bench [--repeats N] [--steps N] [--threads N] [--no-peers]\n";
      return 2;
    }
  }
  const Bed prism = cached_bed(bench_recipe()), bed = tile(prism, 3, 8);
  fmt::print("{} grains, solid fraction {:.3f}, {} steps after {} to warm up, {} repeats in turns\n", bed.grains.size(),
             bed.solid_fraction, steps, warm_up, repeats);
  const auto folder = std::filesystem::temp_directory_path() / ("terrode_dem_bench_" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  write_data(bed, folder / "bed.data");
  write_data(prism, folder / "prism.data");
  const Interaction epsd2 = bench_law("epsd2"), epsd = bench_law("epsd"), none = bench_law("none");
  Rate one, one_epsd, one_none, many, generic, avx2, small, liggghts, lammps, ignored;
  for (int r = 0; r < repeats; ++r) {
    ours(bed, 1, "", epsd2, steps, one);
    if (peers) peer("liggghts", "bed.data", bed.grains.size(), steps, folder, liggghts);
    ours(bed, threads, "", epsd2, steps, many);
    if (peers) peer("lmp", "bed.data", bed.grains.size(), steps, folder, lammps);
    ours(prism, 1, "", epsd2, 10 * steps, small);
    ours(bed, 1, "", epsd, steps, one_epsd);
    ours(bed, 1, "", none, steps, one_none);
    ours(bed, 1, "avx2", epsd2, steps, avx2);
    ours(bed, 1, "generic", epsd2, steps, generic);
  }

  fmt::print("\n{:34} {:>8} {:>8} {:>8} {:>10}\n", "million particle-steps/s", "median", "best", "cpu", "contacts");
  const auto row = [&](const std::string& name, const Rate& r) {
    if (r.wall.empty())
      fmt::print("{:34} {}\n", name, r.note.empty() ? "not run" : r.note);
    else
      fmt::print("{:34} {:8.2f} {:8.2f} {:>8} {:10.2f}\n", name, median(r.wall), best(r.wall),
                 r.cpu.empty() ? "" : fmt::format("{:.2f}", median(r.cpu)), r.contacts);
  };
  row("terrode epsd2, 1 thread, " + one.note, one);
  row("terrode epsd, 1 thread", one_epsd);
  row("terrode no rolling, 1 thread", one_none);
  row("terrode epsd2, 1 thread, avx2", avx2);
  row("terrode epsd2, 1 thread, SSE2", generic);
  row(fmt::format("terrode epsd2, {} threads", threads), many);
  row("LIGGGHTS epsd2, 1 process", liggghts);
  row("LAMMPS granular mindlin + sds", lammps);
  fmt::print("\n");
  for (const auto& [name, p] : {std::pair("LIGGGHTS", &liggghts), {"LAMMPS", &lammps}})
    if (!p->wall.empty())
      fmt::print("ratio to {}: median {:.2f}, best {:.2f}\n", name, median(one.wall) / median(p->wall),
                 best(one.wall) / best(p->wall));
  if (thread_count(0) >= threads)
    fmt::print("efficiency on {} threads: median {:.2f}, best {:.2f}\n", threads,
               median(many.wall) / median(one.wall) / threads, best(many.wall) / best(one.wall) / threads);

  const double extra = static_cast<double>(bed.grains.size() - prism.grains.size());
  fmt::print("\nmemory a grain: arrays {:.0f} B; growth of the process from {} to {} grains {:.0f} B", one.bytes,
             prism.grains.size(), bed.grains.size(), (own_memory(argv[0], 3, 8) - own_memory(argv[0], 1, 1)) / extra);
  for (const auto& [name, program, p] :
       {std::tuple("LIGGGHTS", "liggghts", &liggghts), {"LAMMPS", "lmp", &lammps}}) {
    if (p->wall.empty()) continue;
    const double large = peer(program, "bed.data", bed.grains.size(), 1, folder, ignored),
                 little = peer(program, "prism.data", prism.grains.size(), 1, folder, ignored);
    fmt::print(", {} {:.0f} B", name, (large - little) / extra);
  }
  std::filesystem::remove_all(folder);

  const Times& t = one.times;
  const double step = t.lists + t.forces + t.motion + t.bodies + t.checks;
  fmt::print("\n\na step takes {:.0f} us: pairs {:.0f} %, walls {:.0f} %, motion {:.0f} %, lists {:.1f} %, bodies {:.1f} %, "
             "checks {:.1f} %\n",
             1e6 * step, 100 * (t.forces - t.walls) / step, 100 * t.walls / step, 100 * t.motion / step,
             100 * t.lists / step, 100 * t.bodies / step, 100 * t.checks / step);
  // A step reads and writes particles (position, velocity, spin: 96 B) once in the motion, reads them in the forces,
  // reads and writes loads twice (64 B), and reads and writes each contact's history and partners (48 and 8 B).
  const double pairs = 0.5 * one.contacts, moved = 96 * 3 + 64 * 4 + pairs * (2 * 48 + 8);
  const double bandwidth = stream_bandwidth(static_cast<std::size_t>(one.bytes * static_cast<double>(bed.grains.size())));
  fmt::print("in the second-level cache ({} grains): {:.2f} million/s at {:.2f} contacts: {:.1f} ns a contact against "
             "{:.1f} ns with {} grains\n",
             prism.grains.size(), median(small.wall), small.contacts, 1e3 / median(small.wall) / (0.5 * small.contacts),
             1e3 / median(one.wall) / pairs, bed.grains.size());
  fmt::print("a particle-step moves about {:.0f} B: {:.1f} GB/s; a triad over as much memory does {:.1f} GB/s\n", moved,
             moved * median(one.wall) * 1e-3, 1e-9 * bandwidth);

  DirectShearSettings shear;
  shear.time_step = time_step;
  shear.travel = 0.1 * shear.rate;
  shear.samples = 10;
  shear.soil.contact.rolling = "epsd2";
  cached_bed(shear.soil);
  std::vector<double> cost;
  for (int r = 0; r < 3; ++r) {
    const double c0 = cpu_clock();
    direct_shear(shear);
    cost.push_back((cpu_clock() - c0) / (1.2 * shear.seating + shear.travel / shear.rate));
  }
  fmt::print("direct shear, 60 mm box, {} grains and lid, time step 3 us: {:.1f} CPU s a simulated second\n",
             cached_bed(shear.soil).grains.size(), median(cost));
  return 0;
}
