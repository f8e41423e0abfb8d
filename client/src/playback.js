// A motion in frames at an even pace: it plays while it still comes in, and can be scrubbed once all of it has.

export class Playback {
  /** `step`: s between frames. `duration`: s in all. `width`: numbers of a frame. */
  constructor({ step, duration, width }) {
    this.step = step;
    this.width = width;
    this.duration = duration;
    this.rows = new Float32Array(width * (Math.ceil(duration / step) + 2));
    this.frames = 0; // received so far
    this.whole = false;
    this.at = 0; // s
    this.played = 0; // s, as far as it has been shown
    this.shownToEnd = false; 
    this.paused = false; // by the user's hand
    this.begun = false; // its first frame has been shown
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

  /** s of the motion that have been received. */
  get available() {
    return Math.max(this.frames - 1, 0) * this.step;
  }

  /** Goes on by `dt` s; whether the end is shown now for the first time. */
  advance(dt) {
    if (this.paused || !this.frames) return false;
    const ended = this.whole && this.at >= this.available;
    if (ended && this.shownToEnd) {
      this.rest += dt;
      if (this.rest > 1) this.at = 0; // again, after a second at its end
      return false;
    }
    this.at = Math.min(this.at + (this.begun ? dt : 0), this.available); // else its end would come sooner than it lasts
    this.begun = true;
    this.played = Math.max(this.played, this.at);
    if (!this.whole || this.at < this.available) return false;
    this.rest = 0;
    const first = !this.shownToEnd;
    this.shownToEnd = true;
    return first;
  }

  /** To `time`, s, and stays there; no leap ahead before it has been shown to its end. */
  pauseAt(time) {
    this.paused = true;
    this.at = Math.min(time, this.shownToEnd ? this.available : this.played);
  }

  get index() {
    return Math.min(Math.floor(this.at / this.step + 1e-6), Math.max(this.frames - 1, 0));
  }
}
