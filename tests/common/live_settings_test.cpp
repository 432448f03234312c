// SPDX-License-Identifier: MIT
#include "common/live_settings.h"

#include <catch2/catch.hpp>

namespace rikiseki {
namespace {

using Lines = std::vector<std::string>;

TEST_CASE("what is read again is taken, or needs a restart until the file says otherwise again") {
  LiveSettings settings({"a.live"}, {{"a.live", "1"}, {"a.fixed", "2"}});
  CHECK(settings.Compare({{"a.live", "1"}, {"a.fixed", "2"}}).now.empty());

  const ConfigValues changed{{"a.live", "5"}, {"a.fixed", "6"}};
  CHECK(settings.Compare(changed).now == Lines{"a.live = 5"});
  CHECK(settings.Compare(changed).at_restart == Lines{"a.fixed = 6"});
  settings.Adopt(changed);
  CHECK(settings.Compare(changed).now.empty());
  // It still runs with 2.
  CHECK(settings.Compare(changed).at_restart == Lines{"a.fixed = 6"});
  CHECK(settings.Compare({{"a.live", "5"}, {"a.fixed", "2"}}).at_restart.empty());
}

}  // namespace
}  // namespace rikiseki
