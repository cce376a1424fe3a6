#include "vantage/report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>

namespace vantage::cli {
namespace {

constexpr double kDegree = M_PI / 180.0;
constexpr double kClearBlurPx = 0.3;
constexpr double kMaxErrorM = 0.3;  // A pose that is quite wrong is not more wrong for being farther off.

std::string Text(const char* format, double a, double b = 0.0, double c = 0.0) {
  char text[200];
  std::snprintf(text, sizeof text, format, a, b, c);
  return text;
}

struct ErrorSample {
  double rotation_rad = 0.0;
  double error_m = 0.0;
  Eigen::Vector3d by_axis_m = Eigen::Vector3d::Zero();
};

std::vector<ErrorBin> Binned(const std::vector<ErrorSample>& samples) {
  std::map<int, std::vector<ErrorSample>> cells;
  for (const ErrorSample& sample : samples) cells[static_cast<int>(sample.rotation_rad / (5.0 * kDegree))].push_back(sample);
  std::vector<ErrorBin> bins;
  for (const auto& [cell, of] : cells) {
    ErrorBin bin;
    bin.rotation_deg = 5.0 * cell + 2.5;
    bin.count = static_cast<int>(of.size());
    std::vector<double> errors;
    for (const ErrorSample& sample : of) {
      errors.push_back(std::min(sample.error_m, kMaxErrorM));
      bin.mean_m += errors.back() / bin.count;
      bin.by_axis_m += sample.by_axis_m.cwiseMin(kMaxErrorM) / bin.count;
    }
    bin.median_m = Quantile(errors, 0.5);
    bins.push_back(bin);
  }
  return bins;
}

// Share of right ones among proposals with a confidence in [lower, upper].
struct Share {
  int right = 0, of = 0;
  double value() const { return of > 0 ? right / static_cast<double>(of) : std::nan(""); }
};
Share RightWithin(const std::vector<assessment::Trial>& trials, double lower, double upper) {
  Share share;
  for (const assessment::Trial& trial : trials) {
    for (const assessment::Proposal& proposal : trial.together) {
      if (proposal.confidence < lower || proposal.confidence > upper) continue;
      ++share.of;
      share.right += proposal.correct;
    }
  }
  return share;
}

// Where p(o|c) passes p; 1 where it never does.
double ConfidenceAt(const measures::ObservedSuccess& observed, double p) {
  for (double c = 0.0; c <= 1.0; c += 0.002) {
    if (observed.Probability(c) >= p) return c;
  }
  return 1.0;
}

double MeanRightConfidence(const std::vector<assessment::Trial>& trials, double noise) {
  double sum = 0.0;
  int of = 0;
  for (const assessment::Trial& trial : trials) {
    if (trial.image_noise != noise || trial.together.empty() || !trial.together.front().correct) continue;
    sum += trial.together.front().confidence;
    ++of;
  }
  return of > 0 ? sum / of : std::nan("");
}

// Hardly disturbed: of the 8 levels of noise and of blur the lowest two.
bool IsClear(const assessment::Trial& trial, const std::vector<double>& levels) {
  const double most = *std::max_element(levels.begin(), levels.end());
  return trial.image_noise <= 0.2 * most && trial.blur_px <= kClearBlurPx;
}

// Of the right proposals with a confidence below 0.1, those in images hardly disturbed.
Share ClearAmongFaint(const std::vector<assessment::Trial>& trials, const std::vector<double>& levels) {
  Share share;
  for (const assessment::Trial& trial : trials) {
    for (const assessment::Proposal& proposal : trial.together) {
      if (!proposal.correct || proposal.confidence > 0.1) continue;
      ++share.of;
      share.right += IsClear(trial, levels);
    }
  }
  return share;
}

// Where the median error passes the distance that the mean passes as soon as a few poses are quite wrong.
std::string MedianPassesAt(const std::vector<ErrorBin>& bins) {
  const auto median = PassesAt(bins, 0.04, &ErrorBin::median_m);
  return median ? Text("the median passes it at %.1f degrees", *median) : "the median does not";
}

// Of proposals with all views on offer, those that change sides between 2 and 6 cm.
Share NearlyRight(const std::vector<assessment::Trial>& trials) {
  Share share;
  for (const assessment::Trial& trial : trials) {
    for (const assessment::Proposal& proposal : trial.together) {
      ++share.of;
      share.right += proposal.error_m >= 0.02 && proposal.error_m < 0.06;
    }
  }
  return share;
}

void ObserveObject(const Report& report, const ReportObject& object, std::vector<Observation>* all) {
  const auto note = [&](const std::string& claim, const std::string& seen, bool agrees, const std::string& why) {
    all->push_back({object.name, claim, seen, agrees, why});
  };
  const std::vector<double> levels = NoiseLevels(object.trials);
  const auto clear = FitWhere(report, object.trials, [&](const auto& trial) { return IsClear(trial, levels); });
  const measures::ObservedSuccess& observed = object.measures.observed;
  const Share sure = RightWithin(object.trials, 0.35, 0.45), unsure = RightWithin(object.trials, 0.0, 0.1);
  const Share faint = ClearAmongFaint(object.trials, levels);
  const double p_sure = observed.Probability(0.4), p_unsure = observed.Probability(0.1);
  note("A confidence of 0.4 is almost certainly right",
       Text("p(o|c = 0.4) = %.2f; %.0f of %.0f proposals from 0.35 to 0.45 right", p_sure, sure.right, sure.of), p_sure >= 0.95,
       Text("right ones have %.2f on average, wrong ones %.2f: p(o|c) passes 0.95 at %.2f", observed.positive().mean,
            observed.negative().mean, ConfidenceAt(observed, 0.95)));
  note("Confidences under 0.1 tend to be false",
       Text("p(o|c = 0.1) = %.2f; %.0f of %.0f proposals below 0.1 right", p_unsure, unsure.right, unsure.of),
       unsure.of > 0 ? unsure.value() < 0.5 : p_unsure < 0.5,
       Text("wrong ones reach %.2f on average; of the right ones below 0.1 %.0f of %.0f are in images with more than little noise "
            "or blur",
            observed.negative().mean, faint.of - faint.right, faint.of));
  const double halfway_deg = object.measures.predicted.HalfwayRotation() / kDegree;
  note("One view is detected half of the time at about 22 degrees", Text("at %.1f degrees", halfway_deg),
       std::abs(halfway_deg - 22.0) <= 5.0,
       Text("at %.1f degrees in images with little noise and blur", clear.predicted.HalfwayRotation() / kDegree));
  const auto bins = ErrorOverRotation(object);
  const auto passes = PassesAt(bins, 0.04);
  note("The mean pose error passes 4 cm at about 20 degrees",
       passes ? Text("at %.1f degrees (virtual)", *passes) : "it does not where it was tried (virtual)",
       passes && std::abs(*passes - 20.0) <= 5.0, MedianPassesAt(bins));
  const double least = MeanRightConfidence(object.trials, levels.front());
  const double most = MeanRightConfidence(object.trials, levels.back());
  note("Noise shifts confidence",
       Text("right ones have %.2f on average without noise, %.2f at %.0f grey levels", least, most, levels.back()),
       most < 0.9 * least, "noise hides learned interest points and adds others, so that fewer find support");
  const Share nearly = NearlyRight(object.trials);
  double change = 0.0;
  for (const double correct_m : {0.02, 0.06}) {
    const auto other = FitAt(report, object.trials, correct_m).observed;
    for (double c = 0.0; c <= 1.0; c += 0.01) change = std::max(change, std::abs(other.Probability(c) - observed.Probability(c)));
  }
  note("What counts as right, 2, 4 or 6 cm, has no significant impact", Text("p(o|c) changes by %.2f at most", change),
       change <= 0.1, Text("%.0f of %.0f proposals are off by 2 to 6 cm", nearly.right, nearly.of));
}

// Where one curve leaves the band of others, in steps of confidence.
struct Band {
  int within = 0, of = 0;
  int above = 0;  // Of those outside.
  double first = 1.0, last = 0.0;
  std::string Where() const {
    if (within == of) return "everywhere";
    return Text("outside from c = %.2f to %.2f, above the band in %.0f of these places", first, last, above);
  }
};
Band WithinBand(const measures::ObservedSuccess& curve, const std::vector<measures::ObservedSuccess>& others) {
  constexpr double kTolerance = 0.02;
  Band band;
  for (double c = 0.0; c <= 0.6; c += 0.01) {
    double lower = 1.0, upper = 0.0;
    for (const auto& other : others) {
      lower = std::min(lower, other.Probability(c));
      upper = std::max(upper, other.Probability(c));
    }
    ++band.of;
    const bool above = curve.Probability(c) > upper + kTolerance;
    if (!above && curve.Probability(c) >= lower - kTolerance) {
      ++band.within;
      continue;
    }
    band.above += above;
    band.first = std::min(band.first, c);
    band.last = c;
  }
  return band;
}

double SpreadOf(const measures::ObservedSuccess& observed) { return ConfidenceAt(observed, 0.75) - ConfidenceAt(observed, 0.25); }

void ObserveTruth(const Report& report, const ReportObject& object, std::vector<Observation>* all) {
  const auto note = [&](const std::string& claim, const std::string& seen, bool agrees, const std::string& why) {
    all->push_back({object.name, claim, seen, agrees, why});
  };
  const measures::Measures real = FitTruth(*report.truth);
  const std::vector<double> levels = NoiseLevels(object.trials);
  std::vector<double> widths;
  std::vector<measures::ObservedSuccess> virtual_ones;
  for (const double noise : levels) {
    virtual_ones.push_back(FitWhere(report, object.trials, [&](const auto& trial) { return trial.image_noise == noise; }).observed);
    widths.push_back(SpreadOf(virtual_ones.back()));
  }
  const Band band = WithinBand(real.observed, virtual_ones);
  note("The real p(o|c) lies in the band of the virtual ones", Text("in %.0f of %.0f places", band.within, band.of),
       band.within >= 0.9 * band.of, band.Where());
  const double width = SpreadOf(real.observed);
  note("The real p(o|c) is steeper than the virtual ones",
       Text("from 1/4 to 3/4 within %.3f of confidence; virtual ones within %.3f (median)", width, Quantile(widths, 0.5)),
       width < Quantile(widths, 0.5),
       Text("%.0f real hypotheses, %.0f virtual images a level: few samples are drawn towards the flatter default",
            static_cast<double>(report.truth->hypotheses.size()),
            static_cast<double>(object.trials.size()) / static_cast<double>(levels.size())));
  const auto clear = FitWhere(report, object.trials, [&](const auto& trial) { return IsClear(trial, levels); });
  const double virtual_deg = object.measures.predicted.HalfwayRotation() / kDegree;
  const double real_deg = real.predicted.HalfwayRotation() / kDegree;
  note("Virtual and real p(o|theta) intersect where they fall to one half",
       Text("virtual at %.1f, real at %.1f degrees", virtual_deg, real_deg), std::abs(virtual_deg - real_deg) <= 3.0,
       Text("virtual at %.1f degrees with little noise and blur", clear.predicted.HalfwayRotation() / kDegree));
  const auto bins = ErrorOverRotation(*report.truth);
  const auto passes = PassesAt(bins, 0.04);
  note("The mean pose error passes 4 cm at about 20 degrees",
       passes ? Text("at %.1f degrees (real)", *passes) : "it does not (real)", passes && std::abs(*passes - 20.0) <= 5.0,
       MedianPassesAt(bins));
  Eigen::Vector3d near = Eigen::Vector3d::Zero();
  int count = 0;
  for (const ErrorBin& bin : bins) {
    if (bin.rotation_deg < 20.0) near += bin.count * bin.by_axis_m, count += bin.count;
  }
  near *= 1000.0 / std::max(1, count);
  note("The depth error is higher than that within the image plane",
       Text("x %.1f, y %.1f, z %.1f mm up to 20 degrees", near.x(), near.y(), near.z()), near.z() > std::max(near.x(), near.y()),
       "in colour alone depth shows as size only");
}

}  // namespace

std::vector<double> NoiseLevels(const std::vector<assessment::Trial>& trials) {
  std::vector<double> levels;
  for (const assessment::Trial& trial : trials) {
    if (trial.object_shown) levels.push_back(trial.image_noise);
  }
  std::sort(levels.begin(), levels.end());
  levels.erase(std::unique(levels.begin(), levels.end()), levels.end());
  if (levels.empty()) levels.push_back(0.0);
  return levels;
}

measures::Measures FitWhere(const Report& report, const std::vector<assessment::Trial>& trials,
                            const std::function<bool(const assessment::Trial&)>& taken) {
  std::vector<assessment::Trial> some;
  for (const assessment::Trial& trial : trials) {
    if (!trial.object_shown || taken(trial)) some.push_back(trial);
  }
  return assessment::FitMeasures(some, report.recogniser, report.observed_fit);
}

measures::Measures FitAt(const Report& report, std::vector<assessment::Trial> trials, double correct_m) {
  for (assessment::Trial& trial : trials) {
    for (assessment::Proposal& proposal : trial.alone) proposal.correct = proposal.error_m < correct_m;
    for (assessment::Proposal& proposal : trial.together) proposal.correct = proposal.error_m < correct_m;
  }
  return assessment::FitMeasures(trials, report.recogniser, report.observed_fit);
}

measures::Measures FitTruth(const ReportTruth& truth) {
  measures::Measures measures;
  measures.observed = assessment::FitObserved(truth.hypotheses);
  measures.predicted = assessment::FitPredicted(truth.view_trials, measures.observed);
  return measures;
}

std::vector<ErrorBin> ErrorOverRotation(const ReportObject& object) {
  std::vector<ErrorSample> samples;
  for (const assessment::Trial& trial : object.trials) {
    if (trial.object_shown && trial.hypothesis()) samples.push_back({trial.rotation_rad, trial.alone.front().error_m});
  }
  return Binned(samples);
}

std::vector<ErrorBin> ErrorOverRotation(const ReportTruth& truth) {
  std::vector<ErrorSample> samples;
  for (const assessment::ViewTrial& trial : truth.view_trials) {
    if (trial.hypothesis) samples.push_back({trial.rotation_rad, trial.error_m, trial.error_by_axis_m});
  }
  return Binned(samples);
}

std::optional<double> PassesAt(const std::vector<ErrorBin>& bins, double error_m, double ErrorBin::*error) {
  for (std::size_t i = 0; i < bins.size(); ++i) {
    if (bins[i].*error < error_m) continue;
    if (i == 0) return bins[0].rotation_deg;
    const ErrorBin &a = bins[i - 1], &b = bins[i];
    return a.rotation_deg + (b.rotation_deg - a.rotation_deg) * (error_m - a.*error) / (b.*error - a.*error);
  }
  return std::nullopt;
}

std::vector<Observation> Observe(const Report& report) {
  std::vector<Observation> all;
  std::vector<double> halves, right;
  for (const ReportObject& object : report.objects) {
    ObserveObject(report, object, &all);
    halves.push_back(ConfidenceAt(object.measures.observed, 0.5));
    right.push_back(object.measures.observed.positive().mean);
    if (report.truth && report.truth->object == object.name) ObserveTruth(report, object, &all);
  }
  if (halves.size() > 1) {
    const auto [least, most] = std::minmax_element(halves.begin(), halves.end());
    const auto [weakest, strongest] = std::minmax_element(right.begin(), right.end());
    all.push_back({"", "p(o|c) differs considerably from object to object",
                   Text("it passes one half at confidences from %.2f to %.2f", *least, *most), *most - *least > 0.05,
                   Text("right ones have from %.2f to %.2f on average, wrong ones from background and look-alikes alike", *weakest,
                        *strongest)});
  }
  return all;
}

Json ToJson(const std::vector<Observation>& observations) {
  Json json = Json::array();
  for (const Observation& one : observations) {
    json.push_back({{"object", one.object}, {"claim", one.claim}, {"seen", one.seen}, {"agrees", one.agrees}, {"why", one.why}});
  }
  return json;
}

}  // namespace vantage::cli
