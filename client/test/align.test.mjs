// The arithmetic of alignment, without a browser.

import assert from "node:assert/strict";
import { test } from "node:test";
import { Quaternion, Vector3 } from "three";
import { Dwell, Pivot, expectedError, fit, inBase, residuals, worst } from "../src/align.js";
import { inverse } from "../src/aligning.js";

/** Mulberry32: the same numbers every time. */
function draws(seed) {
  return () => {
    seed = (seed + 0x6d2b79f5) | 0;
    let t = Math.imul(seed ^ (seed >>> 15), 1 | seed);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 2 ** 32;
  };
}
const gauss = (next) => Math.sqrt(-2 * Math.log(1 - next())) * Math.cos(2 * Math.PI * next());

const POSE = { position: new Vector3(0.4, -0.2, 0.9), quaternion: new Quaternion(0.5, 0.1, -0.7, 0.4).normalize() };
const PLACES = [[0.3, 0.4, 0.2], [0.6, -0.3, 0.3], [0.2, -0.5, 0.6], [0.7, 0.2, 0.7], [0.4, 0, 0.4], [0.5, 0.5, 0.5]].map((p) => new Vector3(...p));
const seen = (next, sigma) => PLACES.map((point) =>
  inBase(inverse(POSE), point).add(new Vector3(sigma * gauss(next), sigma * gauss(next), sigma * gauss(next))));

test("exact touches give the pose back", () => {
  const room = seen(draws(1), 0);
  const found = fit(room, PLACES);
  assert.ok(found.position.distanceTo(POSE.position) < 1e-9);
  assert.ok(found.quaternion.angleTo(POSE.quaternion) < 1e-7);
  assert.ok(Math.max(...residuals(found, room, PLACES)) < 1e-9);
});

test("touches of 1 mm: what is expected is what comes out, in the mean of many", () => {
  const next = draws(2), point = new Vector3(0.9, 0, 0.2);
  let true2 = 0, expected2 = 0;
  for (let n = 0; n < 400; n++) {
    const room = seen(next, 0.001), found = fit(room, PLACES);
    true2 += inBase(found, inBase(inverse(POSE), point)).distanceToSquared(point);
    expected2 += expectedError(found, room, PLACES, point) ** 2;
  }
  const ratio = Math.sqrt(expected2 / true2);
  assert.ok(ratio > 0.9 && ratio < 1.1, `expected over true: ${ratio}`);
});

test("a touch that is 20 mm off is named, and three touches name none", () => {
  const room = seen(draws(3), 0.0005);
  room[3].x += 0.02;
  const { index, off } = worst(room, PLACES);
  assert.equal(index, 3);
  assert.ok(off > 0.015);
  assert.equal(worst(room.slice(0, 3), PLACES.slice(0, 3)).index, -1);
});

test("the tip is found by turning the controller about it", () => {
  const next = draws(4), tip = new Vector3(0.01, -0.03, -0.05), dent = new Vector3(0.3, 1, -0.4), pivot = new Pivot();
  let found = null;
  for (let n = 0; n < 400 && !found; n++) {
    const turn = new Quaternion().setFromAxisAngle(new Vector3(gauss(next), gauss(next), gauss(next)).normalize(), 0.6 * next());
    const noise = new Vector3(gauss(next), gauss(next), gauss(next)).multiplyScalar(0.0003);
    found = pivot.hear(dent.clone().sub(tip.clone().applyQuaternion(turn)).add(noise), turn);
  }
  assert.ok(found.distanceTo(tip) < 0.001, `${found.distanceTo(tip)} m`);
});

test("a tip that rests is one touch, one that moves is none", () => {
  const dwell = new Dwell(), place = new Vector3(0.1, 0.2, 0.3), touches = [];
  for (let n = 0; n < 200; n++) touches.push(dwell.hear(n / 72, place));
  assert.equal(touches.filter(Boolean).length, 1);
  assert.ok(touches.find(Boolean).distanceTo(place) < 1e-12);
  const moving = new Dwell();
  for (let n = 0; n < 200; n++) assert.equal(moving.hear(n / 72, new Vector3(0.02 * (n / 72), 0, 0)), null);
});
