// SPDX-License-Identifier: MIT
#include "protocol/tools/check/case.h"

#include <cstdio>

#include "specification.h"

namespace rikiseki::protocol::check {

const char* Name(Verdict verdict) noexcept {
  switch (verdict) {
    case Verdict::kOk:
      return "OK";
    case Verdict::kInformational:
      return "INFORMATIONAL";
    case Verdict::kUnimplemented:
      return "UNIMPLEMENTED";
    case Verdict::kNonStrict:
      return "NON-STRICT";
    case Verdict::kFailed:
      break;
  }
  return "FAILED";
}

void Fail(const std::string& text) {
  throw Outcome{Verdict::kFailed, text};
}
void NotStrict(const std::string& text) {
  throw Outcome{Verdict::kNonStrict, text};
}
void Inform(const std::string& text) {
  throw Outcome{Verdict::kInformational, text};
}
void Unimplemented(const std::string& text) {
  throw Outcome{Verdict::kUnimplemented, text};
}
void Require(bool condition, const std::string& text) {
  if (!condition) Fail(text);
}

void AsShould(const std::function<void()>& judge) {
  try {
    judge();
  } catch (const Outcome& outcome) {
    if (outcome.verdict == Verdict::kFailed) NotStrict(outcome.text);
    throw;
  }
}

std::string NumberOf(const std::string& id) {
  const std::size_t begin = id.find('/') + 1;
  return id.substr(begin, id.find('/', begin) - begin);
}

std::string SentenceOf(const std::string& number) {
  const std::string spec = kSpecification;
  const std::string mark = "\n- [" + number + "] ";
  std::size_t at = spec.find(mark);
  if (at == std::string::npos) return {};
  at += mark.size();
  std::string sentence;
  for (; at < spec.size(); ++at) {
    if (spec[at] != '\n') {
      sentence += spec[at];
    } else if (spec.compare(at, 3, "\n  ") == 0) {
      sentence += ' ';
      at += 2;
    } else {
      break;
    }
  }
  return sentence;
}

std::string Ms(std::int64_t ns) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f ms", static_cast<double>(ns) * 1e-6);
  return text;
}

std::string Num(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

}  // namespace rikiseki::protocol::check
