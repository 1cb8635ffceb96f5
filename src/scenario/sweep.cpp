#include "scenario/sweep.h"

#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <mutex>

#include "bekker/steady_wheel.h"
#include "core/parallel.h"

namespace terrode::scenario {
namespace {

double thread_cpu_seconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

// A method made ready for one scenario; compute() may be called from several threads at once.
class Method {
 public:
  virtual ~Method() = default;
  virtual void compute(SweepPoint& point, const Progress& progress) const = 0;
};

class SteadyMethod : public Method {
 public:
  explicit SteadyMethod(const Scenario& s) : wheel_(s.wheel_size(), s.bekker_soil(), s.contact_angles()), travel_(s.rig.travel) {}

  void compute(SweepPoint& point, const Progress&) const override {
    bekker::Operating operating;
    operating.slip = point.at.slip;
    operating.normal_load = point.at.normal_load;
    operating.angular_velocity = point.at.angular_velocity;
    if (std::isinf(operating.slip)) {
      operating.angular_velocity = 0.0;
      operating.forward_velocity = point.at.angular_velocity * wheel_.wheel().radius;
      point.remarks.push_back("locked wheel: dragged at angular_velocity times radius");
    }
    operating.pass = point.at.pass;
    operating.travel_length = travel_;
    operating.position = travel_ / 2;
    const bekker::SteadyState s = wheel_.solve(operating);
    point.drawbar_pull = s.drawbar_pull;
    point.driving_torque = s.driving_torque;
    point.sinkage = s.sinkage;
    point.normal_load = s.normal_load;
    point.entry_angle = s.entry_angle;
    if (s.peak_clamped) point.remarks.push_back("the angle of the stress peak lay outside the contact and was moved to its nearer end");
  }

 private:
  bekker::SteadyWheel wheel_;
  double travel_;
};

std::unique_ptr<Method> make_method(const std::string& name, const Scenario& scenario) {
  if (name == "steady") return std::make_unique<SteadyMethod>(scenario);
  throw InputError({scenario.file, 0, 0, "method", fmt::format("is '{}', which cannot be computed yet", name), "steady"});
}

}  // namespace

bool same_point(const OperatingPoint& a, const OperatingPoint& b) {
  return a.slip == b.slip && a.normal_load == b.normal_load && a.angular_velocity == b.angular_velocity && a.pass == b.pass;
}

std::vector<MethodResult> run_sweep(const Scenario& scenario, const SweepTask& task) {
  std::vector<std::unique_ptr<Method>> methods;
  std::vector<MethodResult> out;
  struct Work {
    std::size_t method, point;
  };
  std::vector<Work> work;
  for (std::size_t m = 0; m < task.methods.size(); ++m) {
    methods.push_back(make_method(task.methods[m], scenario));
    out.push_back({task.methods[m], {}});
    for (std::size_t p = 0; p < task.points.size(); ++p) {
      const SweepPoint* known = task.known ? task.known(task.methods[m], task.points[p]) : nullptr;
      if (known) {
        out[m].points.push_back(*known);
        out[m].points.back().at = task.points[p];
      } else {
        out[m].points.emplace_back();
        out[m].points.back().at = task.points[p];
        work.push_back({m, p});
      }
    }
  }

  std::mutex mutex;
  std::vector<double> fraction(work.size(), 0.0);
  std::size_t done = 0;
  std::atomic<bool> stopped = false;
  parallel_for(work.size(), task.threads, [&](std::size_t i) {
    if (stopped || task.progress.stop_requested()) {
      stopped = true;
      return;
    }
    const Work w = work[i];
    SweepPoint point = out[w.method].points[w.point];
    const std::string what = fmt::format("{} at slip {:g}", task.methods[w.method], point.at.slip_given);
    Progress progress;
    progress.stop_requested = task.progress.stop_requested;
    progress.report = [&](double f, const std::string&) {
      double total = 0.0;
      {
        const std::lock_guard lock(mutex);
        fraction[i] = f;
        for (const double x : fraction) total += x;
      }
      task.progress.report(total / static_cast<double>(work.size()), what);
    };
    const double start = thread_cpu_seconds();
    try {
      methods[w.method]->compute(point, progress);
    } catch (const Interrupted&) {
      stopped = true;
      return;
    } catch (const std::exception& e) {
      point = SweepPoint{};
      point.at = task.points[w.point];
      point.error = e.what();
    }
    point.cpu_seconds = thread_cpu_seconds() - start;
    {
      const std::lock_guard lock(mutex);
      ++done;
      out[w.method].points[w.point] = point;
      try {
        if (task.finished) task.finished(w.method, w.point, point);
      } catch (...) {
        stopped = true;
        throw;
      }
    }
    progress.report(1.0, what);
  });
  if (stopped) throw Interrupted(fmt::format("{} of {} points were computed.", done, work.size()));
  return out;
}

}  // namespace terrode::scenario
