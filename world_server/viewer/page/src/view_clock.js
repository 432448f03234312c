// SPDX-License-Identifier: MIT
// Which moment the picture shows. Live, it follows the daemons' clock, behind by as much as
// interpolation needs: until the frame after has come. Paused, it stands, and can be stepped.

const NS_PER_MS = 1e6;
const ARRIVAL_NS = 40e6; // from a frame's publication to its arrival here, with room for a busy machine
const FOLLOW = 0.2; // how fast the delay changes, s per s: the picture never runs backwards

export class ViewClock {
  constructor() {
    this.interpolate = true;
    this.paused = null; // ns, the moment shown, or null: live
    this.#offset = null;
    this.#delay = 0;
    this.#last = 0;
  }
  #offset;
  #delay;
  #last;

  /** An update came that was made at `now` [ns]. */
  hear(now, arrived = performance.now()) {
    const offset = now - arrived * NS_PER_MS;
    // The one that was fastest on its way is nearest to the truth; clocks drift a little.
    if (this.#offset === null || offset > this.#offset || this.#offset - offset > 1e9) {
      this.#offset = offset;
    } else {
      this.#offset -= 1e-3 * (this.#offset - offset);
    }
  }

  /** Called once for each picture; `period` [ns] of the world. Returns the moment shown, ns. */
  advance(period, at = performance.now()) {
    const seconds = Math.min((at - this.#last) / 1e3, 1);
    this.#last = at;
    const wanted = this.interpolate ? 1.25 * period + ARRIVAL_NS : 0;
    if (!this.interpolate || this.#delay === 0) {
      this.#delay = wanted;
    } else {
      const most = FOLLOW * seconds * 1e9;
      this.#delay += Math.min(Math.max(wanted - this.#delay, -most), most);
    }
    return this.paused ?? this.live(at);
  }

  /** Now, on the daemons' clock, ns. */
  present(at = performance.now()) {
    return (this.#offset ?? 0) + at * NS_PER_MS;
  }

  /** The moment that would be shown without a pause, ns. */
  live(at = performance.now()) {
    return this.present(at) - this.#delay;
  }

  setInterpolate(on) {
    this.interpolate = on;
    this.#delay = 0;
  }

  togglePause() {
    this.paused = this.paused === null ? this.live() : null;
  }

  /** Pauses, and moves by `step` [ns] between `oldest` and the present. */
  stepBy(step, oldest) {
    const live = this.live();
    this.paused = Math.min(Math.max((this.paused ?? live) + step, oldest), live);
  }
}
