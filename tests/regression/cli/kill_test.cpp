// A few kills of each kind of long work; kill_long_test.cpp has fifty of each.
#include "killed.h"

namespace terrode {
namespace {

constexpr int kKills = 3;

TEST_F(Killed, SweepGoesOnToTheSameNumbers) { kill_program({"sweep", rig_scenario("node-spring", 0.1)}, kKills); }
TEST_F(Killed, RunGoesOnToTheSameNumbers) { kill_program({"run", rig_scenario("node-spring", 0.4), "--slip", "0.2", "--frames", "5"}, kKills); }
TEST_F(Killed, DriveGoesOnToTheSameNumbers) { kill_program({"drive", drive_scenario(1.0)}, kKills); }
TEST_F(Killed, BedSettlesToTheSameGrains) { kill_settling(0.08, kKills); }

}  // namespace
}  // namespace terrode
