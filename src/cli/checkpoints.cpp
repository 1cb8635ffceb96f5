#include "cli/checkpoints.h"

#include <fmt/format.h>

#include <atomic>
#include <filesystem>

#include "core/version.h"
#include "recording/checkpoint.h"
#include "terrain/terrain.h"

namespace terrode::cli {

namespace fs = std::filesystem;

struct Checkpoints::State {
  std::string folder, method, work;
  double seconds = 30.0;
  std::atomic<int> resumed{0};

  std::string path(const recording::Condition& c) const {
    const std::string text = fmt::format("{} {:.17g} {:.17g} {:.17g} {}", method, c.slip, c.normal_load.value_or(0.0),
                                         c.angular_velocity.value_or(0.0), c.pass);
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(text.data());
    return fmt::format("{}/{}-{:016x}.h5", folder, method, terrain::digest({bytes, text.size()}));
  }
};

Checkpoints::Checkpoints(const std::string& result_file, const std::string& method, const std::string& work, double seconds)
    : state_(std::make_shared<State>()) {
  state_->folder = result_file + ".unfinished";
  state_->method = method;
  state_->work = fmt::format("terrode {}\n{}\n{}", version(), method, work);
  state_->seconds = seconds;
}

int Checkpoints::resumed() const { return state_->resumed; }

vehicle::RunMemory Checkpoints::memory() const {
  const auto state = state_;
  vehicle::RunMemory out;
  out.interval = state->seconds;
  out.load = [state](const recording::Condition& c) -> std::shared_ptr<const recording::Checkpoint> {
    std::error_code error;
    if (!fs::exists(state->path(c), error)) return nullptr;
    try {
      auto kept = recording::read_checkpoint(recording::Hdf5File::open(state->path(c)));
      if (!kept || kept->work != state->work) return nullptr;
      ++state->resumed;
      return std::make_shared<recording::Checkpoint>(std::move(*kept));
    } catch (const std::exception&) {
      return nullptr;  // damaged: the point begins anew
    }
  };
  out.save = [state](const recording::Condition& c, const recording::Checkpoint& checkpoint) {
    std::error_code error;
    fs::create_directories(state->folder, error);
    if (error) throw RunError(fmt::format("{}: cannot be made: {}", state->folder, error.message()));
    recording::write_atomically(state->path(c), false, [&](recording::Hdf5File& file) {
      recording::Checkpoint copy = checkpoint;
      copy.work = state->work;
      recording::write_checkpoint(file, copy);
    });
  };
  out.forget = [state](const recording::Condition& c) {
    std::error_code error;
    fs::remove(state->path(c), error);
    fs::remove(state->folder, error);  // stays while it is not empty
  };
  return out;
}

}  // namespace terrode::cli
