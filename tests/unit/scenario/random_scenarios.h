// Random scenarios, in the ranges of the literature and far outside them: each gives finite numbers or a clear refusal.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <time.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "core/progress.h"
#include "core/random.h"
#include "scenario/methods.h"
#include "scenario/scenario.h"

namespace terrode::scenario {

struct Tally {
  int results = 0, refused = 0, failed = 0, stopped = 0;
  double longest = 0.0;  // s of computing, of one scenario

  void print() const {
    fmt::print("{} results, {} refused, {} failed, {} stopped; the longest took {:.2f} s\n", results, refused, failed, stopped, longest);
  }
};

// A value between lo and hi, evenly in its logarithm; in one of four wild scenarios it is anything.
inline std::string any_value(Random& r, double lo, double hi, bool wild) {
  if (wild && r.below(4) == 0) {
    const char* odd[] = {"0", "-1", "1e300", "1e-300", "-1e-9", ".inf", "1e18", "5e-324", "nonsense", "1e9"};
    if (r.below(3) == 0) return odd[r.below(std::size(odd))];
    return fmt::format("{:.6g}", std::exp(r.uniform(std::log(lo * 1e-6), std::log(hi * 1e6))));
  }
  return fmt::format("{:.6g}", std::exp(r.uniform(std::log(lo), std::log(hi))));
}

// Ranges: soils of Wong (2010) tables 2.3 and 2.4 and of lunar and Martian simulants; wheels from laboratory to tractor.
inline std::string random_scenario(Random& r, const std::string& method) {
  const bool wild = r.below(2) == 0;
  const auto v = [&](double lo, double hi) { return any_value(r, lo, hi, wild); };
  const double slip = r.uniform(-0.95, 0.95), radius = std::exp(r.uniform(std::log(0.03), std::log(1.0)));
  std::string text = fmt::format("wheel: {{radius: {}, width: {}{}}}\n", wild ? v(0.03, 1.0) : fmt::format("{}", radius), v(0.02, 0.6),
                                 r.below(3) == 0 ? fmt::format(", grousers: {{count: {}, height: {}}}", r.below(30), v(1e-3, 0.03)) : "");
  text += fmt::format("soil:\n  bekker: {{cohesion: {}, friction_angle: {}, shear_modulus: {}, n: {}, ", v(1, 5e4), v(0.1, 0.8), v(5e-4, 0.06),
                      v(0.2, 1.8));
  text += r.below(2) == 0 ? fmt::format("k: {}, plate_width: {}}}\n", v(1e3, 1e7), v(0.01, 0.3))
                          : fmt::format("kc: {}, kphi: {}}}\n", v(1, 1e5), v(1e4, 1e7));
  text += fmt::format("  contact: {{a0: {}, a1: {}, theta_r: {}}}\n", v(0.05, 0.6), v(0.05, 0.6), r.below(2) ? "0" : "-" + v(0.01, 0.3));
  text += fmt::format("rig: {{normal_load: {}, angular_velocity: {}, travel: {}, time_step: {}}}\n", v(5, 2e4), v(0.05, 5),
                      fmt::format("{:.4g}", 0.05 * radius), v(5e-4, 5e-3));
  if (method != "steady") text += fmt::format("terrain: {{node_spacing: {}}}\n", v(radius / 30, radius / 8));
  text += fmt::format("sweep: {{slips: [{}]}}\n", wild && r.below(6) == 0 ? v(0.01, 1) : fmt::format("{:.4g}", slip));
  return text;
}

// Seconds this thread has computed, which other work on the machine does not lengthen.
inline double computed() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

// Runs scenario number `i` of a seed. A run that computes longer than `seconds` is stopped, which counts as neither.
inline void try_scenario(std::uint64_t seed, std::uint64_t i, const std::string& method, double seconds, Tally& tally) {
  Random random = Random::stream(seed, i);
  const std::string text = random_scenario(random, method);
  SCOPED_TRACE(fmt::format("scenario {} of seed {}:\n{}", i, seed, text));
  const double begin = computed();
  Progress progress;
  progress.stop_requested = [&] { return computed() - begin > seconds; };
  try {
    const Scenario s = parse_scenario(text, "random.yaml");
    const vehicle::SweepMethod m = make_method(method, s);
    for (const OperatingPoint& at : s.operating_points()) {
      const vehicle::PointResult result = m.run(condition_of(at, s.wheel.radius), progress);
      for (const auto& [name, value] : result.run.steady) EXPECT_TRUE(std::isfinite(value.mean)) << name << " " << value.mean;
      EXPECT_TRUE(!result.run.steady.empty() || !result.run.time.empty());
      for (const recording::Channel& c : result.run.channels)
        for (const double x : c.values)
          if (!std::isfinite(x)) {
            ADD_FAILURE() << c.name << " is " << x;
            break;
          }
    }
    ++tally.results;
  } catch (const InputError& e) {
    ++tally.refused;
    EXPECT_FALSE(e.problems().empty());
    for (const Problem& p : e.problems()) EXPECT_GT(p.message.size() + p.expected.size(), 4u);
  } catch (const RunError& e) {
    ++tally.failed;
    EXPECT_GT(std::string(e.what()).size(), 20u) << e.what();
  } catch (const Interrupted&) {
    ++tally.stopped;
  } catch (const std::exception& e) {
    ADD_FAILURE() << "neither a result nor a clear refusal: " << e.what();
  }
  tally.longest = std::max(tally.longest, computed() - begin);
}

}  // namespace terrode::scenario
