#include "recording/csv.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace terrode::recording {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TEST(Csv, ReadsHeaderWithUnits) {
  const CsvTable t = parse_csv("time [s],drawbar_pull [N], sinkage [mm],marker\n0.0,1.5, -2e1,3\n0.1,+1.25,5,4\n", "a.csv");
  ASSERT_TRUE(t.problems.empty());
  ASSERT_EQ(t.columns.size(), 4u);
  EXPECT_EQ(t.columns[1].name, "drawbar_pull");
  EXPECT_EQ(t.columns[1].unit, "N");
  EXPECT_TRUE(t.columns[1].has_unit);
  EXPECT_FALSE(t.columns[3].has_unit);
  EXPECT_THAT(t.find("drawbar_pull")->values, ElementsAre(1.5, 1.25));
  EXPECT_THAT(t.find("sinkage")->values, ElementsAre(-20.0, 5.0));
  EXPECT_THAT(t.lines, ElementsAre(2, 3));
  EXPECT_EQ(t.find("nothing"), nullptr);
}

TEST(Csv, TakesLineEndingsMarksQuotesAndOpenEnds) {
  const CsvTable t = parse_csv("\xef\xbb\xbf\"time [s]\";\"a, b [N/m^2]\";\r\n\r\n\"1\";2;\r\n3;4;", "a.csv");
  EXPECT_TRUE(t.problems.empty()) << t.problems[0].text();
  EXPECT_EQ(t.separator, ';');
  ASSERT_EQ(t.columns.size(), 2u);
  EXPECT_EQ(t.columns[1].name, "a, b");
  EXPECT_THAT(t.columns[0].values, ElementsAre(1.0, 3.0));
  EXPECT_THAT(t.lines, ElementsAre(3, 4));
}

TEST(Csv, ReadsDecimalCommaSkippedRowsAndNoHeader) {
  const CsvTable t = parse_csv("made by rig 7\n# note\n0,5;1,25\n1;-3,5e-1\n", "a.csv",
                               {.decimal_comma = true, .header = false, .skip_rows = 1, .comment = '#'});
  EXPECT_TRUE(t.problems.empty());
  ASSERT_EQ(t.columns.size(), 2u);
  EXPECT_EQ(t.columns[1].name, "2");
  EXPECT_THAT(t.columns[1].values, ElementsAre(1.25, -0.35));
  EXPECT_THAT(t.lines, ElementsAre(3, 4));
  const CsvTable blanks = parse_csv("  1   2\n 3\t4 \n", "a.txt", {.separator = ' ', .header = false});
  EXPECT_THAT(blanks.columns[1].values, ElementsAre(2.0, 4.0));
}

TEST(Csv, CountsMissingCellsAndNamesBadOnes) {
  const CsvTable t = parse_csv("a,b\n1,\n2,NaN\n3,inf\n4,x1\n5,\"n/a\"\n6,0x10\n7,1e400\n", "a.csv");
  EXPECT_TRUE(t.problems.empty());
  const CsvColumn& b = t.columns[1];
  EXPECT_EQ(b.missing, 3u);
  EXPECT_EQ(b.bad_count, 4u);
  ASSERT_EQ(b.bad.size(), 4u);
  EXPECT_EQ(b.bad[0].line, 4);
  EXPECT_EQ(b.bad[0].column, 3);
  EXPECT_EQ(b.bad[0].text, "inf");
  for (const double v : b.values) EXPECT_TRUE(std::isnan(v));
  EXPECT_THAT(t.cell_problems(b)[1].text(), HasSubstr("a.csv:5:3: b: is 'x1'"));
}

TEST(Csv, PointsToTheDecimalComma) {
  const CsvTable t = parse_csv("a;b\n1,5;2\n", "a.csv");
  EXPECT_THAT(t.cell_problems(t.columns[0])[0].text(), HasSubstr("decimal comma"));
  const CsvTable mixed = parse_csv("a;b\n1.234,5;2\n", "a.csv", {.decimal_comma = true});
  EXPECT_EQ(mixed.columns[0].bad_count, 1u) << "a thousands separator must not be guessed";
}

TEST(Csv, FindsWhatIsWrongWithRowsAndHeaders) {
  const CsvTable t = parse_csv("a,b,b\n1,2,3\n1,2\n1,2,3,4\n1,\"2,3\n", "a.csv");
  ASSERT_EQ(t.problems.size(), 4u);
  EXPECT_THAT(t.problems[0].text(), HasSubstr("a.csv:1:5: b: names two columns"));
  EXPECT_THAT(t.problems[1].text(), HasSubstr("a.csv:3: has 2 cells, expected 3"));
  EXPECT_THAT(t.problems[2].text(), HasSubstr("a.csv:4: has 4 cells"));
  EXPECT_THAT(t.problems[3].text(), HasSubstr("a.csv:5: has a quote"));
  EXPECT_EQ(t.rows(), 4u);
  for (const CsvColumn& c : t.columns) EXPECT_EQ(c.values.size(), 4u);
  EXPECT_THAT(parse_csv("1,2\n3,4\n", "a.csv").problems.at(0).text(), HasSubstr("not names"));
  EXPECT_THAT(parse_csv("a,b\n", "a.csv").problems.at(0).text(), HasSubstr("no rows"));
}

TEST(Csv, RefusesWhatIsNoTable) {
  EXPECT_THROW(parse_csv("", "a.csv"), InputError);
  EXPECT_THROW(parse_csv("\n\n  \n", "a.csv"), InputError);
  EXPECT_THROW(parse_csv(std::string_view("a\0b", 3), "a.csv"), InputError);
  EXPECT_THROW(parse_csv("\xff\xfe" "a", "a.csv"), InputError);
  EXPECT_THROW(parse_csv("a\n1\n", "a.csv", {.skip_rows = 5}), InputError);
  EXPECT_THROW(parse_csv("a\n1\n2\n3\n", "a.csv", {.max_rows = 2}), InputError);
  EXPECT_THROW(parse_csv("a,b,c\n1,2,3\n", "a.csv", {.max_columns = 2}), InputError);
  EXPECT_THROW(read_csv("/nowhere/a.csv"), InputError);
  EXPECT_THROW(read_csv("/tmp"), InputError);
}

TEST(Csv, ManyBadRowsAreCountedNotListed) {
  std::string text = "a,b\n";
  for (int i = 0; i < 1000; ++i) text += "1\n";
  const CsvTable t = parse_csv(text, "a.csv");
  EXPECT_LT(t.problems.size(), 20u);
  EXPECT_THAT(t.problems.back().text(), HasSubstr("990 more rows"));
}

}  // namespace
}  // namespace terrode::recording
