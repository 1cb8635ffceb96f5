#include "vehicle/slip_sweep.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <ctime>
#include <limits>
#include <mutex>
#include <new>
#include <numeric>

#include "core/parallel.h"
#include "effects/steady_reading.h"
#include "vehicle/instruments.h"

namespace terrode::vehicle {

namespace {

double thread_cpu_seconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

std::string label(const std::string& method, const recording::Condition& c) {
  return fmt::format("{} at slip {:.4g}", method, c.slip);
}

}  // namespace

std::vector<SweepPoint> sweep(const std::vector<SweepMethod>& methods,
                              const std::vector<recording::Condition>& conditions, const SweepOptions& options,
                              const Progress& progress) {
  Problems p;
  if (methods.empty()) p.push_back({{}, 0, 0, "sweep.methods", "is empty", "at least one method"});
  if (conditions.empty()) p.push_back({{}, 0, 0, "sweep.slips", "is empty", "at least one slip"});
  throw_if_any(p);

  struct Task {
    const SweepMethod* method;
    const recording::Condition* condition;
  };
  std::vector<Task> tasks;
  for (const SweepMethod& m : methods)
    for (const recording::Condition& c : conditions)
      if (!options.skip || !options.skip(m.name, c)) tasks.push_back({&m, &c});

  std::vector<SweepPoint> points(tasks.size());
  std::vector<std::atomic<double>> fractions(tasks.size());
  std::atomic<std::size_t> ended{0};
  std::atomic<bool> interrupted{false};
  std::mutex mutex;
  const double total = static_cast<double>(tasks.size());

  // Points that creep take longest to travel their distance: begun first, they leave no thread waiting at the end.
  std::vector<std::size_t> order(tasks.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    if (tasks[a].method != tasks[b].method) return tasks[a].method < tasks[b].method;  // methods in the order asked for
    return tasks[a].condition->forward_velocity.value_or(0.0) < tasks[b].condition->forward_velocity.value_or(0.0);
  });
  parallel_for(tasks.size(), options.threads, [&](std::size_t n) {
    const std::size_t i = order[n];
    const Task& task = tasks[i];
    SweepPoint& point = points[i];
    point.method = task.method->name;
    point.condition = *task.condition;
    if (interrupted || progress.stop_requested()) {
      interrupted = true;
      return;
    }
    Progress own;
    own.stop_requested = [&] { return interrupted || progress.stop_requested(); };
    own.report = [&](double fraction, const std::string&) {
      fractions[i] = fraction;
      double sum = 0.0;
      for (const auto& f : fractions) sum += f;
      progress.report(sum / total, label(point.method, point.condition));
    };
    const double cpu = thread_cpu_seconds();
    const auto wall = std::chrono::steady_clock::now();
    try {
      point.result = task.method->run(*task.condition, own);
    } catch (const Interrupted&) {
      interrupted = true;
      return;
    } catch (const std::bad_alloc&) {
      point.error = "not enough memory";
    } catch (const std::exception& e) {
      point.error = e.what();
    }
    point.cpu_seconds = point.result.cpu_seconds.value_or(thread_cpu_seconds() - cpu);
    point.wall_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - wall).count();
    point.result.run.condition = point.condition;
    own.report(1.0, {});
    const std::lock_guard<std::mutex> lock(mutex);
    ++ended;
    try {
      if (options.on_point) options.on_point(point);
    } catch (...) {
      interrupted = true;  // no hours of work for a disk that is full
      throw;
    }
    if (!options.keep_series) point.result.run = {};
  });
  if (interrupted)
    throw Interrupted(
        fmt::format("sweep stopped after {} of {} points; those that ended are kept, run the same command "
                    "again to go on",
                    ended.load(), tasks.size()));
  return points;
}

std::vector<recording::Condition> conditions_at(const std::vector<double>& slips, double normal_load,
                                                double angular_velocity, double radius) {
  std::vector<recording::Condition> out;
  for (const double slip : slips) {
    recording::Condition c;
    c.slip = slip;
    c.normal_load = normal_load;
    const bool locked = std::isinf(slip) && slip < 0.0;
    c.angular_velocity = locked ? 0.0 : angular_velocity;
    c.forward_velocity = angular_velocity * radius * (locked ? 1.0 : 1.0 - slip);
    out.push_back(c);
  }
  return out;
}

SweepMethod steady_method(const bekker::WheelSize& wheel, const bekker::Soil& soil, const bekker::ContactAngles& angles,
                          const effects::EffectSet& effects, const bekker::PointLaw& law,
                          const bekker::SteadyOptions& options, double travel, std::shared_ptr<const void> owner) {
  struct Model {
    std::shared_ptr<const void> owner;
    effects::EffectSet effects;
    std::vector<const bekker::StressModifier*> modifiers;
    std::optional<bekker::SteadyWheel> wheel;
  };
  const auto model = std::make_shared<Model>();
  model->owner = std::move(owner);
  model->effects = effects;
  model->modifiers.assign(law.modifiers.begin(), law.modifiers.end());
  for (const bekker::StressModifier* m : model->effects.modifiers()) model->modifiers.push_back(m);
  bekker::PointLaw whole = law;
  whole.modifiers = model->modifiers;
  model->wheel.emplace(wheel, soil, angles, whole, options);
  const auto run = [model, travel](const recording::Condition& c, const Progress&) {
    bekker::Operating o;
    o.slip = c.slip;
    o.normal_load = c.normal_load.value_or(o.normal_load);
    o.angular_velocity = c.angular_velocity.value_or(o.angular_velocity);
    o.forward_velocity = c.forward_velocity.value_or(o.forward_velocity);
    o.pass = c.pass;
    o.phase_average = true;
    const bekker::SteadyWheel& solver = *model->wheel;
    o.travel_length = travel;
    o.position = 0.5 * travel;
    const double speed = solver.context(o).forward_velocity;
    if (speed > 0.0) o.time = o.position / speed;
    const bekker::SteadyState s = solver.solve(o);
    const effects::Reading reading = effects::reading_of(solver, model->effects, o, s);
    PointResult out;
    auto& values = out.run.steady;
    values[recording::channel::drawbar_pull].mean = reading.drawbar_pull;
    values[recording::channel::driving_torque].mean = reading.driving_torque;
    values[recording::channel::sinkage].mean = reading.sinkage;
    values[recording::channel::normal_load].mean = reading.normal_load;
    values["entry_angle"].mean = s.entry_angle;
    values["peak_angle"].mean = s.peak_angle;
    values["compaction_resistance"].mean = s.compaction_resistance;
    for (const char* name : {recording::channel::drawbar_pull, recording::channel::driving_torque, recording::channel::sinkage,
                             recording::channel::normal_load})
      if (!std::isfinite(values[name].mean))
        throw RunError(fmt::format("steady wheel at slip {:.4g}: {} is not finite: parameters of soil or effects are out of any range",
                                   c.slip, name));
    if (s.peak_clamped)
      out.events.push_back("the angle of largest stress lay outside the contact and was moved to its end");
    return out;
  };
  return {"steady", run};
}

namespace {
bekker::ContactShape carried(const recording::Condition& c, double wheel_load, const effects::EffectSet& effects) {
  bekker::Context asked;
  asked.slip = c.slip;
  asked.normal_load = c.normal_load.value_or(wheel_load);
  return effects.carried_by_rig(asked);
}
}  // namespace

void read_instruments(recording::Run& run, const recording::Condition& c, double wheel_load,
                      const effects::EffectSet& effects, const wheel::Rolling& rim) {
  run.condition = c;
  run.condition.normal_load = c.normal_load.value_or(wheel_load);
  // The recorded slip is the one computed from speeds and the believed radius.
  const double given = carried(c, wheel_load, effects).slip;
  if (given != c.slip)
    for (recording::Channel& channel : run.channels)
      if (channel.name == "slip")
        for (double& value : channel.values) value += c.slip - given;
  apply_instruments(effects, rim, run);
}

SweepMethod rig_method(const std::string& name, const RigSpec& spec, const RigMotion& motion,
                       std::shared_ptr<const wheel::Body> shape,
                       std::function<std::unique_ptr<terrain::Terrain>(const recording::Condition&)> ground,
                       const effects::EffectSet& effects, const RigObservers& observe,
                       std::shared_ptr<const recording::Checkpoint> resume, const RunMemory& memory) {
  throw_if_any(spec.validate());
  const auto run = [=](const recording::Condition& c, const Progress& progress) {
    RigSpec s = spec;
    RigMotion m = motion;
    const bekker::ContactShape given = carried(c, s.normal_load, effects);
    s.normal_load = given.normal_load;
    m.slip = given.slip;
    m.angular_velocity = c.angular_velocity.value_or(m.angular_velocity);
    if (c.forward_velocity) m.forward_velocity = c.forward_velocity;
    if (std::isinf(c.slip) && c.slip < 0.0) m.angular_velocity = 0.0;
    std::unique_ptr<terrain::Terrain> bed = ground(c);
    const bool audited = bed->sampling() == terrain::Sampling::point_value;  // grains keep no such books
    PointResult out;
    std::shared_ptr<const recording::Checkpoint> from = resume;
    if (!from && memory.load) from = memory.load(c);
    recording::Regularly regularly(memory.interval);
    const auto keep = [&](Rig& rig) {
      if (!memory.save || !(regularly.due() || progress.stop_requested())) return;
      memory.save(c, rig.checkpoint());
      regularly.done();
    };
    for (int pass = from ? c.pass : 1; pass <= c.pass; ++pass) {
      Rig rig(s, m, shape, std::move(bed));
      rig.set_earlier_seconds(out.simulated_seconds);
      if (from) rig.resume(*from);
      Progress share = progress;
      share.report = [&](double fraction, const std::string& what) {
        progress.report((pass - 1 + fraction) / c.pass, what);
      };
      if (pass == c.pass && (observe.sample || memory.save))
        rig.set_observer([&](Rig& r) {
          if (observe.sample) observe.sample(r);
          keep(r);
        });
      if (pass == c.pass && (observe.touchdown || memory.save))
        rig.set_touchdown_observer([&](Rig& r) {
          if (observe.touchdown) observe.touchdown(r);
          keep(r);
        });
      out.run = rig.run(share);
      out.events = rig.events();
      if (audited) out.energy = rig.energy();
      out.simulated_seconds = rig.earlier_seconds() + rig.simulated_seconds();
      bed = rig.release_ground();
    }
    if (memory.forget) memory.forget(c);
    read_instruments(out.run, c, spec.normal_load, effects, *shape->rolling());
    return out;
  };
  return {name, run};
}

}  // namespace terrode::vehicle
