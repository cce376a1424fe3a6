// One per host: measures the other hosts' clocks, and brings a model store from the host that has it to those that have not.
#pragma once

#include <deque>
#include <optional>
#include <string>

#include "config/yaml.h"
#include "link/store_ends.h"
#include "messaging/host_clocks.h"
#include "messaging/node.h"

namespace vantage::link {

struct LinkParams {
  std::string host;            // This machine's name; empty: as the system says.
  std::string offer;           // The store that is here (the learner's); empty: none.
  std::string copy;            // The file it is copied to; empty: it is not.
  double period_s = 1.0;       // LINK_CLOCK, and the question what there is; in (0, 60].
  double part_pause_s = 0.02;  // Between the parts of an object, 180 KB each; in [0, 1].
  double patience_s = 3.0;     // An answer of which nothing more comes is asked for again; > 0.

  void Check() const;  // Throws std::invalid_argument naming the field.
};

// Reads the fields of the YAML file; throws std::runtime_error "FILE:LINE: ...".
LinkParams LoadLinkParams(const std::string& file);

class LinkNode : public messaging::Node {
 public:
  LinkNode(messaging::Bus& bus, const LinkParams& params);

  void Step() override;
  std::int64_t NextStep_us() const override;
  const messaging::HostClocks& clocks() const { return clocks_; }

 protected:
  std::string State() const override { return awaited_ ? "copying" : params_.copy.empty() ? "running" : "copied"; }
  // "robot +1.3 ms (0.4 ms on the way)" for every other host.
  std::string Detail() const override;

 private:
  struct Awaited {
    std::int64_t request = 0;
    std::int64_t last_us = 0;  // Something of it came.
    messaging::StoreAssembler parts;
  };

  void OnQuery(const store_query_t& query);
  void OnList(const store_list_t& list);
  void OnPart(const store_part_t& part);
  void Ask(store_query_t query);

  LinkParams params_;
  messaging::HostClocks clocks_;
  std::optional<StoreOffer> offer_;
  std::optional<StoreCopy> copy_;
  std::deque<store_part_t> outgoing_;
  std::optional<Awaited> awaited_;
  std::int64_t next_say_us_ = 0;
  std::int64_t next_part_us_ = 0;
  std::int64_t next_request_ = 0;
};

}  // namespace vantage::link
