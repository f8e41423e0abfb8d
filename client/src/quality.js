// How well the page draws: less well where a picture takes long, so that input never waits for drawing.

const SLOW = 0.06; // s a picture, above which quality is lowered
const HOPELESS = 0.24; // s, from which on all is lowered at once
const LIGHT = 0.012; // s, below which it may rise again
const LOOKS = 5; // pictures whose median counts
const SETTLES = 1; // s after a change before the next
const CALM = 10; // s of light pictures before quality rises; it doubles with each fall
const SMALL = 400_000, READABLE = 0.7; // pixels of a window, and how coarse it becomes at most
const LATE = 0.1; // s between inputs at which they suffer

/** From best to least: pixels drawn for each of the page's, whether the reach may be shown, and whether robots have few faces. */
export const LEVELS = [
  { ratio: 2, reach: true }, { ratio: 1, reach: true }, { ratio: 0.7, reach: true }, { ratio: 0.7, reach: false }, { ratio: 0.5, reach: false, coarse: true },
];

export class Quality {
  /** `apply(level)` is called on each change. `finest`: pixels of the screen for each of the page's. `isWeak`: drawing is likely
   * to be slow, so it begins with the least, and control is not lost before that is known. */
  constructor(apply, finest, isWeak = false) {
    this.apply = apply;
    this.finest = finest;
    this.best = LEVELS.findLastIndex(({ ratio }, index) => index === 0 || ratio >= finest);
    this.at = isWeak ? LEVELS.length - 1 : this.best;
    this.recent = [];
    this.seconds = 0; // median of late
    this.since = 0; // s of the page, of the last change
    this.calm = CALM;
    this.isFixed = false; // for pictures that are to be as good as can be
  }

  /** Pixels drawn for each of a window of `area` pixels; of a small one not so few that nothing can be read. */
  ratioOf(area) {
    return Math.min(Math.max(LEVELS[this.at].ratio, area < SMALL ? READABLE : 0), this.finest);
  }

  get reach() {
    return LEVELS[this.at].reach;
  }

  get isCoarse() {
    return Boolean(LEVELS[this.at].coarse);
  }

  get isSlow() {
    return this.seconds > SLOW;
  }

  /** A picture took `seconds`, and was there at `now`, s. */
  took(seconds, now) {
    this.recent = [...this.recent, seconds].slice(-LOOKS);
    if (this.recent.length < LOOKS || this.isFixed) return;
    this.seconds = [...this.recent].sort((a, b) => a - b)[LOOKS >> 1];
    if (this.seconds > LIGHT) this.lightSince = null;
    else this.lightSince ??= now;
    if (now - this.since < SETTLES) return;
    if (this.isSlow && this.at + 1 < LEVELS.length) {
      this.calm *= 2;
      this.change(this.seconds > HOPELESS ? LEVELS.length - 1 : this.at + 1, now);
    } else if (this.lightSince !== null && now - this.lightSince > this.calm && this.at > this.best) this.change(this.at - 1, now);
  }

  /** `gap` s lay between two inputs, which shall be even: a long one counts as a slow picture. */
  input(gap, now) {
    if (gap > LATE) this.took(gap, now);
  }

  change(level, now) {
    this.at = level;
    this.since = now;
    this.lightSince = null;
    this.recent = [];
    this.apply(LEVELS[level]);
  }

  /** What is slow and what to do, "" where nothing is. `reachShown`: whether it is drawn now. */
  hint(reachShown) {
    const { seconds, at, best } = this;
    if (!this.isSlow && at === best) return "";
    const lowered = at > best ? `drawn coarser${this.reach ? "" : ", without the reach"}` : "";
    if (!this.isSlow) return lowered;
    const help = reachShown ? "H hides the reach; a smaller window draws faster" : "a smaller window draws faster";
    return [`slow, ${(Math.ceil(10 * seconds) / 10).toFixed(1)} s a picture`, lowered, help].filter(Boolean).join("; ");
  }
}

/** Whether WebGL here is a program without a graphics card, for which smooth edges cost most. */
export function isSoftware() {
  const gl = document.createElement("canvas").getContext("webgl2");
  const names = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = names ? String(gl.getParameter(names.UNMASKED_RENDERER_WEBGL)) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

/** Calls `done(seconds)` when all calls of `gl` since `began`, s of `now()`, are drawn, without waiting for it; one at a time. */
export class Stopwatch {
  constructor(gl, now, done) {
    Object.assign(this, { gl, now, done, sync: null });
  }

  get isRunning() {
    return this.sync !== null;
  }

  start(began) {
    const { gl } = this;
    this.cancel();
    const sync = gl.isContextLost() ? null : gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    if (!sync) return;
    this.sync = sync;
    gl.flush();
    const look = () => {
      if (this.sync !== sync) return;
      const isPending = !gl.isContextLost() && gl.getSyncParameter(sync, gl.SYNC_STATUS) === gl.UNSIGNALED; // null after a loss
      if (isPending) return void setTimeout(look, 4);
      this.cancel();
      this.done(this.now() - began);
    };
    setTimeout(look, 0);
  }

  /** Nothing is waited for any more. */
  cancel() {
    if (this.sync) this.gl.deleteSync(this.sync);
    this.sync = null;
  }
}
