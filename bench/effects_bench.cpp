// Time of a steady slip sweep of 50 conditions, plain and with three effects at a time, on one core, in turns: medians of
// the ratios of neighbouring rounds. Prints some triples, the slowest of all single effects, and the spread over all triples
// of effects that act on soil and wheel (one round each; those above two times plain again by fifteen, since a round that
// was interrupted says nothing of the effects).
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include "effects/catalogue.h"

using namespace terrode;

namespace {

// A sweep that can be timed again and again.
class Sweep {
 public:
  explicit Sweep(const std::vector<std::string>& ids) : set_(wanted(ids)) {}

  double microseconds() const {
    const bekker::SteadyWheel wheel(effects::reference_wheel(), effects::reference_soil(), {}, {nullptr, nullptr, set_.modifiers()});
    const auto start = std::chrono::steady_clock::now();
    double sum = 0;
    for (int i = 0; i < 50; ++i) {
      bekker::Operating o = effects::reference_operating();
      o.slip = -0.5 + 0.03 * (i % 48);
      o.normal_load = 60.0 + 3.0 * i;
      sum += effects::steady_reading(wheel, set_, o).drawbar_pull;
    }
    const double out = 1e6 * std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (sum == 12345.678) std::printf(" ");
    return out;
  }

 private:
  static std::map<std::string, std::map<std::string, double>> wanted(const std::vector<std::string>& ids) {
    std::map<std::string, std::map<std::string, double>> out;
    for (const std::string& id : ids) out[id] = {};
    return out;
  }
  effects::EffectSet set_;
};

double median(std::vector<double> x) {
  std::sort(x.begin(), x.end());
  return x[x.size() / 2];
}

// Time with effects over that without, rounds in turns; median.
double ratio_to_plain(const std::vector<std::string>& ids, std::size_t rounds = 15) {
  const Sweep plain({}), with(ids);
  std::vector<double> ratios;
  for (std::size_t i = 0; i < rounds; ++i) {
    const double before = plain.microseconds(), t = with.microseconds(), after = plain.microseconds();
    ratios.push_back(2.0 * t / (before + after));
  }
  return median(ratios);
}

}  // namespace

int main() {
  const Sweep plain({});
  std::vector<double> rounds(9);
  for (double& t : rounds) t = plain.microseconds();
  std::printf("50 conditions, plain: %.0f us\n", median(rounds));
  const std::vector<std::vector<std::string>> triples = {{"slip_sinkage", "bulldozing", "slope"},
                                                         {"slip_sinkage", "multi_pass", "bulldozing"},
                                                         {"pressure_dependent_K", "shear_rate", "grousers"},
                                                         {"rear_contact", "peak_shear", "sensor_drift"},
                                                         {"penetration_rate", "hard_layer", "interface_friction"}};
  for (const auto& t : triples) std::printf("%s, %s, %s: %.2f times plain\n", t[0].c_str(), t[1].c_str(), t[2].c_str(), ratio_to_plain(t));
  double slowest = 0;
  std::string name;
  for (const effects::EffectType& e : effects::all_effects()) {
    const double ratio = ratio_to_plain({std::string(e.info->id)});
    if (ratio > slowest) {
      slowest = ratio;
      name = std::string(e.info->id);
    }
  }
  std::printf("slowest effect by itself: %s, %.2f times plain\n", name.c_str(), slowest);

  std::vector<std::string> soil;
  for (const effects::EffectType& e : effects::all_effects()) {
    const std::map<std::string, std::map<std::string, double>> one = {{std::string(e.info->id), {}}};
    if (!effects::EffectSet(one).modifiers().empty()) soil.emplace_back(e.info->id);
  }
  struct Triple {
    double ratio;
    std::vector<std::string> ids;
  };
  std::vector<Triple> all;
  for (std::size_t i = 0; i < soil.size(); ++i)
    for (std::size_t j = i + 1; j < soil.size(); ++j)
      for (std::size_t k = j + 1; k < soil.size(); ++k) all.push_back({ratio_to_plain({soil[i], soil[j], soil[k]}, 1), {soil[i], soil[j], soil[k]}});
  for (Triple& t : all)
    if (t.ratio > 2.0) t.ratio = ratio_to_plain(t.ids);
  std::sort(all.begin(), all.end(), [](const Triple& a, const Triple& b) { return a.ratio < b.ratio; });
  const auto above = std::count_if(all.begin(), all.end(), [](const Triple& t) { return t.ratio > 3.0; });
  const std::vector<std::string>& worst = all.back().ids;
  std::printf("all %zu triples: median %.2f, nine of ten below %.2f, largest %.2f (%s, %s, %s), %td above 3\n", all.size(),
              all[all.size() / 2].ratio, all[all.size() * 9 / 10].ratio, all.back().ratio, worst[0].c_str(), worst[1].c_str(), worst[2].c_str(),
              above);
}
