// The Python module `terrode`: steady wheel, slip sweep, recordings and diagnosis, with NumPy arrays. A thin layer, as
// tools/ is: what it computes, the rooms compute. docs/how-to/python.md shows it in use.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <limits>

#include "bekker/steady_wheel.h"
#include "cli/input.h"
#include "cli/sweep_result.h"
#include "core/version.h"
#include "diagnosis/diagnose.h"
#include "scenario/methods.h"
#include "scenario/recording_file.h"
#include "scenario/scenario.h"

namespace py = pybind11;
using namespace terrode;

namespace {

using Array = py::array_t<double>;
using Input = py::array_t<double, py::array::c_style | py::array::forcecast>;

Array array(const std::vector<double>& values) { return Array(static_cast<py::ssize_t>(values.size()), values.data()); }
py::object number(const std::optional<double>& value) { return value ? py::object(py::float_(*value)) : py::none(); }

// Ctrl-C in Python stops the work at its next look.
Progress python_progress() {
  Progress out;
  out.stop_requested = [] {
    const py::gil_scoped_acquire gil;
    return PyErr_CheckSignals() != 0;
  };
  return out;
}

// Columns of a steady solution for each slip given.
py::dict solve(const bekker::SteadyWheel& wheel, const Input& slip, double normal_load, double angular_velocity) {
  const auto n = slip.size();
  Array pull(n), torque(n), sinkage(n), entry(n), peak(n), resistance(n);
  for (py::ssize_t i = 0; i < n; ++i) {
    bekker::Operating at;
    at.slip = slip.data()[i];
    at.normal_load = normal_load;
    at.angular_velocity = angular_velocity;
    at.forward_velocity = angular_velocity * wheel.wheel().radius;
    const bekker::SteadyState s = wheel.solve(at);
    pull.mutable_at(i) = s.drawbar_pull;
    torque.mutable_at(i) = s.driving_torque;
    sinkage.mutable_at(i) = s.sinkage;
    entry.mutable_at(i) = s.entry_angle;
    peak.mutable_at(i) = s.peak_angle;
    resistance.mutable_at(i) = s.compaction_resistance;
  }
  py::dict out;
  out["drawbar_pull"] = pull;
  out["driving_torque"] = torque;
  out["sinkage"] = sinkage;
  out["entry_angle"] = entry;
  out["peak_angle"] = peak;
  out["compaction_resistance"] = resistance;
  return out;
}

// sigma, tau, ... at `points` angles of the contact.
py::dict profile(const bekker::SteadyWheel& wheel, double slip, double normal_load, double angular_velocity, std::size_t points) {
  if (points < 2) throw InputError("a profile needs at least 2 points");
  bekker::Operating at;
  at.slip = slip;
  at.normal_load = normal_load;
  at.angular_velocity = angular_velocity;
  std::vector<bekker::ProfilePoint> found(points);
  wheel.profile(at, wheel.solve(at), found);
  std::vector<double> theta, sinkage, sigma, tau, j;
  for (const bekker::ProfilePoint& p : found) {
    theta.push_back(p.theta);
    sinkage.push_back(p.sinkage);
    sigma.push_back(p.sigma);
    tau.push_back(p.tau);
    j.push_back(p.shear_displacement);
  }
  py::dict out;
  out["theta"] = array(theta);
  out["sinkage"] = array(sinkage);
  out["sigma"] = array(sigma);
  out["tau"] = array(tau);
  out["shear_displacement"] = array(j);
  return out;
}

// As `terrode sweep`, without files: {method: {column: array}}.
py::dict sweep(const std::string& path, const std::vector<std::string>& names, const std::optional<Input>& slips, int threads) {
  const scenario::Scenario s = scenario::load_scenario(path, threads);
  std::vector<double> given;
  if (slips) given.assign(slips->data(), slips->data() + slips->size());
  const std::vector<scenario::OperatingPoint> points = slips ? s.operating_points(given) : s.operating_points();
  scenario::MethodSettings settings;
  std::vector<vehicle::SweepMethod> methods;
  for (const std::string& name : names) methods.push_back(scenario::make_method(name, s, settings));
  std::vector<recording::Condition> conditions;
  for (const scenario::OperatingPoint& p : points) conditions.push_back(scenario::condition_of(p, s.wheel.radius));
  vehicle::SweepOptions options;
  options.threads = threads;
  std::vector<vehicle::SweepPoint> done;
  {
    const Progress progress = python_progress();
    const py::gil_scoped_release release;
    done = vehicle::sweep(methods, conditions, options, progress);
  }
  if (PyErr_Occurred()) throw py::error_already_set();
  py::dict out;
  for (std::size_t m = 0; m < names.size(); ++m) {
    std::vector<double> slip, pull, torque, sinkage, pull_sem, torque_sem, sinkage_sem, cpu;
    std::vector<std::string> error;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const cli::SweepPoint p =
          cli::summarise(done[m * points.size() + i], points[i], scenario::averaging_period(names[m], s, points[i]));
      slip.push_back(p.at.slip_given);
      pull.push_back(p.drawbar_pull);
      torque.push_back(p.driving_torque);
      sinkage.push_back(p.sinkage);
      pull_sem.push_back(p.drawbar_pull_sem);
      torque_sem.push_back(p.driving_torque_sem);
      sinkage_sem.push_back(p.sinkage_sem);
      cpu.push_back(p.cpu_seconds);
      error.push_back(p.error);
    }
    py::dict columns;
    columns["slip"] = array(slip);
    columns["drawbar_pull"] = array(pull);
    columns["driving_torque"] = array(torque);
    columns["sinkage"] = array(sinkage);
    columns["drawbar_pull_sem"] = array(pull_sem);
    columns["driving_torque_sem"] = array(torque_sem);
    columns["sinkage_sem"] = array(sinkage_sem);
    columns["cpu_seconds"] = array(cpu);
    columns["error"] = error;
    out[py::str(names[m])] = columns;
  }
  return out;
}

py::dict condition_dict(const recording::Condition& c) {
  py::dict out;
  out["slip"] = c.slip;
  out["normal_load"] = number(c.normal_load);
  out["angular_velocity"] = number(c.angular_velocity);
  out["forward_velocity"] = number(c.forward_velocity);
  out["pass"] = c.pass;
  out["repeat"] = c.repeat;
  return out;
}

// The document of diagnosis.json, as far as numbers and names go.
py::dict diagnosis_dict(const diagnosis::Diagnosis& d) {
  py::list effects, located, experiments;
  for (const auto& f : d.effects) {
    py::dict parameters;
    for (const auto& [name, e] : f.parameters) parameters[py::str(name)] = py::dict(py::arg("value") = e.value, py::arg("std") = e.deviation, py::arg("unit") = e.unit);
    effects.append(py::dict(py::arg("ids") = f.ids, py::arg("probability") = f.probability, py::arg("share") = f.share,
                            py::arg("parameters") = parameters, py::arg("equation") = f.equation, py::arg("source") = f.source,
                            py::arg("statement") = f.statement));
  }
  for (const auto& l : d.located)
    located.append(py::dict(py::arg("channel") = l.channel, py::arg("where") = l.where, py::arg("size") = l.size,
                            py::arg("unit") = l.unit, py::arg("significance") = l.significance));
  py::dict parameters, fit;
  for (const auto& p : d.parameters)
    parameters[py::str(p.name)] = py::dict(py::arg("believed") = p.believed, py::arg("fitted") = p.fitted, py::arg("std") = p.deviation,
                                           py::arg("unit") = p.unit, py::arg("refitted_plain") = p.refitted);
  for (int c = 0; c < diagnosis::kChannels; ++c) {
    const auto& f = d.fit[static_cast<std::size_t>(c)];
    if (f.present)
      fit[diagnosis::channel_name(c)] = py::dict(py::arg("rmse_before") = f.rmse_before, py::arg("rmse_after") = f.rmse_after,
                                                 py::arg("heldout_rmse_before") = f.heldout_before,
                                                 py::arg("heldout_rmse_after") = f.heldout_after,
                                                 py::arg("noise_floor") = f.noise_floor, py::arg("unit") = diagnosis::channel_unit(c));
  }
  for (const auto& e : d.next_experiments) experiments.append(py::dict(py::arg("design") = e.design, py::arg("separates") = e.separates));
  return py::dict(py::arg("recording") = d.title, py::arg("verdict") = d.verdict, py::arg("statement") = d.statement,
                  py::arg("effects") = effects, py::arg("located") = located, py::arg("parameters") = parameters, py::arg("fit") = fit,
                  py::arg("next_experiments") = experiments, py::arg("remarks") = d.remarks);
}

py::dict diagnose(const recording::Recording& recording, const recording::Recording* reference, unsigned long seed, int threads,
                  const std::vector<std::string>& without) {
  diagnosis::Options options;
  options.seed = seed;
  options.threads = threads;
  options.without = without;
  options.reference = reference;
  options.progress = python_progress();
  diagnosis::Diagnosis d;
  try {
    const py::gil_scoped_release release;
    d = diagnosis::diagnose(recording, options);
  } catch (const Interrupted&) {
    if (PyErr_Occurred()) throw py::error_already_set();
    throw;
  }
  return diagnosis_dict(d);
}

}  // namespace

PYBIND11_MODULE(terrode, m) {
  m.doc() = "Wheels on deformable soil. SI units and radians; drawbar pull positive forward, torque positive driving, "
            "sinkage positive down; slip s = 1 - v/(omega r) unless a file says otherwise.";
  m.attr("__version__") = version();
  py::register_exception<InputError>(m, "InputError", PyExc_ValueError);
  py::register_exception<RunError>(m, "RunError", PyExc_RuntimeError);

  py::class_<bekker::Soil>(m, "Soil", "Bekker soil: sigma = k (z/plate_width)^n, c and phi, shear modulus K. Pa, rad, m, kg/m3.")
      .def(py::init([](double cohesion, double friction_angle, double shear_modulus, double k, double n, double plate_width, double bulk_density) {
             bekker::Soil s;
             s.cohesion = cohesion, s.friction_angle = friction_angle, s.shear_modulus = shear_modulus;
             s.k = k, s.n = n, s.plate_width = plate_width, s.bulk_density = bulk_density;
             if (const Problems bad = s.validate(); !bad.empty()) throw InputError(bad);
             return s;
           }),
           py::kw_only(), py::arg("cohesion"), py::arg("friction_angle"), py::arg("shear_modulus"), py::arg("k"), py::arg("n"),
           py::arg("plate_width") = 1.0, py::arg("bulk_density") = 1600.0)
      .def_readonly("cohesion", &bekker::Soil::cohesion)
      .def_readonly("friction_angle", &bekker::Soil::friction_angle)
      .def_readonly("shear_modulus", &bekker::Soil::shear_modulus)
      .def_readonly("k", &bekker::Soil::k)
      .def_readonly("n", &bekker::Soil::n)
      .def_readonly("plate_width", &bekker::Soil::plate_width);

  py::class_<bekker::SteadyWheel>(m, "SteadyWheel", "The steady Bekker / Wong-Reece wheel.")
      .def(py::init([](double radius, double width, const bekker::Soil& soil, double a0, double a1, double theta_r) {
             return bekker::SteadyWheel({radius, width}, soil, {a0, a1, theta_r});
           }),
           py::arg("radius"), py::arg("width"), py::arg("soil"), py::kw_only(), py::arg("a0") = 0.18, py::arg("a1") = 0.32,
           py::arg("theta_r") = 0.0)
      .def("solve", &solve, "Columns over slip at a load [N]: drawbar_pull, driving_torque, sinkage, entry_angle, peak_angle, compaction_resistance.",
           py::arg("slip"), py::arg("normal_load"), py::arg("angular_velocity") = 0.3)
      .def("profile", &profile, "Stresses along the contact: theta, sinkage, sigma, tau, shear_displacement.", py::arg("slip"),
           py::arg("normal_load"), py::arg("angular_velocity") = 0.3, py::arg("points") = 101);

  m.def("sweep", &sweep, "Slip sweep of a scenario file or a recording: {method: {column: array}}. A point that failed is NaN and says why under 'error'.",
        py::arg("scenario"), py::arg("methods") = std::vector<std::string>{"steady"}, py::arg("slips") = py::none(), py::arg("threads") = 0);

  py::class_<recording::Run>(m, "Run", "One run: a time series, or a row of steady values.")
      .def_readonly("id", &recording::Run::id)
      .def_property_readonly("condition", [](const recording::Run& r) { return condition_dict(r.condition); })
      .def_property_readonly("time", [](const recording::Run& r) { return array(r.time); })
      .def_property_readonly("channels",
                             [](const recording::Run& r) {
                               py::dict out;
                               for (const recording::Channel& c : r.channels) out[py::str(c.name)] = array(c.values);
                               return out;
                             })
      .def_property_readonly("units",
                             [](const recording::Run& r) {
                               py::dict out;
                               for (const recording::Channel& c : r.channels) out[py::str(c.name)] = c.unit;
                               return out;
                             })
      .def_property_readonly("steady", [](const recording::Run& r) {
        py::dict out;
        for (const auto& [name, value] : r.steady) out[py::str(name)] = py::make_tuple(value.mean, number(value.std));
        return out;
      });

  py::class_<recording::Recording>(m, "Recording", "What a laboratory recorded; load_recording reads it.")
      .def_readonly("title", &recording::Recording::title)
      .def_readonly("source", &recording::Recording::source)
      .def_readonly("slip_convention", &recording::Recording::slip_convention)
      .def_readonly("remarks", &recording::Recording::remarks)
      .def_property_readonly("wheel", [](const recording::Recording& r) { return py::dict(py::arg("radius") = r.wheel.radius, py::arg("width") = r.wheel.width, py::arg("mass") = number(r.wheel.mass)); })
      .def_property_readonly("runs", [](const recording::Recording& r) {
        py::list out;
        for (const recording::Run& run : r.runs) out.append(py::cast(run));
        return out;
      });
  m.def("load_recording", &scenario::load_recording, "Reads a recording: its folder or its recording.yaml. Raises InputError with every problem.",
        py::arg("path"), py::arg("threads") = 0, py::call_guard<py::gil_scoped_release>());
  m.def("diagnose", &diagnose,
        "What the recording says that the steady wheel does not, or a reference of the same soil and conditions: a dict with the keys of diagnosis.json.",
        py::arg("recording"), py::kw_only(), py::arg("reference") = nullptr, py::arg("seed") = 1, py::arg("threads") = 0, py::arg("without") = std::vector<std::string>{});
}
