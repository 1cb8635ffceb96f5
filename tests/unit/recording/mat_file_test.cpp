#include "recording/mat_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <matio.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "recording/columns.h"

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

}  // namespace
}  // namespace terrode::recording
