#include "liggghts/engine.h"

#define OMPI_SKIP_MPICXX 1
#include <fcntl.h>
#include <fmt/format.h>
#include <liggghts/library.h>
#include <mpi.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <optional>
#include <sstream>

#include "core/problem.h"
#include "core/system_error.h"

namespace terrode::liggghts {
namespace {

bool inside = false;  // LIGGGHTS is at work in this process
int spoken = -1;      // its file in memory

struct Inside {
  Inside() { inside = true; }
  ~Inside() { inside = false; }
};

// Standard output and error go nowhere meanwhile.
class Hushed {
 public:
  Hushed() {
    std::fflush(nullptr);
    const int nowhere = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
    for (const int stream : {1, 2}) {
      kept_[stream - 1] = fcntl(stream, F_DUPFD_CLOEXEC, 3);
      dup2(nowhere, stream);
    }
    close(nowhere);
  }
  ~Hushed() {
    std::fflush(nullptr);
    for (const int stream : {1, 2}) {
      dup2(kept_[stream - 1], stream);
      close(kept_[stream - 1]);
    }
  }
  Hushed(const Hushed&) = delete;
  Hushed& operator=(const Hushed&) = delete;

 private:
  int kept_[2] = {-1, -1};
};

// The last error that it wrote, without the place in its source.
std::string last_error() {
  std::fflush(nullptr);
  if (spoken < 0) return {};
  constexpr off_t most = 8192;
  const off_t end = lseek(spoken, 0, SEEK_END), from = end > most ? end - most : 0;
  std::string text(static_cast<std::size_t>(end > from ? end - from : 0), '\0');
  const ssize_t got = pread(spoken, text.data(), text.size(), from);
  text.resize(got > 0 ? static_cast<std::size_t>(got) : 0);
  const std::size_t at = text.rfind("ERROR");
  if (at == std::string::npos) return {};
  text = text.substr(at, text.find('\n', at) - at);
  if (const std::size_t colon = text.find(": "); colon != std::string::npos) text = text.substr(colon + 2);
  if (const std::size_t place = text.rfind(" (./"); place != std::string::npos) text.resize(place);
  return text;
}

[[noreturn]] void fail() {
  const std::string text = last_error();
  throw EngineFailure("LIGGGHTS: " + (text.empty() ? std::string("gave up without a reason") : text));
}

}  // namespace
}  // namespace terrode::liggghts

// LIGGGHTS ends the process on an error: by MPI_Finalize and exit where all ranks found it, by MPI_Abort where one did.
// MPI lets a program take these names (its profiling interface); an error is then one that the caller can catch, and
// what cannot be caught ends with a line that says what happened.
extern "C" int MPI_Finalize() {
  if (terrode::liggghts::inside) terrode::liggghts::fail();
  return PMPI_Finalize();
}

extern "C" int MPI_Abort(MPI_Comm communicator, int status) {
  if (terrode::liggghts::inside) {
    int ranks = 1, rank = 0;
    MPI_Comm_size(communicator, &ranks);
    MPI_Comm_rank(communicator, &rank);
    if (ranks == 1) terrode::liggghts::fail();
    const std::string text = terrode::liggghts::last_error();
    std::fprintf(stderr, "terrode: LIGGGHTS failed on rank %d of %d%s%s\n", rank, ranks, text.empty() ? "" : ": ", text.c_str());
  }
  return PMPI_Abort(communicator, status == 0 ? 1 : status);
}

namespace terrode::liggghts {

Engine::~Engine() {
  if (lammps_ && !dead_) {
    const Inside guard;
    lammps_close(lammps_);
  }
  if (screen_ >= 0) close(screen_);
}

void Engine::open() {
  if (lammps_ && !dead_) return;
  const bool again = lammps_ != nullptr;  // what is left of one that failed cannot be closed, its files are
  if (screen_ < 0) screen_ = memfd_create("terrode-liggghts", MFD_CLOEXEC);
  if (screen_ < 0) throw RunError(fmt::format("no file in memory for what LIGGGHTS says: {}", system_error_text(errno)));
  spoken = screen_;
  std::string name = "liggghts", log = "-log", none = "none", screen = "-screen", file = fmt::format("/proc/self/fd/{}", screen_);
  char* arguments[] = {name.data(), log.data(), none.data(), screen.data(), file.data()};
  dead_ = true;
  {
    std::optional<Hushed> hushed;
    if (again) hushed.emplace();  // opened a second time it warns of every style that it knows already
    const Inside guard;
    lammps_open(5, arguments, MPI_COMM_WORLD, &lammps_);
  }
  dead_ = false;
}

void Engine::command(const char* line) {
  try {
    const Inside guard;
    lammps_command(lammps_, line);
  } catch (...) {
    dead_ = true;
    throw;
  }
}

void Engine::commands(const std::string& lines) {
  open();
  std::istringstream in(lines);
  for (std::string line; std::getline(in, line);) {
    if (line.empty()) continue;
    std::optional<Hushed> hushed;
    if (line.starts_with("read_restart")) hushed.emplace();  // says a version on standard output
    command(line.c_str());
  }
}

void Engine::forget() {
  open();
  command("clear");
}

void Engine::set_moving(const MovingPart& part) {
  open();
  const int n = *static_cast<int*>(lammps_extract_global(lammps_, "nlocal"));
  auto* mask = static_cast<int*>(lammps_extract_atom(lammps_, "mask"));
  auto** x = static_cast<double**>(lammps_extract_atom(lammps_, "x"));
  auto** v = static_cast<double**>(lammps_extract_atom(lammps_, "v"));
  auto** w = static_cast<double**>(lammps_extract_atom(lammps_, "omega"));
  auto* radius = static_cast<double*>(lammps_extract_atom(lammps_, "radius"));
  const auto near_an_axis = [&](int i) {
    for (const MovingPart::Axis& a : part.axes)
      if (std::hypot(x[i][0] - a.x, x[i][2] - a.z) < a.reach + radius[i]) return true;
    return false;
  };
  for (int i = 0; i < n; ++i) {
    const double y = x[i][1] - part.width * std::nearbyint(x[i][1] / part.width);
    if (std::abs(y) <= part.side && ((x[i][0] >= part.from && x[i][0] < part.to) || near_an_axis(i))) {
      mask[i] = (mask[i] | moving_bit) & ~standing_bit;
      continue;
    }
    mask[i] = (mask[i] | standing_bit) & ~moving_bit;
    for (int k = 0; k < 3; ++k) v[i][k] = w[i][k] = 0.0;
  }
}

std::vector<double> Engine::run(long steps, const std::vector<BodyMotion>& bodies) {
  open();
  // All variables and always in this order: a variable that is given anew moves to the end of LIGGGHTS's list, and
  // the moving meshes know theirs by their place.
  for (std::size_t b = 0; b < bodies.size(); ++b)
    for (int k = 0; k < 6; ++k)
      command(fmt::format("variable body{}_{} equal {:.17g}", b, k, k < 3 ? bodies[b].velocity[k] : bodies[b].spin[k - 3]).c_str());
  std::vector<double> out(7 * bodies.size() + 1, 0.0);
  std::vector<std::string> names;
  for (std::size_t b = 0; b < bodies.size(); ++b) names.push_back(fmt::format("body{}", b));
  for (long s = 0; s < steps; ++s) {
    command("run 1 pre no post no");
    for (std::size_t b = 0; b < bodies.size(); ++b)
      for (int k = 0; k < 6; ++k) {
        auto* value = static_cast<double*>(lammps_extract_fix(lammps_, names[b].c_str(), 0, 1, k, 0));
        if (!value) throw RunError("LIGGGHTS does not tell the force on a mesh");
        out[7 * b + static_cast<std::size_t>(k)] += *value;
        lammps_free(value);
      }
  }
  const int n = *static_cast<int*>(lammps_extract_global(lammps_, "nlocal"));
  auto** x = static_cast<double**>(lammps_extract_atom(lammps_, "x"));
  auto* radius = static_cast<double*>(lammps_extract_atom(lammps_, "radius"));
  auto** force = static_cast<double**>(lammps_extract_fix(lammps_, "force_bodies", 1, 2, 0, 0));
  std::vector<double> touching(bodies.size() + 1, 0.0);
  touching.back() = n;
  for (int i = 0; force && i < n; ++i) {
    if (force[i][0] == 0.0 && force[i][1] == 0.0 && force[i][2] == 0.0) continue;
    for (std::size_t b = 0; b < bodies.size(); ++b) {
      const BodyMotion& m = bodies[b];
      const double d = std::hypot(x[i][0] - m.centre[0], x[i][1] - m.centre[1], x[i][2] - m.centre[2]);
      if (d <= m.reach + radius[i]) touching[b] += 1.0;
    }
  }
  MPI_Allreduce(MPI_IN_PLACE, touching.data(), static_cast<int>(touching.size()), MPI_DOUBLE, MPI_SUM, MPI_COMM_WORLD);
  for (std::size_t b = 0; b < bodies.size(); ++b) out[7 * b + 6] = touching[b];
  out.back() = touching.back();
  if (ftruncate(screen_, 0) != 0) throw RunError("the file of what LIGGGHTS says cannot be emptied");
  return out;
}

std::vector<double> Engine::grains() {
  open();
  const int n = *static_cast<int*>(lammps_extract_global(lammps_, "nlocal"));
  auto* id = static_cast<int*>(lammps_extract_atom(lammps_, "id"));
  auto** x = static_cast<double**>(lammps_extract_atom(lammps_, "x"));
  auto* radius = static_cast<double*>(lammps_extract_atom(lammps_, "radius"));
  std::vector<double> own;
  for (int i = 0; i < n; ++i) own.insert(own.end(), {static_cast<double>(id[i]), x[i][0], x[i][1], x[i][2], radius[i]});
  int ranks = 1, rank = 0, mine = static_cast<int>(own.size());
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  std::vector<int> counts(static_cast<std::size_t>(ranks)), offsets(static_cast<std::size_t>(ranks));
  MPI_Gather(&mine, 1, MPI_INT, counts.data(), 1, MPI_INT, 0, MPI_COMM_WORLD);
  std::vector<double> all;
  if (rank == 0) {
    int total = 0;
    for (std::size_t r = 0; r < counts.size(); ++r) {
      offsets[r] = total;
      total += counts[r];
    }
    all.resize(static_cast<std::size_t>(total));
  }
  MPI_Gatherv(own.data(), mine, MPI_DOUBLE, all.data(), counts.data(), offsets.data(), MPI_DOUBLE, 0, MPI_COMM_WORLD);
  return all;
}

}  // namespace terrode::liggghts
