#include "measures/text.h"

#include <nlohmann/json.hpp>
#include <stdexcept>
#include <vector>

namespace vantage::measures {
namespace {

using Json = nlohmann::json;

Json ToJson(const Gaussian& gaussian) { return {{"mean", gaussian.mean}, {"sigma", gaussian.sigma}, {"count", gaussian.count}}; }

Json ToJson(const std::vector<Knot>& curve) {
  Json json = Json::array();
  for (const Knot& knot : curve) json.push_back({knot.confidence, knot.log_ratio});
  return json;
}

Gaussian GaussianFromJson(const Json& json) {
  return {json.at("mean").get<double>(), json.at("sigma").get<double>(), json.at("count").get<int>()};
}

ObservedSuccess ObservedFromJson(const Json& json) {
  const Gaussian positive = GaussianFromJson(json.at("positive")), negative = GaussianFromJson(json.at("negative"));
  const Source source = SourceFromString(json.at("source").get<std::string>());
  const ObservedFit fit = ObservedFitFromString(json.value("fit", "gaussians"));  // Older stores know no other.
  if (fit == ObservedFit::kGaussians) return {positive, negative, source};
  std::vector<Knot> curve;
  for (const Json& knot : json.at("curve")) curve.push_back({knot.at(0).get<double>(), knot.at(1).get<double>()});
  return {positive, negative, source, fit, std::move(curve)};
}

}  // namespace

std::string ToText(const Measures& measures) {
  const ObservedSuccess& observed = measures.observed;
  const PredictedSuccess& predicted = measures.predicted;
  Json json;
  json["observed"] = {{"positive", ToJson(observed.positive())},
                      {"negative", ToJson(observed.negative())},
                      {"source", ToString(observed.source())},
                      {"fit", ToString(observed.fit())},
                      {"curve", ToJson(observed.curve())}};
  json["predicted"] = {{"trials", predicted.trial_counts()},
                       {"successes", predicted.success_counts()},
                       {"prior_count", predicted.prior_count()},
                       {"common_cause", predicted.common_cause()},
                       {"source", ToString(predicted.source())}};
  json["fingerprint"] = measures.fingerprint;
  return json.dump();
}

Measures MeasuresFromText(const std::string& text) {
  try {
    const Json json = Json::parse(text);
    const Json& predicted = json.at("predicted");
    Measures measures;
    measures.observed = ObservedFromJson(json.at("observed"));
    measures.predicted = PredictedSuccess::FromCounts(
        predicted.at("trials").get<std::vector<double>>(), predicted.at("successes").get<std::vector<double>>(),
        SourceFromString(predicted.at("source").get<std::string>()), predicted.at("prior_count").get<double>());
    measures.predicted.set_common_cause(predicted.value("common_cause", PredictedSuccess::kDefaultCommonCause));  // As above.
    measures.fingerprint = json.at("fingerprint").get<std::string>();
    return measures;
  } catch (const std::exception& error) {
    throw std::runtime_error(std::string("measures text is broken: ") + error.what());
  }
}

}  // namespace vantage::measures
