#include "recording/columns.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <string>

#include "recording/hdf5_file.h"

namespace terrode::recording {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class ColumnsTest : public testing::Test {
 protected:
  void SetUp() override {
    path_ = (std::filesystem::temp_directory_path() / ("terrode_columns_" + std::to_string(::getpid()) + "_" +
                                                       testing::UnitTest::GetInstance()->current_test_info()->name() + ".h5"))
                .string();
  }
  void TearDown() override { std::filesystem::remove(path_); }
  std::string refusal(const ReadingRule& rule) const {
    try {
      read_columns(path_, rule);
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  }
  std::string path_;
};

TEST_F(ColumnsTest, VectorsOfAnHdf5GroupAreColumns) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  {
    Hdf5File f = Hdf5File::create(path_);
    f.write<double>("/test/time [ms]", std::vector<double>{0, 1000, 2000});
    f.write_grid<double>("/test/drawbar_pull", std::vector<double>{1, kNone, 3}, {1, 3});
    f.set_attribute("/test/drawbar_pull", "units", "kN");
    f.write_grid<double>("/test/map", std::vector<double>(4, 1.0), {2, 2});  // no vector
    f.write<double>("/test/one", std::vector<double>{1});                    // nor this
    f.write_text("/test/names", {"a", "b", "c"});
    f.create_group("/empty");
    f.close();
  }
  ReadingRule rule;
  rule.group = "test";
  const CsvTable table = read_columns(path_, rule);
  ASSERT_EQ(table.columns.size(), 2u);
  EXPECT_EQ(table.rows(), 3u);
  EXPECT_EQ(table.find("drawbar_pull")->unit, "kN");
  EXPECT_EQ(table.find("drawbar_pull")->missing, 1u);
  recording::Run run;
  Problems problems;
  std::vector<Remark> remarks;
  fill_run(table, rule, run, problems, remarks);
  EXPECT_TRUE(problems.empty()) << problems.front().text();
  EXPECT_THAT(run.time, ElementsAre(0.0, 1.0, 2.0));
  EXPECT_EQ(run.find("drawbar_pull")->values[2], 3000.0);
  EXPECT_TRUE(std::isnan(run.find("drawbar_pull")->values[1]));

  rule.group = "/empty";
  EXPECT_THAT(refusal(rule), HasSubstr("has no one-dimensional numeric array in '/empty'"));
  rule.group = "nowhere";
  EXPECT_THAT(refusal(rule), HasSubstr("has no group '/nowhere'"));
}

TEST_F(ColumnsTest, AShorterVectorIsNamedAndFilledUp) {
  {
    Hdf5File f = Hdf5File::create(path_);
    f.write<double>("/time [s]", std::vector<double>{0, 1, 2});
    f.write<double>("/drawbar_pull [N]", std::vector<double>{5, 6});
    f.close();
  }
  const CsvTable table = read_columns(path_, {});
  ASSERT_EQ(table.problems.size(), 1u);
  EXPECT_THAT(table.problems[0].text(), HasSubstr("drawbar_pull: has 2 values, expected 3"));
  ASSERT_EQ(table.find("drawbar_pull")->values.size(), 3u);
  EXPECT_TRUE(std::isnan(table.find("drawbar_pull")->values[2]));
}

CsvTable made_table(std::vector<std::pair<std::string, std::vector<double>>> columns) {
  CsvTable t;
  t.file = "t.csv";
  t.header_line = 1;
  for (auto& [header, values] : columns) {
    const HeaderName h = split_header(header);
    CsvColumn c;
    c.name = h.name;
    c.unit = h.unit;
    c.has_unit = h.has_unit;
    c.values = values;
    t.columns.push_back(std::move(c));
  }
  for (std::size_t i = 0; i < t.columns[0].values.size(); ++i) t.lines.push_back(static_cast<int>(i) + 2);
  return t;
}

// A logger with two clocks: the slower channel is put on the run's times, and nothing is made up outside its own.
TEST(Columns, AChannelWithItsOwnClockIsInterpolated) {
  const CsvTable table = made_table({{"time [s]", {0, 1, 2, 3}}, {"slow clock [s]", {0.5, 2.5, NAN, NAN}}, {"pull [N]", {10, 30, NAN, NAN}}});
  ReadingRule rule;
  ColumnUse time, pull;
  time.channel = time.column = "time";
  pull.channel = channel::drawbar_pull;
  pull.column = "3";
  pull.clock = "slow clock";
  rule.columns = {time, pull};
  recording::Run run;
  Problems problems;
  std::vector<Remark> remarks;
  fill_run(table, rule, run, problems, remarks);
  ASSERT_TRUE(problems.empty()) << problems.front().text();
  const std::vector<double>& got = run.find("drawbar_pull")->values;
  ASSERT_EQ(got.size(), 4u);
  EXPECT_TRUE(std::isnan(got[0]));
  EXPECT_DOUBLE_EQ(got[1], 15.0);
  EXPECT_DOUBLE_EQ(got[2], 25.0);
  EXPECT_TRUE(std::isnan(got[3]));

  rule.columns[1].clock = "no clock";
  fill_run(table, rule, run, problems, remarks);
  ASSERT_EQ(problems.size(), 1u);
  EXPECT_THAT(problems[0].text(), HasSubstr("has no clock column 'no clock'"));
}

TEST(Columns, AMotorsCurrentIsATorque) {
  const CsvTable table = made_table({{"time [s]", {0, 1}}, {"current [mA]", {1000, -2000}}});
  ReadingRule rule;
  ColumnUse torque;
  torque.channel = channel::driving_torque;
  torque.column = "current";
  torque.torque_constant = 2.5;
  torque.sign = -1.0;
  torque.offset = 0.5;
  rule.columns = {torque};
  rule.sample_rate = 10.0;
  recording::Run run;
  Problems problems;
  std::vector<Remark> remarks;
  fill_run(table, rule, run, problems, remarks);
  ASSERT_TRUE(problems.empty()) << problems.front().text();
  EXPECT_THAT(run.time, ElementsAre(0.0, 0.1));
  EXPECT_THAT(run.find("driving_torque")->values, ElementsAre(-2.0, 5.5));
}

TEST(Columns, RulesThatCannotBeAreNamed) {
  ColumnUse use;
  use.channel = channel::drawbar_pull;
  use.sign = 2.0;
  use.scale = 0.0;
  use.torque_constant = 0.0;
  std::string text;
  for (const Problem& p : use.validate()) text += p.text() + "\n";
  for (const char* key : {"sign", "scale", "torque_constant", "only for driving_torque", "column: is empty"})
    EXPECT_THAT(text, HasSubstr(key));
  ReadingRule rule;
  rule.csv.decimal_comma = true;
  rule.csv.separator = ',';
  rule.sample_rate = -1.0;
  rule.columns = {use};
  text.clear();
  for (const Problem& p : rule.validate()) text += p.text() + "\n";
  for (const char* key : {"separator: is a comma", "sample_rate", "columns.drawbar_pull.sign"}) EXPECT_THAT(text, HasSubstr(key));
}

}  // namespace
}  // namespace terrode::recording
