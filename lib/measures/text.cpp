#include "measures/text.h"

#include <nlohmann/json.hpp>
#include <stdexcept>
#include <vector>

namespace vantage::measures {
namespace {

using Json = nlohmann::json;

Json ToJson(const Gaussian& gaussian) { return {{"mean", gaussian.mean}, {"sigma", gaussian.sigma}, {"count", gaussian.count}}; }

Gaussian GaussianFromJson(const Json& json) {
  return {json.at("mean").get<double>(), json.at("sigma").get<double>(), json.at("count").get<int>()};
}

}  // namespace

std::string ToText(const Measures& measures) {
  const ObservedSuccess& observed = measures.observed;
  const PredictedSuccess& predicted = measures.predicted;
  Json json;
  json["observed"] = {{"positive", ToJson(observed.positive())},
                      {"negative", ToJson(observed.negative())},
                      {"source", ToString(observed.source())}};
  json["predicted"] = {{"trials", predicted.trial_counts()},
                       {"successes", predicted.success_counts()},
                       {"prior_count", predicted.prior_count()},
                       {"source", ToString(predicted.source())}};
  json["fingerprint"] = measures.fingerprint;
  return json.dump();
}

Measures MeasuresFromText(const std::string& text) {
  try {
    const Json json = Json::parse(text);
    const Json& observed = json.at("observed");
    const Json& predicted = json.at("predicted");
    Measures measures;
    measures.observed = ObservedSuccess(GaussianFromJson(observed.at("positive")), GaussianFromJson(observed.at("negative")),
                                        SourceFromString(observed.at("source").get<std::string>()));
    measures.predicted = PredictedSuccess::FromCounts(
        predicted.at("trials").get<std::vector<double>>(), predicted.at("successes").get<std::vector<double>>(),
        SourceFromString(predicted.at("source").get<std::string>()), predicted.at("prior_count").get<double>());
    measures.fingerprint = json.at("fingerprint").get<std::string>();
    return measures;
  } catch (const std::exception& error) {
    throw std::runtime_error(std::string("measures text is broken: ") + error.what());
  }
}

}  // namespace vantage::measures
