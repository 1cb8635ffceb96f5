#include "scenario/reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <numbers>

namespace terrode::scenario {
namespace {

using ::testing::HasSubstr;

std::string problem_when_read(const std::string& yaml, ReadLimits limits = {}) {
  try {
    parse_yaml(yaml, "f.yaml", limits);
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

TEST(Reader, ValuesHaveTheirPlace) {
  const Node root = parse_yaml("a: 1\nb:\n  c: [2, 3 mm]\n  d: {e: x}\n", "f.yaml");
  EXPECT_EQ(root.at("a")->text, "1");
  EXPECT_EQ(root.at("b.c[1]")->text, "3 mm");
  EXPECT_EQ(root.at("b.c[1]")->line, 3);
  EXPECT_EQ(root.at("b.c[1]")->column, 10);
  EXPECT_EQ(root.at("b.d.e")->line, 4);
  EXPECT_EQ(root.at("b.nothing.e"), nullptr);
  EXPECT_EQ(root.at("b.c[2]"), nullptr);
}

TEST(Reader, NumbersCarryUnits) {
  const Node root = parse_yaml("r: 130 mm\nw: 17 deg/s\nn: 1.1\n", "f.yaml");
  Source source{"f.yaml", {}, {}};
  MapReader map(root, "", source);
  EXPECT_DOUBLE_EQ(map.number("r", "m").value(), 0.13);
  EXPECT_DOUBLE_EQ(map.number("w", "rad/s").value(), 17.0 * std::numbers::pi / 180.0);
  EXPECT_DOUBLE_EQ(map.number("n", "-").value(), 1.1);
  map.finish();
  EXPECT_TRUE(source.problems.empty());
}

TEST(Reader, SaysEveryProblemAtOnceWithPlaceAndExpectation) {
  const Node root = parse_yaml("radius: 130 kg\nwidth: -1\nmass: .nan\nradus: 2\nplate:\n", "f.yaml");
  Source source{"f.yaml", {}, {}};
  MapReader map(root, "wheel", source);
  EXPECT_FALSE(map.number("radius", "m", above(0)));
  EXPECT_FALSE(map.number("width", "m", above(0)));
  EXPECT_FALSE(map.number("mass", "kg", at_least(0)));
  EXPECT_FALSE(map.number("plate", "m"));
  map.need("load");
  map.finish();
  ASSERT_EQ(source.problems.size(), 6u);
  EXPECT_EQ(source.problems[0].text(),
            "f.yaml:1:9: wheel.radius: is '130 kg', whose unit cannot be converted, expected a value above 0 m");
  EXPECT_EQ(source.problems[1].text(), "f.yaml:2:8: wheel.width: is -1, expected a value above 0 m");
  EXPECT_EQ(source.problems[2].text(),
            "f.yaml:3:7: wheel.mass: is '.nan', not a finite number, expected a value of at least 0 kg");
  EXPECT_THAT(source.problems[3].text(), HasSubstr("wheel.plate: has no value"));
  EXPECT_THAT(source.problems[4].text(), HasSubstr("wheel.load: is missing"));
  EXPECT_EQ(source.problems[5].text(), "f.yaml:4:1: wheel.radus: is not a known key (did you mean 'radius'?)");
}

TEST(Reader, KeepingReaderNotesUnknownKeysAndRefusesNearOnes) {
  const Node root = parse_yaml("slip: 0.1\noperator: Jo\nslpi: 3\n", "f.yaml");
  Source source{"f.yaml", {}, {}};
  MapReader map(root, "", source, MapReader::Unknown::keep);
  map.number("slip", "-");
  const auto kept = map.finish();
  ASSERT_EQ(kept.size(), 1u);
  EXPECT_EQ(kept[0].first, "operator");
  ASSERT_EQ(source.notes.size(), 1u);
  EXPECT_THAT(source.notes[0], HasSubstr("f.yaml:2:1: operator"));
  ASSERT_EQ(source.problems.size(), 1u);
  EXPECT_THAT(source.problems[0].text(), HasSubstr("did you mean 'slip'?"));
}

TEST(Reader, RefusesDuplicateKeys) {
  EXPECT_EQ(problem_when_read("a: 1\nb:\n  c: 2\n  c: 3\n"), "f.yaml:4:3: b.c: is given twice (first in line 3), expected each key once");
}

TEST(Reader, TurnsSyntaxErrorsIntoProblems) {
  EXPECT_THAT(problem_when_read("a: [1, 2\nb: 3\n"), HasSubstr("f.yaml:"));
  EXPECT_THAT(problem_when_read("a: \"open\n"), HasSubstr("is not YAML here"));
  EXPECT_THAT(problem_when_read("a: 1\n---\nb: 2\n"), HasSubstr("a second document"));
  EXPECT_THAT(problem_when_read("a: !!python/object x\n---\n"), HasSubstr("second document"));
  EXPECT_THAT(problem_when_read("a: !mine x\n"), HasSubstr("tag"));
  EXPECT_THAT(problem_when_read(std::string("a: 1\nb\0: 2\n", 11)), HasSubstr("f.yaml:2: holds a zero byte"));
  EXPECT_THAT(problem_when_read("? [a, b]\n: 1\n"), HasSubstr("a key that is not text"));
  EXPECT_THAT(problem_when_read("a: *nowhere\n"), HasSubstr("f.yaml:1"));
}

TEST(Reader, RefusesBombs) {
  std::string deep;
  for (int i = 0; i < 5000; ++i) deep += "[";
  EXPECT_THAT(problem_when_read(deep), HasSubstr("nested more than 32 levels"));
  std::string laughs = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n";
  for (int i = 1; i < 12; ++i) {
    laughs += "a" + std::to_string(i) + ": &a" + std::to_string(i) + " [";
    for (int k = 0; k < 10; ++k) laughs += std::string(k ? "," : "") + "*a" + std::to_string(i - 1);
    laughs += "]\n";
  }
  EXPECT_THAT(problem_when_read(laughs), HasSubstr("more than 200000 values"));
  EXPECT_THAT(problem_when_read("a: &x [*x]\n"), HasSubstr("contains it"));
  ReadLimits few_bytes;
  few_bytes.bytes = 10;
  EXPECT_THAT(problem_when_read("a: 123456789\n", few_bytes), HasSubstr("larger than 10 bytes"));
}

TEST(Reader, FilesThatCannotBeReadSayWhy) {
  EXPECT_THROW(read_yaml("/nowhere/at/all.yaml"), InputError);
  EXPECT_THROW(read_yaml("/tmp"), InputError);
  EXPECT_THROW(read_yaml("/dev/zero"), InputError);
  try {
    read_yaml("/nowhere/at/all.yaml");
  } catch (const InputError& e) {
    EXPECT_STREQ(e.what(), "/nowhere/at/all.yaml: cannot be read: No such file or directory");
  }
}

TEST(Reader, AliasesAreCopies) {
  const Node root = parse_yaml("a: &s {k: 1 mm}\nb: *s\n", "f.yaml");
  EXPECT_EQ(root.at("b.k")->text, "1 mm");
  EXPECT_EQ(root.at("b")->line, 2);
}

TEST(Reader, ChoicesSuggestTheNearest) {
  Source source{"f.yaml", {}, {}};
  const Node root = parse_yaml("m: node-sprng\nf: true\ni: 2.5\n", "f.yaml");
  MapReader map(root, "", source);
  EXPECT_FALSE(map.choice("m", {"steady", "node-spring"}));
  EXPECT_EQ(map.flag("f"), true);
  EXPECT_FALSE(map.integer("i", 0, 10));
  ASSERT_EQ(source.problems.size(), 2u);
  EXPECT_THAT(source.problems[0].text(), HasSubstr("did you mean 'node-spring'?"));
  EXPECT_THAT(source.problems[1].text(), HasSubstr("a whole number from 0 to 10"));
}

TEST(Reader, WritesWhatItReads) {
  const std::string text =
      "title: \"a: b # c\"\nwheel:\n  radius: 130 mm\n  list: [1, -2, \"x, y\"]\nruns:\n  - id: r1\n    slip: -0.5\n"
      "  - id: \"- r2\"\n    none: ~\nempty: {}\nlines: \"one\\ntwo\"\n";
  const Node root = parse_yaml(text, "f.yaml");
  const std::string once = to_yaml(root);
  const Node again = parse_yaml(once, "g.yaml");
  EXPECT_EQ(once, to_yaml(again));
  EXPECT_EQ(again.at("title")->text, "a: b # c");
  EXPECT_EQ(again.at("runs[1].id")->text, "- r2");
  EXPECT_EQ(again.at("lines")->text, "one\ntwo");
  EXPECT_EQ(again.at("wheel.list[2]")->text, "x, y");
}

TEST(Reader, ValidationProblemsFindTheirPlace) {
  const Node root = parse_yaml("soil:\n  bekker:\n    n: -1\n", "f.yaml");
  Problems problems;
  require(problems, "n", -1, "-", false, "above 0");
  require(problems, "cohesion", -1, "Pa", false, "at least 0");
  locate(problems, root, "f.yaml", "soil.bekker");
  EXPECT_EQ(problems[0].line, 3);
  EXPECT_EQ(problems[0].key, "soil.bekker.n");
  EXPECT_EQ(problems[1].line, 3);
}

}  // namespace
}  // namespace terrode::scenario
