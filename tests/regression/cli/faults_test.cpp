// What the system can do to a run: no room, no permission, no memory, no terminal, nobody who listens. Each is one clear
// line and exit status 1, with earlier results as they were.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/mount.h>

#include <nlohmann/json.hpp>

#include "program.h"
#include "../../sanitized.h"
#include "recording/result_file.h"

namespace terrode {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class Faults : public ProgramTest {
 protected:
  // A file system of its own; false where this user may not mount.
  bool mount_small(const std::string& options) {
    fs::create_directories(file("disk"));
    mounted_ = mount("tmpfs", file("disk").c_str(), "tmpfs", 0, options.c_str()) == 0;
    return mounted_;
  }
  bool make_read_only() { return mount("tmpfs", file("disk").c_str(), "tmpfs", MS_REMOUNT | MS_RDONLY, nullptr) == 0; }
  ~Faults() override {
    if (mounted_) umount2(file("disk").c_str(), MNT_DETACH);
  }
  void expect_one_line(const Outcome& o) {
    EXPECT_EQ(std::count(o.err.begin(), o.err.end(), '\n'), 1) << o.err;
  }

 private:
  bool mounted_ = false;
};

TEST_F(Faults, FullDiskKeepsEarlierResults) {
  if (!mount_small("size=128k")) GTEST_SKIP() << "mounting a small disk needs root";
  const std::string name = scenario(), output = file("disk/o.h5").string();
  ASSERT_EQ(run({"sweep", name, "--method", "steady", "-o", output, "--quiet"}).status, 0);
  const std::string before = content(output);
  for (const std::string command : {"run", "sweep"}) {
    // Some 300 KiB of time series. The sweep goes on in the file that is there, the run takes a name of its own.
    const std::string into = command == "run" ? file("disk/r.h5").string() : output;
    const std::string long_one = scenario("{slips: [0.1, 0.2, 0.3]}", 1.0);
    Outcome o = run({command, long_one, "--method", "node-spring", "-o", into, "--quiet", "--checkpoint", "0"});
    if (command == "sweep" && o.status == 2) o = run({command, long_one, "--method", "node-spring", "-o", into, "--overwrite", "--quiet"});
    EXPECT_EQ(o.status, 1) << command << o.err;
    EXPECT_THAT(o.err, HasSubstr("No space left on device"));
    EXPECT_THAT(o.err, HasSubstr(fs::path(into).filename().string()));
    if (command == "run") {  // a sweep goes on in it: what it held is still read below
      EXPECT_EQ(content(output), before);
    }
    const Outcome kept = run({"export", output, "--to", "csv", "-o", file("kept.csv").string(), "--quiet"});
    EXPECT_EQ(kept.status, 0) << command << kept.err;
    for (const auto& entry : fs::directory_iterator(file("disk")))
      EXPECT_THAT(entry.path().filename().string(), Not(HasSubstr(".part"))) << "left behind";
  }
}

TEST_F(Faults, ReadOnlyDiskIsKnownBeforeTheWork) {
  if (!mount_small("size=1m")) GTEST_SKIP() << "mounting needs root";
  const std::string name = scenario("{slips: [0.1]}", 400.0), output = file("disk/o.h5").string();
  if (!make_read_only()) GTEST_SKIP() << "this system cannot remount";
  for (const std::string command : {"sweep", "run", "drive"}) {
    const std::string what = command == "drive" ? std::string(TERRODE_SOURCE_DIR) + "/scenarios/rover.yaml" : name;
    const Outcome o = run({command, what, "-o", output});  // 400 m would take hours
    EXPECT_EQ(o.status, 1) << command << o.err;
    EXPECT_THAT(o.err, HasSubstr("Read-only file system"));
    expect_one_line(o);
  }
  const Outcome csv = run({"sweep", name, "--method", "steady", "--csv", file("disk/o.csv").string()});
  EXPECT_EQ(csv.status, 1);
  EXPECT_THAT(csv.err, HasSubstr("o.csv: cannot be written: Read-only file system"));
}

TEST_F(Faults, MissingPermission) {
  const std::string name = scenario(), output = file("closed/o.h5").string();
  fs::create_directories(file("closed"));
  ASSERT_EQ(run({"sweep", name, "--method", "steady", "-o", output, "--quiet"}).status, 0);
  const std::string before = content(output);
  fs::permissions(file("closed"), fs::perms::owner_read | fs::perms::owner_exec | fs::perms::others_read | fs::perms::others_exec);
  const auto as_nobody = [] {
    if (getuid() == 0 && (setgid(65534) != 0 || setuid(65534) != 0)) _exit(98);
  };
  const Outcome o = run({"sweep", name, "--method", "steady", "--slip", "0.5", "-o", output}, as_nobody);
  fs::permissions(file("closed"), fs::perms::all);
  if (o.status == 98 || o.status == 99) GTEST_SKIP() << "the program cannot be run as another user here";
  EXPECT_EQ(o.status, 1) << o.err;
  EXPECT_THAT(o.err, HasSubstr("Permission denied"));
  EXPECT_EQ(content(output), before);

  const std::string secret = scenario();
  fs::permissions(secret, fs::perms::none);
  const Outcome read = run({"sweep", secret, "--method", "steady"}, as_nobody);
  EXPECT_EQ(read.status, 2);  // an input that cannot be read is a wrong input
  EXPECT_THAT(read.err, HasSubstr("scenario.yaml: cannot be read: Permission denied"));
}

TEST_F(Faults, OutOfMemoryIsAMessage) {
  if (kSanitized) GTEST_SKIP() << "sanitizers reserve more address space than the limit";
  // A bed of half a million tiles of nodes does not fit into 160 MB, in which the program starts.
  std::string text = content(scenario("{slips: [0.1]}", 50.0));
  const std::string big = text.replace(text.find("node_spacing: 1 cm"), 18, "node_spacing: 0.1 mm");
  const std::string name = write("big.yaml", big).string();
  const Outcome o = run({"sweep", name, "--method", "node-spring", "-j", "1", "--quiet"}, [] { limit(RLIMIT_AS, 160u << 20); });
  EXPECT_EQ(o.status, 1) << o.err;
  EXPECT_THAT(o.err, HasSubstr("not enough memory"));
  // Threads that the system does not give are done without.
  const Outcome threads = run({"sweep", scenario(), "--method", "node-spring", "-j", "512", "--quiet"}, [] { limit(RLIMIT_AS, 300u << 20); });
  EXPECT_EQ(threads.status, 0) << threads.err;
}

TEST_F(Faults, ClosedPipeAndClosedOutput) {
  const std::string name = scenario();
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  close(ends[0]);  // nobody listens
  const Outcome pipe_closed = run({"sweep", name, "--method", "steady", "--json"}, [&] { dup2(ends[1], STDOUT_FILENO); });
  close(ends[1]);
  EXPECT_EQ(pipe_closed.status, 0) << pipe_closed.err;
  EXPECT_EQ(pipe_closed.err, "");
  // Without standard output at all a result file must not take its place.
  const std::string output = file("o.h5").string();
  const Outcome closed = run({"sweep", name, "--method", "steady", "-o", output}, [] {
    close(STDIN_FILENO);
    close(STDOUT_FILENO);
    close(STDERR_FILENO);
  });
  EXPECT_EQ(closed.status, 0);
  EXPECT_EQ(recording::read_result(output, "steady").runs.size(), 2u);
}

TEST_F(Faults, NoTerminalAndNoEnvironment) {
  const Outcome o = run({"sweep", scenario(), "--method", "steady,node-spring", "-o", file("o.h5").string()}, [] {
    setsid();
    clearenv();
    const int null = open("/dev/null", O_RDONLY);
    dup2(null, STDIN_FILENO);
  });
  EXPECT_EQ(o.status, 0) << o.err;
  EXPECT_THAT(o.err, Not(HasSubstr("\033")));
  EXPECT_THAT(o.out, Not(HasSubstr("\033")));
}

TEST_F(Faults, FileBeyondALimit) {
  const std::string name = scenario("{slips: [0.1]}", 0.5), output = file("r.h5").string();
  const Outcome o = run({"run", name, "--slip", "0.2", "-o", output, "--quiet"}, [] { limit(RLIMIT_FSIZE, 20'000); });
  EXPECT_EQ(o.status, 1) << o.err;
  EXPECT_THAT(o.err, HasSubstr("r.h5"));
  EXPECT_THAT(o.err, HasSubstr("File too large"));
}

TEST_F(Faults, PathsThatLeaveTheFolderAreSaid) {
  fs::create_directories(file("in"));
  write("soil.yaml", "bekker: {cohesion: 96.24, friction_angle: 0.606, shear_modulus: 4.534 mm, k: 2.305e4, n: 0.418, plate_width: 5 cm}\n");
  const auto named = [&](const std::string& soil) {
    return write("in/s.yaml", "wheel: {radius: 130 mm, width: 160 mm}\nsoil: " + soil + "\nrig: {normal_load: 115 N}\nsweep: {slips: [0.1]}\n").string();
  };
  const Outcome out = run({"sweep", named("../soil.yaml"), "--method", "steady"});
  EXPECT_EQ(out.status, 0) << out.err;
  EXPECT_THAT(out.err, HasSubstr("outside the folder of this file"));
  fs::copy(file("soil.yaml"), file("in/soil.yaml"));
  EXPECT_THAT(run({"sweep", named("soil.yaml"), "--method", "steady"}).err, Not(HasSubstr("outside")));
  const Outcome device = run({"sweep", named("/dev/zero"), "--method", "steady"});
  EXPECT_EQ(device.status, 2);
  EXPECT_THAT(device.err, HasSubstr("a device or pipe"));
}

TEST_F(Faults, AThousandPointsWithOneThatFails) {
  const auto points = [&](int count) {
    std::string sweep = "{conditions: [";
    for (int i = 0; i < count; ++i)
      sweep += "{slip: " + std::to_string(0.9 * i / count) + ", normal_load: " + (i == count / 2 ? "115 kN" : "115 N") + "}, ";
    return scenario(sweep + "]}");
  };
  const Outcome few = run({"sweep", points(100), "--method", "steady", "-o", file("few.h5").string(), "--json"});
  EXPECT_EQ(few.status, 1);
  const Outcome o = run({"sweep", points(1000), "--method", "steady", "-o", file("o.h5").string(), "--json"});
  EXPECT_EQ(o.status, 1) << o.err;
  expect_one_line(o);
  EXPECT_THAT(o.err, HasSubstr("steady at slip 0.45 failed"));
  EXPECT_THAT(o.err, HasSubstr("115000"));
  const auto document = nlohmann::json::parse(o.out);
  int failed = 0, good = 0;
  for (const auto& p : document["results"][0]["points"]) ++(p.contains("error") ? failed : good);
  EXPECT_EQ(failed, 1);
  EXPECT_EQ(good, 999);
  EXPECT_EQ(recording::read_result(file("o.h5").string(), "steady").runs.size(), 999u);
  // 900 points more: their numbers in columns, document and file, no more. A sanitizer keeps what was freed for a while.
  if (!kSanitized) {
    EXPECT_LT(o.largest_memory - few.largest_memory, 16 * 1024) << "KiB";
  }
}

}  // namespace
}  // namespace terrode
