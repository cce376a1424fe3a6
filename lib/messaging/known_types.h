// What messages are, by their bytes: which type, whether it belongs on that channel, whether its values can be right.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

namespace vantage::messaging {

// "track_t"; empty where the bytes are of no type of ours.
std::string TypeOf(const void* data, std::size_t size);

// The type that belongs on a channel; empty where the channel is not ours.
std::string TypeOfChannel(const std::string& channel);

// The field every type of ours begins with; nullopt where the bytes are of no type of ours. Microseconds since the epoch.
std::optional<std::int64_t> UtimeOf(const void* data, std::size_t size);

// Why our nodes would refuse this message: another type than the channel's, cut off, values out of range. Empty where they would
// not, and for channels that are not ours.
std::string WhyRefused(const std::string& channel, const void* data, std::size_t size);

}  // namespace vantage::messaging
