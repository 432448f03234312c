// SPDX-License-Identifier: MIT
// The two-rate loops of the reference tables as plain loops over numbers: an independent check of
// the laboratory, which shares no code with the project. Every tick's force is remembered, replay
// repeats them one by one, and the period map is read off by running a period from every unit state.
#pragma once

#include <string>

namespace rikiseki::lab::oracle {

struct Rates {
  std::string method;  // as in the tables
  bool clamped = false;
  double hand_mass = 1, hand_damping = 0, hand_stiffness = 0;
  double stiffness = 2000, damping = 0;
  double period = 1e-3;
  int ticks = 50;
  int latency = 0;
  double mass = 1;
};

/// Growth per world period. Costs the cube of the remembered ticks.
double Growth(const Rates& rates);

}  // namespace rikiseki::lab::oracle
