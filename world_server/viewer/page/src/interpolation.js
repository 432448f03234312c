// SPDX-License-Identifier: MIT
// Where bodies are between two world frames. A cubic through both positions with both velocities,
// its slopes limited as Fritsch and Carlson do (SIAM J. Numer. Anal. 17, 1980): between the frames no
// coordinate leaves the range of its two ends, so that a 5 Hz world moves smoothly and never back.
import { Quaternion } from "three";
import { BODY } from "./decode.js";

const NS = 1e-9;

/** Monotone cubic from p0 to p1 with end slopes v0, v1 [per s]; `s` in 0..1 of `duration` [s]. */
export function monotoneCubic(p0, p1, v0, v1, duration, s) {
  const chord = p1 - p0;
  const limited = (v) => Math.sign(chord) * Math.min(Math.max(Math.sign(chord) * v * duration, 0),
                                                     3 * Math.abs(chord));
  const m0 = limited(v0);
  const m1 = limited(v1);
  const r = 1 - s;
  return p0 * r * r * (1 + 2 * s) + p1 * s * s * (3 - 2 * s) + m0 * s * r * r - m1 * s * s * r;
}

/** A moment between two frames of one world: {a, b, s, duration}; b is null where `a` stands alone. */
export function bracket(frames, time, interpolate) {
  const list = frames.list;
  if (list.length === 0) return null;
  const i = Math.max(0, frames.indexAt(time, interpolate ? "state" : "stamp"));
  const a = list[i];
  const b = list[i + 1];
  const span = b ? b.state - a.state : 0;
  // A world that slept, or another one, is not interpolated to.
  if (!interpolate || !b || b.epoch !== a.epoch || span > 3 * a.period) {
    return { a, b: null, s: 0, duration: 0 };
  }
  return { a, b, s: Math.min(Math.max((time - a.state) / span, 0), 1), duration: span * NS };
}

const turned = [0, 0, 0, 1];

/**
 * A body's pose at a moment, into `position` (Vector3) and `orientation` (Quaternion).
 * @return {boolean} false if the frame does not have the body
 */
export function poseAt(moment, key, position, orientation) {
  const { a, b, s, duration } = moment;
  const row = a.rows.get(key);
  if (row === undefined) return false;
  const from = a.bodies;
  const p = row + BODY.position;
  const q = row + BODY.orientation;
  const next = b ? b.rows.get(key) : undefined;
  if (next === undefined) {
    position.set(from[p], from[p + 1], from[p + 2]);
    orientation.set(from[q + 1], from[q + 2], from[q + 3], from[q]);
    return true;
  }
  const to = b.bodies;
  const axis = (k) =>
    monotoneCubic(from[p + k], to[next + BODY.position + k], from[row + BODY.velocity + k],
                  to[next + BODY.velocity + k], duration, s);
  position.set(axis(0), axis(1), axis(2));
  const r = next + BODY.orientation;
  Quaternion.slerpFlat(turned, 0, [from[q + 1], from[q + 2], from[q + 3], from[q]], 0,
                       [to[r + 1], to[r + 2], to[r + 3], to[r]], 0, s);
  orientation.fromArray(turned);
  return true;
}
