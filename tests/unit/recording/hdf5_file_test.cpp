#include "recording/hdf5_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>

namespace terrode::recording {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class Hdf5FileTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() /
              ("terrode_hdf5_" + std::to_string(::getpid()) + "_" +
               testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::string at(const char* name) const { return (folder_ / name).string(); }
  std::filesystem::path folder_;
};

TEST_F(Hdf5FileTest, KeepsArraysOfEveryTypeAndRank) {
  {
    Hdf5File f = Hdf5File::create(at("a.h5"));
    f.write<double>("/run/x", std::vector<double>{1.5, -2.0, 1e300});
    f.write_grid<float>("/run/grid", std::vector<float>{1, 2, 3, 4, 5, 6}, {2, 3}, {.compression = 4});
    f.write<int>("/ids", std::vector<int>{-1, 7});
    f.write<std::int64_t>("/long", std::vector<std::int64_t>{1LL << 40});
    f.write_grid<std::uint8_t>("/cube", std::vector<std::uint8_t>(8, 9), {2, 2, 2});
    f.write_grid<double>("/small", std::vector<double>{0.1}, {1}, {.keep_float = true});
    f.write<double>("/empty", std::vector<double>{});
    f.write_text("/names", {"a", "", "μ-long"});
    f.close();
  }
  const Hdf5File f = Hdf5File::open(at("a.h5"));
  EXPECT_THAT(f.read<double>("/run/x").values, ElementsAre(1.5, -2.0, 1e300));
  EXPECT_THAT(f.read<double>("/run/grid").shape, ElementsAre(2u, 3u));
  EXPECT_THAT(f.read_rows<float>("/run/grid", 1, 5).values, ElementsAre(4.f, 5.f, 6.f));
  EXPECT_THAT(f.read<int>("/ids").values, ElementsAre(-1, 7));
  EXPECT_THAT(f.read<std::int64_t>("/long").values, ElementsAre(1LL << 40));
  EXPECT_THAT(f.shape("/cube"), ElementsAre(2u, 2u, 2u));
  EXPECT_EQ(f.read<double>("/small").values[0], static_cast<double>(0.1f));
  EXPECT_TRUE(f.read<double>("/empty").values.empty());
  EXPECT_THAT(f.read_text("/names"), ElementsAre("a", "", "μ-long"));
  EXPECT_THAT(f.children("/"), ElementsAre("cube", "empty", "ids", "long", "names", "run", "small"));
  EXPECT_TRUE(f.is_group("/run"));
  EXPECT_TRUE(f.is_array("/run/x"));
  EXPECT_FALSE(f.exists("/nowhere/deep"));
}

TEST_F(Hdf5FileTest, KeepsAttributes) {
  {
    Hdf5File f = Hdf5File::create(at("a.h5"));
    f.create_group("/run/deep");
    f.set_attribute("/", "title", "Größe");
    f.set_attribute("/", "title", "replaced");
    f.set_attribute("/run", "empty", "");
    f.set_attribute("/run", "radius", 0.13);
    f.set_attribute("/run", "count", 24);
    f.set_attribute("/run", "vector", std::vector<double>{1, 2, 3});
  }
  const Hdf5File f = Hdf5File::open(at("a.h5"));
  EXPECT_EQ(f.text_attribute("/", "title"), "replaced");
  EXPECT_EQ(f.text_attribute("/run", "empty"), "");
  EXPECT_EQ(f.number_attribute("/run", "radius"), 0.13);
  EXPECT_EQ(f.number_attribute("/run", "count"), 24.0);
  EXPECT_THAT(*f.numbers_attribute("/run", "vector"), ElementsAre(1, 2, 3));
  EXPECT_FALSE(f.number_attribute("/run", "missing"));
  EXPECT_FALSE(f.number_attribute("/", "title"));
  EXPECT_THAT(f.attributes("/run"), ElementsAre("count", "empty", "radius", "vector"));
}

TEST_F(Hdf5FileTest, AppendsRows) {
  Hdf5File f = Hdf5File::create(at("a.h5"));
  f.write<double>("/t", std::vector<double>{}, {.extendible = true});
  f.write_grid<float>("/p", std::vector<float>{}, {0, 3}, {.compression = 1, .extendible = true});
  f.start_appending();
  EXPECT_THROW(f.create_group("/late"), RunError);
  EXPECT_THROW(f.append<float>("/p", std::vector<float>{1, 2}), RunError);
  for (int i = 0; i < 1000; ++i) {
    f.append<double>("/t", std::vector<double>{0.1 * i, 0.1 * i + 0.05});
    f.append<float>("/p", std::vector<float>{1, 2, static_cast<float>(i)});
  }
  f.flush();
  // A second reader sees what was flushed while the writer still holds the file.
  EXPECT_THAT(Hdf5File::open(at("a.h5")).shape("/t"), ElementsAre(2000u));
  f.close();
  const Hdf5File r = Hdf5File::open(at("a.h5"));
  EXPECT_THAT(r.shape("/p"), ElementsAre(1000u, 3u));
  EXPECT_EQ(r.read<double>("/t").values[1999], 0.1 * 999 + 0.05);
  EXPECT_EQ(r.read_rows<float>("/p", 999, 1).values[2], 999.f);
}

TEST_F(Hdf5FileTest, KilledWriterLeavesAReadableFile) {
  const std::string path = at("killed.h5");
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    Hdf5File f = Hdf5File::create(path);
    f.write<double>("/t", std::vector<double>{}, {.compression = 1, .extendible = true, .chunk_rows = 16});
    f.start_appending();
    for (int i = 0; i < 500; ++i) f.append<double>("/t", std::vector<double>{1.0 * i});
    f.flush();
    for (int i = 500; i < 777; ++i) f.append<double>("/t", std::vector<double>{1.0 * i});
    ::kill(::getpid(), SIGKILL);
    ::_exit(0);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFSIGNALED(status));
  const Hdf5File f = Hdf5File::open(path);
  const auto t = f.read<double>("/t").values;
  ASSERT_GE(t.size(), 500u);
  for (std::size_t i = 0; i < 500; ++i) ASSERT_EQ(t[i], static_cast<double>(i));
}

TEST_F(Hdf5FileTest, AtomicWritingKeepsTheOldFileOnFailure) {
  const std::string path = at("sweep.h5");
  write_atomically(path, true, [](Hdf5File& f) { f.write<int>("/point0", std::vector<int>{0}); });
  write_atomically(path, true, [](Hdf5File& f) { f.write<int>("/point1", std::vector<int>{1}); });
  EXPECT_THROW(write_atomically(path, true,
                                [](Hdf5File& f) {
                                  f.write<int>("/point2", std::vector<int>{2});
                                  throw RunError("diverged");
                                }),
               RunError);
  EXPECT_THAT(Hdf5File::open(path).children("/"), ElementsAre("point0", "point1"));
  write_atomically(path, false, [](Hdf5File& f) { f.create_group("/new"); });
  EXPECT_THAT(Hdf5File::open(path).children("/"), ElementsAre("new"));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_), {}), 1) << "temporary files are left";
}

TEST_F(Hdf5FileTest, SaysWhatIsWrong) {
  std::ofstream(at("text.h5")) << "not hdf5";
  EXPECT_THROW(Hdf5File::open(at("missing.h5")), InputError);
  EXPECT_THROW(Hdf5File::open(at("text.h5")), InputError);
  EXPECT_THROW(Hdf5File::open(folder_.string()), InputError);
  EXPECT_THROW(Hdf5File::create("/nowhere/deep/a.h5"), RunError);
  Hdf5File f = Hdf5File::create(at("a.h5"));
  f.write_text("/names", {"a"});
  f.write<int>("/fixed", std::vector<int>{1});
  EXPECT_THROW(f.read<double>("/names"), RunError);
  EXPECT_THROW(f.read_text("/fixed"), RunError);
  EXPECT_THROW(f.append<int>("/fixed", std::vector<int>{1}), RunError);
  EXPECT_THROW(f.write<int>("/fixed", std::vector<int>{1}), RunError) << "an array may not be written twice";
  EXPECT_THROW(f.write_grid<int>("/shape", std::vector<int>{1, 2, 3}, {2, 2}), RunError);
  try {
    f.read<double>("/absent");
    FAIL();
  } catch (const RunError& e) {
    EXPECT_THAT(e.what(), HasSubstr("a.h5"));
    EXPECT_THAT(e.what(), HasSubstr("/absent"));
  }
  f.close();
  EXPECT_THROW(f.flush(), RunError);
}

}  // namespace
}  // namespace terrode::recording
