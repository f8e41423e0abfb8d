// What has no browser in it: the wire's bytes, the preview's pace, a recording.

import assert from "node:assert/strict";
import { test } from "node:test";
import { Playback } from "../src/playback.js";
import { Recording } from "../src/recording.js";
import { decode, encode, noHand } from "../src/wire.js";
import { FROM_CLIENT, FROM_SERVER, HAND, HEAD_BYTES, INPUT_BYTES } from "../src/wire_table.js";
import { Box3, Group, Ray, Vector3 } from "three";
import { axisOf, onAxis, objectAt } from "../src/handles.js";
import { doubtQuestion, isDoubtful, lasts, ofDevice, success, whyLost, whyNothing } from "../src/hints.js";
import { LEVELS, Quality } from "../src/quality.js";
import { clustered, matrixOf } from "../src/geoms.js";
import { Confirming } from "../src/confirming.js";
import { freeArea } from "../src/views.js";
import { RobotScene } from "../src/scene.js";
import { predictionText, remedy, uiText } from "../src/panel.js";
import { MeasuredArm, camerasText, colourOf, correctionText } from "../src/measured.js";
import { OFFER, TIP, WRONG, css } from "../src/colours.js";

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
  const message = decode(robot(7, 1.5, 0.25));
  assert.deepEqual([message.kind, message.count, message.sequence, message.time], ["robot", 1, 7, 1.5]);
  assert.deepEqual([...message.flags].sort(), ["moving", "stale"]);
  assert.deepEqual([...message.rows], [0.25, 0, 0, 1, 0, 0, 0]);
  const unknown = new Uint8Array(HEAD_BYTES);
  unknown[0] = 250;
  assert.equal(decode(unknown.buffer), null);
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
  assert.equal(playback.at, 0, "what passed before its first picture is no part of it");
  assert.equal(playback.advance(0.5), false);
  assert.ok(Math.abs(playback.at - 0.2) < 1e-9, "it waits for what is not there");
  playback.add(3, new Float32Array([3, 4, 5, 6, 7, 8, 9, 10]), true);
  playback.pauseAt(1);
  assert.ok(playback.at < 0.21, "no leap before it has been shown to its end");
  playback.paused = false;
  const ends = [];
  for (let n = 0; n < 60; n++) ends.push(playback.advance(0.05));
  assert.equal(ends.filter(Boolean).length, 1);
  playback.pauseAt(0.55);
  assert.equal(playback.index, 5);
  assert.equal(playback.rows[playback.index], 5);
});

test("a recording is replayed at its own times, without a last message that is not whole", () => {
  const messages = [[0, 10, 0], [1, 10.5, 1], [2, 11, 2]].map((values) => new Uint8Array(robot(...values)));
  const bytes = messages.flatMap((message) => [...new Uint8Array(new Uint32Array([message.length]).buffer), ...message]);
  const { playback } = new Recording(new Uint8Array([...bytes, 60, 0, 0, 0, 1]).buffer);
  assert.ok(Math.abs(playback.available - 1) < 0.02);
  const at = (time) => playback.rows[Math.floor(time * 72) * playback.width];
  assert.deepEqual([at(0.25), at(0.75), at(1)], [0, 1, 2]);
  assert.equal(new Recording(new ArrayBuffer(3)).playback, null);
});

test("a robot that has arrived is shown as arrived, until the next plan is asked for", () => {
  const page = { lease: null, id: "", age: 0.02, up: true, reason: null, stale: false, immersed: false };
  const robot = (mode, does, settles) => uiText({ ...page, settles, state: { mode, robot: does } }).facts.Robot;
  assert.equal(robot("aim", "done"), "arrived, seen 20 ms ago");
  assert.equal(robot("aim", "done", 2.1), "at its place, the arm rests in 3 s, seen 20 ms ago");
  for (const [mode, does] of [["aim", "idle"], ["execute", "running"], ["plan", "done"], ["ready", "done"]]) assert.equal(robot(mode, does), "seen 20 ms ago");
});

test("a preview that has been shown waits for what it foresees, and says so", () => {
  const page = { state: { mode: "preview", keys: "watch the preview to its end" }, lease: { holder: "a", clients: [] }, id: "a", up: true, reason: null, age: null };
  assert.equal(uiText(page).next, "Watch the preview to its end.");
  assert.match(uiText({ ...page, awaits: true }).next, /^Wait: how sure/);
  assert.doesNotMatch(uiText({ ...page, awaits: true, state: { mode: "ready" } }).next, /^Wait/);
});

test("a wrong token comes with a remedy, any other reason as it is", () => {
  assert.match(remedy("token: wrong"), /Open the address anew that the session has printed/);
  assert.equal(remedy("version: found 1"), "version: found 1");
});

const FORESEEN = { probability: null, low: null, high: null, futures: 12, within: 0.9, miss: null, spread: [], unknown: "" };

test("of a place: how far the preview ends from it, and how far the robot's tip may from that", () => {
  assert.equal(
    predictionText({ ...FORESEEN, miss: 0.0082, spread: [0.001, 0.012] }),
    "The preview ends 8 mm from the target; in 90 % of cases the robot’s tip ends within 12 mm of the preview’s, where it touches nothing.",
  );
});

test("a radius that is unknown is named as such, with the reason", () => {
  assert.equal(
    predictionText({ ...FORESEEN, probability: 0.84, low: 0.68, high: 0.93, unknown: "mount tilted by 95°, trials up to 90°" }),
    "Grasp holds in 84 % of 12 futures (68 % to 93 %); how near the robot’s tip comes to the preview’s is unknown: " +
      "mount tilted by 95°, trials up to 90°.",
  );
});

/** Gives `quality` pictures of `seconds` each, from `from` to `to` s; the time of the last. */
function pictures(quality, seconds, from, to) {
  let now = from;
  for (; now < to; now += Math.max(seconds, 0.05)) quality.took(seconds, now);
  return now;
}

test("slow pictures lower the quality step by step, the reach before all is coarse; quick ones raise it late", () => {
  const applied = [], quality = new Quality((level) => applied.push(level), 2);
  let now = pictures(quality, 0.02, 0, 30);
  assert.deepEqual(applied, [], "pictures of 20 ms are no reason");
  now = pictures(quality, 0.2, now, now + 60);
  assert.deepEqual(applied, LEVELS.slice(1));
  assert.equal(quality.reach, false);
  assert.match(quality.hint(true), /^slow, 0.2 s a picture; drawn coarser, without the reach; H hides the reach/);
  assert.doesNotMatch(quality.hint(false), /H hides/, "what is hidden already need not be");
  now = pictures(quality, 0.005, now, now + 100);
  assert.equal(quality.at, 4, "it does not swing");
  pictures(quality, 0.005, now, now + 1000);
  assert.equal(quality.at, 0);
  assert.equal(quality.hint(true), "");
});

test("where drawing is likely to be slow, or far too slow, all is lowered at once", () => {
  assert.equal(new Quality(() => {}, 1, true).at, LEVELS.length - 1);
  const applied = [], quality = new Quality((level) => applied.push(level), 1);
  pictures(quality, 0.3, 0, 3);
  assert.deepEqual(applied, [LEVELS.at(-1)]);
});

test("a mesh in cells keeps what spans them, each corner once", () => {
  const vertices = [0, 0, 0, 0.001, 0, 0, 1, 0, 0, 1.001, 0, 0, 0, 1, 0], faces = [0, 2, 4, 1, 3, 4, 0, 1, 4, 2, 3, 4];
  assert.deepEqual(clustered({ vertices, faces }, 0.1), { vertices, faces: [0, 2, 4, 0, 2, 4] });
  assert.deepEqual(clustered({ vertices, faces }, 1e-4).faces, faces);
  assert.equal(clustered({ vertices, faces }, 10).faces.length, 9, "small as it is, it does not vanish");
});

test("inputs that come late lower the quality too, and a screen of one pixel a pixel begins at the level that shows it", () => {
  const applied = [], quality = new Quality((level) => applied.push(level), 1);
  assert.equal(quality.at, 1);
  for (let n = 0; n < 20; n++) quality.input(0.02, n / 10);
  assert.deepEqual(applied, []);
  for (let n = 20; n < 40; n++) quality.input(0.15, n / 5);
  assert.ok(applied.length > 0);
  quality.at = LEVELS.length - 1;
  assert.deepEqual([quality.ratioOf(1280 * 720), quality.ratioOf(400 * 720)], [0.5, 0.7]);
});

test("a notice is in the words of the device at hand", () => {
  const notice = "tip target is 17 mm out of reach; primary button takes the nearest point that is within";
  assert.equal(ofDevice(notice, "controllers"), notice);
  assert.equal(ofDevice(notice, "keys"), "the tip’s target is 17 mm out of reach; R takes the nearest point that is within");
  assert.equal(ofDevice("stopped; primary button goes on", "touch"), "stopped; “Go on” goes on");
  assert.equal(ofDevice("hold G and press Enter to confirm, or move a target", "touch"), "hold “Let it move” and tap “Confirm”, or move a target");
  for (const core of ["controllers have changed places; holding until both grips are let go", "left controller: not tracked; holding", "right controller: pose is not a number; holding"]) {
    assert.doesNotMatch(ofDevice(core, "keys"), /controller|grip|trigger|primary/);
    assert.doesNotMatch(ofDevice(core, "touch"), /controller|grip|trigger|primary|\bG\b/);
  }
  for (const code of ["Enter", "KeyG", "KeyR", "KeyF", "ArrowUp"]) {
    for (const mode of ["hold", "aim", "plan", "preview", "ready", "delay", "execute", "follow", "stopped"]) {
      for (const gripped of [true, false]) {
        const reason = ofDevice(whyNothing(code, { up: true, controls: true, mode, gripped, offers: gripped }), "touch");
        assert.doesNotMatch(reason, /\bEnter\b|\b[GFR]\b|[Aa]rrows/);
      }
    }
  }
});

test("a notice lasts while aiming only as long as its cause", () => {
  const at = (rigid, tip) => ({ mode: "aim", targets: { rigid: { reach: rigid }, tip: { reach: tip } }, gripped: false });
  const outside = "tip target is 17 mm out of reach";
  assert.ok(lasts(outside, at("inside", "outside")));
  assert.ok(!lasts(outside, at("inside", "inside")));
  assert.ok(!lasts("rigid target is inside the table", at("inside", "inside")));
  assert.ok(!lasts("both targets are needed: hold a grip to set each", at("inside", "inside")));
  assert.ok(lasts("no plan: world: the table", at("inside", "inside")), "a cause that cannot be checked stays");
});

test("a key without effect has a reason, and one with an effect has none", () => {
  const now = { up: true, controls: true, holder: "a", mode: "aim", gripped: false, offers: false, cameras: false };
  assert.equal(whyNothing("Enter", now), "");
  assert.equal(whyNothing("KeyC", now), "No cameras are heard.");
  assert.equal(whyNothing("KeyC", { ...now, cameras: true }), "");
  assert.equal(whyNothing("KeyX", { ...now, up: false }), "");
  assert.match(whyNothing("Enter", { ...now, controls: false, holder: "" }), /press “Take control” first/);
  assert.match(whyNothing("KeyG", { ...now, controls: false }), /Somebody else controls/);
  assert.match(whyNothing("Enter", { ...now, mode: "ready" }), /Hold G, and press Enter/);
  assert.equal(whyNothing("Enter", { ...now, mode: "ready", gripped: true }), "");
  assert.match(whyNothing("KeyR", now), /nothing is offered/);
  assert.match(whyNothing("KeyR", { ...now, offers: true, gripped: true }), /Let go of G/);
  assert.equal(whyNothing("KeyR", { ...now, mode: "stopped" }), "");
  assert.match(whyNothing("ArrowUp", { ...now, mode: "execute" }), /stay as they are/);
});

test("letting go is asked only while something is pressed", () => {
  const page = { lease: { holder: "me", clients: [] }, id: "me", age: 0.02, up: true, reason: null, stale: false, device: "keys" };
  const state = { mode: "hold", keys: "let go of all keys for a moment", next: "let go of grips and triggers for a moment" };
  assert.match(uiText({ ...page, state, pressed: true }).next, /Let go of G/);
  assert.doesNotMatch(uiText({ ...page, state, pressed: false }).next, /let go/i);
  assert.match(uiText({ ...page, state, device: "controllers", pressed: true }).next, /grips and triggers/);
  assert.doesNotMatch(uiText({ ...page, state, device: "controllers" }).next, /let go/i);
  assert.match(uiText({ ...page, state, device: "touch", pressed: true }).next, /“Let it move”/);
});

test("the reason for lost control is what happened here of late", () => {
  assert.match(whyLost({ gap: 1.3, hidden: false }), /sent nothing for 1.3 s.*“Take control”/);
  assert.match(whyLost({ gap: 0.1, hidden: true }), /was hidden/);
  assert.doesNotMatch(whyLost({ gap: 0.1, hidden: false }), /busy|hidden/);
});

test("a grasp that is likely to fail is marked and takes two presses, one that is likely to hold does not", () => {
  assert.ok(isDoubtful({ probability: 0.4 }) && !isDoubtful({ probability: 0.84 }) && !isDoubtful({ probability: null }) && !isDoubtful(null));
  assert.match(predictionText({ ...FORESEEN, probability: 0.4, low: 0.2, high: 0.6, unknown: "x" }), /^Grasp holds in only 40 %/);
  const question = doubtQuestion({ probability: 0.4 });
  assert.match(question, /only 40 % of cases. Pull the trigger again/);
  assert.match(ofDevice(question, "keys"), /only 40 % of cases. Press Enter again/);
  assert.match(ofDevice(question, "touch"), /only 40 % of cases. tap “Confirm” again/);
});

/** Whether the right trigger is sent, and how often the user was asked, at each of `steps`: [mode, prediction, trigger, grip]. */
function sentTriggers(...steps) {
  let questions = 0;
  const confirming = new Confirming(() => (questions += 1));
  return steps.map(([mode, prediction, trigger, grip = true]) => {
    const hands = { left: { ...noHand(), grip }, right: { ...noHand(), trigger } };
    return `${confirming.filter(hands, mode, prediction).right.trigger ? "sent" : "not"} ${questions}`;
  });
}

test("a press that would confirm a doubtful grasp only asks, however long it lasts; the next one confirms, of this plan alone", () => {
  const bad = { digest: "a", probability: 0.4 }, worse = { digest: "b", probability: 0.3 }, good = { digest: "c", probability: 0.9 };
  const [up, down] = [false, true];
  assert.deepEqual(sentTriggers(["ready", bad, up], ["ready", bad, down], ["ready", bad, down], ["ready", bad, up], ["ready", bad, down]),
    ["not 0", "not 1", "not 1", "not 1", "sent 1"]);
  assert.deepEqual(sentTriggers(["ready", bad, down], ["ready", bad, up], ["ready", worse, down]), ["not 1", "not 1", "not 2"]);
  assert.deepEqual(sentTriggers(["ready", good, down], ["ready", { digest: "d", probability: null }, down]), ["sent 0", "sent 0"]);
  assert.deepEqual(sentTriggers(["ready", bad, down, false]), ["sent 0"]); // the server's notice names the missing grip
  assert.deepEqual(sentTriggers(["aim", null, down], ["plan", null, down], ["ready", bad, down]), ["sent 0", "sent 0", "sent 0"]); // it asks for a plan, and is no fresh press
});

test("a press that begins before a preview's end confirms nothing that was not read", () => {
  const good = { digest: "c", probability: 0.9 };
  assert.deepEqual(sentTriggers(["preview", null, true], ["ready", good, true], ["ready", good, false], ["ready", good, true]), ["not 0", "not 0", "not 0", "sent 0"]);
});

test("the notice after a motion: lifted, put down, arrived", () => {
  const cup = { name: "the cup", support: "held" };
  assert.equal(success(["reach", "curl", "lift"], [cup]), "Held: lift of the cup is done. Now point where it goes.");
  assert.match(success(["carry", "release"], [{ ...cup, support: "standing" }]), /^Put down/);
  assert.match(success(["reach"], [{ ...cup, support: "standing" }], 0), /^Arrived/);
  assert.equal(success(["reach"], [], 1.2), "");
});

test("a handle moves along its own axis, and a ray meets the object that it points at", () => {
  const ray = new Ray(new Vector3(0.3, -2, 0.4), new Vector3(0, 1, 0));
  assert.deepEqual(onAxis(ray, new Vector3(0, 0, 0.1), axisOf(2)).toArray().map((x) => Math.round(1e6 * x) / 1e6), [0, 0, 0.4]);
  assert.deepEqual(onAxis(ray, new Vector3(0, 0, 0.1), axisOf(0)).toArray().map((x) => Math.round(1e6 * x) / 1e6), [0.3, 0, 0.1]);
  assert.equal(onAxis(ray, new Vector3(), axisOf(1)), null, "end on");
  const lying = { name: "lying", shape: "cylinder", diameter: 0.04, height: 0.3, position: [0.2, 0, 0.4], quaternion: [Math.SQRT1_2, 0, Math.SQRT1_2, 0] };
  const behind = { ...lying, name: "behind", position: [0.3, 1, 0.4] };
  const inverse = ({ position, quaternion }) => matrixOf(position, quaternion).invert();
  for (const objects of [[behind, lying], [lying, behind]]) assert.equal(objectAt(ray, objects, inverse, 0.01).name, "lying");
  assert.equal(objectAt(new Ray(new Vector3(0.3, -2, 0.5), new Vector3(0, 1, 0)), [behind, lying], inverse, 0.01), null);
});

test("the floor is drawn where it is, a base that stands above it has a stand, and what hangs a string", () => {
  const drawn = new RobotScene();
  const wide = { low: [-5, -5, -1], high: [5, 5, -0.7] }, table = { low: [0.3, -0.2, -0.7], high: [0.8, 0.2, -0.1] };
  const ball = { name: "ball", shape: "sphere", diameter: 0.05, height: 0.05, position: [0.5, 0.5, 0.3], quaternion: [1, 0, 0, 0], support: "hanging" };
  const box = () => (drawn.worldMesh ? new Box3().setFromObject(drawn.worldMesh) : null);
  const near = (actual, expected) => assert.ok(Math.abs(actual - expected) < 1e-6, `${actual}, expected ${expected}`);
  drawn.showWorld({ boxes: [], things: [] });
  near(drawn.floor.position.z, 0);
  assert.equal(box(), null, "a base on the floor needs no stand");
  drawn.showWorld({ boxes: [wide], things: [] });
  near(drawn.floor.position.z, -0.7); // its top, of what is the floor
  assert.deepEqual([box().min.z, box().max.z].map((z) => Math.round(1e6 * z) / 1e6 + 0), [-0.7, 0]); // from the floor to the base
  drawn.ground("light");
  near(drawn.floor.position.z, -0.7);
  drawn.showWorld({ boxes: [{ ...table, low: [0.3, -0.2, -0.8] }], things: [] });
  near(drawn.floor.position.z, -0.8); // what a table stands on, where no floor is known
  drawn.showWorld({ boxes: [wide], things: [{ ...ball, support: "standing" }] });
  near(box().max.z, 0.325);
  drawn.showWorld({ boxes: [wide], things: [ball] });
  near(box().max.z, 0.325 + 0.15 + 0.006); // string and hook
});

test("in a small window the robot is viewed in what the panels leave free", () => {
  const rect = (left, top, width, height) => ({ left, top, right: left + width, bottom: top + height });
  assert.deepEqual(freeArea(1280, 720, rect(14, 14, 430, 150), rect(300, 650, 600, 56)), { left: 0, top: 0, width: 1280, height: 720 });
  assert.deepEqual(freeArea(400, 720, rect(7, 7, 386, 143), rect(7, 620, 386, 93)), { left: 0, top: 150, width: 400, height: 470 });
  assert.deepEqual(freeArea(640, 360, rect(7, 7, 243, 143), rect(7, 310, 500, 43)), { left: 250, top: 0, width: 390, height: 310 });
});

test("a measured tip within the radius that its plan's preview stated is green and says so, one beyond is orange, beyond twice it vermilion", () => {
  const soon = { markers: [[0, 0, 0], null], tip: [0, 0, 0], apart: 0.0075, age: 0, rate: 120, loss: 0, fault: "", from_preview: null, radius: null, frame: "" };
  assert.equal(camerasText(soon), "1 of 2 bodies, 120 Hz; tip 7.5 mm from the twin’s");
  const within = { ...soon, from_preview: 0.0042, radius: 0.0081 }, beyond = { ...within, from_preview: 0.0082 }, far = { ...within, from_preview: 0.0163 };
  assert.match(camerasText(within), /twin’s, 4.2 mm from its preview’s end, within the 8.1 mm stated$/);
  assert.match(camerasText(beyond), /8.2 mm from its preview’s end, beyond the 8.1 mm stated$/);
  assert.match(camerasText(far), /16.3 mm from its preview’s end, far beyond the 8.1 mm stated$/);
  assert.deepEqual([within, beyond, far].map(colourOf), [OFFER, TIP, WRONG]);
  assert.ok(![OFFER, TIP, WRONG].includes(colourOf(soon)));
  assert.match(camerasText({ ...soon, frame: "frame as set" }), /from the twin’s; frame as set$/);
});

test("the label at a measured tip, and the arm, have the colour of how far the tip is from where its preview ends", (t) => {
  const pen = { measureText: () => ({ width: 9 }), clearRect() {}, beginPath() {}, roundRect() {}, fill() {}, fillText(text) { this.written = [text, this.fillStyle]; } };
  globalThis.document = { createElement: () => ({ getContext: () => pen }) };
  t.after(() => delete globalThis.document);
  const arm = new MeasuredArm(new Group()), message = { markers: [[0, 0, 0]], tip: [0, 0, 0.1], apart: 0.0075, fault: "", radius: 0.008 };
  for (const [off, colour] of [[0.007, OFFER], [0.015, TIP], [0.017, WRONG]]) {
    arm.receive({ ...message, from_preview: off }, 0);
    assert.deepEqual(pen.written, ["7.5 mm", css(colour)]);
    assert.equal(arm.material.color.getHex(), colour);
  }
});

test("a plan that may correct itself says so only as long as cameras are relied on", () => {
  const preview = { correction: { steps: 5, longest: 0.005, astray: 0.03 }, uncorrected: "" };
  assert.match(correctionText(preview, { fault: "" }), /corrects itself .* of up to 5 mm .* within 30 mm of its target\.$/);
  assert.match(correctionText(preview, { fault: "'tip' is 0.5 m off" }), /Cameras are not relied on now: .* it will not\.$/);
  assert.equal(correctionText({ correction: null, uncorrected: "it grasps" }, null), "It will not correct itself: it grasps.");
});
