// The page in an ordinary browser: mouse and keyboard, reconnecting, what it asks of the network, its accessibility.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { after, before, test } from "node:test";
import { inMode, launch, open, passed, picture, serve, until } from "./harness.mjs";
import { FROM_SERVER, HEAD, HEAD_BYTES } from "../src/wire_table.js";

const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
let browser, server;

before(async () => {
  server = await serve();
  browser = await launch();
});
after(async () => {
  await browser?.close();
  await server?.close();
});

const loaded = (page) => until(page, () => globalThis.trunkline.loaded && globalThis.trunkline.frame && true);

/** As on a graphics card, where the robot has all its faces. */
const finely = (page) => page.evaluate(() => {
  const { quality } = globalThis.trunkline;
  quality.change(quality.best, 0);
  quality.isFixed = true;
});

async function takeControl(page) {
  await until(page, () => !document.querySelector("#control").disabled);
  await page.click("#control");
  await until(page, () => globalThis.trunkline.wire.controls);
  await inMode(page, "aim");
}

/** A server whose robot is where it starts. */
async function anew(t) {
  const fresh = await serve();
  t.after(() => fresh.close());
  return fresh;
}

/** Drags a target's marker by `dx`, `dy` pixels, with the true mouse. */
async function drag(page, kind, dx, dy) {
  const [x, y] = await until(page, (name) => {
    const { desktop, marks } = globalThis.trunkline;
    const hand = name === "rigid" ? desktop.rigid : 1 - desktop.rigid;
    if (!desktop.wanted[hand]) return null;
    const [u, v] = desktop.toScreen(desktop.wanted[hand]);
    return marks.nearest((point) => desktop.toScreen(point), u, v, 15) === hand ? [u, v] : null; // once it is drawn there
  }, kind);
  await page.mouse.move(x, y);
  await page.mouse.down();
  for (let step = 1; step <= 8; step++) {
    await page.mouse.move(x + (dx * step) / 8, y + (dy * step) / 8);
    await page.waitForTimeout(40);
  }
  await page.waitForTimeout(300);
  await page.mouse.up();
  await page.waitForTimeout(1200);
}

/** Of both targets: whether its solid is drawn, and what is drawn of it on top of the robot. */
const visibleParts = (page) => until(page, () => {
  const { targets } = globalThis.trunkline.marks;
  return Object.values(targets).every(({ group }) => group.visible) && Object.values(targets).map(({ solid, faint, halo }) =>
    [solid.visible, ...[faint, halo].map(({ visible, material }) => visible && !material.depthTest)].join());
});

const target = (page, kind) => page.evaluate((name) => globalThis.trunkline.state?.targets?.[name]?.position ?? null, kind);

test("the page loads with no error and asks nothing of other hosts", async (t) => {
  const { page, wrongs } = await open(t, browser, server);
  await loaded(page);
  await finely(page);
  const { calls, triangles } = await until(page, () => {
    const { render } = globalThis.trunkline.renderer.info;
    return render.triangles > 5_000 && { calls: render.calls, triangles: render.triangles }; // once the robot is drawn
  });
  assert.ok(calls <= 60, `${calls} draw calls`);
  assert.ok(triangles <= 100_000, `${triangles} triangles`);
  await page.waitForTimeout(500);
  assert.deepEqual(wrongs, []);
});

test("a cycle by mouse and keyboard: aim, plan, preview, confirm, execute, done", async (t) => {
  const { page, wrongs } = await open(t, browser, server);
  await loaded(page);
  await finely(page);
  await takeControl(page);
  assert.deepEqual(await visibleParts(page), ["false,true,true", "false,true,true"]); // they begin inside the robot
  await drag(page, "rigid", 16, -12);
  await drag(page, "tip", -30, -45);
  await until(page, () => globalThis.trunkline.state.targets && true);
  assert.deepEqual(await visibleParts(page), ["true,true,true", "true,true,true"]);
  await picture(page, "1-aim");
  await page.keyboard.press("Enter");
  await inMode(page, "preview");
  await until(page, () => globalThis.trunkline.drawn.ghost.visible && globalThis.trunkline.playback.at > 0.9);
  const { calls, triangles } = await page.evaluate(() => globalThis.trunkline.renderer.info.render);
  assert.ok(calls <= 60, `${calls} draw calls with the ghost`);
  assert.ok(triangles <= 100_000, `${triangles} triangles with the ghost`);
  await picture(page, "2-preview");
  await inMode(page, "ready");
  await page.keyboard.press("Enter"); // without the grip nothing is confirmed
  await page.waitForTimeout(500);
  assert.equal(await page.evaluate(() => globalThis.trunkline.state.mode), "ready");
  await page.keyboard.down("KeyG");
  await page.waitForTimeout(300);
  await page.keyboard.press("Enter");
  await inMode(page, "execute");
  await picture(page, "3-execute");
  await passed(page, server, ["preview", "ready", "delay", "execute", "aim"]);
  await page.keyboard.up("KeyG");
  await until(page, () => /Robotarrived, seen/.test(document.querySelector("#facts").textContent));
  assert.deepEqual(wrongs, []);
});

test("keys move the chosen target by a step, and the grip let go holds the robot", async (t) => {
  const { page } = await open(t, browser, server);
  await loaded(page);
  await takeControl(page);
  for (const [key, kind] of [["Digit1", "rigid"], ["Digit2", "tip"]]) {
    await page.keyboard.press(key);
    await page.keyboard.press("ArrowUp");
    await page.waitForTimeout(1500);
    if (kind === "tip") await until(page, () => globalThis.trunkline.state.targets);
  }
  const before = await target(page, "tip");
  for (let n = 0; n < 5; n++) await page.keyboard.press("ArrowUp");
  await page.waitForTimeout(1500);
  const after = await target(page, "tip");
  assert.ok(Math.abs(after[2] - before[2] - 0.05) < 0.004, `rose by ${after[2] - before[2]} m`);
  await page.keyboard.press("Enter");
  await inMode(page, "ready");
  await page.keyboard.down("KeyG");
  await page.waitForTimeout(300);
  await page.keyboard.press("Enter");
  await inMode(page, "execute");
  await page.keyboard.up("KeyG");
  await passed(page, server, ["execute", "hold", "aim"]);
});

test("the robot follows while the grip is held, and the notice has the reason why it holds then", async (t) => {
  const { page } = await open(t, browser, server);
  await loaded(page);
  await takeControl(page);
  await drag(page, "rigid", 16, -12);
  await drag(page, "tip", -30, -45);
  await until(page, () => globalThis.trunkline.state.targets && true);
  await page.keyboard.down("KeyG");
  await page.waitForTimeout(300);
  await page.keyboard.press("KeyF");
  await inMode(page, "follow");
  await until(page, () => globalThis.trunkline.state.robot === "running");
  const before = await target(page, "rigid");
  await page.keyboard.press("Digit1");
  for (let n = 0; n < 3; n++) await page.keyboard.press("ArrowUp");
  await until(page, (z) => globalThis.trunkline.state.targets.rigid.position[2] > z + 0.02, before[2]);
  await page.keyboard.up("KeyG");
  await until(page, () => /G was let go/.test(document.querySelector("#notice").textContent));
  await passed(page, server, ["follow", "hold", "aim"]);
  await until(page, () => globalThis.trunkline.state.robot === "idle");
});

test("out of reach is shown in words, by a ring and by an offer that R takes", async (t) => {
  const { page } = await open(t, browser, server);
  await loaded(page);
  await takeControl(page);
  await drag(page, "rigid", 10, 0);
  await drag(page, "tip", 0, 0);
  await page.keyboard.press("Digit1");
  for (let n = 0; n < 65; n++) await page.keyboard.press("ArrowUp"); // beyond the ball of what the mount can reach
  await until(page, () => globalThis.trunkline.state.targets?.rigid.reach === "outside");
  await until(page, () => globalThis.trunkline.marks.targets.rigid.ring.visible);
  await page.keyboard.press("Enter");
  await until(page, () => /out of reach/.test(document.querySelector("#notice").textContent));
  await picture(page, "4-out-of-reach");
  await page.keyboard.press("KeyR");
  await until(page, () => globalThis.trunkline.state.targets?.rigid.reach === "inside");
});

test("space stops, and R goes on", async (t) => {
  const { page } = await open(t, browser, server);
  await loaded(page);
  await takeControl(page);
  await page.keyboard.press("Space");
  await inMode(page, "stopped");
  await picture(page, "5-stopped");
  await page.keyboard.press("KeyR");
  await inMode(page, "aim");
});

test("a lost connection is shown, the robot turns grey, and it comes back", async (t) => {
  const { page } = await open(t, browser, server);
  await loaded(page);
  await server.command("drop");
  await until(page, () => document.querySelector("#mode").dataset.mode === "lost", null, "words on the lost connection");
  await until(page, () => globalThis.trunkline.drawn.faded);
  await server.command("listen");
  await until(page, () => globalThis.trunkline.wire.up && globalThis.trunkline.state && true);
  await until(page, () => !globalThis.trunkline.drawn.faded);
});

test("a robot without new poses is marked as old, and grey", async (t) => {
  const { page } = await open(t, browser, server);
  await loaded(page);
  await server.command("silent");
  await until(page, () => /OLD/.test(document.querySelector("#facts").textContent) && globalThis.trunkline.drawn.faded);
  await server.command("speak");
  await until(page, () => !/OLD/.test(document.querySelector("#facts").textContent));
});

test("without its token the page asks for the six digits, and a wrong token is reported", async (t) => {
  const { page } = await open(t, browser, server, { url: `${server.origin}/` });
  await until(page, () => !document.querySelector("#pairing").hidden);
  const renewed = (await server.command("code")).findLast((line) => line.startsWith("code "));
  await page.fill("#code", renewed.slice("code ".length));
  await page.click("#pairing button");
  await loaded(page);
  assert.ok(await page.evaluate(() => document.querySelector("#pairing").hidden));
  const wrong = await open(t, browser, server, { url: `${server.origin}/#token=${"0".repeat(32)}` });
  await until(wrong.page, () => /Open the address anew.*token: wrong/.test(document.querySelector("#why").textContent));
  assert.doesNotMatch(await wrong.page.textContent("#next"), /Trying again/);
});

test("on a small page the list of keys hides neither the state nor the next action", async (t) => {
  const { page } = await open(t, browser, server, { width: 800, height: 500 });
  await loaded(page);
  await page.click("#help summary");
  for (const width of [800, 640, 961]) {
    await page.setViewportSize({ width, height: 500 });
    const [status, keys, acts] = await page.evaluate(() => ["#status", "#help[open]", "#acts"].map((id) => document.querySelector(id).getBoundingClientRect().toJSON()));
    assert.ok(status.right <= keys.left, `${width}: the state ends at ${status.right}, the keys begin at ${keys.left}`);
    assert.ok(keys.bottom <= acts.top, `${width}: the keys end at ${keys.bottom}, the actions begin at ${acts.top}`);
  }
});

test("the tip's marker that is dragged onto an object marks it, and a handle moves a target along its axis alone", async (t) => {
  const server = await anew(t), { page } = await open(t, browser, server, { drawn: false });
  await loaded(page);
  await takeControl(page);
  await drag(page, "rigid", 16, -12);
  const [from, cup] = await page.evaluate(() => {
    const { desktop } = globalThis.trunkline, [object] = desktop.objects;
    const place = desktop.wanted[0].clone().set(...object.position);
    return [desktop.wanted[1 - desktop.rigid], place].map((point) => desktop.toScreen(point));
  });
  await page.mouse.move(...from);
  await page.mouse.down();
  await page.mouse.move(...cup, { steps: 4 });
  const away = await page.evaluate(() => {
    const { desktop } = globalThis.trunkline, wanted = desktop.wanted[1 - desktop.rigid];
    return wanted.distanceTo(wanted.clone().set(...desktop.objects[0].position));
  });
  assert.ok(away < 1e-6, `the marker is ${away} m from the middle of what the pointer is on`);
  await page.waitForTimeout(300);
  await page.mouse.up();
  await until(page, () => globalThis.trunkline.state.targets?.thing === "the cup");
  await page.keyboard.press("Digit1");
  const handle = await until(page, () => {
    const { handles, desktop } = globalThis.trunkline, { group } = handles;
    if (!group.visible || group.position.distanceTo(desktop.wanted[desktop.rigid]) > 1e-6) return null;
    return desktop.toScreen(group.position.clone().setZ(group.position.z + 0.1 * group.scale.x));
  });
  const before = await page.evaluate(() => globalThis.trunkline.desktop.wanted[globalThis.trunkline.desktop.rigid].toArray());
  await page.mouse.move(...handle);
  await page.mouse.down();
  await page.mouse.move(handle[0] + 5, handle[1] - 40, { steps: 4 });
  const after = await page.evaluate(() => globalThis.trunkline.desktop.wanted[globalThis.trunkline.desktop.rigid].toArray());
  await page.mouse.up();
  assert.deepEqual([0, 1].map((axis) => Math.abs(after[axis] - before[axis]) < 1e-9), [true, true]);
  assert.ok(after[2] - before[2] > 0.02, `rose by ${after[2] - before[2]} m`);
});

test("the arm as cameras see it is drawn, a plan that may correct itself says its bounds, and a stream that is not sound is named", async (t) => {
  const fresh = await anew(t);
  const { page, wrongs } = await open(t, browser, fresh);
  await loaded(page);
  await takeControl(page);
  assert.ok(await page.evaluate(() => document.querySelector("#correct").hidden));
  await page.evaluate(() => (globalThis.trunkline.corrects = true));
  await page.keyboard.press("c");
  await until(page, () => /No cameras are heard/.test(document.querySelector("#notice").textContent));
  assert.ok(await page.evaluate(() => globalThis.trunkline.corrects), "the choice is as it was");
  await page.evaluate(() => (globalThis.trunkline.corrects = false));
  await fresh.command("cameras");
  await until(page, () => globalThis.trunkline.measured.group.visible && !document.querySelector("#correct").hidden);
  await until(page, () => /7 of 7 bodies, 120 Hz; tip 7.5 mm from the twin/.test(document.querySelector("#facts").textContent));
  await picture(page, "measured");
  await page.click("#cameras");
  await until(page, () => !globalThis.trunkline.measured.group.visible);
  await page.click("#cameras");
  await page.keyboard.press("c");
  await until(page, () => document.querySelector("#correct").getAttribute("aria-pressed") === "true");
  await drag(page, "rigid", 16, -12);
  await drag(page, "tip", -30, -45);
  await until(page, () => globalThis.trunkline.state.targets && true);
  await page.keyboard.press("Enter");
  await inMode(page, "ready");
  await until(page, () => /by 5 steps at most, each of up to 5 mm of cable, 25 mm in all, the tip within 30 mm of its target/.test(document.querySelector("#foreseen").textContent));
  assert.ok(await page.evaluate(() => globalThis.trunkline.measured.bounds.visible));
  await page.waitForTimeout(500);
  await picture(page, "measured-ready");
  await page.keyboard.down("KeyG");
  await page.waitForTimeout(300);
  await page.keyboard.press("Enter");
  await inMode(page, "execute");
  await until(page, () => globalThis.trunkline.state.correction === "waits until the tip rests");
  await inMode(page, "aim");
  await page.keyboard.up("KeyG");
  await until(page, () => /Correctionnot corrected, [\d.]+ mm off: the tip is \d+ mm off, expected at most 30 mm/.test(document.querySelector("#facts").textContent));
  assert.ok(await page.evaluate(() => !globalThis.trunkline.measured.bounds.visible));
  await fresh.command("blind");
  await until(page, () => /not relied on: found no frame for 0.20 s/.test(document.querySelector("#facts").textContent) && !globalThis.trunkline.measured.group.visible);
  await picture(page, "measured-blind");
  assert.deepEqual(wrongs, []);
});

test("the twin's certificate is linked, and opens as a page that runs its own script and reaches nothing", async (t) => {
  const { page, wrongs } = await open(t, browser, server, { drawn: false });
  await loaded(page);
  const [certificate] = await Promise.all([page.waitForEvent("popup"), page.click("#certificate")]);
  await until(certificate, () => document.title === "Replay, no requests", null, "the certificate's script");
  const { origin, opener, colour } = await certificate.evaluate(() => ({ origin: globalThis.origin, opener: globalThis.opener, colour: getComputedStyle(document.querySelector("p")).color }));
  assert.deepEqual([origin, opener, colour], ["null", null, "rgb(0, 128, 0)"]);
  assert.deepEqual(wrongs, []);
});

test("a doubtful grasp looks so, and its first confirmation only asks again", async (t) => {
  const server = await anew(t);
  await server.command("doubtful");
  const { page } = await open(t, browser, server, { drawn: false });
  await loaded(page);
  await takeControl(page);
  await drag(page, "rigid", 16, -12);
  await drag(page, "tip", -30, -45);
  await page.keyboard.press("Enter");
  await inMode(page, "ready");
  assert.ok(await page.evaluate(() => document.querySelector("#foreseen").hasAttribute("data-doubtful")));
  await page.keyboard.down("KeyG");
  await page.waitForTimeout(300);
  await page.keyboard.press("Enter");
  await until(page, () => /only 40 % of cases. Press Enter again/.test(document.querySelector("#notice").textContent));
  await page.waitForTimeout(500);
  assert.equal(await page.evaluate(() => globalThis.trunkline.state.mode), "ready");
  await page.keyboard.press("Enter");
  await passed(page, server, ["ready", "delay", "execute", "aim"]);
  await until(page, () => /^Arrived/.test(document.querySelector("#notice").textContent));
  await page.keyboard.up("KeyG");
});

test("the notice has why a key did nothing and why control was lost, until its cause is gone", async (t) => {
  const { page } = await open(t, browser, server, { drawn: false });
  await loaded(page);
  await until(page, () => !document.querySelector("#control").disabled);
  await page.keyboard.press("Enter");
  await until(page, () => /press “Take control” first/.test(document.querySelector("#notice").textContent));
  await takeControl(page);
  await until(page, () => document.querySelector("#notice").textContent === "");
  await server.command("drop");
  await server.command("listen");
  await until(page, () => /Control was lost with the connection/.test(document.querySelector("#notice").textContent));
  await takeControl(page);
  await until(page, () => !/lost/.test(document.querySelector("#notice").textContent));
});

test("in small windows and at 200 % the panels leave the robot visible, from each side", async (t) => {
  const { page } = await open(t, browser, server, { drawn: false });
  await loaded(page);
  await takeControl(page);
  for (const [width, height] of [[400, 720], [640, 360], [1280, 720]]) {
    await page.setViewportSize({ width, height });
    await page.waitForTimeout(300);
    for (const view of ["", "front", "side", "top", "fit"]) {
      if (view) await page.click(`#${view}`);
      const [places, panels] = await page.evaluate(() => {
        const { drawn, frame, desktop } = globalThis.trunkline;
        const points = drawn.extent(frame.rows).map((point) => desktop.toScreen(drawn.base.worldToLocal(point)));
        return [points, ["#status", "#acts"].map((id) => document.querySelector(id).getBoundingClientRect().toJSON())];
      });
      const hidden = places.filter(([x, y]) => x < 0 || y < 0 || x > width || y > height || panels.some(({ left, top, right, bottom }) => x > left && x < right && y > top && y < bottom));
      assert.equal(hidden.length, 0, `${width} by ${height}, ${view || "as it begins"}: ${hidden.length} of ${places.length} bodies hidden`);
    }
  }
});

test("the panel of a preview covers no other, however long its words are", async (t) => {
  const { page } = await open(t, browser, server, { drawn: false });
  await loaded(page);
  await page.evaluate(() => {
    globalThis.trunkline.play = () => {}; // it would write its own
    document.querySelector("#playing").hidden = false;
  });
  for (const [width, height] of [[760, 640], [400, 720], [1280, 720]]) {
    await page.setViewportSize({ width, height });
    for (const words of [5, 60, 90]) {
      await page.evaluate((count) => (document.querySelector("#foreseen").textContent = "as it goes ".repeat(count / 3)), words);
      await page.waitForTimeout(200);
      const [panel, help] = await page.evaluate(() => ["#playing", "#help"].map((id) => document.querySelector(id).getBoundingClientRect().toJSON()));
      const apart = help.bottom <= panel.top || help.left >= panel.right || help.right <= panel.left || help.top >= panel.bottom;
      assert.ok(apart, `${width} by ${height}, ${words} words`);
    }
  }
});

test("light and dark follow the system", async (t) => {
  const { page } = await open(t, browser, server, { drawn: false });
  await loaded(page);
  const turns = (isLight) => until(page, (light) => {
    const shades = [globalThis.trunkline.ground.getHSL({}).l, Number(/\d+/.exec(getComputedStyle(document.body).backgroundColor)[0]) / 255];
    return shades.every((shade) => (light ? shade > 0.7 : shade < 0.3));
  }, isLight);
  await page.emulateMedia({ colorScheme: "light" });
  await turns(true);
  await page.waitForTimeout(300); // buttons change their colours softly
  await page.evaluate(AXE);
  const { violations } = await page.evaluate(() => globalThis.axe.run(document));
  assert.deepEqual(violations.map(({ id, nodes }) => `${id}: ${nodes.map((node) => node.target).join(", ")}`), []);
  await page.emulateMedia({ colorScheme: "dark" });
  await turns(false);
});

test("a finger needs no key: what is offered has a button, and words name it", async (t) => {
  const { page } = await open(t, browser, server, { drawn: false, touch: true });
  await loaded(page);
  await until(page, () => !document.querySelector("#control").disabled);
  await page.tap("#control");
  await inMode(page, "aim");
  await until(page, () => document.body.hasAttribute("data-touch"));
  await page.tap("#pad summary");
  await page.tap("#which"); // the tip's
  const z = () => page.evaluate(() => globalThis.trunkline.desktop.wanted[globalThis.trunkline.desktop.chosen].z);
  const before = await z();
  await page.tap('[data-step="ArrowUp"]');
  assert.ok(Math.abs((await z()) - before - 0.01) < 1e-6);
  await page.tap("#stop");
  await inMode(page, "stopped");
  await until(page, () => /tap “Go on”/i.test(document.querySelector("#next").textContent));
  await page.tap("#go");
  await inMode(page, "aim");
  await until(page, () => document.querySelector("#go").hidden);
  await page.evaluate(() => (globalThis.trunkline.state.targets = { ...globalThis.trunkline.state.targets, better: {} })); // the assistant's, of a plan that is void
  await until(page, () => !document.querySelector("#go").hidden && /take the offer/i.test(document.querySelector("#go").textContent));
});

test("a cycle by fingers: aim by taps, plan, preview, the grip held by one finger and confirmed by another", async (t) => {
  const fresh = await anew(t);
  const { page, wrongs } = await open(t, browser, fresh, { drawn: false, touch: true });
  const screen = await page.context().newCDPSession(page);
  const on = async (selector, id) => {
    const { x, y, width, height } = await page.locator(selector).boundingBox();
    return { id, x: x + width / 2, y: y + height / 2 };
  };
  const fingers = (type, ...points) => screen.send("Input.dispatchTouchEvent", { type, touchPoints: points });
  await loaded(page);
  await until(page, () => !document.querySelector("#control").disabled);
  await page.tap("#control");
  await inMode(page, "aim");
  await page.tap("#pad summary");
  for (let target = 0; target < 2; target++) {
    await page.tap('[data-step="ArrowUp"]');
    await page.waitForTimeout(1500);
    await page.tap("#which");
  }
  await until(page, () => globalThis.trunkline.state.targets && true);
  await page.tap("#plan");
  await inMode(page, "ready");
  const grip = await on("#grip", 0);
  await fingers("touchStart", grip);
  await until(page, () => globalThis.trunkline.desktop.deadman);
  await page.waitForTimeout(300);
  const plan = await on("#plan", 1);
  await fingers("touchStart", grip, plan);
  await fingers("touchEnd", plan);
  await inMode(page, "execute");
  await passed(page, fresh, ["preview", "ready", "delay", "execute", "aim"]);
  await fingers("touchEnd", grip);
  await until(page, () => !globalThis.trunkline.desktop.deadman);
  assert.deepEqual(wrongs, []);
});

test("a recording is played by the ghost, and a file that is none is refused", async (t) => {
  const { page, wrongs } = await open(t, browser, server);
  await loaded(page);
  const rows = await page.evaluate(() => [...globalThis.trunkline.frame.rows].map((value) => (Number.isFinite(value) ? value : null)));
  const messages = [0, 0.5, 1].map((time) => {
    const view = new DataView(new ArrayBuffer(4 + HEAD_BYTES + 4 * rows.length));
    view.setUint32(0, view.byteLength - 4, true);
    view.setUint8(4, FROM_SERVER.robot.type);
    view.setFloat64(4 + HEAD.time.offset, time, true);
    rows.forEach((value, place) => view.setFloat32(4 + HEAD_BYTES + 4 * place, place === 0 ? time : (value ?? NaN), true));
    return Buffer.from(view.buffer);
  });
  const load = (buffer) => page.setInputFiles("#recording", { name: "run.bin", mimeType: "application/octet-stream", buffer });
  await load(Buffer.from("no recording"));
  await until(page, () => /no recording of this robot/.test(document.querySelector("#notice").textContent));
  assert.equal(await page.evaluate(() => globalThis.trunkline.recording), null);
  await load(Buffer.concat(messages));
  await until(page, () => document.querySelector("#foreseen").textContent === "A recording." && globalThis.trunkline.drawn.ghost.visible);
  await until(page, () => globalThis.trunkline.playing.rows[globalThis.trunkline.playing.index * globalThis.trunkline.playing.width] === 1);
  assert.deepEqual(wrongs, []);
});

test("a pose is acknowledged when its picture is there, and no other is begun before: not by a page that has lost it", async (t) => {
  const { page } = await open(t, browser, server);
  await loaded(page);
  await until(page, () => globalThis.trunkline.wire.drawn); // it does not control, so no input takes it
  const after = (seconds) => page.evaluate(async (wait) => {
    globalThis.trunkline.wire.drawn = false;
    await new Promise((resolve) => setTimeout(resolve, 1000 * wait));
    return globalThis.trunkline.wire.drawn;
  }, seconds);
  const pictures = () => page.evaluate(() => globalThis.trunkline.renderer.info.render.frame);
  await page.evaluate(async () => {
    const { renderer, stopwatch, wire } = globalThis.trunkline, gl = renderer.getContext();
    while (stopwatch.isRunning) await new Promise((resolve) => setTimeout(resolve));
    gl.getSyncParameter = () => gl.UNSIGNALED; // as long as it is being drawn
    wire.drawn = false;
  });
  await page.waitForTimeout(200);
  assert.equal(await page.evaluate(() => globalThis.trunkline.wire.drawn), false);
  const before = await pictures();
  assert.equal(await after(1), false);
  assert.equal(await pictures(), before);
  await page.evaluate(() => delete globalThis.trunkline.renderer.getContext().getSyncParameter);
  await until(page, () => globalThis.trunkline.wire.drawn);
  await page.evaluate(() => {
    globalThis.lost = globalThis.trunkline.renderer.getContext().getExtension("WEBGL_lose_context");
    globalThis.lost.loseContext();
  });
  assert.equal(await after(1), false);
  await page.evaluate(() => globalThis.lost.restoreContext());
  await until(page, () => globalThis.trunkline.wire.drawn);
  await page.evaluate(async () => { // lost and back while a picture is under way, and nobody looks: its fence is no more
    const { renderer, stopwatch, wire } = globalThis.trunkline, gl = renderer.getContext();
    while (!stopwatch.isRunning) await new Promise(requestAnimationFrame);
    gl.getSyncParameter = () => null;
    while (stopwatch.isRunning) await new Promise((resolve) => setTimeout(resolve));
    delete gl.getSyncParameter;
    wire.drawn = false;
  });
  await until(page, () => globalThis.trunkline.wire.drawn);
  await page.evaluate(() => { // a picture that is cleared before it is there is not waited for, nor acknowledged
    const { renderer, stopwatch } = globalThis.trunkline, gl = renderer.getContext();
    gl.getSyncParameter = () => gl.UNSIGNALED;
    stopwatch.start(0);
    dispatchEvent(new Event("resize"));
    globalThis.waits = [stopwatch.isRunning];
    globalThis.trunkline.size = null;
    dispatchEvent(new Event("resize"));
    globalThis.waits.push(stopwatch.isRunning);
    delete gl.getSyncParameter;
  });
  assert.deepEqual(await page.evaluate(() => globalThis.waits), [true, false]);
});

test("axe finds nothing against the page", async (t) => {
  const { page } = await open(t, browser, server);
  await loaded(page);
  await takeControl(page);
  await page.evaluate(AXE); // by the debugger's protocol, which the page's rules do not bind
  const { violations } = await page.evaluate(() => globalThis.axe.run(document));
  assert.deepEqual(violations.map(({ id, nodes }) => `${id}: ${nodes.map((node) => node.target).join(", ")}`), []);
});
