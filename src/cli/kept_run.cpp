#include "cli/kept_run.h"

#include <fmt/format.h>

#include <filesystem>

#include "cli/terminal.h"
#include "core/progress.h"

namespace terrode::cli {

namespace fs = std::filesystem;

void add_kept_run(Command& command, KeptRunOptions& options) {
  command.add_option("-o,--output", options.output, "result file (HDF5); a run that was cut off goes on from what is in it")
      ->type_name("OUT.h5");
  command.add_option("--checkpoint", options.seconds, "write the result file anew every so many seconds (default: 30)")
      ->check(range(0.0, 1e9))
      ->type_name("SECONDS");
  command.add_flag("--overwrite", options.overwrite, "begin anew where the result file holds an unfinished run");
}

void add_new_samples(const recording::Run& all, recording::Run& out) {
  if (out.channels.empty()) {
    out = all;
    return;
  }
  const auto add = [](const std::vector<double>& from, std::vector<double>& to) {
    to.insert(to.end(), from.begin() + static_cast<std::ptrdiff_t>(to.size()), from.end());
  };
  add(all.time, out.time);
  for (std::size_t k = 0; k < out.channels.size(); ++k) add(all.channels[k].values, out.channels[k].values);
}

KeptRun::KeptRun(const KeptRunOptions& options, recording::ResultHeader header, std::string work, const Common& common)
    : options_(options), header_(std::move(header)), work_(header_.generator + "\n" + std::move(work)), regularly_(options.seconds) {
  const std::string& path = options_.output;
  if (path.empty()) return;
  const fs::path folder = fs::absolute(path).parent_path();
  if (!fs::is_directory(folder)) throw InputError({path, 0, 0, {}, fmt::format("the folder {} does not exist", folder.string()), {}});
  if (fs::exists(path)) {
    const recording::Hdf5File file = recording::Hdf5File::open(path);
    const recording::ResultHeader old = recording::read_header(file);
    if (old.filetype != header_.filetype && !options_.overwrite)
      throw InputError({path, 0, 0, {}, fmt::format("is of type '{}'", old.filetype), "another name after -o, or --overwrite"});
    if (options_.overwrite) return;
    auto kept = recording::read_checkpoint(file);
    if (!kept) return;
    if (kept->work != work_)
      throw InputError({path, 0, 0, {},
                        fmt::format("holds an unfinished run of another scenario, method, seed or version ({}, {})", old.scenario_file,
                                    old.generator),
                        "another name after -o, or --overwrite"});
    header_.created = old.created;
    resume_ = std::make_shared<recording::Checkpoint>(std::move(*kept));
    note(common, fmt::format("{} was cut off: going on from there", path));
    return;
  }
  // A place that cannot be written is known before the work, not after it.
  write(nullptr, nullptr, {});
  fs::remove(path);
}

bool KeptRun::asked_to_stop() const { return cli::interrupted(); }

void KeptRun::sample(const std::function<recording::Run()>& samples, const std::function<recording::Checkpoint()>& state) {
  seen_ = true;
  const bool stop = asked_to_stop();
  if (!options_.output.empty() && (stop || regularly_.due())) {
    const recording::Run run = samples();
    recording::Checkpoint c = state();
    c.work = work_;
    write(&run, &c, {});
    regularly_.done();
    kept_until_ = run.time.empty() ? 0.0 : run.time.back();
  }
  stopped_ = stop;
}

void KeptRun::finish(const recording::Run& run) {
  if (!options_.output.empty()) write(&run, nullptr, {});
}

void KeptRun::fail(const recording::Run& until_now, const std::string& why) {
  if (options_.output.empty() || until_now.time.empty()) return;
  try {
    write(&until_now, nullptr, why);
  } catch (const RunError& e) {
    std::fprintf(stderr, "terrode: what there was could not be kept: %s\n", e.what());
  }
}

void KeptRun::interrupted() const {
  if (options_.output.empty()) throw Interrupted("Nothing was kept: name a file with -o to go on later.");
  if (!seen_) throw Interrupted("The run had not begun; nothing was written.");
  throw Interrupted(fmt::format("Its first {:.3g} s are in {}; the same command goes on from there.", kept_until_, options_.output));
}

void KeptRun::write(const recording::Run* run, const recording::Checkpoint* state, const std::string& why) {
  recording::write_atomically(options_.output, false, [&](recording::Hdf5File& file) {
    recording::write_header(file, header_);
    if (!run) return;
    recording::write_series(file, "/run", *run);
    file.set_attribute("/run", "complete", state || !why.empty() ? 0 : 1);
    if (!why.empty()) file.set_attribute("/run", "ended_early", why);
    extra(file);
    if (state) recording::write_checkpoint(file, *state);
  });
}

}  // namespace terrode::cli
