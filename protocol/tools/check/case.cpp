#include "protocol/tools/check/case.h"

#include <cstdio>

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
