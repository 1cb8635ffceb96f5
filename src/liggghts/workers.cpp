#include "liggghts/workers.h"

#define OMPI_SKIP_MPICXX 1
#include <mpi.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>

#include "core/environment.h"
#include "core/problem.h"
#include "liggghts/ranks.h"

namespace terrode::liggghts {
namespace {

std::unique_ptr<Engine> engine;  // of this process
bool begun = false;              // MPI by this program

struct Header {
  std::int64_t bytes = 0;
  std::int32_t order = 0, unused = 0;
};

// Waits without holding the processor: between two orders lies the work of rank 0 alone.
void broadcast(void* data, std::size_t bytes) {
  MPI_Request request;
  MPI_Ibcast(data, static_cast<int>(bytes), MPI_BYTE, 0, MPI_COMM_WORLD, &request);
  int done = 0;
  for (int tries = 0; !done; ++tries) {
    MPI_Test(&request, &done, MPI_STATUS_IGNORE);
    if (!done && tries > 2000) usleep(tries > 20000 ? 1000 : 50);
  }
}

std::vector<double> numbers(std::span<const char> data) {
  std::vector<double> out(data.size() / sizeof(double));
  std::memcpy(out.data(), data.data(), out.size() * sizeof(double));
  return out;
}

std::vector<double> obey(Order order, std::span<const char> data) {
  if (!engine) engine = std::make_unique<Engine>();
  switch (order) {
    case Order::commands:
      engine->commands(std::string(data.begin(), data.end()));
      break;
    case Order::forget:
      engine->forget();
      break;
    case Order::set_moving: {
      const std::vector<double> n = numbers(data);
      MovingPart part{n.at(0), n.at(1), n.at(2), n.at(3), {}};
      for (std::size_t k = 4; k + 2 < n.size(); k += 3) part.axes.push_back({n[k], n[k + 1], n[k + 2]});
      engine->set_moving(part);
      break;
    }
    case Order::run: {
      long steps = 0;
      std::memcpy(&steps, data.data(), sizeof steps);
      std::vector<BodyMotion> bodies((data.size() - sizeof steps) / sizeof(BodyMotion));
      if (!bodies.empty()) std::memcpy(bodies.data(), data.data() + sizeof steps, bodies.size() * sizeof(BodyMotion));
      return engine->run(steps, bodies);
    }
    case Order::grains:
      return engine->grains();
    case Order::quit:
      break;
  }
  return {};
}

// Whether mpirun, srun or the like started this process as one of several; MPI is left alone otherwise.
bool launched() {
  const auto above = [](const char* name, int n) {
    const std::string value = environment(name);
    return !value.empty() && std::atoi(value.c_str()) > n;
  };
  return above("OMPI_COMM_WORLD_SIZE", 1) || above("PMI_SIZE", 1) || (above("PMIX_RANK", -1) && above("SLURM_STEP_NUM_TASKS", 1));
}

void begin() {
  int initialised = 0;
  MPI_Initialized(&initialised);
  if (initialised) return;
  int provided = 0;
  MPI_Init_thread(nullptr, nullptr, MPI_THREAD_SERIALIZED, &provided);
  begun = true;
}

int rank() {
  int r = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &r);
  return r;
}

// At the end of rank 0, however it comes about.
void end() {
  int finalised = 0;
  MPI_Finalized(&finalised);
  if (!begun || finalised) return;
  Header header;
  header.order = static_cast<std::int32_t>(Order::quit);
  broadcast(&header, sizeof header);
  engine.reset();
  MPI_Finalize();
}

}  // namespace

bool available() { return true; }

std::optional<int> serve() {
  if (!launched()) return std::nullopt;
  begin();
  if (rank() == 0) {
    std::atexit(end);
    return std::nullopt;
  }
  // Rank 0 hears of a wish to stop, keeps what there is, and lets the others go.
  std::signal(SIGINT, SIG_IGN);
  std::signal(SIGTERM, SIG_IGN);
  for (;;) {
    Header header;
    broadcast(&header, sizeof header);
    std::vector<char> data(static_cast<std::size_t>(header.bytes));
    if (!data.empty()) broadcast(data.data(), data.size());
    const auto order = static_cast<Order>(header.order);
    if (order == Order::quit) break;
    try {
      obey(order, data);
    } catch (const EngineFailure&) {
      // On rank 0 as well, which says so.
    } catch (const std::exception& e) {
      std::fprintf(stderr, "terrode: rank %d: %s\n", rank(), e.what());
      PMPI_Abort(MPI_COMM_WORLD, 1);
    }
  }
  engine.reset();
  MPI_Finalize();
  return 0;
}

Workers& Workers::instance() {
  static Workers workers;
  return workers;
}

Workers::Workers() {
  const bool early = begun;
  begin();
  if (!early) std::atexit(end);
  MPI_Comm_size(MPI_COMM_WORLD, &ranks_);
}

std::vector<double> Workers::perform(Order order, std::span<const char> data) {
  Header header;
  header.order = static_cast<std::int32_t>(order);
  header.bytes = static_cast<std::int64_t>(data.size());
  if (ranks_ > 1) {
    broadcast(&header, sizeof header);
    if (!data.empty()) broadcast(const_cast<char*>(data.data()), data.size());
  }
  try {
    return obey(order, data);
  } catch (const EngineFailure& e) {
    throw RunError(e.what());
  } catch (const std::exception& e) {
    if (ranks_ == 1) throw;
    std::fprintf(stderr, "terrode: rank 0: %s\n", e.what());  // the others are in the middle of it
    PMPI_Abort(MPI_COMM_WORLD, 1);
    throw;
  }
}

void Workers::commands(const std::string& lines) { perform(Order::commands, lines); }

void Workers::forget() { perform(Order::forget, {}); }

void Workers::set_moving(const MovingPart& part) {
  std::vector<double> n = {part.from, part.to, part.side, part.width};
  for (const MovingPart::Axis& a : part.axes) n.insert(n.end(), {a.x, a.z, a.reach});
  perform(Order::set_moving, {reinterpret_cast<const char*>(n.data()), n.size() * sizeof(double)});
}

std::vector<double> Workers::run(long steps, const std::vector<BodyMotion>& bodies) {
  std::vector<char> data(sizeof steps + bodies.size() * sizeof(BodyMotion));
  std::memcpy(data.data(), &steps, sizeof steps);
  if (!bodies.empty()) std::memcpy(data.data() + sizeof steps, bodies.data(), bodies.size() * sizeof(BodyMotion));
  return perform(Order::run, data);
}

std::vector<double> Workers::grains() { return perform(Order::grains, {}); }

}  // namespace terrode::liggghts
