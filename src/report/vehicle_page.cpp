#include "report/vehicle_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "report/svg.h"

namespace terrode::report {
namespace {

struct Shown {
  const char* channel;
  const char* title;
  const char* unit;
  double per_si;
};

constexpr Shown kWheelFigures[] = {
    {"slip", "Slip", "", 1.0},
    {"sinkage", "Sinkage", "mm", 1e3},
    {"drawbar_pull", "Drawbar pull", "N", 1.0},
    {"normal_load", "Normal load", "N", 1.0},
    {"driving_torque", "Driving torque", "N m", 1.0},
    {"power", "Power", "W", 1.0},
};

const std::vector<double>& values(const VehicleReport& r, const std::string& name) {
  static const std::vector<double> none;
  const recording::Channel* c = r.run.find(name);
  return c != nullptr ? c->values : none;
}

double last(const std::vector<double>& v) { return v.empty() ? 0.0 : v.back(); }

double mean_of_last_half(const std::vector<double>& v) {
  const auto from = v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2);
  return from == v.end() ? 0.0 : std::accumulate(from, v.end(), 0.0) / static_cast<double>(v.end() - from);
}

// Few enough points for a page: means of neighbours.
Series thinned(const std::string& name, const std::vector<double>& x, const std::vector<double>& y, double scale) {
  constexpr std::size_t kMost = 600;
  Series s;
  s.name = name;
  const std::size_t n = std::min(x.size(), y.size()), stride = std::max<std::size_t>(1, (n + kMost - 1) / kMost);
  for (std::size_t i = 0; i < n; i += stride) {
    const std::size_t end = std::min(n, i + stride);
    double sx = 0.0, sy = 0.0;
    for (std::size_t k = i; k < end; ++k) {
      sx += x[k];
      sy += y[k];
    }
    s.x.push_back(sx / static_cast<double>(end - i));
    s.y.push_back(scale * sy / static_cast<double>(end - i));
  }
  return s;
}

Figure path_figure(const VehicleReport& r) {
  Figure f;
  f.title = "Path";
  f.x = {"x", "m"};
  f.y = {"y", "m"};
  if (r.planned.size() > 1) {
    Series plan;
    plan.name = "planned";
    plan.colour = kInk;
    plan.dashed = true;
    for (const auto& [x, y] : r.planned) {
      plan.x.push_back(x);
      plan.y.push_back(y);
    }
    f.series.push_back(std::move(plan));
  }
  Series driven = thinned("driven", values(r, "position_x"), values(r, "position_y"), 1.0);
  driven.colour = 0;
  f.series.push_back(std::move(driven));
  f.caption = "The machine's origin, seen from above.";
  return f;
}

}  // namespace

std::pair<std::vector<double>, std::vector<double>> energy_along_path(const VehicleReport& r, double stretch) {
  std::pair<std::vector<double>, std::vector<double>> out;
  const std::vector<double>& travel = values(r, "travel");
  std::vector<double> energy(travel.size(), 0.0);
  for (const std::string& w : r.wheels) {
    const std::vector<double>& e = values(r, w + "_energy");
    for (std::size_t i = 0; i < std::min(e.size(), energy.size()); ++i) energy[i] += e[i];
  }
  std::size_t from = 0;
  for (std::size_t i = 1; i < travel.size(); ++i) {
    if (travel[i] - travel[from] < stretch) continue;
    out.first.push_back(0.5 * (travel[i] + travel[from]));
    out.second.push_back((energy[i] - energy[from]) / (travel[i] - travel[from]));
    from = i;
  }
  return out;
}

Page vehicle_page(const VehicleReport& r) {
  Page page(r.title.empty() ? r.machine : r.title);
  page.subtitle(r.machine);
  if (!r.command.empty()) page.command(r.command);
  const double seconds = last(r.run.time), travel = last(values(r, "travel"));
  std::string sentence = fmt::format("{} m in {} s", format_number(travel, 3), format_number(seconds, 3));
  if (travel > 1e-6) sentence += fmt::format(", {} J per metre of path", format_number(r.energy_per_metre, 3));
  sentence += ".";
  for (const std::string& e : r.events) sentence += " " + std::string(1, static_cast<char>(std::toupper(e.empty() ? ' ' : e[0]))) + (e.empty() ? "" : e.substr(1)) + ".";
  page.verdict(r.ended_early ? Mood::bad : Mood::neutral, sentence);
  double power = 0.0, worst_slip = 0.0, deepest = 0.0;
  for (const std::string& w : r.wheels) {
    power += mean_of_last_half(values(r, w + "_power"));
    worst_slip = std::max(worst_slip, mean_of_last_half(values(r, w + "_slip")));
    for (const double z : values(r, w + "_sinkage")) deepest = std::max(deepest, z);
  }
  page.facts({{"path", format_number(travel, 3) + " m"},
              {"energy", format_number(r.energy_per_metre, 3) + " J/m"},
              {"power, second half", format_number(power, 3) + " W"},
              {"largest mean slip of a wheel", format_number(worst_slip, 2)},
              {"deepest sinkage", format_number(1e3 * deepest, 3) + " mm"},
              {"mobility margin, last", r.margins.empty() ? std::string("not asked for")
                                                          : (r.margins.back().at_least ? "at least " : "") +
                                                                format_number(r.margins.back().pull, 3) + " N"}});
  page.section("Path");
  std::vector<Figure> pair = {path_figure(r)};
  const auto [at, cost] = energy_along_path(r, std::max(0.02 * travel, 1e-3));
  if (at.size() > 1) {
    Figure f;
    f.title = "Energy per metre";
    f.x = {"Path", "m"};
    f.y = {"Energy per metre", "J/m"};
    Series s;
    s.name = "all drives";
    s.x = at;
    s.y = cost;
    f.series.push_back(std::move(s));
    pair.push_back(std::move(f));
  }
  page.figures(std::move(pair));
  if (!r.margins.empty()) {
    Figure f;
    f.title = "Mobility margin";
    f.x = {"Path", "m"};
    f.y = {"Further pull", "N"};
    Series s;
    s.name = "pull that the wheels hold besides";
    s.draw = Draw::line_and_points;
    for (const VehicleMargin& m : r.margins) {
      s.x.push_back(m.travel);
      s.y.push_back(m.pull);
    }
    f.series.push_back(std::move(s));
    f.y.min = 0.0;
    f.caption = "Largest resisting pull at the hitch, found by a ramp from the state of that moment.";
    page.figure(std::move(f));
  }
  page.section("Wheels");
  std::vector<Figure> figures;
  for (const Shown& s : kWheelFigures) {
    Figure f;
    f.title = s.title;
    f.x = {"Time", "s"};
    f.y = {s.title, s.unit};
    for (const std::string& w : r.wheels)
      if (r.run.find(w + "_" + s.channel) != nullptr)
        f.series.push_back(thinned(w, r.run.time, values(r, w + "_" + s.channel), s.per_si));
    figures.push_back(std::move(f));
  }
  page.figures(std::move(figures));
  Table table;
  table.caption = "Means over the second half of the run; energy over all of it.";
  table.columns = {{"wheel"}};
  for (const Shown& s : kWheelFigures) table.columns.push_back({s.title, s.unit});
  table.columns.push_back({"Energy", "J"});
  for (const std::string& w : r.wheels) {
    std::vector<Cell> row = {w};
    for (const Shown& s : kWheelFigures) row.push_back(s.per_si * mean_of_last_half(values(r, w + "_" + s.channel)));
    row.push_back(last(values(r, w + "_energy")));
    table.rows.push_back(std::move(row));
  }
  page.table(std::move(table));
  page.section("Body");
  Figure attitude, speed;
  attitude.title = "Attitude";
  speed.title = "Speed";
  attitude.x = speed.x = {"Time", "s"};
  attitude.y = {"Angle", "deg"};
  speed.y = {"Forward velocity", "m/s"};
  constexpr double degrees = 57.29577951308232;
  for (const char* c : {"pitch", "roll", "heading"}) attitude.series.push_back(thinned(c, r.run.time, values(r, c), degrees));
  speed.series.push_back(thinned("forward velocity", r.run.time, values(r, "forward_velocity"), 1.0));
  page.figures({std::move(attitude), std::move(speed)});
  if (!r.energy.empty()) {
    Table books;
    books.caption = "Where the energy went: given by drives, gravity and hitch; taken by ground, rocks, springs and motion.";
    books.columns = {{"part"}, {"Energy", "J"}};
    for (const auto& [name, joule] : r.energy) books.rows.push_back({name, joule});
    page.section("Energy").table(std::move(books));
  }
  if (!r.notes.empty()) page.section("Notes").list(r.notes);
  if (!r.scenario_text.empty()) page.listing(r.scenario_name, r.scenario_text);
  return page;
}

}  // namespace terrode::report
