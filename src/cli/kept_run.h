// The result file of a single run, written while the run goes on: its samples until now and the state to go on from.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "cli/commands.h"
#include "recording/checkpoint.h"
#include "recording/result_file.h"

namespace terrode::cli {

// -o FILE, --checkpoint SECONDS, --overwrite.
struct KeptRunOptions {
  std::string output;
  double seconds = 30.0;
  bool overwrite = false;
};
void add_kept_run(Command& command, KeptRunOptions& options);

// Appends the samples that `all` has more than `out`.
void add_new_samples(const recording::Run& all, recording::Run& out);

class KeptRun {
 public:
  // `work` is all that decides the numbers but the program's version (which is added). Throws InputError where the
  // folder is missing, the file is no result, or holds an unfinished run of other work; RunError where it cannot be
  // written. Without an output nothing is kept.
  KeptRun(const KeptRunOptions& options, recording::ResultHeader header, std::string work, const Common& common);

  // The state that the file had: of a run that was cut off.
  std::shared_ptr<const recording::Checkpoint> resume() const { return resume_; }

  // What is written besides the header, the samples and the state.
  std::function<void(recording::Hdf5File&)> extra = [](recording::Hdf5File&) {};

  // Call after each sample: writes the file when it is time, or when the user asked to stop. `samples` and `state` are
  // called only then.
  void sample(const std::function<recording::Run()>& samples, const std::function<recording::Checkpoint()>& state);
  // To be asked between samples in place of interrupted(): true once the state of this moment is kept.
  bool stop() const { return seen_ ? stopped_ : asked_to_stop(); }

  // The end: all samples, no state.
  void finish(const recording::Run& run);
  // The work failed: what there is until now is kept, and why there is no more.
  void fail(const recording::Run& until_now, const std::string& why);
  // Throws Interrupted with what is kept and how to go on.
  [[noreturn]] void interrupted() const;

 private:
  bool asked_to_stop() const;
  void write(const recording::Run* run, const recording::Checkpoint* state, const std::string& why);

  KeptRunOptions options_;
  recording::ResultHeader header_;
  std::string work_;
  std::shared_ptr<const recording::Checkpoint> resume_;
  recording::Regularly regularly_;
  bool seen_ = false, stopped_ = false;
  double kept_until_ = 0.0;  // s
};

}  // namespace terrode::cli
