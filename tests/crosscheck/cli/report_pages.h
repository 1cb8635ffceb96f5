// Reports of every command that writes one, made by the program in a folder, with what it printed beside them.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

namespace terrode::cli {

struct ReportPage {
  std::string html;
  nlohmann::json printed;
};

inline std::string text_of(const std::filesystem::path& path) {
  std::ifstream in(path);
  return {std::istreambuf_iterator<char>(in), {}};
}

inline bool has_option(const std::string& command, const std::string& option) {
  return std::system((std::string(TERRODE_PROGRAM) + " " + command + " --help 2>&1 | grep -q -- '" + option + "'").c_str()) == 0;
}

// By the name of the command. `drive`, which simulates for seconds, only where asked for.
inline std::map<std::string, ReportPage> make_reports(const std::filesystem::path& folder, bool with_drive) {
  namespace fs = std::filesystem;
  const std::string source = TERRODE_SOURCE_DIR;
  std::map<std::string, ReportPage> out;
  const auto make = [&](const std::string& name, const std::string& arguments, const std::string& page) {
    const std::string command = "cd " + folder.string() + " && " + TERRODE_PROGRAM + " " + arguments + " --json --quiet > " + name + ".json 2> " + name + ".err";
    if (std::system(command.c_str()) != 0) {
      ADD_FAILURE() << "terrode " << arguments << "\n" << text_of(folder / (name + ".err"));
      return;
    }
    out[name] = {text_of(folder / page), nlohmann::json::parse(text_of(folder / (name + ".json")))};
  };
  make("sweep", "sweep " + source + "/scenarios/ding2011.yaml --method steady -o o.h5 --report sweep.html", "sweep.html");
  make("compare", "compare o.h5 " + source + "/recordings/ding2011 --method steady --report compare.html", "compare.html");
  make("calibrate", "calibrate " + source + "/recordings/ding2011 --to wheel --no-profiles --starts 4 --report calibrate.html", "calibrate.html");
  make("diagnose", "diagnose " + source + "/recordings/ding2011 -o d", "d/report.html");
  std::ofstream table(folder / "tone.csv");
  table << "time [s],drawbar_pull [N]\n";
  for (int i = 0; i < 1500; ++i) table << 0.02 * i << "," << 20 + 3 * std::sin(2 * M_PI * 0.8 * 0.02 * i) + 0.3 * std::sin(0.7 * i * i) << "\n";
  table.close();
  make("oscillation", "oscillation tone.csv --radius 0.13 --angular-velocity 0.3 --slip 0.2 --report oscillation.html", "oscillation.html");
  if (with_drive && has_option("drive", "--report"))
    make("drive", "drive " + source + "/scenarios/robot.yaml --report drive.html", "drive.html");
  return out;
}

}  // namespace terrode::cli
