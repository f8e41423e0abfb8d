// The state in words, once for both: as text of the page, and on a board in the room.

import { CanvasTexture, LinearFilter, Mesh, MeshBasicMaterial, PlaneGeometry, SRGBColorSpace, Vector3 } from "three";
import { isDoubtful, ofDevice, whileHolding } from "./hints.js";
import { GHOST, MOUNT, OFFER, REACH, WRONG, css } from "./colours.js";

const TITLES = {
  hold: "Holding", aim: "Aiming", plan: "Planning", preview: "Preview", ready: "Ready to confirm", delay: "About to move",
  execute: "Moving", follow: "Following", stopped: "Stopped", lost: "No connection", connecting: "Connecting",
};
const COLOURS = {
  aim: MOUNT, plan: REACH, preview: REACH, ready: GHOST, delay: OFFER, execute: OFFER, follow: OFFER, stopped: WRONG, lost: WRONG,
};
const OLD = 0.25; // s beyond which a pose of the robot is marked as old

const PLANNED = new Set(["plan", "preview", "ready", "delay"]); // what the robot did before is past
const REMEDIES = { "token: wrong": "This address is not of the session that runs now. Open the address anew that the session has printed" };

/** What to do about the `reason` for which the server has ended a connection. */
export const remedy = (reason) => (reason in REMEDIES ? `${REMEDIES[reason]} (${reason}).` : reason);

/** The status of `page` in words: `mode`, `title`, `next`, `notice`, how far a robot has `arrived`, and facts by name. `settles`: s until the arm rests, as its preview had it. `ended`: it will not connect again by itself. `device`: as in `ofDevice`; `pressed`: whether a key, the mouse, a grip or a trigger is. `awaits`: its preview has been shown to its end, and what it foresees is not there. */
export function uiText(page) {
  const { state, lease, id, age, up, reason, ended, stale, device = "keys", pressed = false, awaits = false, settles = 0 } = page;
  const immersed = device === "controllers";
  const mode = !up ? (reason === null ? "connecting" : "lost") : (state?.mode ?? "connecting");
  const controls = lease?.holder === id && id !== "";
  const holder = lease?.clients?.find((client) => client.id === lease.holder);
  const facts = {};
  if (up && lease) facts.Control = controls ? "you" : holder ? holder.name || "somebody else" : "nobody";
  if (up && lease?.asking?.length && controls) facts.Asked = `${lease.asking.length} would like to take over`;
  const arrived = up && state?.robot === "done" && !PLANNED.has(mode) ? (settles > 0 ? `at its place, the arm rests in ${Math.ceil(settles)} s` : "arrived") : "";
  const poseAge = age === null ? "" : `seen ${age < 0.001 ? "now" : `${Math.round(1000 * age)} ms ago`}${stale || age > OLD ? ", OLD" : ""}`;
  if (arrived || poseAge) facts.Robot = [arrived, poseAge].filter(Boolean).join(", ");
  if (state?.fault) facts.Fault = state.fault;
  let title = TITLES[mode];
  if (mode === "delay" && Number.isFinite(state.countdown)) title = `Moves in ${state.countdown.toFixed(1)} s`;
  const action = (immersed ? state?.next : state?.keys) ?? "";
  const instruction = controls && mode === "hold" ? whileHolding(pressed, device) : ofDevice(action, device);
  let next = controls || !lease?.holder ? sentence(instruction) : "You watch. Ask for control to aim.";
  if (controls && mode === "preview" && awaits) next = "Wait: how sure the preview is, is still being computed.";
  if (!up) next = reason === null ? "Waiting for the server." : `The connection is lost${reason ? `: ${reason}` : ""}. Trying again.`;
  if (!up && ended) next = `The server has ended the connection: ${reason}.`;
  return { mode, title, next, notice: ofDevice((up && state?.notice) || "", device), arrived, facts };
}

const sentence = (text) => (text ? `${text[0].toUpperCase()}${text.slice(1)}.` : "");

/** The prediction in one line. */
export function predictionText(prediction) {
  if (!prediction) return "";
  const spread = prediction.spread.length ? Math.round(1000 * prediction.spread[prediction.spread.length - 1]) : null;
  const parts = [];
  if (prediction.probability !== null)
    parts.push(`Grasp holds in ${isDoubtful(prediction) ? "only " : ""}${percent(prediction.probability)} of ${prediction.futures} futures (${percent(prediction.low)} to ${percent(prediction.high)})`);
  if (prediction.miss !== null) parts.push(`the preview ends ${Math.round(1000 * prediction.miss)} mm from the target`);
  if (spread !== null) parts.push(`in ${percent(prediction.within)} of cases the robot’s tip ends within ${spread} mm of the preview’s, where it touches nothing`);
  else parts.push(`how near the robot’s tip comes to the preview’s is unknown: ${prediction.unknown}`);
  return sentence(parts.join("; "));
}

const percent = (share) => `${Math.round(100 * share)} %`;

/** Writes into the page; only what has changed, so that a screen reader reads it once. */
export class PagePanel {
  constructor(find) {
    this.parts = Object.fromEntries(["mode", "next", "notice", "facts"].map((id) => [id, find(id)]));
    this.facts = "";
  }

  /** `kind` of the notice: "" or "good". */
  show({ mode, title, next, notice, facts, kind = "" }) {
    if (this.parts.notice.dataset.kind !== kind) this.parts.notice.dataset.kind = kind;
    setText(this.parts.mode, title);
    if (this.parts.mode.dataset.mode !== mode) this.parts.mode.dataset.mode = mode;
    setText(this.parts.next, next);
    setText(this.parts.notice, notice === next ? "" : notice);
    const key = JSON.stringify(facts);
    if (key === this.facts) return;
    this.facts = key;
    this.parts.facts.replaceChildren(
      ...Object.entries(facts).flatMap(([name, value]) => [element("dt", name), element("dd", value)]),
    );
  }
}

function element(tag, text) {
  const node = document.createElement(tag);
  node.textContent = text;
  return node;
}

function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

const WIDTH = 1024, HEIGHT = 460; // pixels of the board
const BROAD = 0.7; // m
const AWAY = 1.1, ASIDE = 0.42, BELOW = 0.05; // m from the eyes
const LOOSE = 0.3; // m by which it may be elsewhere before it comes along
const EASE = 4; // per s

/** The board in the room: it comes along when the viewer turns, and stands still otherwise. */
export class RoomPanel {
  constructor(scene) {
    this.canvas = document.createElement("canvas");
    [this.canvas.width, this.canvas.height] = [WIDTH, HEIGHT];
    this.texture = new CanvasTexture(this.canvas);
    this.texture.colorSpace = SRGBColorSpace;
    this.texture.minFilter = LinearFilter;
    const material = new MeshBasicMaterial({ map: this.texture, transparent: true });
    this.board = new Mesh(new PlaneGeometry(BROAD, (BROAD * HEIGHT) / WIDTH), material);
    this.board.renderOrder = 9;
    this.board.visible = false;
    this.drawn = "";
    scene.add(this.board);
  }

  /** `eye`: the viewer's camera. Every word is drawn again when one changes. */
  show({ mode, title, next, notice, arrived, facts: { Robot, ...facts } }, extra, eye, dt) {
    this.board.visible = true;
    this.comeAlong(eye, dt);
    if (arrived) facts.Robot = arrived; // without its age, which changes all the time
    const key = JSON.stringify([mode, title, next, notice, facts, extra]);
    if (key === this.drawn) return;
    this.drawn = key;
    const pen = this.canvas.getContext("2d");
    pen.clearRect(0, 0, WIDTH, HEIGHT);
    pen.fillStyle = "rgba(20, 24, 29, 0.9)";
    pen.beginPath();
    pen.roundRect(0, 0, WIDTH, HEIGHT, 36);
    pen.fill();
    pen.fillStyle = css(COLOURS[mode] ?? 0x9aa5b1);
    pen.fillRect(0, 40, 14, HEIGHT - 80);
    const write = wrapped(pen, 50, WIDTH - 90);
    write(title, "650 66px system-ui, sans-serif", "#ffffff", 84, 1);
    write(next, "46px system-ui, sans-serif", "#ffffff", 56, 3);
    write(notice === next ? "" : notice, "38px system-ui, sans-serif", css(GHOST), 48, 2);
    write(extra, "34px system-ui, sans-serif", "#c4ccd4", 42, 2);
    write(Object.entries(facts).map(([name, value]) => `${name}: ${value}`).join("   "),
      "34px system-ui, sans-serif", "#c4ccd4", 42, 1);
    this.texture.needsUpdate = true;
  }

  comeAlong(eye, dt) {
    const ahead = new Vector3(0, 0, -1).transformDirection(eye.matrixWorld).setY(0).normalize();
    const left = new Vector3(ahead.z, 0, -ahead.x);
    const goal = new Vector3().setFromMatrixPosition(eye.matrixWorld);
    goal.addScaledVector(ahead, AWAY).addScaledVector(left, ASIDE);
    goal.y -= BELOW;
    const away = this.board.position.distanceTo(goal);
    if (this.placed && away < LOOSE && !this.coming) return this.faceEye(eye);
    this.coming = away > 0.03;
    this.board.position.lerp(goal, this.placed ? 1 - Math.exp(-EASE * dt) : 1);
    this.placed = true;
    this.faceEye(eye);
  }

  faceEye(eye) {
    this.board.lookAt(new Vector3().setFromMatrixPosition(eye.matrixWorld));
  }

  hide() {
    this.board.visible = this.placed = false;
  }
}

/** Writes lines one below the other, broken at words, at most `most` of each text. */
function wrapped(pen, x, width) {
  let y = 44;
  return (text, font, colour, height, most) => {
    if (!text) return;
    pen.font = font;
    pen.fillStyle = colour;
    pen.textBaseline = "top";
    let line = "", lines = 0;
    const put = (line) => {
      if (lines++ >= most) return;
      pen.fillText(line, x, y, width);
      y += height;
    };
    for (const word of text.split(" ")) {
      const longer = line ? `${line} ${word}` : word;
      if (line && pen.measureText(longer).width > width) {
        put(line);
        line = word;
      } else line = longer;
    }
    put(line);
    y += 10;
  };
}
