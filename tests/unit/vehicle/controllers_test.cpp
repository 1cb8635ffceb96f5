// Controllers go on from a state only where it is one of theirs.
#include "vehicle/controllers.h"

#include <gtest/gtest.h>

#include <cmath>

namespace terrode::vehicle {
namespace {

void refuse_wrong_places(Controller& controller, double last) {
  const std::vector<double> good = controller.state();
  EXPECT_NO_THROW(controller.set_state(good));
  for (const double place : {-1.0, std::nan(""), last + 1.0, 1e300}) {
    std::vector<double> wrong = good;
    wrong[0] = place;
    EXPECT_THROW(controller.set_state(wrong), InputError) << place;
  }
  EXPECT_THROW(controller.set_state({}), InputError);
  EXPECT_EQ(controller.state(), good);
}

TEST(Controllers, GoOnOnlyFromPlacesThatThereAre) {
  Manoeuvre m;
  m.duration = 1.0;
  Script script({m, m});
  refuse_wrong_places(script, 2.0);
  PathFollower path({{0.0, 0.0}, {1.0, 0.0}}, {});
  refuse_wrong_places(path, 1.0);
}

}  // namespace
}  // namespace terrode::vehicle
