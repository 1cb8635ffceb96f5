#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <mutex>

#include "bekker/steady_wheel.h"
#include "calibration/dem_tests.h"
#include "calibration/soil_file.h"
#include "cli/calibration_output.h"
#include "cli/input.h"
#include "cli/processes.h"
#include "cli/sources.h"
#include "cli/terminal.h"
#include "core/parallel.h"
#include "core/units.h"
#include "report/page.h"
#include "scenario/dem_file.h"

namespace terrode::cli {
namespace {

namespace fs = std::filesystem;
using calibration::TestTarget;
using calibration::WheelFit;

struct DemToBekkerArguments {
  std::string scenario, output, slips, sweep, travel, sinkage;
  std::vector<std::string> stresses, plates, free;
  int repeats = 3, starts = 24;
  double confidence = 0.95;
  bool overwrite = false;
};

std::vector<double> quantities(const std::vector<std::string>& texts, const std::string& unit, const std::string& option) {
  std::vector<double> out;
  for (const std::string& text : texts) {
    const QuantityText q = parse_quantity(text, unit);
    if (!q.error.empty() || !(q.value > 0)) throw InputError(Problem{{}, 0, 0, option, "'" + text + "' " + (q.error.empty() ? "is not above 0" : q.error), "values in " + unit + " above 0"});
    out.push_back(q.value);
  }
  return out;
}

struct SoilTest {
  TestTarget target;
  int repeat = 0;
  std::vector<double> x, y;  // m, Pa
};

Json soil_test_json(const SoilTest& t, const std::string& recipe) {
  return {{"test", t.target.test}, {"normal_stress", t.target.normal_stress}, {"plate_width", t.target.plate_width}, {"repeat", t.repeat},
          {"recipe", recipe}, {"displacement", t.x}, {"stress", t.y}};
}

// The tests for this wheel: stresses about its mean contact pressure, plates about the size of its contact.
std::vector<SoilTest> planned(const DemToBekkerArguments& a, const scenario::Scenario& s, double diameter) {
  const double load = s.operating_points().front().normal_load, pressure = load / (s.wheel.width * 0.7 * s.wheel.radius);
  std::vector<double> stresses = quantities(a.stresses, "Pa", "--stress"), plates = quantities(a.plates, "m", "--plate");
  if (stresses.empty()) stresses = {0.4 * pressure, pressure, 2.5 * pressure};
  const double across = std::max(5.0 * diameter, 0.4 * s.wheel.radius);
  if (plates.empty()) plates = {across, 1.6 * across};
  const double travel = a.travel.empty() ? std::max(6e-3, 0.6 * diameter) : quantities({a.travel}, "m", "--shear-travel").front();
  const double sinkage = a.sinkage.empty() ? std::max(0.02, 0.15 * s.wheel.radius) : quantities({a.sinkage}, "m", "--depth").front();
  std::vector<SoilTest> out;
  for (int r = 0; r < a.repeats; ++r) {
    for (const double stress : stresses) {
      SoilTest t;
      t.target.test = "direct_shear";
      t.target.normal_stress = stress;
      t.target.at = {0.5 * travel, travel};
      t.repeat = r;
      out.push_back(t);
    }
    for (const double width : plates) {
      SoilTest t;
      t.target.test = "pressure_sinkage";
      t.target.plate_width = t.target.plate_length = width;
      t.target.at = {0.5 * sinkage, sinkage};
      t.repeat = r;
      out.push_back(t);
    }
  }
  return out;
}

void run_soil_tests(std::vector<SoilTest>& tests, const dem::DemTerrainParams& ground, const fs::path& folder, std::uint64_t seed, int threads, const Progress& progress) {
  calibration::DemTestSettings settings;
  settings.cache = (folder / "beds").string();
  std::mutex one;
  std::size_t done = 0;
  const double box = std::max(0.06, 7.0 * [&] {
    double sum = 0.0;
    for (const dem::Grain& g : ground.prism.grains) sum += 2.0 * g.radius;
    return sum / static_cast<double>(ground.prism.grains.size());
  }());
  parallel_for(tests.size(), threads, [&](std::size_t i) {
    SoilTest& t = tests[i];
    const dem::BedRecipe recipe = calibration::recipe_of_ground(ground, seed + static_cast<std::uint64_t>(t.repeat) + 1);
    const auto shear = calibration::shear_settings(t.target, recipe, box, settings);
    const auto plate = calibration::plate_settings(t.target, recipe, settings);
    const bool sheared = t.target.test == "direct_shear";
    // Equal text, equal test. A recipe's text is that of the bed as it settles: the friction it is tested with may be another.
    const std::string friction =
        recipe.settling_friction || recipe.settling_rolling_friction
            ? fmt::format("tested with {:.17g} {:.17g}\n", recipe.contact.friction, recipe.contact.rolling_friction)
            : std::string();
    const std::string text =
        friction + (sheared ? shear.soil.text() + fmt::format("normal_stress {}\nrate {}\ntravel {}\n", shear.normal_stress, shear.rate, shear.travel)
                            : plate.prism.text() + fmt::format("plate {}\nrate {}\nsinkage {}\n", plate.plate_width, plate.rate, plate.sinkage));
    const fs::path file = folder / fmt::format("test_{:03}.json", i);
    if (fs::exists(file)) {
      std::ifstream in(file);
      const Json j = Json::parse(in, nullptr, false);
      if (!j.is_discarded() && j.value("recipe", std::string()) == text) {
        t.x = j.at("displacement").get<std::vector<double>>();
        t.y = j.at("stress").get<std::vector<double>>();
      }
    }
    if (t.x.empty()) {
      Progress part;
      part.stop_requested = progress.stop_requested;
      if (sheared) {
        auto result = dem::direct_shear(shear, part);
        t.x = std::move(result.shear_displacement), t.y = std::move(result.shear_stress);
      } else {
        auto result = dem::pressure_sinkage(plate, part);
        t.x = std::move(result.sinkage), t.y = std::move(result.pressure);
      }
      write_text_atomically(file.string(), json_text(soil_test_json(t, text)) + "\n");
    }
    const std::lock_guard<std::mutex> lock(one);
    ++done;
    progress.report(0.5 * static_cast<double>(done) / static_cast<double>(tests.size()), fmt::format("soil tests: {} of {}", done, tests.size()));
  });
  fs::remove_all(folder / "beds");
}

std::string last_line(const fs::path& path) {
  std::ifstream in(path);
  std::string last;
  for (std::string line; std::getline(in, line);)
    if (!line.empty()) last = line;
  return last;
}

// The wheel on the same particles by `terrode sweep`, which goes on from what is in its file.
void run_sweep(const DemToBekkerArguments& a, const fs::path& file, const fs::path& log, const Common& common, const Progress& progress) {
  std::vector<std::string> words = {"sweep", a.scenario, "--method", "dem", "-o", file.string(), "-j", std::to_string(common.threads)};
  if (!a.slips.empty()) words.push_back("--slip=" + a.slips);
  if (a.overwrite) words.emplace_back("--overwrite");
  if (common.seed_given()) words.insert(words.end(), {"--seed", std::to_string(common.seed)});
  int status = 0, looks = 0;
  const bool finished = run_processes({{words, log.string()}}, 1, [&](std::size_t, int s) { status = s; }, [&] {
    if (++looks % 100 == 0) {
      // Its own messages hold how far it is: "  40 %  12 s left  ...".
      const std::string line = last_line(log);
      const std::size_t at = line.find('%');
      const double share = at == std::string::npos ? 0.0 : parse_number(line.substr(line.find_first_not_of(' '), line.find_first_of(" %", line.find_first_not_of(' ')) - line.find_first_not_of(' '))).value_or(0.0);
      progress.report(0.5 + 0.005 * std::clamp(share, 0.0, 100.0), "wheel on particles: " + line);
    }
    return progress.stop_requested();
  });
  if (!finished) throw Interrupted("What was computed is kept; the same command goes on from there.");
  if (status == 2) throw InputError(last_line(log));
  if (status != 0 && status != 1) throw RunError(fmt::format("the sweep ended with status {}: {}", status, last_line(log)));
}

double root_mean_square(double sum, int count) { return count > 0 ? std::sqrt(sum / count) : std::numeric_limits<double>::quiet_NaN(); }

// Points predicted by a soil; NaN where it does not carry the wheel.
std::vector<std::array<double, 3>> predict(const bekker::Soil& soil, const bekker::ContactAngles& angles, const calibration::WheelData& data) {
  std::vector<std::array<double, 3>> out(data.points.size(), {NAN, NAN, NAN});
  const bekker::SteadyWheel wheel({data.radius, data.width}, soil, angles);
  for (std::size_t p = 0; p < data.points.size(); ++p) {
    try {
      const bekker::SteadyState s = wheel.solve(data.points[p].operating);
      out[p] = {s.drawbar_pull, s.driving_torque, s.sinkage};
    } catch (const RunError&) {
    }
  }
  return out;
}

double shear_stress(const bekker::Soil& s, double normal, double j) { return (s.cohesion + normal * std::tan(s.friction_angle)) * -std::expm1(-j / s.shear_modulus); }
double pressure(const bekker::Soil& s, double z) { return s.k * std::pow(std::max(0.0, z) / s.plate_width, s.n); }

void dem_to_bekker(const DemToBekkerArguments& a, Common& common) {
  const scenario::Scenario s = load_input(a.scenario, common);
  if (a.output.empty()) throw InputError(Problem{{}, 0, 0, "--output", "is missing", "a folder that keeps tests and sweep"});
  const fs::path folder = a.output;
  std::error_code problem;
  fs::create_directories(folder / "tests", problem);
  if (problem) throw InputError(Problem{a.output, 0, 0, {}, "cannot be made: " + problem.message(), "a folder"});
  const std::uint64_t seed = static_cast<std::uint64_t>(s.seed);
  Progress progress = show_progress(common);
  const int threads = thread_count(common.threads);
  const dem::DemTerrainParams ground = scenario::particle_params(s, threads);
  double diameter = 0.0;
  for (const dem::Grain& g : ground.prism.grains) diameter += 2.0 * g.radius / static_cast<double>(ground.prism.grains.size());
  std::vector<SoilTest> tests = planned(a, s, diameter);
  try {
    run_soil_tests(tests, ground, folder / "tests", seed, threads, progress);
  } catch (const Interrupted&) {
    progress = {};
    throw Interrupted(fmt::format("What was computed is in {}; the same command goes on from there.", a.output));
  }
  const fs::path sweep_file = a.sweep.empty() ? folder / "sweep.h5" : fs::path(a.sweep);
  if (a.sweep.empty()) run_sweep(a, sweep_file, folder / "sweep.log", common, progress);
  progress = {};

  recording::Recording recording = load_runs(sweep_file.string(), "dem", {}, threads);
  recording.soil = s.soil;
  recording.wheel.radius = s.wheel.radius;
  recording.wheel.width = s.wheel.width;
  for (std::size_t i = 0; i < tests.size(); ++i) {
    const SoilTest& t = tests[i];
    const std::string name = fmt::format("test {} of {}", t.repeat + 1, a.repeats);
    if (t.target.test == "direct_shear") {
      recording::DirectShearTest out;
      out.file = name;
      out.normal_stress = t.target.normal_stress;
      out.shear_displacement = t.x, out.shear_stress = t.y;
      recording.direct_shear.push_back(out);
    } else {
      recording::PressureSinkageTest out;
      out.file = name;
      out.plate_width = t.target.plate_width, out.plate_length = t.target.plate_length;
      out.sinkage = t.x, out.pressure = t.y;
      recording.pressure_sinkage.push_back(out);
    }
  }

  // Bekker's parameters from either.
  calibration::SoilTestOptions test_options;
  test_options.confidence = a.confidence;
  const calibration::SoilTestFits fits = calibration::fit_soil_tests(recording, test_options);
  recording::SoilBelief from_tests = s.soil;
  calibration::apply(fits, from_tests);
  bekker::Soil tests_soil;
  tests_soil.cohesion = *from_tests.cohesion;
  tests_soil.friction_angle = *from_tests.friction_angle;
  tests_soil.shear_modulus = *from_tests.shear_modulus;
  tests_soil.k = *from_tests.k;
  tests_soil.n = *from_tests.n;
  tests_soil.plate_width = *from_tests.plate_width;
  const bekker::ContactAngles angles = s.contact_angles();
  const calibration::WheelData data = calibration::wheel_data(recording);
  for (const std::string& n : data.notes) note(common, n);
  calibration::WheelFitOptions o;
  if (!a.free.empty()) o.free = a.free;
  o.soil = tests_soil;
  o.angles = angles;
  o.start_from_soil = true;
  o.starts = a.starts;
  o.confidence = a.confidence;
  o.threads = threads;
  o.seed = common.seed;
  const WheelFit wheel = calibration::fit_wheel(data, o, progress);
  const std::vector<Comparison> comparison = compare(fits, wheel);

  // What each says of the other's measurements.
  const auto by_tests = predict(tests_soil, angles, data);
  Json prediction = Json::object();
  std::vector<std::vector<std::string>> rows = {{"channel", "unit", "root mean square", "missed by soil tests", "missed by wheel fit"}};
  double worst = 0.0;
  for (std::size_t c = 0; c < 3; ++c) {
    double size = 0.0, missed = 0.0;
    int count = 0;
    for (std::size_t p = 0; p < data.points.size(); ++p) {
      if (!data.points[p].mean[c] || !std::isfinite(by_tests[p][c])) continue;
      size += std::pow(*data.points[p].mean[c], 2), missed += std::pow(*data.points[p].mean[c] - by_tests[p][c], 2), ++count;
    }
    if (wheel.channels[c].count == 0) continue;
    const double rms = root_mean_square(size, count), error = root_mean_square(missed, count);
    if (rms > 0) worst = std::max(worst, error / rms);
    prediction[calibration::kWheelChannels[c]] = {{"unit", calibration::kWheelUnits[c]}, {"points", count}, {"rms", number(rms)}, {"soil_tests_rmse", number(error)}, {"wheel_rmse", number(wheel.channels[c].rmse)}};
    rows.push_back({calibration::kWheelChannels[c], calibration::kWheelUnits[c], fmt::format("{:.3g}", rms), fmt::format("{:.3g}", error), fmt::format("{:.3g}", wheel.channels[c].rmse)});
  }
  for (const char* kind : {"direct_shear", "pressure_sinkage"}) {
    double size = 0.0, own = 0.0, other = 0.0;
    int count = 0;
    for (const SoilTest& t : tests) {
      if (t.target.test != kind) continue;
      const bool sheared = t.target.test == "direct_shear";
      if (!sheared && fits.sinkage && std::abs(t.target.plate_width - fits.sinkage->plate_width) > 0.02 * t.target.plate_width) continue;  // not the plate that k is of
      for (std::size_t i = 0; i < t.x.size(); ++i) {
        const double mine = sheared ? shear_stress(tests_soil, t.target.normal_stress, t.x[i]) : pressure(tests_soil, t.x[i]);
        const double theirs = sheared ? shear_stress(wheel.soil, t.target.normal_stress, t.x[i]) : pressure(wheel.soil, t.x[i]);
        size += t.y[i] * t.y[i], own += std::pow(t.y[i] - mine, 2), other += std::pow(t.y[i] - theirs, 2), ++count;
      }
    }
    prediction[kind] = {{"unit", "Pa"}, {"points", count}, {"rms", number(root_mean_square(size, count))}, {"soil_tests_rmse", number(root_mean_square(own, count))}, {"wheel_rmse", number(root_mean_square(other, count))}};
    rows.push_back({kind, "Pa", fmt::format("{:.3g}", root_mean_square(size, count)), fmt::format("{:.3g}", root_mean_square(own, count)), fmt::format("{:.3g}", root_mean_square(other, count))});
  }

  recording::SoilBelief from_wheel = from_tests;
  from_wheel.cohesion = wheel.soil.cohesion, from_wheel.friction_angle = wheel.soil.friction_angle, from_wheel.shear_modulus = wheel.soil.shear_modulus;
  from_wheel.k = wheel.soil.k, from_wheel.n = wheel.soil.n, from_wheel.plate_width = wheel.soil.plate_width;
  from_wheel.a0 = wheel.angles.a0, from_wheel.a1 = wheel.angles.a1, from_wheel.theta_r = wheel.angles.theta_r;
  write_text_atomically((folder / "soil_tests.yaml").string(), calibration::soil_yaml(from_tests, fmt::format("{}\nfrom soil tests on particles\nby: {}", s.title, common.command_line)));
  write_text_atomically((folder / "wheel.yaml").string(), calibration::soil_yaml(from_wheel, fmt::format("{}\nfrom a wheel on particles\nby: {}", s.title, common.command_line)));

  Json document = {{"scenario", a.scenario}, {"title", s.title}, {"mean_diameter", diameter}, {"soil_tests", soil_tests_json(fits)}, {"wheel", wheel_json(wheel, data)},
                   {"disagreement", comparison_json(comparison)}, {"prediction", prediction}};
  for (std::size_t p = 0; p < data.points.size(); ++p)
    for (std::size_t c = 0; c < 3; ++c) document["wheel"]["points"][p][std::string(calibration::kWheelChannels[c]) + "_by_soil_tests"] = number(by_tests[p][c]);
  write_text_atomically((folder / "result.json").string(), json_text(document, 1) + "\n");

  std::size_t apart = 0;
  for (const Comparison& c : comparison) apart += std::abs(c.distance) > 2.5;
  if (common.json) {
    print_json(document);
  } else {
    if (fits.shear) {
      print_fit("direct shear on particles (Eq. 24)", *fits.shear);
      print_warnings(fits.shear->warnings);
    }
    if (fits.sinkage) {
      print_fit(fmt::format("plates on particles (Eq. 25), plate width {:.4g} m", fits.sinkage->plate_width), *fits.sinkage);
      print_warnings(fits.sinkage->warnings);
    }
    if (fits.moduli) {
      print_fit("several plates, sigma = (kc/b + kphi) z^n", *fits.moduli);
      print_warnings(fits.moduli->warnings);
    }
    print_fit("wheel on particles", wheel);
    print_warnings(wheel.warnings);
    print_comparison(comparison);
    std::printf("%s\n", aligned(rows).c_str());
  }
  note(common, fmt::format("wrote {} and {}", (folder / "soil_tests.yaml").string(), (folder / "wheel.yaml").string()));
  if (!common.report.empty()) {
    report::Page page("Bekker's parameters of particles: " + (s.title.empty() ? a.scenario : s.title));
    page.command(common.command_line);
    page.verdict(apart || worst > 0.25 ? report::Mood::warning : report::Mood::good,
                 fmt::format("Soil tests and wheel on the same particles disagree on {} of {} parameters; the tests' soil misses the wheel's curves by up to {:.0f} % of their root mean square.", apart, comparison.size(), 100 * worst));
    page.section("Where soil tests and wheel disagree").table(comparison_table(comparison));
    report::Table table;
    table.columns = {{"measured on particles"}, {"unit"}, {"root mean square", "", 3}, {"missed by the tests' soil", "", 3}, {"missed by the wheel's soil", "", 3}};
    for (const auto& [key, value] : prediction.items()) {
      const auto cell = [&, &v = value](const char* name) { return v[name].is_null() ? report::Cell{} : report::Cell{v[name].get<double>()}; };
      table.rows.push_back({key, value["unit"].get<std::string>(), cell("rms"), cell("soil_tests_rmse"), cell("wheel_rmse")});
    }
    page.table(table);
    std::vector<report::Figure> figures;
    const char* labels[3] = {"Drawbar pull", "Driving torque", "Sinkage"};
    const char* units[3] = {"N", "N m", "mm"};
    std::vector<std::size_t> order(data.points.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::sort(order.begin(), order.end(), [&](std::size_t x, std::size_t y) { return data.points[x].operating.slip < data.points[y].operating.slip; });
    for (std::size_t c = 0; c < 3; ++c) {
      if (wheel.channels[c].count == 0) continue;
      const double scale = c == 2 ? 1e3 : 1.0;
      report::Figure f;
      f.title = labels[c];
      f.x = {"Slip", ""};
      f.y = {labels[c], units[c]};
      report::Series particles, tests_line, wheel_line;
      particles.name = "particles";
      particles.draw = report::Draw::points;
      particles.colour = report::kInk;
      tests_line.name = "Bekker from soil tests";
      wheel_line.name = "Bekker from the wheel";
      for (const std::size_t p : order) {
        const double slip = data.points[p].operating.slip;
        if (!std::isfinite(slip)) continue;
        if (data.points[p].mean[c]) particles.x.push_back(slip), particles.y.push_back(scale * *data.points[p].mean[c]);
        tests_line.x.push_back(slip), tests_line.y.push_back(scale * by_tests[p][c]);
        wheel_line.x.push_back(slip), wheel_line.y.push_back(scale * wheel.predicted[p][c]);
      }
      f.series = {particles, tests_line, wheel_line};
      figures.push_back(f);
    }
    for (const char* kind : {"direct_shear", "pressure_sinkage"}) {
      const bool sheared = std::string(kind) == "direct_shear";
      report::Figure f;
      f.title = sheared ? "Direct shear" : "Pressure under the plates";
      f.x = {sheared ? "Shear displacement" : "Sinkage", "mm"};
      f.y = {sheared ? "Shear stress" : "Pressure", "kPa"};
      int colour = 0;
      for (const SoilTest& t : tests) {
        if (t.target.test != kind || t.repeat != 0) continue;
        report::Series points, mine, theirs;
        const std::string name = sheared ? fmt::format("{:.3g} kPa", 1e-3 * t.target.normal_stress) : fmt::format("{:.3g} mm", 1e3 * t.target.plate_width);
        points.name = "particles, " + name;
        points.draw = report::Draw::points;
        mine.name = "from soil tests, " + name;
        theirs.name = "from the wheel, " + name;
        theirs.dashed = true;
        points.colour = mine.colour = theirs.colour = colour;
        for (std::size_t i = 0; i < t.x.size(); ++i) {
          points.x.push_back(1e3 * t.x[i]), points.y.push_back(1e-3 * t.y[i]);
          mine.y.push_back(1e-3 * (sheared ? shear_stress(tests_soil, t.target.normal_stress, t.x[i]) : pressure(tests_soil, t.x[i])));
          theirs.y.push_back(1e-3 * (sheared ? shear_stress(wheel.soil, t.target.normal_stress, t.x[i]) : pressure(wheel.soil, t.x[i])));
        }
        mine.x = theirs.x = points.x;
        f.series.insert(f.series.end(), {points, mine, theirs});
        colour = (colour + 1) % 8;
      }
      f.caption = sheared ? "One repeat of each." : "One repeat of each; Bekker's curves are those of the plate that k refers to.";
      figures.push_back(f);
    }
    page.section("Particles and both fits").figures(figures);
    soil_tests_on(page, fits);
    wheel_on(page, "Wheel on particles", wheel, data);
    page.section("Soil files").listing("soil_tests.yaml", calibration::soil_yaml(from_tests, s.title), true).listing("wheel.yaml", calibration::soil_yaml(from_wheel, s.title), true);
    page.download("result.json", json_text(document, 1));
    page.write_html(common.report);
    note(common, "wrote " + common.report);
  }
}

}  // namespace

void add_dem_to_bekker(Command& app, Common& common) {
  Command* command = app.add_subcommand("dem-to-bekker", "soil tests and a wheel sweep on particles, Bekker's parameters fitted to both, and where they disagree; resumable");
  const auto a = std::make_shared<DemToBekkerArguments>();
  command->add_option("SCENARIO", a->scenario, "scenario file, or a recording")->required()->type_name("");
  command->add_option("-o,--output", a->output, "folder that keeps tests and sweep; what is in it already is not computed again")->type_name("DIR");
  command->add_option("--slip", a->slips, "slips of the wheel, by the convention of the scenario: 0,0.1,0.3 or FROM:TO:STEP")->type_name("LIST");
  command->add_option("--sweep", a->sweep, "result file that holds the wheel's sweep by the method dem, in place of one computed here")->type_name("FILE.h5");
  command->add_option("--stress", a->stresses, "normal stresses of the shear tests (default: 0.4, 1 and 2.5 of the wheel's pressure)")->delimiter(',')->type_name("LIST");
  command->add_option("--plate", a->plates, "widths of the square plates (default: the larger of 5 grains and 0.4 radii, and 1.6 of it)")->delimiter(',')->type_name("LIST");
  command->add_option("--shear-travel", a->travel, "of the shear tests (default: 6 mm, at least 0.6 grains)")->type_name("LENGTH");
  command->add_option("--depth", a->sinkage, "of the plates (default: 20 mm, at least 0.15 radii)")->type_name("LENGTH");
  command->add_option("--repeats", a->repeats, "beds of different seeds for each test (default: 3)")->check(range(1, 100))->type_name("N");
  command->add_option("--free", a->free, "parameters fitted to the wheel: cohesion, friction_angle, shear_modulus, k, n, a0, a1, theta_r (default: all but the last)")->delimiter(',')->type_name("NAMES");
  command->add_option("--starts", a->starts, "starting points of the wheel fit (default: 24)")->check(range(1, 10000))->type_name("N");
  command->add_option("--confidence", a->confidence, "of intervals (default: 0.95)")->check(range(0.01, 0.9999))->type_name("P");
  command->add_flag("--overwrite", a->overwrite, "replace a sweep of another scenario");
  add_common(*command, common, true);
  command->callback([a, &common] { dem_to_bekker(*a, common); });
}

}  // namespace terrode::cli
