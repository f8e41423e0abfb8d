// Full cycles in an emulated Quest 3 against a server that runs: qualification/headset_cycles.py starts this and answers.
//
//   node cycles.mjs URL RUNS AT
//
// A line of JSON each way: {lead: k} asks for the robot to be led to its place number k, and is answered by {mark}, where
// the flange's mark is in the base then, m. {run, presses, touches, off, expected, why} ends a run, answered by {}; why:
// "" where all went well, off: m, of the point AT of the base, JSON, as aligned.

import { createInterface } from "node:readline";
import { frames, inMode, launch, open, point, press, set, until } from "../test/harness.mjs";

const TIP = [0.01, -0.03, -0.05]; // m, of the controller's tip, which the server has to calibrate
const TREMOR = 2e-4, TOUCH = 1e-3; // m along each axis: of a hand at rest, and of a touch
const RIGID = [0.5, 0, 0.55], SOFT = [0.62, 0, 0.2], ASIDE = 0.15; // m, of the targets; to both sides, in turns
const MOST_TOUCHES = 12, TOUCHED = 20_000; // ms that a touch may take

const lines = createInterface({ input: process.stdin })[Symbol.asyncIterator]();
async function ask(question) {
  process.stdout.write(`${JSON.stringify(question)}\n`);
  return JSON.parse((await lines.next()).value);
}

/** In the page: the operator's right hand, its tip at the point `hand.at`, with tremor, `turning` about it, or `moving`
 * near it, as one does between touches; and `room`, where the base truly stands. */
function operate({ tip, tremor, base }) {
  const gauss = () => Math.sqrt(-2 * Math.log(1 - Math.random())) * Math.cos(2 * Math.PI * Math.random());
  const turned = ([x, y, z], { x: a, y: b, z: c, w }) => { // of a vector by a quaternion
    const [u, v, t] = [2 * (b * z - c * y), 2 * (c * x - a * z), 2 * (a * y - b * x)];
    return [x + w * u + b * t - c * v, y + w * v + c * u - a * t, z + w * t + a * v - b * u];
  };
  globalThis.hand = { at: null };
  globalThis.room = (point) => turned(point, base.quaternion).map((value, axis) => value + base.position[axis]);
  let angle = 0;
  setInterval(() => {
    const { at, turning, moving } = globalThis.hand, { right } = globalThis.headset.controllers;
    if (!at) return;
    angle += turning || moving ? 0.11 : 0;
    const about = turning ? [Math.sin(angle), Math.sin(1.7 * angle + 1), Math.sin(2.3 * angle + 2)].map((value) => 0.25 * value) : [0.2, 0, 0.1];
    const q = { x: about[0], y: about[1], z: about[2], w: Math.sqrt(1 - about.reduce((sum, value) => sum + value * value, 0)) };
    const [x, y, z] = turned(tip, q).map((value, axis) => at[axis] - value + tremor * gauss() + (moving ? 0.05 * Math.sin(angle) : 0));
    right.position.set(x, y, z);
    right.quaternion.set(q.x, q.y, q.z, q.w);
  }, 10);
}

const hold = (page, at, how = {}) => page.evaluate((hand) => (globalThis.hand = hand), { at, ...how });
const alignment = (page) => page.evaluate(() => ({ step: globalThis.trunkline.immersive.alignment.step, feedback: globalThis.trunkline.immersive.alignment.feedback }));
const gauss = () => Math.sqrt(-2 * Math.log(1 - Math.random())) * Math.cos(2 * Math.PI * Math.random());

/** Six touches and what goes before, by the board's instructions: the tip in a dent, then the mark wherever the robot holds it. */
async function align(page, where) {
  await press(page, "right", "thumbstick");
  await until(page, () => globalThis.trunkline.immersive.alignment.step === "tip");
  await hold(page, [0.3, 1, -0.4], { turning: true });
  await until(page, () => globalThis.trunkline.immersive.alignment.step === "touch");
  await hold(page, [0.3, 1.2, -0.4], { moving: true });
  let touches = 0;
  for (; touches < MOST_TOUCHES && (await alignment(page)).step === "touch"; touches++) {
    const { mark } = await ask({ lead: touches });
    const { feedback } = await alignment(page);
    const place = (await page.evaluate((point) => globalThis.room(point), mark)).map((value) => value + TOUCH * gauss());
    await hold(page, place);
    const end = Date.now() + TOUCHED;
    for (let now = await alignment(page); now.feedback === feedback && now.step === "touch"; now = await alignment(page)) {
      if (Date.now() > end) throw new Error(`touch ${touches + 1} was not heard: ${feedback}`);
      await page.waitForTimeout(50);
    }
    await hold(page, place.map((value, axis) => value + (axis === 1 ? 0.2 : 0)), { moving: true });
  }
  await until(page, () => globalThis.trunkline.immersive.alignment.done && globalThis.trunkline.immersive.anchor && true);
  await hold(page, null);
  const result = await page.evaluate((at) => {
    const { place, progress } = globalThis.trunkline.immersive.alignment;
    const estimate = place.position.clone().set(...at).applyQuaternion(place.quaternion).add(place.position).toArray();
    return { off: Math.hypot(...globalThis.room(at).map((value, axis) => value - estimate[axis])), expected: progress.expected };
  }, where);
  return { ...result, touches };
}

/** Aim with both rays, ask, watch, confirm, until the robot has done it; how often the trigger was pressed. */
async function cycle(page, run, counted) {
  const y = run % 2 ? ASIDE : -ASIDE;
  await inMode(page, "aim");
  for (const [side, [x, , z]] of [["left", RIGID], ["right", SOFT]]) {
    await point(page, side, [x, y, z]);
    await page.waitForTimeout(500); // the filter's
    await set(page, side, "squeeze", 1);
  }
  await page.waitForTimeout(800);
  await until(page, () => globalThis.trunkline.state.targets && true);
  for (const side of ["left", "right"]) await set(page, side, "squeeze", 0);
  await frames(page, 20);
  counted.presses += 1;
  await press(page, "right", "trigger");
  const { mode, notice } = await until(page, () => {
    const { state } = globalThis.trunkline;
    return (state.mode === "ready" || (state.mode === "aim" && state.notice)) && state;
  }, null, "a preview seen to its end");
  if (mode !== "ready") throw new Error(`no preview: ${notice}`);
  await set(page, "left", "squeeze", 1);
  await frames(page, 20);
  counted.presses += 1;
  await press(page, "right", "trigger");
  await until(page, () => ["execute", "hold", "stopped"].includes(globalThis.trunkline.state.mode));
  const ended = await until(page, () => globalThis.trunkline.state.mode !== "execute" && globalThis.trunkline.state);
  if (ended.mode !== "aim" || ended.robot !== "done") throw new Error(`${ended.mode}, ${ended.robot}: ${ended.notice || ended.fault}`);
  await set(page, "left", "squeeze", 0);
}

const [url, runs, at] = process.argv.slice(2);
const browser = await launch();
try {
  for (let run = 0; run < Number(runs); run++) {
    const closing = [], counted = { presses: 0 };
    let accuracy = {}, why = "";
    try {
      const { page, wrongs } = await open({ after: (work) => closing.push(work) }, browser, { url, origin: new URL(url).origin }, { headset: true, drawn: false, width: 320, height: 240 });
      const yaw = Math.PI * (2 * Math.random() - 1), [c, s] = [Math.cos(yaw / 2), Math.sin(yaw / 2)], h = Math.SQRT1_2;
      const quaternion = { x: -h * c, y: h * s, z: h * s, w: h * c }; // z up as y up, then turned about it
      const base = { position: [0.4 * Math.random() - 0.2, 0.7 + 0.2 * Math.random(), -0.8 - 0.4 * Math.random()], quaternion };
      await page.evaluate(operate, { tip: TIP, tremor: TREMOR, base });
      await until(page, () => globalThis.trunkline.loaded && globalThis.trunkline.frame && true);
      await until(page, () => !document.querySelector("#immerse").hidden);
      await page.click("#immerse");
      await until(page, () => globalThis.trunkline.immersive.session && globalThis.trunkline.wire.controls);
      await until(page, () => globalThis.trunkline.immersive.alignment.place && true);
      accuracy = await align(page, JSON.parse(at));
      await cycle(page, run, counted);
      if (wrongs.length) throw new Error(wrongs[0]);
    } catch (error) {
      why = error.message.split("\n")[0] || "it failed";
    }
    for (const work of closing) await work();
    await ask({ run, ...counted, ...accuracy, why });
  }
} finally {
  await browser.close();
}
process.exit(0);
