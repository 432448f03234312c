// SPDX-License-Identifier: MIT
// Reads the binary updates that live_message.h describes. Times in ns of the daemons' monotonic
// clock, which a double holds exactly for a hundred days.

export const TICK_NUMBERS = 5;
export const POINTER_NUMBERS = 9;
export const BODY_NUMBERS = 12;

// Columns of a tick.
export const TICK = { start: 0, tick: 1, frame: 2, duration: 3, featureAge: 4 };
// Columns of a pointer, from where it begins in its tick.
export const POINTER = { number: 0, reason: 1, radius: 2, position: 3, force: 6 };
// Columns of a body.
export const BODY = { body: 0, generation: 1, position: 2, orientation: 5, velocity: 9 };

/**
 * @param {ArrayBuffer} message
 * @return {{head: Object, ticks: Float64Array, stride: number, bodies: !Array<Float64Array>}}
 *     `stride`: numbers per tick; `bodies` of each of head.frames
 */
export function decodeUpdate(message) {
  const headBytes = new DataView(message).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(message, 4, headBytes)));
  const stride = TICK_NUMBERS + head.ticks.pointers * POINTER_NUMBERS;
  const tickNumbers = head.ticks.count * stride;
  let at = 4 + headBytes;
  const take = (numbers) => {
    const taken = new Float64Array(message, at, numbers);
    at += taken.byteLength;
    return taken;
  };
  const ticks = take(tickNumbers);
  const bodies = head.frames.map((frame) => take(frame.bodies * BODY_NUMBERS));
  return { head, stride, ticks, bodies };
}

/** The number by which pages know a body: number and generation in one. */
export function bodyKey(body, generation) {
  return generation * 65536 + body;
}
