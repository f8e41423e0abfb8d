// The trials that the page carries: both arms' points, as numbers of `unit_m`, little-endian, 16 bits.

const LOST = -32768; // of a point that the cameras did not see
const USUAL = 0.95; // share of a trial's errors that the colours resolve

/** What Python packed (trunkline/report/certificate/replays.py): trials by number, and each frame's points. */
export class Replays {
  constructor(packed) {
    const bytes = Uint8Array.from(atob(packed.data), (letter) => letter.charCodeAt(0));
    const view = new DataView(bytes.buffer);
    this.numbers = new Int16Array(bytes.length / 2);
    for (let index = 0; index < this.numbers.length; index++) this.numbers[index] = view.getInt16(2 * index, true);
    Object.assign(this, { trials: packed.trials, rate: packed.frames_per_s, unit: packed.unit_m, points: packed.radii_m.length, radii: packed.radii_m });
  }

  /** Both arms in a frame, m, from the base on: `measured` has NaN where no camera saw the point; and how far apart, mm. */
  frame(trial, frame) {
    const { offset, frames } = this.trials[trial], size = 3 * this.points;
    const [measured, simulated] = [0, 1].map((arm) => {
      const first = offset + (arm * frames + frame) * size;
      return Array.from(this.numbers.subarray(first, first + size), (number) => (number === LOST ? NaN : number * this.unit));
    });
    const errors = Array.from({ length: this.points }, (_, i) => 1e3 * Math.hypot(...[0, 1, 2].map((k) => measured[3 * i + k] - simulated[3 * i + k])));
    return { measured, simulated, errors };
  }

  /** An error that few of a trial exceed, mm, rounded up to a number that reads well. */
  scale(trial) {
    const errors = Array.from({ length: this.trials[trial].frames }, (_, frame) => this.frame(trial, frame).errors).flat();
    const sorted = errors.filter(Number.isFinite).sort((a, b) => a - b);
    const most = Math.max(sorted[Math.floor(USUAL * (sorted.length - 1))] ?? 0, 0.1);
    const ten = 10 ** Math.floor(Math.log10(most));
    return ten * [1, 2, 5, 10].find((step) => step * ten >= most);
  }
}

/** Only the points that the cameras saw, and their values. */
export function visiblePoints(points, values) {
  const indices = values.map((_, i) => i).filter((i) => Number.isFinite(points[3 * i]));
  return { points: indices.flatMap((i) => points.slice(3 * i, 3 * i + 3)), values: indices.map((i) => values[i]) };
}
