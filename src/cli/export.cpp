#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <memory>

#include "cli/sweep_result.h"
#include "cli/terminal.h"
#include "recording/result_file.h"
#include "report/vtk.h"

namespace terrode::cli {
namespace {

struct ExportArguments {
  std::string result, format = "csv", output;
};

void export_csv(const ExportArguments& a) {
  const recording::Hdf5File file = recording::Hdf5File::open(a.result);
  recording::read_header(file);
  std::string text;
  if (file.is_group("/run")) {
    text = recording::series_csv(recording::read_series(file, "/run"));
  } else {
    std::vector<MethodResult> results;
    for (const std::string& method : recording::result_methods(file))
      results.push_back({method, from_table(recording::read_table(file, "/sweep/" + method))});
    text = sweep_csv(results);
  }
  if (a.output.empty())
    std::fwrite(text.data(), 1, text.size(), stdout);
  else
    write_text_atomically(a.output, text);
}

void export_vtk(const ExportArguments& a, const Common& common) {
  const recording::Hdf5File file = recording::Hdf5File::open(a.result);
  recording::read_header(file);
  if (!recording::FrameReader::has_frames(file))
    throw InputError({a.result, 0, 0, "frames", "are not in the file", "a result of 'terrode run --frames N'"});
  const recording::FrameReader frames(file);
  std::filesystem::path output = a.output;
  if (output.empty()) output = std::filesystem::path(a.result).replace_extension(".pvd");
  std::vector<std::filesystem::path> written;
  {
    const Progress progress = show_progress(common);
    written = report::write_vtk(frames, output, progress);
  }
  if (common.json)
    print_json({{"file", written.back().string()}, {"frames", frames.count()}, {"files", written.size()}});
  else
    std::printf("%s: %zu frames in %zu files\n", written.back().string().c_str(), frames.count(), written.size());
}

}  // namespace

void add_export(Command& app, Common& common) {
  Command* command = app.add_subcommand("export", "a result for spreadsheets (csv), its frames for ParaView (vtk)");
  const auto a = std::make_shared<ExportArguments>();
  const std::vector<std::string> formats = {"csv", "vtk"};
  command->add_option("RESULT", a->result, "result file (HDF5)")->required()->type_name("");
  command->add_option("--to", a->format, "csv, vtk")->required()->check(is_member(formats))->type_name("FORMAT");
  command->add_option("-o,--output", a->output, "file to write (default: csv to standard output, vtk beside the result with .pvd)")->type_name("FILE");
  common.words["export --to"] = formats;
  add_common(*command, common, false);
  command->callback([a, &common] { a->format == "vtk" ? export_vtk(*a, common) : export_csv(*a); });
}

}  // namespace terrode::cli
