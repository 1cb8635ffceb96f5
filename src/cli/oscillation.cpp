#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>

#include "analysis/lines.h"
#include "analysis/steady_state.h"
#include "cli/sources.h"
#include "cli/terminal.h"
#include "core/problem.h"
#include "core/units.h"
#include "report/page.h"

namespace terrode::cli {
namespace {

struct Request {
  std::vector<std::string> files, channels;
  std::string method;
  TableHelp help;
  analysis::LineOptions lines;
};

// A run with where it came from.
struct Item {
  std::string file;   // as the JSON names it
  std::string label;  // short
  std::optional<ContactRinging> ringing;
};

constexpr double kSameFrequency = 0.05;  // a line this near an eigenfrequency is named by it

constexpr std::size_t kSpectraShown = 8;
constexpr std::size_t kTextLines = 200;


// Spectral density at a line, with the limits between which it lies with a probability of 95 %.
struct LineDensity {
  double density = 0.0, low = 0.0, high = 0.0, background = 0.0;
};
LineDensity density_at(const analysis::ChannelSpectrum& s, double frequency) {
  const auto& f = s.spectrum.frequency;
  const auto at = static_cast<std::size_t>(std::lower_bound(f.begin(), f.end(), frequency) - f.begin());
  const std::size_t i = std::min(at > 0 && at < f.size() && frequency - f[at - 1] < f[at] - frequency ? at - 1 : at, f.size() - 1);
  const auto [low, high] = s.spectrum.confidence(i);
  const double d = s.spectrum.density[i];
  return {d, low * d, high * d, s.background[i]};
}

// The resonance that a line may be: only one that no motion drives can be one.
std::optional<analysis::Resonance> damping_of(const recording::Run& run, const std::string& channel, const analysis::SpectralLine& l) {
  if (l.locked_to != analysis::Lock::time && l.locked_to != analysis::Lock::undecided) return std::nullopt;
  analysis::EvenSeries series = analysis::even_series(run.time, run.find(channel)->values);
  analysis::remove_trend(series.x, 1);
  return analysis::resonance_near(series, l.frequency);
}

Json line_json(const recording::Run& run, const analysis::ChannelSpectrum& spectrum, const analysis::SpectralLine& l,
               const std::vector<std::string>& channels, const analysis::LineOptions& options) {
  const auto or_null = [](double x) { return x > 0.0 ? number(x) : Json(nullptr); };
  Json out = {{"frequency", number(l.frequency)},
              {"order", or_null(l.order)},
              {"amplitude", number(l.amplitude)},
              {"share_of_variance", number(l.share_of_variance)},
              {"significance", number(l.significance)},
              {"locked_to", analysis::lock_name(l.locked_to)},
              {"frequency_std", number(l.frequency_std)},
              {"per_metre", or_null(l.per_metre)},
              {"per_slip_metre", or_null(l.per_slip_metre)},
              {"phase", number(l.phase)},
              {"false_alarm_probability", number(l.false_alarm)},
              {"sinusoidal", l.sinusoidal},
              {"lock_evidence", number(l.lock_evidence)},
              {"driver", l.driver}};
  if (l.harmonic_of >= 0) out["harmonic"] = {{"of", number(spectrum.lines[static_cast<std::size_t>(l.harmonic_of)].frequency)}, {"number", l.harmonic}};
  const LineDensity d = density_at(spectrum, l.frequency);
  out["density"] = {{"value", number(d.density)}, {"confidence_95", {number(d.low), number(d.high)}}, {"background", number(d.background)}};
  if (const auto r = damping_of(run, spectrum.channel, l))
    out["damping"] = {{"frequency", number(r->frequency)}, {"ratio", number(r->damping)}, {"ratio_std", number(r->damping_std)}};
  Json coherence = Json::object();
  for (const std::string& other : channels) {
    if (other == spectrum.channel || !run.find(other)) continue;
    const analysis::Coherence c = analysis::line_coherence(run, spectrum, other, l.frequency, options);
    coherence[other] = {{"coherence", number(c.coherence)}, {"phase", number(c.phase)}, {"gain", number(c.gain)}, {"p", number(c.p)}};
  }
  if (!coherence.empty()) out["coherence"] = coherence;
  return out;
}

Json track_json(const analysis::LineTrack& t, const std::vector<Item>& items) {
  static const char* const units[] = {"Hz", "1/turn", "1/m", "1/m"};
  Json points = Json::array();
  for (const auto& p : t.points)
    points.push_back({{"run", items[p.run].label}, {"frequency", number(p.frequency)}, {"amplitude", number(p.amplitude)}, {"own_line", p.line >= 0}});
  Json out = {{"channel", t.channel}, {"locked_to", analysis::lock_name(t.locked_to)}, {"driver", t.driver}};
  if (t.locked_to != analysis::Lock::undecided) {
    out["value"] = number(t.value);
    out["value_std"] = number(t.value_std);
    out["unit"] = units[static_cast<std::size_t>(t.locked_to)];
    if (t.locked_to == analysis::Lock::slip_travel) out["slip_offset"] = number(t.slip_offset);
  }
  out["evidence"] = number(t.evidence);
  out["evidence_by_axis"] = {{"time", number(t.evidence_by_axis[0])},
                             {"wheel", number(t.evidence_by_axis[1])},
                             {"travel", number(t.evidence_by_axis[2])},
                             {"slip_travel", number(t.evidence_by_axis[3])}};
  out["points"] = std::move(points);
  return out;
}

std::string shown(double x, const char* format = "{:.4g}") { return x > 0.0 && std::isfinite(x) ? fmt::format(fmt::runtime(format), x) : "-"; }

void write_report(const std::string& path, const analysis::Oscillation& o, const std::vector<recording::Run>& runs,
                  const std::vector<Item>& items, const analysis::LineOptions& options, const Common& common) {
  report::Page page("Oscillations");
  page.subtitle(fmt::format("{} runs, {} channels", runs.size(), o.channels.size())).command(common.command_line);
  std::size_t lines = 0, decided = 0;
  for (const auto& [name, tracks] : o.tracks)
    for (const auto& t : tracks) {
      ++lines;
      if (t.locked_to != analysis::Lock::undecided) ++decided;
    }
  page.verdict(report::Mood::neutral, lines == 0 ? "No line stands out from the background in any channel."
                                                 : fmt::format("{} lines were followed; for {} of them the runs decide what they are locked to.", lines, decided));
  for (const std::string& channel : o.channels) {
    const auto& spectra = o.spectra.at(channel);
    const std::string unit = recording::channel::unit_of(channel).value_or("");
    page.section(channel);
    report::Table table;
    table.columns = {{"followed line"}, {"locked to"}, {"value"}, {"unit"}, {"log odds"}, {"own lines"}};
    static const char* const units[] = {"Hz", "1/turn", "1/m", "1/m of slip", ""};
    for (const auto& t : o.tracks.at(channel)) {
      const auto own = std::count_if(t.points.begin(), t.points.end(), [](const auto& p) { return p.line >= 0; });
      report::Cell value = std::string();
      if (t.locked_to != analysis::Lock::undecided) value = report::PlusMinus{t.value, t.value_std};
      table.rows.push_back({t.driver, analysis::lock_name(t.locked_to), value, std::string(units[static_cast<std::size_t>(t.locked_to)]), t.evidence, static_cast<double>(own)});
    }
    if (!table.rows.empty()) page.table(table);
    report::Table lines_table;
    lines_table.columns = {{"run"}, {"f [Hz]"}, {"order"}, {"amplitude"}, {"phase [deg]"}, {"share"}, {"coherence with (phase)"}, {"damping ratio"}};
    constexpr double kDegrees = 180.0 / 3.14159265358979323846;
    for (std::size_t i = 0; i < spectra.size(); ++i)
      for (const auto& l : spectra[i].lines) {
        std::string coherent;
        for (const std::string& other : o.channels) {
          if (other == channel || !runs[i].find(other)) continue;
          const analysis::Coherence c = analysis::line_coherence(runs[i], spectra[i], other, l.frequency, options);
          coherent += fmt::format("{}{} {:.2f} ({:.0f} deg)", coherent.empty() ? "" : ", ", other, c.coherence, kDegrees * c.phase);
        }
        report::Cell damping = std::string();
        if (const auto r = damping_of(runs[i], channel, l)) damping = report::PlusMinus{r->damping, r->damping_std};
        lines_table.rows.push_back({items[i].label, l.frequency, l.order > 0 ? report::Cell(l.order) : report::Cell(std::string()), l.amplitude,
                                    kDegrees * l.phase, l.share_of_variance, coherent, damping});
      }
    if (!lines_table.rows.empty()) page.table(lines_table);

    // The runs with the strongest lines: density over background, so that runs of any level share one picture.
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < spectra.size(); ++i)
      if (!spectra[i].background.empty()) order.push_back(i);
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      const auto best = [&](std::size_t i) { return spectra[i].lines.empty() ? 0.0 : spectra[i].lines.front().significance; };
      return best(a) > best(b);
    });
    report::Figure density;
    density.title = "Spectral density";
    density.x = {"Frequency", "Hz", true};
    density.y = {"Density", unit.empty() ? "1/Hz" : "(" + unit + ")^2/Hz", true};
    density.caption = "Multitaper estimates, of the first with its limits of 95 % confidence and, dashed, its red-noise background. Lines stand above it.";
    for (std::size_t k = 0; k < std::min(order.size(), kSpectraShown); ++k) {
      const auto& s = spectra[order[k]];
      report::Series curve;
      curve.name = items[order[k]].label;
      curve.colour = static_cast<int>(k);
      report::Series back = curve, band;
      band.name = curve.name + ", 95 %";
      band.draw = report::Draw::band;
      for (std::size_t i = 1; i < s.spectrum.frequency.size(); i += 1 + i / 200) {  // finer where the axis is wide
        if (s.spectrum.frequency[i] > s.highest) break;
        curve.x.push_back(s.spectrum.frequency[i]);
        curve.y.push_back(s.spectrum.density[i]);
        back.y.push_back(s.background[i]);
        const auto [low, high] = s.spectrum.confidence(i);
        band.low.push_back(low * s.spectrum.density[i]);
        band.high.push_back(high * s.spectrum.density[i]);
      }
      band.x = curve.x;
      if (k == 0) density.series.push_back(band);
      back.x = curve.x;
      density.series.push_back(std::move(curve));
      if (k == 0) {
        back.name += ", background";
        back.dashed = true;
        for (const auto& l : s.lines) {
          report::Annotation a;
          a.x = l.frequency;
          a.text = fmt::format("{:.3g} Hz", l.frequency);
          density.annotations.push_back(a);
        }
        density.series.push_back(std::move(back));
      }
    }
    if (density.series.empty()) {
      page.text("No run is long enough for a spectrum.");
      continue;
    }
    page.figure(density);

    // Every line of every run on the four axes: what it is locked to lines up.
    const char* const names[] = {"Frequency", "Order", "Per metre of travel", "Per metre of slip"};
    const char* const axis_units[] = {"Hz", "1/turn", "1/m", "1/m"};
    std::vector<report::Figure> axes;
    for (std::size_t a = 0; a < analysis::kAxes; ++a) {
      report::Figure f;
      f.title = std::string("Lines by ") + analysis::lock_name(static_cast<analysis::Lock>(a));
      f.x = {"Run", ""};
      f.y = {names[a], axis_units[a], true};
      f.width = 480;
      f.height = 320;
      for (const analysis::Lock lock : {analysis::Lock::time, analysis::Lock::wheel, analysis::Lock::travel, analysis::Lock::slip_travel, analysis::Lock::undecided}) {
        report::Series s;
        s.name = analysis::lock_name(lock);
        s.draw = report::Draw::points;
        s.colour = static_cast<int>(lock);
        for (std::size_t i = 0; i < spectra.size(); ++i)
          for (const auto& l : spectra[i].lines) {
            const double y = a == 0 ? l.frequency : a == 1 ? l.order : a == 2 ? l.per_metre : l.per_slip_metre;
            if (l.locked_to != lock || !(y > 0.0)) continue;
            s.x.push_back(static_cast<double>(i + 1));
            s.y.push_back(y);
          }
        if (!s.x.empty()) f.series.push_back(std::move(s));
      }
      if (!f.series.empty()) axes.push_back(std::move(f));
    }
    if (!axes.empty()) page.figures(axes);

    // Where the signal is not stationary: the first run over time and frequency.
    const recording::Run& run = runs[order.front()];
    const recording::Channel* c = run.find(channel);
    analysis::EvenSeries series = analysis::even_series(run.time, c->values);
    analysis::remove_trend(series.x, 1);
    const double top = spectra[order.front()].lines.empty() ? spectra[order.front()].highest
                                                            : std::min(spectra[order.front()].highest, 3.0 * spectra[order.front()].lines.front().frequency);
    const analysis::TimeFrequency tf = analysis::time_frequency(series, series.length() / 6.0, top);
    if (tf.time.size() >= 4 && tf.frequency.size() >= 4 && tf.time.size() * tf.frequency.size() < 40000) {
      report::HeatMap map;
      map.title = fmt::format("Over time: {}", items[order.front()].label);
      map.x = {"Time", "s"};
      map.y = {"Frequency", "Hz"};
      map.x_values = tf.time;
      map.y_values = tf.frequency;
      for (const double d : tf.density) map.values.push_back(d > 0.0 ? std::log10(d) : std::nan(""));
      map.value_label = "log10 density";
      page.heat_map(map);
    }
  }
  page.write_html(path);
}

// A line of a simulation that no axis explains and that lies at the eigenfrequency of the wheel on its contact.
void name_ringing(analysis::LineTrack& track, std::vector<analysis::ChannelSpectrum>& spectra, const std::vector<Item>& items) {
  if (track.locked_to != analysis::Lock::undecided && track.locked_to != analysis::Lock::time) return;
  for (const auto& p : track.points) {
    if (p.line < 0 || !items[p.run].ringing) continue;
    const ContactRinging& r = *items[p.run].ringing;
    if (std::abs(p.frequency / r.eigenfrequency - 1.0) > kSameFrequency) continue;
    track.driver = fmt::format("numerical: the wheel rings on its contact, eigenfrequency {:.3g} Hz of {:.3g} N/m and {:.3g} kg", r.eigenfrequency, r.stiffness, r.mass);
    spectra[p.run].lines[static_cast<std::size_t>(p.line)].driver = track.driver;
  }
}

void oscillation(const Request& request, Common& common) {
  std::vector<recording::Run> runs;
  std::vector<Item> items;
  analysis::LineOptions options = request.lines;
  for (const std::string& file : request.files) {
    recording::Recording r = load_runs(file, request.method, request.help, common.threads);
    for (const std::string& remark : r.remarks) note(common, remark);
    if (r.wheel.radius > 0.0) {
      if (options.wheel_radius > 0.0 && std::abs(options.wheel_radius - r.wheel.radius) > 1e-3 * r.wheel.radius)
        throw InputError(Problem{file, 0, 0, "wheel.radius", fmt::format("is {} m, that of the files before {} m", r.wheel.radius, options.wheel_radius), "runs of one wheel"});
      options.wheel_radius = r.wheel.radius;
    }
    if (!options.grouser_count) options.grouser_count = r.wheel.grouser_count;
    for (recording::Run& run : r.runs) {
      if (run.time.empty()) continue;
      Item item;
      item.file = run.file.empty() || r.folder.empty() ? file : (std::filesystem::path(r.folder) / run.file).lexically_normal().string();
      item.label = r.runs.size() > 1 || request.files.size() == 1 ? run.id : std::filesystem::path(file).stem().string();
      item.ringing = contact_ringing(file, run);
      items.push_back(std::move(item));
      runs.push_back(std::move(run));
    }
  }
  if (runs.empty()) throw InputError("no file holds a time series");
  for (const std::string& name : request.channels)
    if (std::none_of(runs.begin(), runs.end(), [&](const recording::Run& r) { return r.find(name) != nullptr; })) {
      std::string known;
      for (const recording::Channel& c : runs.front().channels) known += (known.empty() ? "" : ", ") + c.name;
      throw InputError(Problem{{}, 0, 0, "--channel", fmt::format("'{}' is in no run", name), "one of " + known});
    }
  analysis::Oscillation o = analysis::analyse_oscillation(runs, request.channels, options, common.threads);
  for (auto& [name, tracks] : o.tracks)
    for (analysis::LineTrack& t : tracks) name_ringing(t, o.spectra.at(name), items);
  if (o.channels.empty()) throw InputError("the runs have none of the known channels; name one with --channel");
  if (!common.report.empty()) write_report(common.report, o, runs, items, options, common);

  if (common.json) {
    Json files = Json::array();
    for (std::size_t i = 0; i < runs.size(); ++i) {
      Json channels = Json::object();
      for (const std::string& name : o.channels) {
        if (!runs[i].find(name)) continue;
        const analysis::ChannelSpectrum& s = o.spectra.at(name)[i];
        Json lines = Json::array();
        for (const analysis::SpectralLine& l : s.lines) lines.push_back(line_json(runs[i], s, l, o.channels, options));
        channels[name] = {{"mean", number(s.mean)}, {"std", number(s.std)}, {"lines", std::move(lines)}, {"begin", number(s.begin)}, {"end", number(s.end)}, {"lowest_frequency", number(s.lowest)}, {"highest_frequency", number(s.highest)}};
      }
      files.push_back({{"file", items[i].file}, {"run", runs[i].id}, {"channels", std::move(channels)}});
    }
    Json tracks = Json::array();
    for (const std::string& name : o.channels)
      for (const analysis::LineTrack& t : o.tracks.at(name)) tracks.push_back(track_json(t, items));
    print_json({{"files", std::move(files)}, {"followed", std::move(tracks)}});
    return;
  }

  std::vector<std::vector<std::string>> rows = {{"run", "channel", "f [Hz]", "order [1/turn]", "[1/m]", "[1/m slip]", "amplitude", "share", "sigma", "locked to"}};
  std::size_t left_out = 0;
  for (std::size_t i = 0; i < runs.size(); ++i)
    for (const std::string& name : o.channels)
      for (const analysis::SpectralLine& l : o.spectra.at(name)[i].lines) {
        if (rows.size() > kTextLines) {
          ++left_out;
          continue;
        }
        rows.push_back({items[i].label, name, fmt::format("{:.4g}", l.frequency), shown(l.order), shown(l.per_metre), shown(l.per_slip_metre),
                        fmt::format("{:.3g}", l.amplitude), fmt::format("{:.0f} %", 100.0 * l.share_of_variance), fmt::format("{:.1f}", l.significance), analysis::lock_name(l.locked_to)});
      }
  if (rows.size() == 1) {
    std::printf("no line stands out from the background\n");
    return;
  }
  std::printf("%s", aligned(rows).c_str());
  if (left_out > 0) std::printf("... and %zu more lines (all of them with --json)\n", left_out);
  std::printf("\nFollowed through %zu runs:\n", runs.size());
  static const char* const units[] = {"Hz", "per turn", "per m", "per m of slip", ""};
  for (const std::string& name : o.channels)
    for (const analysis::LineTrack& t : o.tracks.at(name)) {
      const auto own = std::count_if(t.points.begin(), t.points.end(), [](const auto& p) { return p.line >= 0; });
      const std::string where = t.locked_to == analysis::Lock::undecided
                                    ? fmt::format("{:.4g} Hz", t.points.empty() ? 0.0 : t.points.front().frequency)
                                    : fmt::format("{:.4g} +- {:.2g} {}", t.value, t.value_std, units[static_cast<std::size_t>(t.locked_to)]);
      std::printf("  %s: %s, %s, in %td of %zu runs: %s\n", name.c_str(), where.c_str(), analysis::lock_name(t.locked_to).c_str(), own, t.points.size(), t.driver.c_str());
    }
}

std::optional<double> quantity(const std::string& text, const char* unit, const char* option) {
  if (text.empty()) return std::nullopt;
  const QuantityText q = parse_quantity(text, unit);
  if (!q.error.empty()) throw InputError(Problem{{}, 0, 0, option, q.error, fmt::format("a value in {}", unit)});
  return q.value;
}

}  // namespace

void add_oscillation(Command& app, Common& common) {
  Command* command = app.add_subcommand("oscillation", "spectrum of recordings or results: their lines and what they are locked to");
  const auto r = std::make_shared<Request>();
  struct Texts {
    std::string radius, omega, speed, slip, from, to;
    int grousers = -1;
  };
  const auto t = std::make_shared<Texts>();
  command->add_option("FILE", r->files, "recordings (folder, recording.yaml or one of its tables), result files, bare tables")->required()->type_name("");
  command->add_option("--channel", r->channels, "only these channels (drawbar_pull, driving_torque, ...)")->type_name("NAME");
  command->add_option("--method", r->method, "which method of a result file")->type_name("NAME");
  command->add_option("--columns", r->help.columns, "YAML file that says what the columns of a bare table mean")->type_name("FILE");
  command->add_option("--radius", t->radius, "wheel radius of a bare table")->type_name("LENGTH");
  command->add_option("--angular-velocity", t->omega, "wheel rate of a bare table without that channel")->type_name("RATE");
  command->add_option("--forward-velocity", t->speed, "speed of a bare table without that channel")->type_name("SPEED");
  command->add_option("--slip", t->slip, "slip of a bare table, s = 1 - v/(omega r)")->type_name("SLIP");
  command->add_option("--grousers", t->grousers, "number of lugs where the file does not say")->check(range(0, 10000))->type_name("N");
  command->add_option("--from", t->from, "begin of the window (default: where the run is steady)")->type_name("TIME");
  command->add_option("--to", t->to, "end of the window")->type_name("TIME");
  command->add_option("--highest", r->lines.highest, "highest frequency [Hz] (default: 0.45 of the sampling rate)")->check(non_negative_number())->type_name("HZ");
  command->add_option("--false-alarm", r->lines.false_alarm, "probability that a channel of noise shows a line (default: 0.01)")->check(range(1e-12, 0.5))->type_name("P");
  add_common(*command, common, true);
  command->callback([r, t, &common] {
    r->help.radius = quantity(t->radius, "m", "--radius");
    r->help.angular_velocity = quantity(t->omega, "rad/s", "--angular-velocity");
    r->help.forward_velocity = quantity(t->speed, "m/s", "--forward-velocity");
    r->help.slip = quantity(t->slip, "-", "--slip");
    r->lines.begin = quantity(t->from, "s", "--from");
    r->lines.end = quantity(t->to, "s", "--to");
    if (t->grousers >= 0) {
      r->help.grousers = t->grousers;
      r->lines.grouser_count = t->grousers;
    }
    oscillation(*r, common);
  });
}

}  // namespace terrode::cli
