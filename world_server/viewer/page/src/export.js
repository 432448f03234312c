// SPDX-License-Identifier: MIT
// Files for the user: the picture, and the ticks of the visible window as CSV.
import { TICK } from "./decode.js";
import { WINDOW_NS, lateness } from "./charts.js";
import { pointersOf } from "./contact_view.js";

const COLUMNS = ["time_s", "tick", "frame", "pointer", "reason", "x_m", "y_m", "z_m", "fx_n", "fy_n", "fz_n",
                 "penetration_m", "feature_age_s", "lateness_s", "displayed_ns", "received_ns"];

/** One row for each tick and pointer; what is not known is empty. */
export function csv(ticks, time, period) {
  const rows = [COLUMNS.join(",")];
  const known = (v) => (Number.isNaN(v) ? "" : v);
  for (let i = Math.max(ticks.first, ticks.indexAt(time - WINDOW_NS) + 1); i <= ticks.indexAt(time); ++i) {
    for (const { pointer, reason, position, force } of pointersOf(ticks, i)) {
      rows.push([(ticks.at(i, TICK.start) * 1e-9).toFixed(6), ticks.at(i, TICK.tick), ticks.at(i, TICK.frame), pointer,
                 reason, ...position.toArray(), ...force.toArray(), known(ticks.penetration(i)),
                 known(ticks.at(i, TICK.featureAge)), lateness(ticks, i, period) * 1e-9, ticks.displayed(i),
                 ticks.receivedImpulse(i)].join(","));
    }
  }
  return rows.join("\n") + "\n";
}

export function save(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
