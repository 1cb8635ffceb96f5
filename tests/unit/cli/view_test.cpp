// `terrode view` and `terrode export --to vtk` on a result file made here.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "recording/frames.h"
#include "recording/result_file.h"

namespace {

namespace fs = std::filesystem;
using namespace terrode;
using namespace terrode::recording;

class ResultWithFrames : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("terrode-view-cli-" + std::to_string(getpid()));
    fs::create_directories(folder_);
    Hdf5File file = Hdf5File::create((folder_ / "run.h5").string());
    ResultHeader header = ResultHeader::now("terrode run");
    header.title = "A run";
    write_header(file, header);
    recording::Run series;
    series.time = {0.0, 0.1, 0.2};
    series.channels = {{"drawbar_pull", "N", {1.0, 2.0, 3.0}}};
    write_series(file, "/run", series);
    FrameLayout layout;
    FrameBody wheel;
    wheel.name = "wheel";
    wheel.radius = 0.1;
    wheel.width = 0.1;
    layout.bodies = {wheel};
    FrameWriter writer(file, layout);
    for (double t : {0.0, 0.1, 0.2}) {
      Frame frame;
      frame.time = t;
      frame.bodies.resize(1);
      writer.append(frame);
    }
    file.close();
    Hdf5File bare = Hdf5File::create((folder_ / "bare.h5").string());
    write_header(bare, header);
    bare.close();
  }
  void TearDown() override { fs::remove_all(folder_); }

  int run(const std::string& arguments) {
    const int status = std::system(("cd " + folder_.string() + " && " TERRODE_PROGRAM " " + arguments + " > out 2> err").c_str());
    return WEXITSTATUS(status);
  }
  std::string read(const std::string& name) {
    std::ifstream in(folder_ / name);
    std::stringstream text;
    text << in.rdbuf();
    return text.str();
  }
  fs::path folder_;
};

TEST_F(ResultWithFrames, ViewWritesAPage) {
  ASSERT_EQ(run("view run.h5"), 0) << read("err");
  EXPECT_NE(read("out").find("run.html: 3 frames"), std::string::npos);
  const std::string page = read("run.html");
  EXPECT_NE(page.find("<title>A run</title>"), std::string::npos);
  EXPECT_NE(page.find("\"label\":\"Drawbar pull\""), std::string::npos);
  EXPECT_EQ(run("view run.h5 -o other.html --json"), 0);
  EXPECT_NE(read("out").find("\"page\": \"other.html\""), std::string::npos);
}

TEST_F(ResultWithFrames, ExportWritesVtk) {
  ASSERT_EQ(run("export run.h5 --to vtk"), 0) << read("err");
  EXPECT_NE(read("run.pvd").find("run_frames/bodies_0002.vtp"), std::string::npos);
  EXPECT_TRUE(fs::exists(folder_ / "run_frames" / "forces_0000.vtp"));
}

TEST_F(ResultWithFrames, WithoutFramesBothSaySo) {
  for (const char* command : {"view bare.h5", "export bare.h5 --to vtk"}) {
    EXPECT_EQ(run(command), 2);
    EXPECT_NE(read("err").find("bare.h5: frames: are not in the file"), std::string::npos) << read("err");
  }
  EXPECT_EQ(run("view missing.h5"), 2);
}

}  // namespace
