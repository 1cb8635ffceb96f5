// Fifty kills each of a sweep, a run, a drive and a settling bed, at random moments.
#include "killed.h"

namespace terrode {
namespace {

constexpr int kKills = 50;

TEST_F(Killed, SweepFiftyTimes) { kill_program({"sweep", rig_scenario("node-spring", 0.3)}, kKills); }
TEST_F(Killed, RunFiftyTimes) { kill_program({"run", rig_scenario("node-spring", 1.0), "--slip", "0.2", "--frames", "20"}, kKills); }
TEST_F(Killed, DriveFiftyTimes) { kill_program({"drive", drive_scenario(2.0)}, kKills); }
TEST_F(Killed, BedFiftyTimes) { kill_settling(0.08, kKills); }

}  // namespace
}  // namespace terrode
