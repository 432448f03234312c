// SPDX-License-Identifier: MIT
// What a conformance case is: a sentence of SPEC.md, and a script that finds out whether a running
// peer keeps it.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace rikiseki::protocol::check {

/// In the order of severity: the exit status follows the worst.
enum class Verdict {
  kOk,
  kInformational,  // observed and told; no sentence decides it
  kUnimplemented,  // the peer does not have this optional feature
  kNonStrict,      // a SHOULD is not met
  kFailed,         // a MUST is broken
};

/// "OK", "INFORMATIONAL", ...
const char* Name(Verdict verdict) noexcept;

/// A case ends early by throwing one.
struct Outcome {
  Verdict verdict = Verdict::kOk;
  std::string text;  // one line: what was seen
};

[[noreturn]] void Fail(const std::string& text);
[[noreturn]] void NotStrict(const std::string& text);
[[noreturn]] void Inform(const std::string& text);
[[noreturn]] void Unimplemented(const std::string& text);
/// Fail(text) unless `condition`.
void Require(bool condition, const std::string& text);
/// Runs what judges a SHOULD: not strict, where a MUST would have failed.
void AsShould(const std::function<void()>& judge);

template <typename Player>
struct Case {
  const char* id;  // "haptic/5.5-2/silence": who is judged, number of the sentence, what
  void (*run)(Player&);
};

struct Result {
  std::string id;
  Outcome outcome;
  double seconds = 0;
};

/// The number in a case id: "5.5-2".
std::string NumberOf(const std::string& id);
/// The sentence of SPEC.md with that number, on one line; empty if there is none.
std::string SentenceOf(const std::string& number);

struct PlayOptions {
  std::string instance = "0";
  /// As world: where the surface is; else it is brought to the finger. As haptic: the middle of the
  /// box; else the origin.
  bool has_target = false;
  double target[3] = {0, 0, 0};
  std::string runtime_directory;  // of the role lock; empty: RuntimeDirectory()
};

/// Milliseconds with one digit, for texts.
std::string Ms(std::int64_t ns);
/// A number with few digits, for texts.
std::string Num(double value);

}  // namespace rikiseki::protocol::check
