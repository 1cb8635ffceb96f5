// What the steady wheel with given soil and effects predicts for every bin of a campaign and every curve of its soil
// tests, and how well: residuals whitened by the noise of bins and by the run-to-run scatter of soil and datum.
#pragma once

#include <Eigen/Core>
#include <map>
#include <string>
#include <vector>

#include "diagnosis/campaign.h"
#include "effects/effect.h"

namespace terrode::diagnosis {

// Parameters of the plain model in the order they are fitted. The last four are the start-up of a run, which every
// recording has: y = y_steady (1 - c exp(-x_rim/L)), c one for forces and c0 + c1 |s| for sinkage.
enum Base { kLnK, kN, kCohesion, kPhi, kLnShear, kA0, kA1, kLnRunIn, kForceStart, kSinkStart, kSinkSlip, kBaseCount };

// One parameter of an effect that is fitted, in a coordinate in which it is close to linear.
struct FitParameter {
  std::size_t effect;     // index into Hypothesis::effects
  std::string name;
  effects::Scale scale;
  double null_value, lower, upper, prior_mean, prior_deviation;  // of the coordinate
  bool strength;
  double least;           // of scale `inverse`: coordinates below this count as the null
  bool of_reading;        // changes what is read and not what acts: the steady states stay
};

// The coordinate in which a parameter of this scale is fitted (ln p, 1/p or p itself).
double to_coordinate(double value, effects::Scale scale);

// One explanation: effects that are switched on, some parameters fixed (choices), the rest to fit.
struct Hypothesis {
  struct Member {
    std::string id;
    std::map<std::string, double> start;  // SI, of the parameters; those of scale `choice` stay
  };
  std::vector<Member> effects;
  // A term without a name: amplitude f(s) (W/W0)^p in one channel; -1: none.
  int free_channel = -1;
  int free_shape = 0;
  int free_power = 0;

  std::string label() const;
};

// The longest start-up that every run has, as rim path [m]; what settles later is run-in.
double usual_start_up(double radius);

// Shapes of the nameless term over slip, with their text.
int free_shape_count();
const char* free_shape_text(int shape);
double free_shape_value(int shape, double slip);

struct Noise {
  double ln_k = 0.03;      // run-to-run deviation of ln k (soil prepared anew)
  double phi = 0.0052;     // of the friction angle, rad
  double datum = 0.0003;   // of the sinkage datum, m
  double eccentricity = 0; // a sine once per turn in the sinkage, at any phase, m; in torque it is the load's lever
  std::array<double, kChannels> sample{};   // deviation of a bin mean times sqrt(samples)
  std::array<double, kChannels> floor{};    // of a run's mean beyond all that
  bool from_replicates = false;
};

struct Fit {
  Eigen::VectorXd base;                 // kBaseCount
  std::vector<double> extra;            // fitted effect parameters (coordinates), then the nameless amplitude
  std::vector<FitParameter> parameters; // of `extra`
  double chi2 = 0.0;                    // of the data
  double penalty = 0.0;                 // of the priors
  double occam = 0.0;                   // what the width of the priors and of the posterior gives to the log evidence (Laplace)
  // Chi-square of each channel by itself, then of the soil tests; of fits to all runs.
  std::array<double, kChannels + 1> misfit{};
  Eigen::MatrixXd covariance;           // of base and extra
  int data = 0;
  int acting = 0;                       // parameters that the data feel at all
  bool converged = false;
};

// What a fit makes least.
inline double cost(const Fit& f) { return f.chi2 + f.penalty; }

class Model {
 public:
  explicit Model(const Campaign& campaign);

  const Campaign& campaign() const { return *campaign_; }
  const Noise& noise() const { return noise_; }
  // W0 of the nameless term: the median load of the conditions [N].
  double reference_load() const { return reference_load_; }

  // Base parameters for a soil and contact angles, with a usual start-up.
  Eigen::VectorXd base_of(const bekker::Soil& soil, const bekker::ContactAngles& angles) const;
  bekker::Soil soil_of(const Eigen::VectorXd& base) const;
  bekker::ContactAngles angles_of(const Eigen::VectorXd& base) const;

  // Estimates run-to-run scatter from replicates and bin noise from within runs, around the model at `base`.
  void estimate_noise(const Eigen::VectorXd& base);

  // Counts a wheel out of round by `offset` [m] as scatter: its phase is another in every run.
  void allow_eccentricity(double offset, const Eigen::VectorXd& base);

  // Minimises the whitened misfit plus priors over base parameters and the hypothesis' own, from `start`.
  // `fixed`: base parameters that stay. `use`: runs that take part (empty: all); curves always take part.
  Fit fit(const Hypothesis& hypothesis, const Eigen::VectorXd& start, const std::vector<bool>& fixed = {},
          const std::vector<char>& use = {}, int iterations = 25) const;

  // Whitened residuals at a fit: those of `use` runs and of curves; empty where the model has no solution there. With a Jacobian for
  // base and extra.
  Eigen::VectorXd residuals(const Hypothesis& hypothesis, const Fit& fit, const std::vector<char>& use = {}) const;
  Eigen::MatrixXd jacobian(const Hypothesis& hypothesis, const Fit& fit, const std::vector<char>& use = {}) const;

  // Predicted means of each bin of each run and channel, unwhitened: [run][channel][bin].
  std::vector<std::array<std::vector<double>, kChannels>> predict(const Hypothesis& hypothesis, const Fit& fit) const;

  // Predicted pressures and shear stresses of the campaign's curves, at their x [Pa].
  std::vector<std::vector<double>> predict_curves(const Hypothesis& hypothesis, const Fit& fit) const;

  // The effects of a fit, parameters in SI, by id (choices included).
  std::map<std::string, std::map<std::string, double>> effects_of(const Hypothesis& hypothesis, const Fit& fit) const;

  // Expected deviation of a run's mean from the model, from all sources of scatter, by channel.
  double run_mean_deviation(int run, int channel) const;

  std::vector<FitParameter> parameters_of(const Hypothesis& hypothesis) const;

 private:
  struct Vector {
    std::vector<std::array<std::vector<double>, kChannels>> runs;
    std::vector<std::vector<double>> curves;
    bool ok = true;
  };
  struct SteadyCache;
  Vector evaluate(const Hypothesis& h, const std::vector<FitParameter>& parameters, const Eigen::VectorXd& all,
                  const std::vector<char>& use, SteadyCache* cache = nullptr) const;
  Eigen::VectorXd whiten(const Vector& v, const std::vector<char>& use) const;
  std::array<double, kChannels + 1> misfit_of(const Vector& v) const;
  void factorise(const Eigen::VectorXd& base);
  void priors(const std::vector<FitParameter>& parameters, Eigen::VectorXd& mean, Eigen::VectorXd& deviation) const;

  const Campaign* campaign_;
  Noise noise_;
  std::vector<Eigen::MatrixXd> run_factor_;    // Cholesky factors of the runs' covariances
  std::vector<std::array<Eigen::MatrixXd, kChannels>> channel_factor_;  // of each channel by itself
  std::vector<Eigen::MatrixXd> curve_factor_;
  std::vector<double> curve_noise_;
  double reference_load_ = 1.0;
};

}  // namespace terrode::diagnosis
