// Time of a steady slip sweep of 50 conditions, plain and with three effects at a time; medians of nine rounds on one
// core, both in this run, and their ratio. Prints some triples, the slowest of all single effects, and the spread over
// all triples of effects that act on soil and wheel (the faster of two rounds each, against plain rounds in between: a
// round that was interrupted says nothing of the effects; triples still above three are timed again, nine rounds).
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include "effects/catalogue.h"

using namespace terrode;

namespace {

double sweep_microseconds(const std::vector<std::string>& ids, std::size_t count = 9) {
  std::map<std::string, std::map<std::string, double>> wanted;
  for (const std::string& id : ids) wanted[id] = {};
  const effects::EffectSet set(wanted);
  const bekker::SteadyWheel wheel(effects::reference_wheel(), effects::reference_soil(), {}, {nullptr, nullptr, set.modifiers()});
  std::vector<double> rounds(count);
  double sum = 0;
  for (double& t : rounds) {
    const auto start = std::chrono::steady_clock::now();
    for (int i = 0; i < 50; ++i) {
      bekker::Operating o = effects::reference_operating();
      o.slip = -0.5 + 0.03 * (i % 48);
      o.normal_load = 60.0 + 3.0 * i;
      sum += effects::steady_reading(wheel, set, o).drawbar_pull;
    }
    t = 1e6 * std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  }
  std::sort(rounds.begin(), rounds.end());
  if (sum == 12345.678) std::printf(" ");
  return rounds[rounds.size() / 2];
}

}  // namespace

int main() {
  const double plain = sweep_microseconds({});
  std::printf("50 conditions, plain: %.0f us\n", plain);
  const std::vector<std::vector<std::string>> triples = {{"slip_sinkage", "bulldozing", "slope"},
                                                         {"slip_sinkage", "multi_pass", "bulldozing"},
                                                         {"pressure_dependent_K", "shear_rate", "grousers"},
                                                         {"rear_contact", "peak_shear", "sensor_drift"},
                                                         {"penetration_rate", "hard_layer", "interface_friction"}};
  for (const auto& t : triples)
    std::printf("%s, %s, %s: %.2f times plain\n", t[0].c_str(), t[1].c_str(), t[2].c_str(), sweep_microseconds(t) / plain);
  double slowest = 0;
  std::string name;
  for (const effects::EffectType& e : effects::all_effects()) {
    const double ratio = sweep_microseconds({std::string(e.info->id)}) / plain;
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
    for (std::size_t j = i + 1; j < soil.size(); ++j) {
      const double now = sweep_microseconds({}, 3);
      for (std::size_t k = j + 1; k < soil.size(); ++k)
        all.push_back({std::min(sweep_microseconds({soil[i], soil[j], soil[k]}, 1), sweep_microseconds({soil[i], soil[j], soil[k]}, 1)) / now,
                       {soil[i], soil[j], soil[k]}});
    }
  for (Triple& t : all)
    if (t.ratio > 3.0) t.ratio = sweep_microseconds(t.ids) / sweep_microseconds({});
  std::sort(all.begin(), all.end(), [](const Triple& a, const Triple& b) { return a.ratio < b.ratio; });
  const auto above = std::count_if(all.begin(), all.end(), [](const Triple& t) { return t.ratio > 3.0; });
  const std::vector<std::string>& worst = all.back().ids;
  std::printf("all %zu triples: median %.2f, nine of ten below %.2f, largest %.2f (%s, %s, %s), %td above 3\n", all.size(),
              all[all.size() / 2].ratio, all[all.size() * 9 / 10].ratio, all.back().ratio, worst[0].c_str(), worst[1].c_str(), worst[2].c_str(),
              above);
}
