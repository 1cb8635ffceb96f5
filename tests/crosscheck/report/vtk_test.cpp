// Reads exported files back with VTK itself; skipped where python3-vtk9 is not installed.
#include "report/vtk.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "frames_example.h"

namespace terrode::report {
namespace {

namespace fs = std::filesystem;

TEST(Vtk, ReadsBackWhatWasWritten) {
  const fs::path folder = fs::temp_directory_path() / ("terrode-vtk-" + std::to_string(getpid()));
  fs::create_directories(folder);
  {
    auto file = recording::Hdf5File::create((folder / "run.h5").string());
    write_example(file, 3, true);
    file.close();
  }
  const auto file = recording::Hdf5File::open((folder / "run.h5").string());
  const recording::FrameReader reader(file);
  const auto written = write_vtk(reader, folder / "out.pvd");
  ASSERT_EQ(written.size(), 3u * 4u + 1u);
  std::ifstream pvd(folder / "out.pvd");
  std::stringstream text;
  text << pvd.rdbuf();
  EXPECT_NE(text.str().find("timestep=\"0.1\""), std::string::npos);
  EXPECT_NE(text.str().find("file=\"out_frames/ground_0002.vts\""), std::string::npos);

  if (std::system("/usr/bin/python3 -c 'import vtk' 2>/dev/null") != 0) {
    fs::remove_all(folder);
    GTEST_SKIP() << "python3-vtk9 is not installed: the files are not read back by VTK";
  }
  // Frame 2 of the example: the wheel's centre at x = 0.2, one node 20 mm deep, 1e4 Pa there.
  const char* script = R"(
import sys, vtk
folder = sys.argv[1]
def read(kind, name):
    r = kind(); r.SetFileName(folder + '/out_frames/' + name); r.Update()
    assert r.GetErrorCode() == 0, name
    return r.GetOutput()
g = read(vtk.vtkXMLStructuredGridReader, 'ground_0002.vts')
assert g.GetDimensions() == (21, 11, 1), g.GetDimensions()
s = g.GetPointData().GetArray('sinkage')
assert abs(s.GetRange()[1] - 0.02) < 1e-6 and abs(s.GetTuple1(5 * 21 + 10) - 0.02) < 1e-6, s.GetRange()
assert abs(g.GetPointData().GetArray('pressure').GetRange()[1] - 1e4) < 1e-2
b = read(vtk.vtkXMLPolyDataReader, 'bodies_0002.vtp')
bounds = b.GetBounds()
assert abs(0.5 * (bounds[0] + bounds[1]) - 0.2) < 1e-3 and abs(bounds[3] - 0.08) < 1e-6, bounds
f = read(vtk.vtkXMLPolyDataReader, 'forces_0002.vtp')
assert f.GetPointData().GetArray('force').GetTuple3(0) == (10.0, 0.0, 80.0)
p = read(vtk.vtkXMLPolyDataReader, 'particles_0002.vtp')
assert p.GetNumberOfPoints() == 50 and p.GetNumberOfVerts() == 50
assert p.GetPointData().GetArray('radius').GetTuple1(7) > 0
)";
  std::ofstream(folder / "read.py") << script;
  EXPECT_EQ(std::system(("/usr/bin/python3 " + (folder / "read.py").string() + " " + folder.string()).c_str()), 0);
  fs::remove_all(folder);
}

TEST(Vtk, SaysWhenItCannotBeWritten) {
  const fs::path path = fs::temp_directory_path() / ("terrode-vtk-" + std::to_string(getpid()) + ".h5");
  {
    auto file = recording::Hdf5File::create(path.string());
    write_example(file, 2, false);
    file.close();
  }
  const auto file = recording::Hdf5File::open(path.string());
  const recording::FrameReader reader(file);
  EXPECT_THROW(write_vtk(reader, "/proc/nowhere/out.pvd"), RunError);
  fs::remove(path);
}

}  // namespace
}  // namespace terrode::report
