// The page in an emulated Quest 3: the full cycle with two controllers, lost tracking, a lost anchor, recentring.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { frames, inMode, launch, open, passed, picture, point, press, serve, set, until } from "./harness.mjs";

let browser, server;

before(async () => {
  server = await serve();
  browser = await launch();
});
after(async () => {
  await browser?.close();
  await server?.close();
});

/** A page that has entered the headset, controls, and whose base has been put in place by A. */
async function aligned(t) {
  const opened = await open(t, browser, server, { headset: true });
  const { page } = opened;
  await until(page, () => globalThis.trunkline.loaded && globalThis.trunkline.frame && true);
  await until(page, () => !document.querySelector("#immerse").hidden);
  await page.click("#immerse");
  await until(page, () => globalThis.trunkline.immersive.session && globalThis.trunkline.wire.controls);
  await until(page, () => globalThis.trunkline.immersive.alignment.place && true);
  await press(page, "right", "a-button");
  await until(page, () => globalThis.trunkline.immersive.alignment.done);
  await inMode(page, "aim");
  return opened;
}

/** Both targets set with their grips, as a user does. */
async function aim(page, setsTargets = true) {
  for (const [side, place] of [["left", [0.5, 0.1, 0.5]], ["right", [0.72, 0.1, 0.13]]]) {
    await point(page, side, place);
    await page.waitForTimeout(300); // the filter's
    await set(page, side, "squeeze", 1);
  }
  await page.waitForTimeout(600);
  if (setsTargets) await until(page, () => globalThis.trunkline.state.targets && true);
}

test("it asks for passthrough with local-floor and anchors, and draws nothing behind the robot", async (t) => {
  const { page, wrongs } = await aligned(t);
  const view = await page.evaluate(() => {
    const { session } = globalThis.trunkline.immersive;
    return { blend: session.environmentBlendMode, features: [...session.enabledFeatures], ground: globalThis.trunkline.drawn.scene.background, rate: session.frameRate };
  });
  assert.equal(view.blend, "alpha-blend");
  assert.ok(view.features.includes("local-floor") && view.features.includes("anchors"));
  assert.equal(view.ground, null);
  assert.ok(view.rate >= 72 && view.rate <= 120, `${view.rate} Hz`);
  const { calls, triangles } = await page.evaluate(() => globalThis.trunkline.renderer.info.render);
  assert.ok(calls <= 60 && triangles <= 100_000, `${calls} calls, ${triangles} triangles`);
  assert.deepEqual(wrongs, []);
});

test("a cycle with two controllers: aim, plan, preview, confirm, execute, done", async (t) => {
  const { page } = await aligned(t);
  await aim(page);
  await picture(page, "6-headset-aim");
  await set(page, "left", "squeeze", 0);
  await set(page, "right", "squeeze", 0);
  await frames(page);
  await press(page, "right", "trigger");
  await inMode(page, "preview");
  await frames(page, 5);
  await picture(page, "7-headset-preview");
  await inMode(page, "ready");
  await set(page, "left", "squeeze", 1);
  await frames(page);
  await press(page, "right", "trigger");
  await passed(page, server, ["preview", "ready", "delay", "execute", "aim"]);
  await set(page, "left", "squeeze", 0);
});

test("a doubtful grasp is confirmed by the second pull of the trigger alone", async (t) => {
  await server.command("doubtful");
  t.after(() => server.command("sure"));
  const { page } = await aligned(t);
  await aim(page);
  for (const side of ["left", "right"]) await set(page, side, "squeeze", 0);
  await frames(page);
  await press(page, "right", "trigger");
  await inMode(page, "ready");
  await set(page, "left", "squeeze", 1);
  await frames(page);
  await press(page, "right", "trigger");
  await until(page, () => /only 40 % of cases. Pull the trigger again/.test(globalThis.trunkline.warning?.text));
  await frames(page, 5);
  await picture(page, "9-headset-doubtful");
  assert.equal(await page.evaluate(() => globalThis.trunkline.state.mode), "ready");
  await press(page, "right", "trigger");
  await passed(page, server, ["ready", "delay", "execute", "aim"]);
  await set(page, "left", "squeeze", 0);
});

test("the hand that moves to the edge of reach feels a tick, once", async (t) => {
  const { page } = await aligned(t);
  await page.evaluate(() => {
    globalThis.ticks = [];
    const { immersive } = globalThis.trunkline, tick = immersive.tick.bind(immersive);
    immersive.tick = (side) => {
      globalThis.ticks.push(side);
      tick(side);
    };
  });
  await aim(page);
  await point(page, "left", [0.5, 0.1, 1.4]);
  await until(page, () => globalThis.trunkline.state.targets?.rigid.reach === "outside");
  await until(page, () => globalThis.ticks.includes("left"));
  assert.equal((await page.evaluate(() => globalThis.ticks)).filter((side) => side === "left").length, 1);
});

test("a controller that is lost or only guessed holds the robot, and the notice names it", async (t) => {
  const { page } = await aligned(t);
  await page.evaluate(() => (globalThis.guessed = true));
  await inMode(page, "hold");
  await page.evaluate(() => (globalThis.guessed = false));
  await inMode(page, "aim");
  await page.evaluate(() => {
    globalThis.headset.controllers.right.connected = false;
  });
  await inMode(page, "hold");
  await until(page, () => /not tracked/.test(globalThis.trunkline.state.notice));
  await page.evaluate(() => {
    globalThis.headset.controllers.right.connected = true;
  });
  await inMode(page, "aim");
});

test("a lost anchor holds the robot until it is back", async (t) => {
  const { page } = await aligned(t);
  await until(page, () => globalThis.trunkline.immersive.anchor && true);
  await losesAnchors(page);
  await inMode(page, "hold");
  await until(page, () => /not aligned/.test(globalThis.trunkline.state.notice) && globalThis.trunkline.immersive.alignment.step === "lost");
  await picture(page, "8-headset-lost");
  await findsAnchors(page);
  await inMode(page, "aim");
});

test("an anchor of the session before is restored, and one touch is asked for", async (t) => {
  const { page } = await aligned(t);
  await until(page, () => globalThis.trunkline.immersive.alignment.progress.anchor && true); // the server follows it
  const before = await page.evaluate(() => globalThis.trunkline.immersive.alignment.place.position.toArray());
  await page.evaluate(() => globalThis.trunkline.immersive.leave());
  await until(page, () => !globalThis.trunkline.immersive.session);
  await until(page, () => globalThis.trunkline.wire.up && globalThis.trunkline.wire.offset !== null);
  await page.evaluate(() => document.querySelector("#immerse").click()); // the emulator has left the canvas on top
  await until(page, () => globalThis.trunkline.immersive.alignment.step === "tip"); // put there by eye: the tip is not calibrated yet
  const now = await page.evaluate(() => globalThis.trunkline.immersive.alignment.place.position.toArray());
  assert.ok(Math.hypot(...now.map((x, axis) => x - before[axis])) < 1e-4);
  assert.match(await page.evaluate(() => globalThis.trunkline.state.notice), /not aligned|^$/);
});

/** Where the base, and a point far out, are in the room itself, which no recentring moves. */
const inRoom = (page) => page.evaluate(() => {
  const { space, alignment: { place } } = globalThis.trunkline.immersive;
  const m = Object.getOwnPropertySymbols(space).map((key) => space[key]).find((inner) => inner.offsetMatrix).offsetMatrix;
  return [[0, 0, 0], [0.9, 0, 0.3]].map((point) => {
    const [x, y, z] = place.position.clone().set(...point).applyQuaternion(place.quaternion).add(place.position).toArray();
    return [0, 1, 2].map((row) => m[row] * x + m[row + 4] * y + m[row + 8] * z + m[row + 12]);
  });
});

/** The headset's frame leaps in the room, with the event of a recentred view; returns the messages that the page sends at once. */
const recentre = (page) => page.evaluate(() => {
  const { immersive } = globalThis.trunkline, { space, sendJson } = immersive, messages = [];
  immersive.sendJson = (type, fields) => {
    messages.push([type, fields.pose]);
    sendJson(type, fields);
  };
  const [c, s] = [Math.cos(0.7), Math.sin(0.7)];
  const inner = Object.getOwnPropertySymbols(space).map((key) => space[key]).find(({ offsetMatrix }) => offsetMatrix);
  inner.offsetMatrix.set([c, 0, -s, 0, 0, 1, 0, 0, s, 0, c, 0, 0.3, 0, -0.2, 1]);
  space.dispatchEvent(new Event("reset"));
  immersive.sendJson = sendJson;
  return messages;
});

/** The headset loses all anchors, until `findsAnchors`. */
const losesAnchors = (page) => page.evaluate(() => {
  const { prototype } = globalThis.XRFrame;
  globalThis.trackedAnchors = Object.getOwnPropertyDescriptor(prototype, "trackedAnchors");
  Object.defineProperty(prototype, "trackedAnchors", { configurable: true, get: () => new Set() });
});
const findsAnchors = (page) => page.evaluate(() => Object.defineProperty(globalThis.XRFrame.prototype, "trackedAnchors", globalThis.trackedAnchors));

const placed = (page) => page.evaluate(() => globalThis.trunkline.immersive.alignment.place?.position.toArray());

function assertSame(now, before) {
  for (const [index, point] of now.entries())
    assert.ok(Math.hypot(...point.map((x, axis) => x - before[index][axis])) < 1e-4, `${point} of ${before[index]}`);
}

test("a recentred view holds the robot until the anchor is back, and the base is where it was in the room", async (t) => {
  const { page } = await aligned(t);
  await until(page, () => globalThis.trunkline.immersive.anchor && globalThis.trunkline.immersive.alignment.progress.anchor && true);
  const before = await inRoom(page), was = await placed(page);
  await losesAnchors(page);
  assert.deepEqual(await recentre(page), [["anchor", null]]);
  await inMode(page, "hold");
  await findsAnchors(page);
  await until(page, ([x]) => {
    const { alignment } = globalThis.trunkline.immersive;
    return alignment.done && Math.abs(alignment.place.position.x - x) > 0.01;
  }, was, "the base in the frame that has leapt");
  await inMode(page, "aim");
  assertSame(await inRoom(page), before);
});

test("a recentred view without an anchor asks to align again, and the robot holds", async (t) => {
  const { page } = await aligned(t);
  await until(page, () => globalThis.trunkline.immersive.anchor && globalThis.trunkline.immersive.alignment.progress.anchor && true);
  await page.evaluate(() => (globalThis.trunkline.immersive.anchor = null));
  assert.deepEqual(await recentre(page), [["alignment", null]]);
  await until(page, () => globalThis.trunkline.immersive.alignment.step === "place");
  await inMode(page, "hold");
});

test("a page that is loaded anew restores the anchor, and controls nothing until it was touched", async (t) => {
  const { page } = await aligned(t);
  await until(page, () => globalThis.trunkline.immersive.anchor && globalThis.trunkline.immersive.alignment.progress.anchor && true);
  const before = await inRoom(page);
  await page.reload();
  await until(page, () => globalThis.trunkline?.loaded && !document.querySelector("#immerse").hidden);
  await page.click("#immerse");
  await until(page, () => globalThis.trunkline.immersive.session && globalThis.trunkline.wire.controls);
  await until(page, () => globalThis.trunkline.immersive.alignment.step === "tip"); // put there by eye: the tip is not calibrated yet
  assertSame(await inRoom(page), before);
  await inMode(page, "hold");
  await aim(page, false);
  assert.equal(await page.evaluate(() => globalThis.trunkline.state.targets), null);
  await inMode(page, "hold");
});

test("the stick asks for touches, and a controller whose place is guessed touches nothing", async (t) => {
  const { page } = await aligned(t);
  await page.evaluate(() => globalThis.trunkline.wire.sendJson("alignment", { pose: null })); // as after a recentring without an anchor
  await until(page, () => globalThis.trunkline.immersive.alignment.step === "place");
  await press(page, "right", "thumbstick");
  await until(page, () => globalThis.trunkline.immersive.alignment.step === "tip");
  await page.evaluate(() => (globalThis.guessed = true));
  await until(page, () => /not tracked/.test(globalThis.trunkline.immersive.alignment.feedback));
  await page.evaluate(() => (globalThis.guessed = false));
  await until(page, () => globalThis.trunkline.immersive.alignment.feedback === "");
  await inMode(page, "hold");
});

test("a stick that is pushed to a side hides and shows the arm as cameras see it, once a push, and moves no ray", async (t) => {
  const { page, wrongs } = await aligned(t);
  const drawn = () => page.evaluate(() => globalThis.trunkline.measured.group.visible);
  const push = async (side, x, y) => {
    await page.evaluate(([hand, ...axes]) => globalThis.headset.controllers[hand].updateAxes("thumbstick", ...axes), [side, x, y]);
    await frames(page);
  };
  await push("right", 1, 0);
  assert.ok(await page.evaluate(() => globalThis.trunkline.measured.shown), "without cameras nothing is switched off");
  await push("right", 0, 0);
  await server.command("cameras");
  await until(page, () => globalThis.trunkline.measured.group.visible);
  const before = await page.evaluate(() => globalThis.trunkline.state.mode);
  await push("right", 1, 0.3);
  assert.ok(!(await drawn()));
  assert.match(await page.evaluate(() => globalThis.trunkline.board.drawn), /"Cameras":"hidden, stick to a side shows; 7 of 7 bodies/);
  await picture(page, "10-headset-measured-hidden");
  await push("right", 0.6, 0.3); // not let go yet
  await push("right", 1, 0.3);
  assert.ok(!(await drawn()));
  await push("right", 0, 0);
  await push("left", 0.9, -1); // the ray's length
  assert.ok(!(await drawn()));
  await push("left", -1, 0);
  assert.ok(await drawn());
  await push("left", 0, 0);
  assert.doesNotMatch(await page.evaluate(() => globalThis.trunkline.board.drawn), /hidden/);
  assert.equal(await page.evaluate(() => globalThis.trunkline.state.mode), before);
  assert.deepEqual(wrongs, []);
});
