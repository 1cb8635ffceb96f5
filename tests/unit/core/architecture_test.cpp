// The direction of dependencies: every #include of src/ must follow an arrow that CMakeLists.txt declares, and the
// libraries with a room of their own (ODE, HDF5, matio, YAML, MPI, LIGGGHTS) must be seen there alone.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <regex>
#include <set>
#include <sstream>

namespace {

std::map<std::string, std::set<std::string>> declared_arrows() {
  std::map<std::string, std::set<std::string>> out;
  std::istringstream list(TERRODE_ARROWS);
  for (std::string entry; list >> entry;) {
    const auto colon = entry.find(':');
    const std::string room = entry.substr(0, colon);
    out[room].insert(room);
    std::istringstream deps(entry.substr(colon + 1));
    for (std::string dep; std::getline(deps, dep, ',');) out[room].insert(dep);
  }
  return out;
}

struct Include {
  std::string file, room, target;
};

std::vector<Include> includes() {
  std::vector<Include> out;
  const std::filesystem::path src = std::filesystem::path(TERRODE_SOURCE_DIR) / "src";
  const std::regex pattern("^\\s*#\\s*include\\s*[<\"]([^>\"]+)[>\"]");
  for (const auto& entry : std::filesystem::recursive_directory_iterator(src)) {
    if (!entry.is_regular_file() || (entry.path().extension() != ".h" && entry.path().extension() != ".cpp")) continue;
    const auto relative = std::filesystem::relative(entry.path(), src);
    std::ifstream in(entry.path());
    std::smatch m;
    for (std::string line; std::getline(in, line);)
      if (std::regex_search(line, m, pattern)) out.push_back({relative.string(), relative.begin()->string(), m[1]});
  }
  return out;
}

TEST(Architecture, IncludesFollowTheDeclaredArrows) {
  const auto arrows = declared_arrows();
  ASSERT_GE(arrows.size(), 14u);
  size_t checked = 0;
  for (const Include& i : includes()) {
    const auto slash = i.target.find('/');
    if (slash == std::string::npos) continue;
    const std::string target_room = i.target.substr(0, slash);
    if (!arrows.contains(target_room)) continue;
    ++checked;
    EXPECT_TRUE(arrows.at(i.room).contains(target_room)) << i.file << " includes " << i.target;
  }
  EXPECT_GT(checked, 5u);
}

TEST(Architecture, ArrowsHaveNoCycle) {
  const auto arrows = declared_arrows();
  std::map<std::string, int> state;
  std::function<void(const std::string&)> visit = [&](const std::string& room) {
    ASSERT_NE(state[room], 1) << "cycle through " << room;
    if (state[room] == 2) return;
    state[room] = 1;
    for (const std::string& dep : arrows.at(room))
      if (dep != room) visit(dep);
    state[room] = 2;
  };
  for (const auto& [room, deps] : arrows) visit(room);
}

TEST(Architecture, LibrariesAreSeenFromTheirRoomAlone) {
  const std::map<std::string, std::string> owner = {{"ode/", "multibody"},    {"hdf5.h", "recording"}, {"H5", "recording"},
                                                    {"matio.h", "recording"}, {"yaml-cpp/", "scenario"}, {"CLI/", "cli"},
                                                    {"mpi.h", "liggghts"},    {"liggghts/library.h", "liggghts"}};
  for (const Include& i : includes())
    for (const auto& [prefix, room] : owner)
      if (i.target.starts_with(prefix)) { EXPECT_EQ(i.room, room) << i.file << " includes " << i.target; }
}

}  // namespace
