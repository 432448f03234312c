// SPDX-License-Identifier: MIT
// What the report is made of: chapters, each a study and the rows that it runs.
#pragma once

#include <string>
#include <vector>

#include "tests/lab/study.h"

namespace rikiseki::lab {

struct Chapter {
  std::string name;  // of its file
  Case study;
  Table rows;
  double row_s = 1;    // about how long a row takes: for the time left, and nothing else
  bool alone = false;  // its times are the wall clock's: one row at a time
};

/// `quick`: what two cores do within five minutes; else within an hour.
std::vector<Chapter> ReportPlan(bool quick);

}  // namespace rikiseki::lab
