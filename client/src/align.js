// From touches to where the robot's base is in the room. Numbers alone: no scene, no session.
//
// A touch is a dwell, not a press, which would jerk the hand. What is touched is a mark on the flange, whose place the
// robot itself knows; so the touches want no ruler.

import { Matrix4, Quaternion, Vector3 } from "three";

export const TOUCHES = 6; // at least 0.5 m apart in all, not in a plane
export const LIMIT = 0.01; // m, of the touch with which a session begins: above, align again
// A mark on the flange's rim (ISO 9409-1-50 has a diameter of 63 mm) on the side of its x axis, in the frame of link_7.
export const MARK = { body: "link_7", place: [0.0315, 0, 0.107] };
const STILL = 0.005, DWELL = 0.5; // m/s below which a tip is still, s for which it must be
const PIVOT_POSES = 120, PIVOT_TURN = 0.5; // poses about a fixed point, rad by which they must differ
const APART = 0.15; // m from every touch before

/** Whether the tip stays where it is: `hear` gives the mean of the last DWELL s once it does, and then not again until it moved. */
export class Dwell {
  constructor() {
    this.heard = [];
    this.done = false;
  }

  hear(time, point) {
    if (!point) {
      this.heard = [];
      return null;
    }
    this.heard.push([time, point.clone()]);
    while (this.heard[0][0] < time - DWELL) this.heard.shift();
    const [[first, from]] = this.heard;
    const speed = Math.max(...this.heard.map(([, one]) => one.distanceTo(from))) / DWELL;
    if (speed > STILL) this.done = false;
    if (this.done || speed > STILL || time - first < 0.95 * DWELL) return null;
    this.done = true;
    return mean(this.heard.map(([, one]) => one));
  }
}

/** Where the tip is in the controller's frame, from poses while the tip rests in one place: R_i t + p_i = c for all. */
export class Pivot {
  constructor() {
    this.poses = [];
  }

  /** The tip (m) once there are poses enough, turned widely enough; else null. */
  hear(position, quaternion) {
    const last = this.poses.at(-1);
    if (last && last.quaternion.angleTo(quaternion) < 0.01) return null;
    this.poses.push({ position: position.clone(), quaternion: quaternion.clone() });
    const turned = Math.max(...this.poses.map((one) => one.quaternion.angleTo(quaternion)));
    this.widest = Math.max(this.widest ?? 0, turned);
    return this.poses.length >= PIVOT_POSES && this.widest > PIVOT_TURN ? tipOf(this.poses) : null;
  }
}

/** Least squares of R_i t - c = -p_i. */
export function tipOf(poses) {
  const normal = Array.from({ length: 6 }, () => new Array(7).fill(0));
  for (const { position, quaternion } of poses) {
    const m = new Matrix4().makeRotationFromQuaternion(quaternion).elements;
    for (let row = 0; row < 3; row++) {
      const line = [m[row], m[4 + row], m[8 + row], 0, 0, 0, -position.getComponent(row)];
      line[3 + row] = -1;
      for (let i = 0; i < 6; i++) for (let j = 0; j < 7; j++) normal[i][j] += line[i] * line[j];
    }
  }
  const solved = solve(normal);
  return new Vector3(solved[0], solved[1], solved[2]);
}

/** The pose `{position, quaternion}` of the room in the base frame: base ≈ position + R room (Horn 1987). */
export function fit(room, base) {
  const a = mean(room), b = mean(base);
  const s = [0, 1, 2].map(() => [0, 0, 0]);
  room.forEach((point, index) => {
    for (let i = 0; i < 3; i++)
      for (let j = 0; j < 3; j++)
        s[i][j] += (point.getComponent(i) - a.getComponent(i)) * (base[index].getComponent(j) - b.getComponent(j));
  });
  const [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]] = s;
  const [w, x, y, z] = largest([
    [xx + yy + zz, yz - zy, zx - xz, xy - yx],
    [yz - zy, xx - yy - zz, xy + yx, zx + xz],
    [zx - xz, xy + yx, yy - xx - zz, yz + zy],
    [xy - yx, zx + xz, yz + zy, zz - xx - yy],
  ]);
  const quaternion = new Quaternion(x, y, z, w);
  const position = b.sub(a.applyQuaternion(quaternion));
  return { position, quaternion };
}

/** A point of the room in the base frame. */
export const inBase = (pose, point) => point.clone().applyQuaternion(pose.quaternion).add(pose.position);

/** How far each touch is from where the fit has it, m. */
export const residuals = (pose, room, base) => room.map((point, index) => inBase(pose, point).distanceTo(base[index]));

/**
 * The touch that disagrees with the others: `{index, off}`, with `off` m by which it misses the fit of the rest.
 * With three touches nothing can disagree.
 */
export function worst(room, base) {
  let found = { index: -1, off: 0 };
  if (room.length < 4) return found;
  room.forEach((point, index) => {
    const others = (list) => list.filter((_, one) => one !== index);
    const off = inBase(fit(others(room), others(base)), point).distanceTo(base[index]);
    if (off > found.off) found = { index, off };
  });
  return found;
}

/**
 * Expected error, m, of the fit at `point` of the base frame (Fitzpatrick, West, Maurer 1998): with FLE² = FRE² n/(n-2),
 * TRE² = FLE²/n (1 + 1/3 Σ d_k²/f_k²), d_k and f_k distances of point and touches from the principal axis k.
 */
export function expectedError(pose, room, base, point) {
  const n = room.length;
  if (n < 4) return Infinity;
  const fre2 = residuals(pose, room, base).reduce((sum, one) => sum + one * one, 0) / n;
  const centre = mean(base);
  const spread = [0, 1, 2].map((i) => [0, 1, 2].map((j) =>
    base.reduce((sum, one) => sum + (one.getComponent(i) - centre.getComponent(i)) * (one.getComponent(j) - centre.getComponent(j)), 0)));
  const axes = eigenvectors(spread);
  const from = (one, axis) => {
    const away = one.clone().sub(centre);
    return away.lengthSq() - away.dot(new Vector3(...axis)) ** 2;
  };
  const lever = axes.reduce((sum, axis) => sum + from(point, axis) / (base.reduce((all, one) => all + from(one, axis), 0) / n), 0);
  return Math.sqrt((fre2 * n) / (n - 2) / n * (1 + lever / 3));
}

/** Whether a new touch is far enough from those before it. */
export const isApart = (point, before) => before.every((one) => one.distanceTo(point) > APART);

export function mean(points) {
  return points.reduce((sum, one) => sum.add(one), new Vector3()).divideScalar(points.length);
}

/** Gauss with pivots; rows of [A | b]. */
function solve(rows) {
  const n = rows.length;
  for (let k = 0; k < n; k++) {
    const best = rows.slice(k).reduce((most, row, i) => (Math.abs(row[k]) > Math.abs(rows[most][k]) ? k + i : most), k);
    [rows[k], rows[best]] = [rows[best], rows[k]];
    for (let i = k + 1; i < n; i++) {
      const share = rows[i][k] / rows[k][k];
      for (let j = k; j <= n; j++) rows[i][j] -= share * rows[k][j];
    }
  }
  const found = new Array(n).fill(0);
  for (let k = n - 1; k >= 0; k--) {
    const known = rows[k].slice(k + 1, n).reduce((sum, value, i) => sum + value * found[k + 1 + i], 0);
    found[k] = (rows[k][n] - known) / rows[k][k];
  }
  return found;
}

/** The unit eigenvector of the largest eigenvalue of a symmetric matrix. */
const largest = (matrix) => jacobi(matrix).reduce((best, one) => (one.value > best.value ? one : best)).vector;

const eigenvectors = (matrix) => jacobi(matrix).map(({ vector }) => vector);

/** Eigenvalues and vectors of a symmetric matrix by Jacobi's rotations. */
function jacobi(matrix) {
  const n = matrix.length, a = matrix.map((row) => [...row]);
  const v = a.map((_, i) => a.map((__, j) => (i === j ? 1 : 0)));
  for (let sweep = 0; sweep < 30; sweep++)
    for (let p = 0; p < n; p++)
      for (let q = p + 1; q < n; q++) {
        if (Math.abs(a[p][q]) < 1e-300) continue;
        const theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
        const t = (theta >= 0 ? 1 : -1) / (Math.abs(theta) + Math.hypot(theta, 1));
        const c = 1 / Math.hypot(t, 1), s = t * c;
        for (let k = 0; k < n; k++) [a[k][p], a[k][q]] = [c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]];
        for (let k = 0; k < n; k++) [a[p][k], a[q][k]] = [c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]];
        for (let k = 0; k < n; k++) [v[k][p], v[k][q]] = [c * v[k][p] - s * v[k][q], s * v[k][p] + c * v[k][q]];
      }
  return a.map((_, k) => ({ value: a[k][k], vector: v.map((row) => row[k]) }));
}
