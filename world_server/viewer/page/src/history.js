// SPDX-License-Identifier: MIT
// What the page remembers: the ticks and the frames of the last 30 s, so that one can pause and step
// back. Frames of scenes with very many bodies are kept for a shorter time, within MOST_FRAME_BYTES.
import { BODY, BODY_NUMBERS, POINTER_NUMBERS, TICK, TICK_NUMBERS, bodyKey } from "./decode.js";

export const SPAN_NS = 30e9;
const MOST_FRAME_BYTES = 96e6;
const MOST_TICKS = 1 << 16;

// What the page adds to a tick, behind what came: norms of the impulse totals, N s, and the
// penetration, m, once the picture has come to it.
const ADDED = 3;

/** The ticks, a ring of rows of numbers. Row i is valid for first <= i < end. */
export class Ticks {
  constructor() {
    this.first = 0;
    this.end = 0;
    this.#allocate(TICK_NUMBERS);
  }

  #allocate(received) {
    this.received = received;
    this.stride = received + ADDED;
    this.first = this.end;
    this.capacity = Math.min(MOST_TICKS, 2 ** Math.floor(Math.log2(48e6 / 8 / this.stride)));
    this.rows = new Float64Array(this.capacity * this.stride);
  }

  append(ticks, stride, displayed, received) {
    if (stride > this.received) this.#allocate(stride);
    for (let from = 0; from < ticks.length; from += stride) {
      const start = ticks[from + TICK.start];
      if (this.end > this.first && start <= this.at(this.end - 1, TICK.start)) continue;
      const row = (this.end % this.capacity) * this.stride;
      this.rows.fill(0, row, row + this.stride);
      this.rows.set(ticks.subarray(from, from + stride), row);
      this.rows[row + this.received] = displayed;
      this.rows[row + this.received + 1] = received;
      this.rows[row + this.received + 2] = NaN;
      ++this.end;
      if (this.end - this.first > this.capacity) ++this.first;
      while (start - this.at(this.first, TICK.start) > SPAN_NS) ++this.first;
    }
  }

  get pointers() {
    return (this.received - TICK_NUMBERS) / POINTER_NUMBERS;
  }
  at(i, column) {
    return this.rows[(i % this.capacity) * this.stride + column];
  }
  displayed(i) {
    return this.at(i, this.received);
  }
  receivedImpulse(i) {
    return this.at(i, this.received + 1);
  }
  penetration(i) {
    return this.at(i, this.received + 2);
  }
  setPenetration(i, metres) {
    this.rows[(i % this.capacity) * this.stride + this.received + 2] = metres;
  }

  /** The last tick that started at `time` or before; first - 1 if there is none. */
  indexAt(time) {
    let low = this.first - 1;
    let high = this.end - 1;
    while (low < high) {
      const middle = Math.ceil((low + high) / 2);
      if (this.at(middle, TICK.start) <= time) low = middle;
      else high = middle - 1;
    }
    return low;
  }
}

/** The frames, oldest first, each {epoch, number, stamp, state, period, planes, copies, bodies, rows}:
 * `rows` leads from bodyKey to where the body begins in `bodies`. */
export class Frames {
  constructor() {
    this.list = [];
    this.bytes = 0;
  }

  append(epoch, told, bodies) {
    const last = this.list.at(-1);
    const { number, stamp_ns, state_ns, period_ns, planes, copies } = told;
    const frame = {
      epoch,
      number,
      stamp: stamp_ns,
      state: last ? Math.max(state_ns, last.state + 1) : state_ns,
      period: period_ns,
      planes,
      copies,
      bodies: bodies.slice(),
    };
    frame.rows = last && sameBodies(last.bodies, bodies) ? last.rows : rowsOf(bodies);
    this.list.push(frame);
    this.bytes += bodies.byteLength;
    while (
      this.list.length > 2 &&
      (frame.state - this.list[0].state > SPAN_NS || this.bytes > MOST_FRAME_BYTES)
    ) {
      this.bytes -= this.list.shift().bodies.byteLength;
    }
    return frame;
  }

  /** Index of the last frame whose `column` ("state" or "stamp") is not after `time`; -1: none. */
  indexAt(time, column) {
    let low = -1;
    let high = this.list.length - 1;
    while (low < high) {
      const middle = Math.ceil((low + high) / 2);
      if (this.list[middle][column] <= time) low = middle;
      else high = middle - 1;
    }
    return low;
  }
}

function sameBodies(before, now) {
  if (before.length !== now.length) return false;
  for (let row = 0; row < now.length; row += BODY_NUMBERS) {
    if (before[row] !== now[row] || before[row + 1] !== now[row + 1]) return false;
  }
  return true;
}

function rowsOf(bodies) {
  const rows = new Map();
  for (let row = 0; row < bodies.length; row += BODY_NUMBERS) {
    rows.set(bodyKey(bodies[row + BODY.body], bodies[row + BODY.generation]), row);
  }
  return rows;
}
