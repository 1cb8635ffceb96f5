#include "report/sweep_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "report/svg.h"

namespace terrode::report {
namespace {

// One channel of the sweep as it is shown.
struct Shown {
  const char* name;        // in a sentence
  const char* title;
  const char* unit;
  double per_si;           // shown value over SI value
  double SweepPoint::*value;
  double SweepPoint::*sem;
  double SweepPoint::*std;
};

constexpr Shown kShown[] = {
    {"drawbar pull", "Drawbar pull", "N", 1.0, &SweepPoint::drawbar_pull, &SweepPoint::drawbar_pull_sem, &SweepPoint::drawbar_pull_std},
    {"torque", "Driving torque", "N m", 1.0, &SweepPoint::driving_torque, &SweepPoint::driving_torque_sem, &SweepPoint::driving_torque_std},
    {"sinkage", "Sinkage", "mm", 1e3, &SweepPoint::sinkage, &SweepPoint::sinkage_sem, &SweepPoint::sinkage_std},
};

bool by_slip(const SweepPoint& a, const SweepPoint& b) { return a.slip < b.slip; }

std::vector<SweepPoint> usable(const SweepCurve& curve, double SweepPoint::*value) {
  std::vector<SweepPoint> out;
  for (const SweepPoint& p : curve.points)
    if (p.error.empty() && std::isfinite(p.*value) && std::isfinite(p.slip)) out.push_back(p);
  std::stable_sort(out.begin(), out.end(), by_slip);
  return out;
}

// Root of the mean squared difference from the measured points that lie within the curve's slips; NaN without any.
struct Difference {
  double rms = SweepPoint::kUnknown;
  double bias = SweepPoint::kUnknown;
  double largest_measured = 0.0;
  size_t points = 0;
  double relative() const { return largest_measured > 0.0 ? rms / largest_measured : SweepPoint::kUnknown; }
};

Difference difference(const SweepCurve& curve, const SweepCurve& measured, double SweepPoint::*value) {
  const auto c = usable(curve, value);
  Difference d;
  double squares = 0.0, sum = 0.0;
  for (const SweepPoint& m : usable(measured, value)) {
    d.largest_measured = std::max(d.largest_measured, std::abs(m.*value));
    constexpr double kSameSlip = 1e-9;
    const auto after = std::lower_bound(c.begin(), c.end(), m.slip - kSameSlip,
                                        [](const SweepPoint& p, double s) { return p.slip < s; });
    if (after == c.end()) continue;
    double modelled = (*after).*value;
    if (std::abs(after->slip - m.slip) > kSameSlip) {
      if (after == c.begin()) continue;
      const SweepPoint& before = *(after - 1);
      const double f = (m.slip - before.slip) / (after->slip - before.slip);
      modelled = (1.0 - f) * before.*value + f * ((*after).*value);
    }
    const double difference = modelled - m.*value;
    squares += difference * difference;
    sum += difference;
    ++d.points;
  }
  if (d.points > 0) {
    d.rms = std::sqrt(squares / static_cast<double>(d.points));
    d.bias = sum / static_cast<double>(d.points);
  }
  return d;
}

std::string joined(const std::vector<std::string>& words) {
  std::string out;
  for (size_t i = 0; i < words.size(); ++i) out += (i == 0 ? "" : i + 1 == words.size() ? " and " : ", ") + words[i];
  return out;
}

std::pair<Mood, std::string> finding(const SweepReport& report, const SweepCurve* measured) {
  size_t failed = 0, unsettled = 0, total = 0;
  std::vector<std::string> names;
  for (const SweepCurve& c : report.curves) {
    if (c.measured) continue;
    names.push_back(c.name);
    for (const SweepPoint& p : c.points) {
      ++total;
      failed += !p.error.empty();
      unsettled += p.error.empty() && !p.steady;
    }
  }
  std::string sentence;
  Mood mood = Mood::neutral;
  if (measured) {
    double best_worst = SweepPoint::kUnknown;
    for (const SweepCurve& c : report.curves) {
      if (c.measured) continue;
      std::vector<std::string> parts;
      double worst = 0.0;
      for (const Shown& s : kShown) {
        const Difference d = difference(c, *measured, s.value);
        if (!std::isfinite(d.relative())) continue;
        parts.push_back(fmt::format("{}\u00a0% in {}", format_number(100.0 * d.relative(), 2), s.name));
        worst = std::max(worst, d.relative());
      }
      if (parts.empty()) continue;
      sentence += (sentence.empty() ? "" : "; ") + c.name + " " + joined(parts);
      if (!(worst > best_worst)) best_worst = worst;
    }
    if (!sentence.empty()) {
      sentence = "Distance from the measured points (root mean square, share of the largest value): " + sentence + ".";
      constexpr double kClose = 0.15;  // a digitised curve is known to about this
      mood = best_worst <= kClose ? Mood::good : Mood::neutral;
    }
  }
  if (sentence.empty() && total > 0)
    sentence = fmt::format("{} points of {} computed; no measurement to compare with.", total - failed, joined(names));
  if (failed > 0) {
    sentence += fmt::format(" {} of {} points failed.", failed, total);
    mood = Mood::bad;
  }
  if (unsettled > 0) {
    sentence += fmt::format(" {} of {} runs had not reached a steady state.", unsettled, total);
    if (mood != Mood::bad) mood = Mood::warning;
  }
  return {mood, sentence};
}

}  // namespace

std::vector<Figure> sweep_figures(const SweepReport& report) {
  std::vector<Figure> out;
  for (const Shown& s : kShown) {
    Figure figure;
    figure.title = std::string(s.title);
    figure.x = {"Slip", ""};
    figure.y = {s.title, s.unit};
    int next = 0;
    for (const SweepCurve& curve : report.curves) {
      const int colour = curve.measured ? kInk : next++;
      Series line{curve.name, {}, {}, curve.measured ? Draw::points : Draw::line_and_points, {}, {}, colour, false};
      bool bars = false;
      for (const SweepPoint& p : usable(curve, s.value)) {
        const double v = p.*s.value * s.per_si, e = p.*s.sem * s.per_si;
        line.x.push_back(p.slip);
        line.y.push_back(v);
        line.low.push_back(std::isfinite(e) ? v - e : SweepPoint::kUnknown);
        line.high.push_back(std::isfinite(e) ? v + e : SweepPoint::kUnknown);
        bars = bars || std::isfinite(e);
      }
      if (!bars) line.low.clear(), line.high.clear();
      if (!line.x.empty()) figure.series.push_back(std::move(line));
    }
    if (!figure.series.empty()) out.push_back(std::move(figure));
  }
  return out;
}

Page sweep_page(const SweepReport& report) {
  const auto measured = std::find_if(report.curves.begin(), report.curves.end(), [](const SweepCurve& c) { return c.measured; });
  const SweepCurve* reference = measured == report.curves.end() ? nullptr : &*measured;

  Page page(report.title);
  if (!report.scenario_name.empty()) page.subtitle("Slip sweep of " + report.scenario_name);
  const auto [mood, sentence] = finding(report, reference);
  if (!sentence.empty()) page.verdict(mood, sentence);
  if (!report.facts.empty()) page.facts(report.facts);
  if (!report.command.empty()) page.command(report.command);

  page.section("Curves");
  auto figures = sweep_figures(report);
  if (!figures.empty()) {
    Figure first = std::move(figures.front());
    figures.erase(figures.begin());
    first.caption = "Bars: standard error of the mean with autocorrelation counted; of measured points, their scatter.";
    bool bars = false;
    for (const Series& s : first.series) bars = bars || !s.low.empty();
    if (!bars) first.caption.clear();
    page.figure(std::move(first));
    if (!figures.empty()) page.figures(std::move(figures));
  }
  if (!report.slip_convention.empty()) page.text("Slip by the convention " + report.slip_convention + ".");

  if (reference) {
    Table table;
    table.columns = {{"Method", "", 4}, {"Channel", "", 4}, {"Root mean square difference", "", 3}, {"Mean difference", "", 3},
                     {"Unit", "", 4}, {"of largest measured", "%", 2}, {"Points", "", 4}};
    for (const SweepCurve& c : report.curves) {
      if (c.measured) continue;
      for (const Shown& s : kShown) {
        const Difference d = difference(c, *reference, s.value);
        if (d.points == 0) continue;
        table.rows.push_back({c.name, std::string(s.title), d.rms * s.per_si, d.bias * s.per_si, std::string(s.unit),
                              100.0 * d.relative(), static_cast<double>(d.points)});
      }
    }
    table.caption = "Model less measurement at the measured slips, the model linear between its own.";
    if (!table.rows.empty()) page.section("Against " + reference->name).table(std::move(table));
  }

  // One row a slip: the methods side by side under each channel.
  const auto same_slip = [](double a, double b) { return std::abs(a - b) < 1e-9; };
  std::vector<double> slips;
  for (const SweepCurve& c : report.curves)
    for (const SweepPoint& p : c.points)
      if (std::none_of(slips.begin(), slips.end(), [&](double s) { return same_slip(s, p.slip); })) slips.push_back(p.slip);
  std::sort(slips.begin(), slips.end());
  Table numbers;
  numbers.columns = {{"Slip", "", 4}};
  for (const Shown& s : kShown)
    for (const SweepCurve& c : report.curves)
      if (!usable(c, s.value).empty()) numbers.columns.push_back({c.measured ? "measured" : c.name, s.unit, 4, s.title});
  for (double slip : slips) {
    constexpr double kRounding = 1e9;
    // Where a slip was measured more than once every repeat keeps a row.
    size_t repeats = 1;
    for (const SweepCurve& c : report.curves)
      repeats = std::max(repeats, static_cast<size_t>(std::count_if(c.points.begin(), c.points.end(), [&](const SweepPoint& p) {
                           return same_slip(p.slip, slip);
                         })));
    for (size_t k = 0; k < repeats; ++k) {
      std::vector<Cell> row{std::round(slip * kRounding) / kRounding};
      for (const Shown& s : kShown)
        for (const SweepCurve& c : report.curves) {
          const auto with_numbers = usable(c, s.value);
          if (with_numbers.empty()) continue;
          size_t seen = 0;
          Cell cell;
          for (const SweepPoint& p : with_numbers)
            if (same_slip(p.slip, slip) && seen++ == k) {
              const double v = p.*s.value * s.per_si, e = p.*s.sem * s.per_si;
              cell = std::isfinite(e) ? Cell(PlusMinus{v, e}) : Cell(v);
            }
          row.push_back(cell);
        }
      numbers.rows.push_back(std::move(row));
    }
  }
  bool errors = false;
  for (const auto& row : numbers.rows)
    errors = errors || std::any_of(row.begin(), row.end(), [](const Cell& c) { return std::holds_alternative<PlusMinus>(c); });
  if (errors) numbers.caption = "±: standard error of the mean, autocorrelation counted; for measured points the scatter given with them.";
  page.section("Numbers").table(std::move(numbers));

  Table cost;
  cost.columns = {{"Method", ""}, {"Points", ""}, {"Failed", ""}, {"Not steady", ""}, {"Processor time a point", "s", 2},
                  {"Simulated time a point", "s", 3}};
  for (const SweepCurve& c : report.curves) {
    if (c.measured) continue;
    double cpu = 0.0, simulated = 0.0, failed = 0.0, unsettled = 0.0;
    for (const SweepPoint& p : c.points) {
      cpu += p.cpu_seconds;
      simulated += p.simulated_seconds;
      failed += !p.error.empty();
      unsettled += p.error.empty() && !p.steady;
    }
    const auto n = static_cast<double>(c.points.size());
    const auto mean = [&](double sum) { return std::isfinite(sum) && n > 0 ? Cell(sum / n) : Cell(); };
    cost.rows.push_back({c.name, n, failed, unsettled, mean(cpu), mean(simulated)});
  }
  if (!cost.rows.empty()) page.section("Runs").table(std::move(cost));
  std::vector<std::string> remarks;
  for (const SweepCurve& c : report.curves)
    for (const SweepPoint& p : c.points) {
      if (!p.error.empty()) remarks.push_back(fmt::format("{}, slip {}: {}", c.name, format_number(p.slip), p.error));
      if (p.error.empty() && !p.steady) remarks.push_back(fmt::format("{}, slip {}: not steady", c.name, format_number(p.slip)));
    }
  if (!remarks.empty()) page.list(std::move(remarks));
  if (!report.notes.empty()) page.section("Notes").list(report.notes);
  if (!report.scenario_text.empty()) page.section("Scenario").listing(report.scenario_name, report.scenario_text);
  return page;
}

}  // namespace terrode::report
