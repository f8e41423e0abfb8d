// What has no browser in it: the wire's bytes, the preview's pace, a recording.

import assert from "node:assert/strict";
import { test } from "node:test";
import { Playback } from "../src/playback.js";
import { Recording } from "../src/recording.js";
import { decode, encode, noHand } from "../src/wire.js";
import { FROM_CLIENT, FROM_SERVER, HAND, HEAD_BYTES, INPUT_BYTES } from "../src/wire_table.js";
import { foreseenWords, remedy, words } from "../src/panel.js";

/** A message `robot` of one row. */
function robot(sequence, time, x) {
  const view = new DataView(new ArrayBuffer(HEAD_BYTES + 28));
  view.setUint8(0, FROM_SERVER.robot.type);
  view.setUint8(1, FROM_SERVER.robot.flags.moving | FROM_SERVER.robot.flags.stale);
  view.setUint16(2, 1, true);
  view.setUint32(4, sequence, true);
  view.setFloat64(8, time, true);
  [x, 0, 0, 1, 0, 0, 0].forEach((value, place) => view.setFloat32(HEAD_BYTES + 4 * place, value, true));
  return view.buffer;
}

test("a frame of the server is read by the table", () => {
  const found = decode(robot(7, 1.5, 0.25));
  assert.deepEqual([found.kind, found.count, found.sequence, found.time], ["robot", 1, 7, 1.5]);
  assert.deepEqual([...found.flags].sort(), ["moving", "stale"]);
  assert.deepEqual([...found.rows], [0.25, 0, 0, 1, 0, 0, 0]);
  const other = new Uint8Array(HEAD_BYTES);
  other[0] = 250;
  assert.equal(decode(other.buffer), null);
});

test("an input has each number in its place, and the flags of what is tracked", () => {
  const left = { ...noHand(), tracked: true, position: [1, 2, 3], quaternion: [0.5, 0.5, -0.5, 0.5], stick: [-0.25, 0.75], grip: true };
  const right = { ...noHand(), secondary: true };
  const message = encode("input", { received: 9, stamp: 2.5, hands: { left, right }, visible: true, drawn: true });
  assert.equal(message.byteLength, INPUT_BYTES);
  const head = new DataView(message), rows = new Float32Array(message, HEAD_BYTES), { flags } = FROM_CLIENT.input;
  assert.deepEqual([head.getUint8(0), head.getUint8(1), head.getUint16(2, true), head.getUint32(4, true), head.getFloat64(8, true)],
    [FROM_CLIENT.input.type, flags.left_tracked | flags.visible | flags.drawn, 2, 9, 2.5]);
  const hand = (index) => Object.fromEntries(HAND.map((name, place) => [name, rows[index * HAND.length + place]]));
  assert.deepEqual(hand(0), { x: 1, y: 2, z: 3, qw: 0.5, qx: 0.5, qy: -0.5, qz: 0.5, trigger: 0, grip: 1, stick_x: -0.25, stick_y: 0.75, stick_pressed: 0, primary: 0, secondary: 0 });
  assert.equal(hand(1).secondary, 1);
  assert.equal(encode("ack", { received: 1, stamp: 0 }).byteLength, HEAD_BYTES);
  const view = new DataView(encode("view", { received: 9, stamp: 2.5, pose: { position: { x: 1, y: 2, z: 3 }, quaternion: { w: 4, x: 5, y: 6, z: 7 } } }));
  assert.equal(view.getUint8(1), FROM_CLIENT.view.flags.tracked);
  assert.equal(view.getUint16(2, true), 1);
  assert.deepEqual(Array.from({ length: 7 }, (_, place) => view.getFloat32(HEAD_BYTES + 4 * place, true)), [1, 2, 3, 4, 5, 6, 7]);
  assert.equal(new DataView(encode("view", { received: 9, stamp: 2.5 })).byteLength, HEAD_BYTES + 28);
});

test("a preview plays while it comes in, ends once, and cannot be leapt through", () => {
  const playback = new Playback({ step: 0.1, duration: 1, width: 1 });
  assert.equal(playback.advance(0.5), false);
  playback.add(0, new Float32Array([0, 1, 2]), false);
  assert.equal(playback.advance(0.5), false);
  assert.ok(Math.abs(playback.at - 0.2) < 1e-9, "it waits for what is not there");
  playback.add(3, new Float32Array([3, 4, 5, 6, 7, 8, 9, 10]), true);
  playback.hold(1);
  assert.ok(playback.at < 0.21, "no leap before it has been seen");
  playback.held = false;
  const ends = [];
  for (let n = 0; n < 60; n++) ends.push(playback.advance(0.05));
  assert.equal(ends.filter(Boolean).length, 1);
  playback.hold(0.55);
  assert.equal(playback.index, 5);
  assert.equal(playback.rows[playback.index], 5);
});

test("a recording is replayed at its own times, without a last message that is not whole", () => {
  const messages = [[0, 10, 0], [1, 10.5, 1], [2, 11, 2]].map((values) => new Uint8Array(robot(...values)));
  const bytes = messages.flatMap((one) => [...new Uint8Array(new Uint32Array([one.length]).buffer), ...one]);
  const { playback } = new Recording(new Uint8Array([...bytes, 60, 0, 0, 0, 1]).buffer);
  assert.ok(Math.abs(playback.there - 1) < 0.02);
  const at = (time) => playback.rows[Math.floor(time * 72) * playback.width];
  assert.deepEqual([at(0.25), at(0.75), at(1)], [0, 1, 2]);
  assert.equal(new Recording(new ArrayBuffer(3)).playback, null);
});

test("a robot that has arrived is said to have, until the next plan is asked for", () => {
  const page = { lease: null, id: "", age: 0.02, up: true, reason: null, stale: false, immersed: false };
  const robot = (mode, does) => words({ ...page, state: { mode, robot: does } }).facts.Robot;
  assert.equal(robot("aim", "done"), "arrived, seen 20 ms ago");
  for (const [mode, does] of [["aim", "idle"], ["execute", "running"], ["plan", "done"], ["ready", "done"]]) assert.equal(robot(mode, does), "seen 20 ms ago");
});

test("what to do about a wrong token is said, and any other reason as it is", () => {
  assert.match(remedy("token: wrong"), /Open the address anew that the session has printed/);
  assert.equal(remedy("version: found 1"), "version: found 1");
});

const FORESEEN = { probability: null, low: null, high: null, futures: 12, within: 0.9, miss: null, spread: [], unknown: "" };

test("of a place: how far the preview ends from it, and how far the robot's tip may from that", () => {
  assert.equal(
    foreseenWords({ ...FORESEEN, miss: 0.0082, spread: [0.001, 0.012] }),
    "The preview ends 8 mm from the target; in 90 % of cases the robot’s tip ends within 12 mm of the preview’s, where it touches nothing.",
  );
});

test("a radius that is unknown is said to be, and why", () => {
  assert.equal(
    foreseenWords({ ...FORESEEN, probability: 0.84, low: 0.68, high: 0.93, unknown: "mount tilted by 95°, trials up to 90°" }),
    "Grasp holds in 84 % of 12 futures (68 % to 93 %); how near the robot’s tip comes to the preview’s is unknown: " +
      "mount tilted by 95°, trials up to 90°.",
  );
});
