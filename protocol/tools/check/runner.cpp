// SPDX-License-Identifier: MIT
#include "protocol/tools/check/runner.h"

#include <algorithm>
#include <fstream>
#include <ostream>

#include "common/clock.h"
#include "common/exit_code.h"
#include "common/text.h"
#include "protocol/tools/check/haptic_player.h"
#include "protocol/tools/check/world_player.h"

namespace rikiseki::protocol::check {

void Reporter::Add(const Result& result) {
  results_.push_back(result);
  std::string line = Name(result.outcome.verdict);
  line.resize(14, ' ');
  line += result.id;
  if (!result.outcome.text.empty()) line += ": " + result.outcome.text;
  out_ << line << "\n";
  if (result.outcome.verdict >= Verdict::kNonStrict) {
    out_ << "              [" << NumberOf(result.id) << "] " << SentenceOf(NumberOf(result.id))
         << "\n";
  }
  out_ << std::flush;
}

void Reporter::Summary() {
  double seconds = 0;
  int counts[5] = {};
  for (const Result& result : results_) {
    ++counts[static_cast<int>(result.outcome.verdict)];
    seconds += result.seconds;
  }
  out_ << results_.size() << " cases in " << Num(seconds) << " s:";
  for (const Verdict verdict : {Verdict::kOk, Verdict::kInformational, Verdict::kUnimplemented,
                                Verdict::kNonStrict, Verdict::kFailed}) {
    out_ << " " << counts[static_cast<int>(verdict)] << " " << Name(verdict)
         << (verdict == Verdict::kFailed ? "\n" : ",");
  }
  out_ << std::flush;
}

Verdict Reporter::worst() const {
  Verdict worst = Verdict::kOk;
  for (const Result& result : results_) worst = std::max(worst, result.outcome.verdict);
  return worst;
}

int Reporter::ExitStatus() const {
  return worst() >= (strict_ ? Verdict::kNonStrict : Verdict::kFailed) ? kExitFault : kExitOk;
}

void Reporter::WriteJunit(const std::string& path, const std::string& suite) const {
  std::ofstream file(path);
  const auto bad = [this](const Result& result) {
    return result.outcome.verdict >= (strict_ ? Verdict::kNonStrict : Verdict::kFailed);
  };
  const auto skipped = [](const Result& result) {
    return result.outcome.verdict == Verdict::kUnimplemented;
  };
  file << "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuite name=\"" << Escaped(suite)
       << "\" tests=\"" << results_.size() << "\" failures=\""
       << std::count_if(results_.begin(), results_.end(), bad) << "\" skipped=\""
       << std::count_if(results_.begin(), results_.end(), skipped) << "\">\n";
  for (const Result& result : results_) {
    file << "  <testcase classname=\"" << Escaped(suite) << "\" name=\"" << Escaped(result.id)
         << "\" time=\"" << result.seconds << "\">\n";
    const std::string text = Escaped(result.outcome.text);
    const std::string sentence = Escaped(SentenceOf(NumberOf(result.id)));
    if (bad(result)) {
      file << "    <failure message=\"" << text << "\">" << sentence << "</failure>\n";
    } else if (skipped(result)) {
      file << "    <skipped message=\"" << text << "\"/>\n";
    }
    file << "    <system-out>" << Name(result.outcome.verdict) << " [" << NumberOf(result.id)
         << "] " << sentence << (text.empty() ? "" : " -- ") << text
         << "</system-out>\n  </testcase>\n";
  }
  file << "</testsuite>\n";
  if (!file) throw StartError(kExitUsage, "cannot write " + path);
}

template <typename Player>
Result RunCase(const Case<Player>& one, Player& player) {
  Result result{one.id, {}, 0};
  const std::int64_t start = MonotonicNow();
  for (int attempt = 1;; ++attempt) {
    player.Calm();
    try {
      one.run(player);
      result.outcome = {};
    } catch (const Outcome& outcome) {
      result.outcome = outcome;
    }
    const bool stalled = player.longest_pause_ns() > kStallNs;
    if (result.outcome.verdict != Verdict::kFailed || !stalled || attempt == kTries) break;
  }
  result.seconds = static_cast<double>(MonotonicNow() - start) * 1e-9;
  return result;
}

template Result RunCase(const Case<WorldPlayer>&, WorldPlayer&);
template Result RunCase(const Case<HapticPlayer>&, HapticPlayer&);

bool Selected(const std::string& id, std::span<const std::string> wanted) {
  return wanted.empty() || std::any_of(wanted.begin(), wanted.end(), [&](const std::string& one) {
           return id == one || (id.starts_with(one) && id[one.size()] == '/');
         });
}

}  // namespace rikiseki::protocol::check
