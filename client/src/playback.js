// A motion in frames at an even pace: it plays while it still comes in, and can be scrubbed once it is there.

export class Playback {
  /** `step`: s between frames. `duration`: s in all. `width`: numbers of a frame. */
  constructor({ step, duration, width }) {
    this.step = step;
    this.width = width;
    this.duration = duration;
    this.rows = new Float32Array(width * (Math.ceil(duration / step) + 2));
    this.frames = 0; // there so far
    this.whole = false;
    this.at = 0; // s
    this.played = 0; // s, as far as it has been shown
    this.seen = false; // whether its end has been
    this.held = false; // by the user's hand
    this.rest = 0; // s at its end
  }

  /** A piece whose first frame is number `first`. */
  add(first, rows, last) {
    const end = (first * this.width) + rows.length;
    if (end > this.rows.length) {
      const longer = new Float32Array(2 * end);
      longer.set(this.rows);
      this.rows = longer;
    }
    this.rows.set(rows, first * this.width);
    this.frames = Math.max(this.frames, end / this.width);
    this.whole ||= last;
  }

  /** s of the motion that are there. */
  get there() {
    return Math.max(this.frames - 1, 0) * this.step;
  }

  /** Goes on by `dt` s; whether the end is shown now for the first time. */
  advance(dt) {
    if (this.held || !this.frames) return false;
    const ended = this.whole && this.at >= this.there;
    if (ended && this.seen) {
      this.rest += dt;
      if (this.rest > 1) this.at = 0; // again, after a second at its end
      return false;
    }
    this.at = Math.min(this.at + dt, this.there);
    this.played = Math.max(this.played, this.at);
    if (!this.whole || this.at < this.there) return false;
    this.rest = 0;
    const first = !this.seen;
    this.seen = true;
    return first;
  }

  /** To `time`, s, and stays there; no leap ahead before it has been seen whole. */
  hold(time) {
    this.held = true;
    this.at = Math.min(time, this.seen ? this.there : this.played);
  }

  get index() {
    return Math.min(Math.floor(this.at / this.step + 1e-6), Math.max(this.frames - 1, 0));
  }
}
