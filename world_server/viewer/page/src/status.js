// SPDX-License-Identifier: MIT
// The banner, which says when and why the force is zero, and the line of facts below the picture.

// Reasons with which the device shows no force, or a fading one, although it might be expected to.
const ZERO = new Set(["world_lost", "world_absent", "over_speed", "not_finite", "no_channel", "device_fault",
                      "loop_fault", "stopped", "emergency_stop", "clutched"]);

/**
 * @param {boolean} connected to the viewer
 * @param {?Object} head of the newest update
 * @return {?{level: string, text: string}} null: nothing to warn of
 */
export function warning(connected, head) {
  if (!connected) return { level: "bad", text: "The viewer does not answer; this page tries again by itself." };
  if (!head) return { level: "note", text: "Waiting for the first update." };
  const { haptic, world } = head;
  if (!haptic.attached) return { level: "bad", text: `No force: no haptic server runs. ${haptic.why}` };
  if (ZERO.has(haptic.reason)) {
    const why = world.attached ? "" : ` ${world.why}`;
    return { level: "bad", text: `No force (${haptic.reason}): ${haptic.sentence}${why}` };
  }
  if (!world.attached) return { level: "bad", text: `No world server runs. ${world.why}` };
  if (haptic.unstable) return { level: "note", text: "The contact is unstable: it gives more energy than the device dissipates." };
  if (haptic.reason === "world_late") return { level: "note", text: haptic.sentence };
  return null;
}

/** One line of facts on both daemons. */
export function facts(head, fps, behindMs) {
  if (!head) return "";
  const { haptic, world } = head;
  const parts = [];
  if (world.attached) {
    parts.push(`${world.scene}, coupling ${world.coupling}, ${(1e9 / world.period_ns).toFixed(0)} Hz, ` +
               `${world.missed} missed`);
  }
  if (haptic.attached && haptic.lateness_us) {
    parts.push(`${haptic.device}, ${(1e9 / haptic.period_ns).toFixed(0)} Hz, late p99 ` +
               `${haptic.lateness_us.p99.toFixed(0)} us, ${haptic.missed} missed`);
    parts.push(haptic.sentence);
  }
  parts.push(`${fps.toFixed(0)} pictures/s, ${behindMs.toFixed(0)} ms behind`);
  return parts.join(" · ");
}
