// LIGGGHTS in one process, driven through its C library. Every rank has one; all are given the same orders.
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

namespace terrode::liggghts {

// LIGGGHTS gave up on all ranks; what() is its own message where this rank knows it.
class EngineFailure : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Six velocities a body: of its origin [m/s], angular [rad/s], world axes; and a ball [m] that holds it.
struct BodyMotion {
  double velocity[3], spin[3];
  double centre[3], reach;
};

// Where grains move: from <= x < to [m] and |y| <= side [m], periodic along y over `width`; and, however far out they are
// along x, within `reach` and their own radius of an axis along y through x, z.
struct MovingPart {
  double from, to, side, width;
  struct Axis {
    double x, z, reach;
  };
  std::vector<Axis> axes;
};

class Engine {
 public:
  ~Engine();
  // Runs input lines.
  void commands(const std::string& lines);
  // Forgets everything but variables.
  void forget();
  // Numbers of the group of grains that move and of those that stand still, as input lines make them.
  static constexpr int moving_bit = 1 << 1, standing_bit = 1 << 2;
  // Those grains move from now on, and the others stand.
  void set_moving(const MovingPart& part);
  // `steps` time steps with the bodies moving so. Seven numbers a body: the sum over the steps of force [N] and of moment
  // about the body's origin [N m], and how many grains touch it at the end; then how many grains there are. Known on every
  // rank.
  std::vector<double> run(long steps, const std::vector<BodyMotion>& bodies);
  // Five numbers a grain: its number, centre, radius; rank 0 alone, in no order.
  std::vector<double> grains();

 private:
  void open();
  void command(const char* line);
  void* lammps_ = nullptr;
  bool dead_ = false;  // after a failure; the next order begins anew
  int screen_ = -1;    // file in memory to which it writes what it has to say
};

}  // namespace terrode::liggghts
