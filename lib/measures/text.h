// Measures as JSON text: how the store keeps them and the bus carries them.
#pragma once

#include <string>

#include "measures/completeness.h"

namespace vantage::measures {

// Parameters and counts, not curves: what comes back evaluates the same to the last bit.
std::string ToText(const Measures& measures);

// Throws std::runtime_error saying which part is missing or out of range.
Measures MeasuresFromText(const std::string& text);

}  // namespace vantage::measures
