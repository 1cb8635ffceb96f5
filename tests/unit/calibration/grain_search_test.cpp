// The search for grain parameters on a made-up laboratory whose curves are closed forms with noise: what it asks for, that
// it finds what is hidden, and what it says about what cannot be found. On particles: tests/analytic/calibration/grain_search_long_test.cpp.
#include "calibration/grain_search.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.h"

namespace terrode::calibration {
namespace {

// Two shear tests and a plate; stiffness by young_modulus, strength by friction and a little by rolling_friction.
// restitution does nothing. Whole curves scatter by 6 percent.
std::vector<std::vector<double>> laboratory(const std::vector<TestTarget>& targets, const GrainValues& v, std::uint64_t seed, double scatter = 0.06) {
  Random random = Random::stream(5, seed);
  std::vector<std::vector<double>> out;
  for (const TestTarget& t : targets) {
    const double level = std::exp(scatter * random.normal()), y = v.at("young_modulus") / 3e6, r = v.at("rolling_friction");
    std::vector<double> curve;
    for (const double x : t.at) {
      if (t.test == "direct_shear") {
        const double strength = t.normal_stress * (0.2 + 0.9 * std::sqrt(v.at("friction")) + 0.25 * std::log1p(5 * r));
        curve.push_back(level * strength * -std::expm1(-x / (1.5e-3 * std::pow(y, -0.4))));
      } else {
        curve.push_back(level * 3e5 * std::pow(y, 0.3) * (0.3 + v.at("friction")) * (0.2 + r) * std::pow(x / 0.03, 0.9));
      }
    }
    out.push_back(curve);
  }
  return out;
}

std::vector<TestTarget> targets(const GrainValues& hidden, int repeats = 4) {
  std::vector<TestTarget> all(3);
  all[0].normal_stress = 2000, all[1].normal_stress = 8000;
  for (int i = 0; i < 3; ++i) {
    TestTarget& t = all[static_cast<std::size_t>(i)];
    t.test = i < 2 ? "direct_shear" : "pressure_sinkage";
    if (i == 2) t.plate_width = t.plate_length = 0.03;
    for (int k = 1; k <= 12; ++k) t.at.push_back(5e-3 * k / 12);
    t.measured.assign(12, 0.0);
    t.repeats = repeats;
    t.level_deviation = 0.06 / std::sqrt(static_cast<double>(repeats));
    t.tilt_deviation = 0.01;
  }
  for (int r = 0; r < repeats; ++r) {
    const auto curves = laboratory(all, hidden, 900000 + static_cast<std::uint64_t>(r));
    for (std::size_t t = 0; t < 3; ++t)
      for (std::size_t i = 0; i < 12; ++i) all[t].measured[i] += curves[t][i] / repeats;
  }
  for (TestTarget& t : all) {
    double square = 0;
    for (const double v : t.measured) square += v * v / 12;
    t.scale = std::sqrt(square);
  }
  return all;
}

const GrainValues kHidden = {{"young_modulus", 1.2e7}, {"friction", 0.35}, {"rolling_friction", 0.5}};

std::vector<Evaluation> search(const GrainSearch& s, std::size_t most = 1000) {
  std::vector<Evaluation> done;
  for (;;) {
    std::vector<Evaluation> batch = s.next(done);
    if (batch.empty() || done.size() >= most) return done;
    for (Evaluation& e : batch) {
      e.curves = laboratory(s.targets(), s.values(e.unit), e.seed);
      done.push_back(e);
    }
  }
}

// Misfit without noise.
double true_misfit(const GrainSearch& s, const Eigen::VectorXd& unit) {
  const auto curves = laboratory(s.targets(), s.values(unit), 1, 0.0);
  auto exact = targets(kHidden);
  const auto hidden = laboratory(exact, kHidden, 1, 0.0);
  for (std::size_t t = 0; t < exact.size(); ++t) exact[t].measured = hidden[t];
  return (target_vector(exact, curves) - target_vector(exact)).squaredNorm();
}

TEST(GrainSearch, RecoversHiddenParametersWithinItsIntervals) {
  const GrainSearch s(targets(kHidden), {});
  const std::vector<Evaluation> done = search(s);
  ASSERT_EQ(done.size(), 40u);
  const SearchResult r = s.result(done);
  for (const Estimate& e : r.estimates) {
    EXPECT_LE(e.low, kHidden.at(e.name)) << e.name;
    EXPECT_GE(e.high, kHidden.at(e.name)) << e.name;
    EXPECT_TRUE(e.identified) << e.name;
  }
  EXPECT_EQ(r.confirmations, 4);
  // Within their scatter: the root mean square of standardised differences of a dozen correlated points stays below 2.
  for (const double z : r.standardised) EXPECT_LT(z, 2.0);
  EXPECT_LT(r.leave_one_out, 1.6);
  EXPECT_FALSE(r.front.empty());
  for (std::size_t i = 1; i < r.front.size(); ++i) {
    EXPECT_GE(r.front[i].misfit.shear, r.front[i - 1].misfit.shear);
    EXPECT_LT(r.front[i].misfit.plates, r.front[i - 1].misfit.plates);
  }
}

TEST(GrainSearch, BeatsRandomSearchAndSimplexOnTheSameBudget) {
  // The geometric mean over a few seeds of the true misfit at what each recommends after 20 evaluations.
  double log_misfit[3] = {0, 0, 0};
  constexpr int kSeeds = 3;
  for (int method = 0; method < 3; ++method)
    for (int seed = 1; seed <= kSeeds; ++seed) {
      SearchOptions o;
      o.evaluations = {20};
      o.confirmations = 0;
      o.method = static_cast<SearchMethod>(method);
      o.seed = static_cast<std::uint64_t>(seed);
      const GrainSearch s(targets(kHidden, 16), o);
      log_misfit[method] += std::log(true_misfit(s, s.result(search(s)).best)) / kSeeds;
    }
  EXPECT_LT(log_misfit[0], log_misfit[1] - std::log(2.0)) << "random search";
  EXPECT_LT(log_misfit[0], log_misfit[2]) << "simplex";
}

TEST(GrainSearch, SaysWhatTheTestsDoNotSee) {
  SearchOptions o;
  o.free = {{"young_modulus"}, {"restitution"}};
  o.evaluations = {16};
  o.confirmations = 0;
  auto t = targets(kHidden);
  const GrainSearch s(t, o);
  std::vector<Evaluation> done;
  for (;;) {
    auto batch = s.next(done);
    if (batch.empty()) break;
    for (Evaluation& e : batch) {
      GrainValues v = kHidden;
      for (const auto& [name, value] : s.values(e.unit)) v[name] = value;
      e.curves = laboratory(t, v, e.seed);
      done.push_back(e);
    }
  }
  const SearchResult r = s.result(done);
  EXPECT_TRUE(r.find("young_modulus")->identified);
  EXPECT_FALSE(r.find("restitution")->identified);
  bool told = false;
  for (const Warning& w : r.warnings) told = told || (w.id == "not_identified" && w.parameter == "restitution");
  EXPECT_TRUE(told);
}

TEST(GrainSearch, GoesOnFromWhatIsThereAsIfItHadNotStopped) {
  for (const SearchMethod method : {SearchMethod::surrogate, SearchMethod::random, SearchMethod::simplex}) {
    SearchOptions o;
    o.method = method;
    o.evaluations = {16};
    const GrainSearch s(targets(kHidden), o);
    const std::vector<Evaluation> done = search(s);
    // From the last batch that was asked for anew.
    for (std::size_t begin = 0; begin < done.size();) {
      const auto again = s.next({done.begin(), done.begin() + static_cast<std::ptrdiff_t>(begin)});
      ASSERT_FALSE(again.empty());
      for (std::size_t i = 0; i < again.size(); ++i) {
        EXPECT_EQ(again[i].seed, done[begin + i].seed);
        EXPECT_TRUE(again[i].unit == done[begin + i].unit);
      }
      begin += again.size();
    }
  }
}

TEST(GrainSearch, EverySeedIsUsedOnceAndPlacesStayInRange) {
  SearchOptions o;
  o.free = {{"friction", 0.3, 0.8}, {"rolling_friction"}, {"young_modulus"}};
  o.evaluations = {14};
  const GrainSearch s(targets(kHidden), o);
  std::vector<std::uint64_t> seeds;
  for (const Evaluation& e : search(s)) {
    seeds.push_back(e.seed);
    const double friction = s.values(e.unit).at("friction");
    EXPECT_GE(friction, 0.3);
    EXPECT_LE(friction, 0.8);
  }
  std::sort(seeds.begin(), seeds.end());
  EXPECT_TRUE(std::adjacent_find(seeds.begin(), seeds.end()) == seeds.end());
}

TEST(GrainSearch, ACheapBedHelpsADearOne) {
  // The dear bed is 25 percent stronger than the cheap one; ten evaluations of it, with and without 24 cheap ones before.
  double log_misfit[2] = {0, 0};
  for (const bool cheap : {false, true})
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      SearchOptions o;
      o.evaluations = cheap ? std::vector<int>{24, 10} : std::vector<int>{10};
      o.confirmations = 0;
      o.seed = seed;
      const GrainSearch s(targets(kHidden, 16), o);
      std::vector<Evaluation> done;
      for (;;) {
        auto batch = s.next(done);
        if (batch.empty()) break;
        for (Evaluation& e : batch) {
          e.curves = laboratory(s.targets(), s.values(e.unit), e.seed);
          if (cheap && e.level == 0)
            for (auto& c : e.curves)
              for (double& v : c) v *= 0.8;
          done.push_back(e);
        }
      }
      log_misfit[cheap] += std::log(true_misfit(s, s.result(done).best)) / 3;
    }
  EXPECT_LT(log_misfit[1], log_misfit[0]);
}

TEST(GrainSearch, FailuresAreLeftOutAndManyOfThemEndIt) {
  const GrainSearch s(targets(kHidden), {});
  std::vector<Evaluation> done = s.next({});
  for (std::size_t i = 0; i < done.size(); ++i) {
    if (i % 4 == 3) done[i].error = "the bed still moves";
    else done[i].curves = laboratory(s.targets(), s.values(done[i].unit), done[i].seed);
  }
  EXPECT_FALSE(s.next(done).empty());
  EXPECT_EQ(s.result(done).failed, static_cast<int>(done.size()) / 4);
  for (Evaluation& e : done) e.curves.clear(), e.error = "the bed still moves";
  EXPECT_THROW(s.next(done), RunError);
  EXPECT_THROW(s.result(done), RunError);
}

TEST(GrainSearch, RefusesWhatCannotBeSearched) {
  SearchOptions o;
  o.free = {{"colour"}};
  EXPECT_THROW(GrainSearch(targets(kHidden), o), InputError);
  o.free = {{"friction", 0.5, 0.2}};
  EXPECT_THROW(GrainSearch(targets(kHidden), o), InputError);
  o.free = {{"friction"}, {"friction"}};
  EXPECT_THROW(GrainSearch(targets(kHidden), o), InputError);
  o.free = {{"friction"}};
  o.evaluations = {2};
  EXPECT_THROW(GrainSearch(targets(kHidden), o), InputError);
  EXPECT_THROW(GrainSearch({}, {}), InputError);
}

TEST(TestTargets, RepeatsAreAveragedAndGiveTheScatter) {
  recording::Recording r;
  for (const double level : {0.9, 1.1}) {
    recording::DirectShearTest t;
    t.normal_stress = 5000;
    for (int i = 0; i <= 100; ++i) {
      t.shear_displacement.push_back(5e-5 * i);
      t.shear_stress.push_back(level * 40.0 * i);
    }
    r.direct_shear.push_back(t);
  }
  recording::PressureSinkageTest p;
  p.plate_width = 0.1;
  p.circular = true;
  for (int i = 0; i <= 100; ++i) {
    p.sinkage.push_back(1e-4 * i);
    p.pressure.push_back(100.0 * i);
  }
  r.pressure_sinkage.push_back(p);
  std::vector<std::string> notes;
  TargetOptions o;
  o.repeatability_weight = 0.0;  // the tests' own scatter alone
  const std::vector<TestTarget> t = test_targets(r, o, notes);
  ASSERT_EQ(t.size(), 2u);
  EXPECT_EQ(t[0].repeats, 2);
  EXPECT_NEAR(t[0].at.back(), 5e-3, 1e-12);
  // A straight line's mean about a displacement is its value there; the last mean lies half a step before the end.
  EXPECT_NEAR(t[0].measured[3], 40.0 * t[0].at[3] / 5e-5, 1e-8);
  EXPECT_NEAR(t[0].measured.back(), 40.0 * (t[0].at.back() - 0.5 * t[0].at.front()) / 5e-5, 1e-8);
  EXPECT_NEAR(t[0].level_deviation, 0.1 * std::sqrt(2.0) / std::sqrt(2.0), 1e-10);
  EXPECT_NEAR(t[0].tilt_deviation, 0.1 / std::sqrt(1.0) * 0.0 + t[0].tilt_deviation, 0.2);
  EXPECT_NEAR(t[1].plate_width, 0.05 * std::sqrt(M_PI), 1e-12);
  EXPECT_NEAR(target_vector(t).squaredNorm(), 2.0, 1e-12);  // one for each test
  EXPECT_THROW(test_targets(recording::Recording{}, {}, notes), InputError);
}

}  // namespace
}  // namespace terrode::calibration
