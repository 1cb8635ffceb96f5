// Every group, dataset and attribute of a result file is described in docs/formats.md, and other programs read them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "recording/result_file.h"

namespace {

namespace fs = std::filesystem;
using terrode::recording::Hdf5File;

class ResultLayout : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("terrode_layout_" + std::to_string(::getpid()));
    fs::create_directories(folder_);
    sweep_ = (folder_ / "sweep.h5").string();
    run_ = (folder_ / "run.h5").string();
    const std::string program = TERRODE_PROGRAM;
    std::ofstream(folder_ / "s.yaml") << "wheel: {radius: 0.13, width: 0.16, mass: 3}\n"
                                         "soil: {bekker: {cohesion: 96, friction_angle: 0.6, shear_modulus: 5e-3, k: 2.3e4, n: 0.4, plate_width: 0.05}}\n"
                                         "rig: {normal_load: 115, travel: 0.03, angular_velocity: 0.3}\nterrain: {node_spacing: 1 cm}\n";
    const std::string scenario = (folder_ / "s.yaml").string();
    ASSERT_EQ(std::system((program + " sweep " + scenario + " --method steady,node-spring --slip 0.1 --quiet -o " + sweep_ + " > /dev/null").c_str()), 0);
    ASSERT_EQ(std::system((program + " run " + scenario + " --quiet -o " + run_ + " > /dev/null").c_str()), 0);
  }
  void TearDown() override { fs::remove_all(folder_); }

  fs::path folder_;
  std::string sweep_, run_;
};

std::string documentation() {
  std::ifstream in(fs::path(TERRODE_SOURCE_DIR) / "docs/formats.md");
  std::ostringstream out;
  out << in.rdbuf();
  return out.str();
}

void walk(const Hdf5File& file, const std::string& group, const std::string& docs, std::size_t& arrays) {
  for (const std::string& name : file.children(group)) {
    const std::string path = group == "/" ? "/" + name : group + "/" + name;
    if (file.is_group(path)) {
      walk(file, path, docs, arrays);
      continue;
    }
    ++arrays;
    EXPECT_NE(docs.find("`" + name + "`"), std::string::npos) << path << " is not in docs/formats.md";
    if (!file.is_numeric(path)) continue;
    EXPECT_TRUE(file.text_attribute(path, "unit").has_value()) << path;
    EXPECT_FALSE(file.text_attribute(path, "description").value_or("").empty()) << path;
    for (const std::string& a : file.attributes(path)) EXPECT_TRUE(a == "unit" || a == "description") << path << " " << a;
  }
}

TEST_F(ResultLayout, IsTheOneThatIsDocumented) {
  const std::string docs = documentation();
  ASSERT_FALSE(docs.empty());
  for (const std::string& name : {sweep_, run_}) {
    const Hdf5File file = Hdf5File::open(name);
    for (const std::string& a : file.attributes("/"))
      EXPECT_NE(docs.find("`" + a + "`"), std::string::npos) << a << " is not in docs/formats.md";
    for (const char* a : {"filetype", "generator", "created", "scenario_text", "slip_convention"})
      EXPECT_FALSE(file.text_attribute("/", a).value_or("").empty()) << a;
    EXPECT_EQ(file.numbers_attribute("/", "schema_version")->size(), 2u);
    std::size_t arrays = 0;
    walk(file, "/", docs, arrays);
    EXPECT_GT(arrays, 10u);
  }
}

TEST_F(ResultLayout, IsReadByH5py) {
  std::string python;
  for (const char* candidate : {"python3", "/usr/bin/python3"})
    if (python.empty() && std::system((std::string(candidate) + " -c 'import h5py' 2> /dev/null").c_str()) == 0) python = candidate;
  if (python.empty()) GTEST_SKIP() << "python3-h5py is not installed";
  std::ofstream(folder_ / "read.py") << R"(
import h5py, sys
def text(value): return value.decode() if isinstance(value, bytes) else str(value)
with h5py.File(sys.argv[1]) as f:
    assert text(f.attrs['filetype']) == 'terrode sweep'
    assert 'radius' in text(f.attrs['scenario_text'])
    table = f['sweep/node-spring']
    pull = table['drawbar_pull']
    assert pull.dtype == 'float64' and pull.shape == (1,), pull
    assert text(pull.attrs['unit']) == 'N' and len(pull.attrs['description']) > 5
    assert abs(table['normal_load'][0] - 115) < 1
    series = table['runs/0000']
    assert series['time'].shape == series['drawbar_pull'].shape
    assert text(table['error'][0]) == ''
with h5py.File(sys.argv[2]) as f:
    assert text(f['run/time'].attrs['unit']) == 's'
    assert f['run'].attrs['normal_load'] == 115
)";
  EXPECT_EQ(std::system((python + " " + (folder_ / "read.py").string() + " " + sweep_ + " " + run_).c_str()), 0);
}

}  // namespace
