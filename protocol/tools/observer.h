// SPDX-License-Identifier: MIT
// A third party that looks at both segments, read-only, and reports what the pair does. Either side
// may be missing, come and go. Used by haptic_status.
#pragma once

#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "protocol/attach.h"

namespace rikiseki::protocol {

class Observer {
 public:
  /// Throws SegmentError (64) for a wrong instance name.
  explicit Observer(const std::string& instance);

  /// Attaches to what can be attached and reads the newest of everything. Rates are measured since
  /// the call before; the first has none. The keys are listed in protocol/tools/README.md.
  nlohmann::ordered_json Read();

  /// Was any side attached at the last Read?
  bool found() const { return haptic_.view != nullptr || world_.view != nullptr; }
  /// Why each side is not, in one line; empty when both are.
  std::string absence() const;

 private:
  /// One side: its view, and the tick count for the rate.
  struct Side {
    AttachRequest request;
    std::unique_ptr<PeerView> view;
    std::string why;
    std::uint64_t last_tick = 0;
    std::uint64_t last_ns = 0;
  };

  void Refresh(Side& side);
  nlohmann::ordered_json Common(Side& side, std::uint64_t now_ns);
  nlohmann::ordered_json Haptic(std::uint64_t now_ns, nlohmann::ordered_json& books);
  nlohmann::ordered_json World(std::uint64_t now_ns);

  Side haptic_;
  Side world_;
  BodiesReader bodies_;
  SceneReader scene_;
};

}  // namespace rikiseki::protocol
