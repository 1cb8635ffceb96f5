#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <memory>

#include "cli/terminal.h"
#include "recording/frames.h"
#include "recording/result_file.h"
#include "report/view_page.h"

namespace terrode::cli {
namespace {

struct ViewArguments {
  std::string result, output;
};

void view(const ViewArguments& a, const Common& common) {
  const recording::Hdf5File file = recording::Hdf5File::open(a.result);
  const recording::ResultHeader header = recording::read_header(file);
  if (!recording::FrameReader::has_frames(file))
    throw InputError({a.result, 0, 0, "frames", "are not in the file", "a result of 'terrode run --frames N'"});
  const recording::FrameReader frames(file);
  const recording::Run series = file.is_group("/run") ? recording::read_series(file, "/run") : recording::Run{};
  report::ViewOptions options;
  options.title = header.title.empty() ? std::filesystem::path(a.result).filename().string() : header.title;
  const std::string output = a.output.empty() ? std::filesystem::path(a.result).replace_extension(".html").string() : a.output;
  report::ViewPage page;
  {
    const Progress progress = show_progress(common);
    page = report::view_page(frames, series, options, progress);
  }
  write_text_atomically(output, page.html);
  if (common.json)
    print_json({{"page", output}, {"frames", page.frames}, {"bytes", page.html.size()}});
  else
    std::printf("%s: %zu frames, %.1f MB\n", output.c_str(), page.frames, static_cast<double>(page.html.size()) * 1e-6);
  if (page.every > 1) note(common, fmt::format("one frame in {} is shown, so that the page stays below {} MB", page.every, options.largest / 1'000'000));
}

}  // namespace

void add_view(Command& app, Common& common) {
  Command* command = app.add_subcommand("view", "a self-contained page that plays a run in 3-D");
  const auto a = std::make_shared<ViewArguments>();
  command->add_option("RESULT", a->result, "result file (HDF5) with frames")->required()->type_name("");
  command->add_option("-o,--output", a->output, "page to write (default: the result's name with .html)")->type_name("FILE.html");
  add_common(*command, common, false);
  command->callback([a, &common] { view(*a, common); });
}

}  // namespace terrode::cli
