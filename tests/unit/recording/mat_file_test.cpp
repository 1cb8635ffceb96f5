#include "recording/mat_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>
#include <matio.h>
#include <unistd.h>
#include <zlib.h>

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "recording/columns.h"
#include "recording/hdf5_file.h"
#include "recording/mat_check.h"

namespace terrode::recording {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

void put_vector(mat_t* file, const char* name, std::vector<double> values, bool row) {
  std::size_t dims[2] = {row ? 1 : values.size(), row ? values.size() : 1};
  matvar_t* v = Mat_VarCreate(name, MAT_C_DOUBLE, MAT_T_DOUBLE, 2, dims, values.data(), 0);
  ASSERT_EQ(Mat_VarWrite(file, v, MAT_COMPRESSION_NONE), 0);
  Mat_VarFree(v);
}

void put_text(mat_t* file, const char* name, std::string text) {
  std::size_t dims[2] = {1, text.size()};
  matvar_t* v = Mat_VarCreate(name, MAT_C_CHAR, MAT_T_UTF8, 2, dims, text.data(), 0);
  ASSERT_EQ(Mat_VarWrite(file, v, MAT_COMPRESSION_NONE), 0);
  Mat_VarFree(v);
}

class MatFileTest : public testing::TestWithParam<mat_ft> {
 protected:
  void SetUp() override {
    path_ = (std::filesystem::temp_directory_path() / ("terrode_mat_" + std::to_string(::getpid()) + ".mat")).string();
  }
  void TearDown() override { std::filesystem::remove(path_); }
  std::string path_;
};

TEST_P(MatFileTest, ReadsVectorsAndUnits) {
  mat_t* file = Mat_CreateVer(path_.c_str(), nullptr, GetParam());
  ASSERT_NE(file, nullptr);
  put_vector(file, "time", {0, 0.1, 0.2}, false);
  put_vector(file, "drawbar_pull", {1, 2, 3}, true);
  put_text(file, "time_unit", "s");
  put_text(file, "drawbar_pull_unit", "kN");
  float matrix[6] = {1, 2, 3, 4, 5, 6};
  std::size_t dims[2] = {3, 2};
  matvar_t* v = Mat_VarCreate("gauge", MAT_C_SINGLE, MAT_T_SINGLE, 2, dims, matrix, 0);
  ASSERT_EQ(Mat_VarWrite(file, v, MAT_COMPRESSION_ZLIB), 0);
  Mat_VarFree(v);
  Mat_Close(file);

  const CsvTable t = read_mat_columns(path_, "");
  EXPECT_THAT(t.find("time")->values, ElementsAre(0, 0.1, 0.2));
  EXPECT_EQ(t.find("drawbar_pull")->unit, "kN");
  EXPECT_THAT(t.find("gauge_2")->values, ElementsAre(4, 5, 6));
  recording::Run run;
  Problems problems;
  std::vector<Remark> remarks;
  fill_run(t, {}, run, problems, remarks);
  ASSERT_TRUE(problems.empty()) << problems[0].text();
  EXPECT_THAT(run.find("drawbar_pull")->values, ElementsAre(1000, 2000, 3000));
}

TEST_P(MatFileTest, ReadsAStructure) {
  mat_t* file = Mat_CreateVer(path_.c_str(), nullptr, GetParam());
  const char* fields[2] = {"time", "fx"};
  std::size_t one[2] = {1, 1}, dims[2] = {3, 1};
  matvar_t* s = Mat_VarCreateStruct("data", 2, one, fields, 2);
  double t[3] = {0, 1, 2}, fx[3] = {5, 6, 7};
  Mat_VarSetStructFieldByName(s, "time", 0, Mat_VarCreate("time", MAT_C_DOUBLE, MAT_T_DOUBLE, 2, dims, t, 0));
  Mat_VarSetStructFieldByName(s, "fx", 0, Mat_VarCreate("fx", MAT_C_DOUBLE, MAT_T_DOUBLE, 2, dims, fx, 0));
  ASSERT_EQ(Mat_VarWrite(file, s, MAT_COMPRESSION_NONE), 0);
  Mat_VarFree(s);
  Mat_Close(file);
  EXPECT_THAT(read_mat_columns(path_, "").find("fx")->values, ElementsAre(5, 6, 7));
  EXPECT_THAT(read_mat_columns(path_, "data").find("time")->values, ElementsAre(0, 1, 2));
  EXPECT_THROW(read_mat_columns(path_, "nothing"), InputError);
}

INSTANTIATE_TEST_SUITE_P(Versions, MatFileTest, testing::Values(MAT_FT_MAT5, MAT_FT_MAT73));

TEST(MatFile, SaysWhatIsWrong) {
  EXPECT_THROW(read_mat_columns("/nowhere/a.mat", ""), InputError);
  const std::string path = (std::filesystem::temp_directory_path() / ("terrode_nomat_" + std::to_string(::getpid()) + ".mat")).string();
  std::ofstream(path) << "this is no MATLAB file, but it is long enough to have a header of one hundred and twenty-eight bytes, which the "
                         "library looks at first.......................";
  EXPECT_THROW(read_mat_columns(path, ""), InputError);
  std::filesystem::remove(path);
}

// Files put together by hand, to say what is not so. MAT-File Format (The MathWorks), chapter 1.
class HostileMat : public testing::Test {
 protected:
  ~HostileMat() override { std::filesystem::remove(path_); }

  static std::string words(const std::vector<std::uint32_t>& w) { return {reinterpret_cast<const char*>(w.data()), 4 * w.size()}; }
  static std::string element(std::uint32_t type, std::string bytes) {
    const std::string tag = words({type, static_cast<std::uint32_t>(bytes.size())});
    bytes.resize((bytes.size() + 7) / 8 * 8);
    return tag + bytes;
  }
  static std::string array(std::uint32_t kind, const std::vector<std::uint32_t>& dims, const std::string& name, const std::string& rest) {
    return element(14, element(6, words({kind, 0})) + element(5, words(dims)) + element(1, name) + rest);
  }
  static std::string doubles(std::size_t count) { return element(9, std::string(8 * count, '\0')); }
  static std::string packed(const std::string& raw) {
    std::string out(compressBound(raw.size()), '\0');
    uLongf size = out.size();
    compress(reinterpret_cast<Bytef*>(out.data()), &size, reinterpret_cast<const Bytef*>(raw.data()), raw.size());
    out.resize(size);
    return words({15, static_cast<std::uint32_t>(size)}) + out;
  }
  // What reading a file with these variables says.
  std::string said(const std::string& variables) {
    std::string header(116, ' ');
    header += std::string(8, '\0') + std::string("\x00\x01IM", 4);
    std::ofstream(path_, std::ios::binary) << header << variables;
    return said();
  }
  std::string said() {
    try {
      const CsvTable t = read_mat_columns(path_, "");
      return std::to_string(t.columns.size()) + " columns of " + std::to_string(t.rows());
    } catch (const InputError& e) {
      return e.what();
    }
  }
  std::string path_ = (std::filesystem::temp_directory_path() / ("terrode_hostile_" + std::to_string(::getpid()) + ".mat")).string();
};

TEST_F(HostileMat, SoundOnesAreRead) {
  EXPECT_EQ(said(array(6, {3, 1}, "x", doubles(3)) + packed(array(6, {3, 1}, "y", doubles(3)))), "2 columns of 3");
  // Objects of MATLAB (those of classdef have no dimensions) and a sparse matrix are passed over.
  const std::string opaque = element(14, element(6, words({17, 0})) + element(1, "object") + element(1, "MCOS") + element(1, "string"));
  EXPECT_EQ(said(array(6, {3, 1}, "x", doubles(3)) + packed(opaque) + packed(array(3, {9, 9}, "old", "")) + array(5, {1u << 30, 1u << 30}, "s", "")),
            "1 columns of 3");
}

TEST_F(HostileMat, MoreValuesDeclaredThanThere) {
  for (const bool pack : {false, true}) {
    const auto put = [&](const std::string& v) { return said(pack ? packed(v) : v); };
    EXPECT_THAT(put(array(6, {500'000'000, 4}, "x", doubles(2))), HasSubstr("2000000000 values with 16 bytes"));
    EXPECT_THAT(put(array(6, {0x7fffffff, 0x7fffffff}, "x", doubles(2))), HasSubstr("dimensions beyond any file"));
    EXPECT_THAT(put(array(1, {1u << 28, 1}, "c", array(6, {2, 1}, "", doubles(2)))), HasSubstr("more elements than it has bytes"));
    const std::string fields = words({0x00040005, 8}) + element(1, std::string("a\0\0\0\0\0\0\0b\0\0\0\0\0\0\0", 16));
    EXPECT_THAT(put(array(2, {1u << 30, 1}, "s", fields)), HasSubstr("too many elements"));
    EXPECT_THAT(put(array(2, {1, 1}, "s", fields + array(6, {1u << 29, 1}, "", doubles(1)))), HasSubstr("536870912 values with 8 bytes"));
    EXPECT_THAT(put(array(4, {1, 1u << 30}, "x_unit", element(16, "m"))), HasSubstr("1073741824 values with 1 bytes"));
  }
  EXPECT_THAT(said(words({14, 0xfffffff0}) + array(6, {2, 1}, "x", doubles(2))), HasSubstr("without its kind"));
  EXPECT_THAT(said(words({15, 0xfffffff0}) + "x"), HasSubstr("it ends in the middle"));
  EXPECT_THAT(said(array(6, {3, 1}, "x", words({9, 24}) + "12345678")), HasSubstr("longer than the one that holds it"));
}

TEST_F(HostileMat, StructuresWithoutEnd) {
  std::string nested = array(6, {2, 1}, "", doubles(2));
  for (int depth = 0; depth < 40; ++depth) nested = array(1, {1, 1}, depth == 39 ? "c" : "", nested);
  EXPECT_THAT(said(nested), HasSubstr("deeper than 16"));
}

TEST_F(HostileMat, OlderVersionsAreRefused) {
  std::ofstream(path_, std::ios::binary) << words({0, 1, 1, 0, 2}) << std::string("x\0", 2) << std::string(8, '\0');
  EXPECT_THAT(said(), HasSubstr("-v7.3"));
}

// The same of a file of version 7.3, which is HDF5 behind 512 bytes of header.
TEST_F(HostileMat, Hdf5Inside) {
  const auto put = [&](const auto& fill) {
    const hid_t plan = H5Pcreate(H5P_FILE_CREATE);
    H5Pset_userblock(plan, 512);
    const hid_t file = H5Fcreate(path_.c_str(), H5F_ACC_TRUNC, plan, H5P_DEFAULT);
    fill(file);
    H5Fclose(file);
    H5Pclose(plan);
    std::string header(116, ' ');
    header += std::string(8, '\0') + std::string("\x00\x02IM", 4);
    std::fstream(path_, std::ios::binary | std::ios::in | std::ios::out) << header;
    return said();
  };
  const auto label = [](hid_t array, const char* kind) {
    const hid_t type = H5Tcopy(H5T_C_S1), space = H5Screate(H5S_SCALAR);
    H5Tset_size(type, std::strlen(kind));
    const hid_t attribute = H5Acreate2(array, "MATLAB_class", type, space, H5P_DEFAULT, H5P_DEFAULT);
    H5Awrite(attribute, type, kind);
    H5Aclose(attribute), H5Sclose(space), H5Tclose(type);
  };
  const auto declared = [&](hid_t file, hid_t type, hsize_t count, const char* kind) {
    const hid_t space = H5Screate_simple(1, &count, nullptr);
    const hid_t array = H5Dcreate2(file, "x", type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    label(array, kind);
    H5Sclose(space);
    return array;
  };
  EXPECT_THAT(put([&](hid_t file) { H5Dclose(declared(file, H5T_IEEE_F64LE, 100'000'000, "double")); }), HasSubstr("more than its bytes can hold"));
  EXPECT_THAT(put([&](hid_t file) { H5Dclose(declared(file, H5T_IEEE_F64LE, hsize_t{1} << 60, "double")); }), HasSubstr("too many values"));
  EXPECT_THAT(put([&](hid_t file) { H5Lcreate_external("other.mat", "/x", file, "x", H5P_DEFAULT, H5P_DEFAULT); }), HasSubstr("lead elsewhere"));
  EXPECT_THAT(put([&](hid_t file) {
                const hid_t cell = declared(file, H5T_STD_REF_OBJ, 1, "cell");  // a cell array that holds itself
                hobj_ref_t itself = 0;
                H5Rcreate(&itself, file, "x", H5R_OBJECT, -1);
                H5Dwrite(cell, H5T_STD_REF_OBJ, H5S_ALL, H5S_ALL, H5P_DEFAULT, &itself);
                H5Dclose(cell);
              }),
              HasSubstr("deeper than 16"));
  // Files that are no MATLAB files declare too.
  put([&](hid_t file) { H5Dclose(declared(file, H5T_IEEE_F64LE, 100'000'000, "double")); });
  const Hdf5File file = Hdf5File::open(path_);
  EXPECT_THROW((void)file.read<double>("/x"), RunError);
}

// Files that MATLAB itself wrote, where Debian's SciPy has brought those of its own tests: not one is refused.
TEST(MatFile, FilesThatMatlabWrotePass) {
  const std::filesystem::path folder = "/usr/lib/python3/dist-packages/scipy/io/matlab/tests/data";
  if (!std::filesystem::is_directory(folder)) GTEST_SKIP() << folder << " is not there";
  int checked = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (!name.ends_with(".mat") || name.find("_4") != std::string::npos) continue;  // version 4 is refused
    if (!name.ends_with("_SOL2.mat") && name.find("_GLNX86") == std::string::npos) continue;
    EXPECT_NO_THROW(check_mat_file(entry.path().string())) << name;
    ++checked;
  }
  EXPECT_GT(checked, 50);
}

// Files of fewer than 400 bytes that made the library clear gigabytes, one of them by a variable of no kind that there is.
TEST(MatFile, SmallFilesThatAskedForGigabytes) {
  for (const char* name : {"claims_too_much", "unknown_kind"})
    EXPECT_THROW(check_mat_file(std::string(TERRODE_SOURCE_DIR) + "/fuzz/seeds/mat/" + name), InputError) << name;
}

}  // namespace
}  // namespace terrode::recording
