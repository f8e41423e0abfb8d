// The connection: what is fast in binary, what is rare in JSON, by the one table that the server has too.

import { FROM_CLIENT, FROM_SERVER, HAND, HANDS, HEAD, HEAD_BYTES, POSE, SERVER_MESSAGES, VERSION } from "./wire_table.js";

const KINDS = new Map(Object.entries(FROM_SERVER).map(([name, kind]) => [kind.type, { name, ...kind }]));
const FIRST_WAIT = 0.25, LONGEST_WAIT = 4; // s until a connection is tried anew; it doubles
export const STRIDE = POSE.length; // numbers of a pose

/** The page's clock, s; it never goes back. */
export const clock = () => performance.now() / 1000;

/** A binary message of the server: `kind`, `flags` that are set, `count`, `sequence`, `time` and `rows`, all numbers. */
export function decode(buffer) {
  const head = new DataView(buffer);
  const kind = KINDS.get(head.getUint8(HEAD.type.offset));
  if (!kind) return null;
  const bits = head.getUint8(HEAD.flags.offset);
  return {
    kind: kind.name,
    flags: new Set(Object.keys(kind.flags).filter((name) => bits & kind.flags[name])),
    count: head.getUint16(HEAD.count.offset, true),
    sequence: head.getUint32(HEAD.sequence.offset, true),
    time: head.getFloat64(HEAD.time.offset, true),
    rows: new Float32Array(buffer, HEAD_BYTES),
  };
}

/** A binary message of a client; `hands` as `desktop` and `immersive` give them, of an input only; `pose` of a view, null where it is lost. */
export function encode(name, { received, stamp, hands = null, visible = false, drawn = false, correct = false, pose = null }) {
  const kind = FROM_CLIENT[name], rows = hands ? HANDS.length : kind.row.length ? 1 : 0;
  const message = new DataView(new ArrayBuffer(HEAD_BYTES + 4 * rows * kind.row.length));
  let flags = 0;
  if (pose) {
    const { position: p, quaternion: q } = pose;
    [p.x, p.y, p.z, q.w, q.x, q.y, q.z].forEach((number, place) => message.setFloat32(HEAD_BYTES + 4 * place, number, true));
    flags |= kind.flags.tracked;
  }
  if (hands) {
    HANDS.forEach((side, index) => {
      if (hands[side].tracked) flags |= kind.flags[`${side}_tracked`];
      const numbers = numbersOf(hands[side]);
      HAND.forEach((_, place) => message.setFloat32(HEAD_BYTES + 4 * (index * HAND.length + place), numbers[place], true));
    });
    if (visible) flags |= kind.flags.visible;
    if (drawn) flags |= kind.flags.drawn;
    if (correct) flags |= kind.flags.correct;
  }
  message.setUint8(HEAD.type.offset, kind.type);
  message.setUint8(HEAD.flags.offset, flags);
  message.setUint16(HEAD.count.offset, rows, true);
  message.setUint32(HEAD.sequence.offset, received, true);
  message.setFloat64(HEAD.time.offset, stamp, true);
  return message.buffer;
}

/** A hand as the table HAND lists it. Quaternions are (w, x, y, z) on the wire, and in a hand. */
function numbersOf(hand) {
  const { position, quaternion, stick } = hand;
  const button = (name) => (hand[name] ? 1 : 0);
  return [
    ...position, ...quaternion, button("trigger"), button("grip"), ...stick,
    button("stick_pressed"), button("primary"), button("secondary"),
  ];
}

/** A hand that is not tracked. */
export const noHand = () => ({
  tracked: false, position: [0, 0, 0], quaternion: [1, 0, 0, 0], stick: [0, 0],
  trigger: false, grip: false, stick_pressed: false, primary: false, secondary: false,
});

/**
 * One connection that comes back by itself.
 *
 * `handlers`: a function for each JSON `type` and binary kind that is used, and `opened()`, `closed(reason, final)`.
 */
export class Wire {
  constructor(handlers, { token = "", code = "", name = "browser", space = "base" } = {}) {
    this.handlers = handlers;
    this.hello = { token, code, name, space };
    this.id = this.key = "";
    this.received = 0;
    this.drawn = false; // whether a pose of the robot was drawn since the last input
    this.offset = null; // s, server = page + offset
    this.controls = false; // then its input acknowledges, else it does so message by message
    this.wait = FIRST_WAIT;
    this.open();
  }

  open() {
    clearTimeout(this.timer);
    const { protocol, host } = location;
    const socket = new WebSocket(`${protocol === "https:" ? "wss" : "ws"}://${host}/ws`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      [this.received, this.drawn] = [0, false];
      const { token, code, name, space } = this.hello;
      this.sendJson("hello", { version: VERSION, token, code: token ? "" : code, key: this.key, name, space });
      this.handlers.opened?.();
    };
    socket.onmessage = ({ data }) => socket === this.socket && this.receive(data);
    socket.onclose = ({ reason }) => socket === this.socket && this.lost(reason);
    this.socket = socket;
    this.refused = "";
  }

  /** Connects anew under the same id, with another `space` for instance. */
  reconnect(changes) {
    Object.assign(this.hello, changes);
    const old = this.socket;
    this.open();
    old.close();
  }

  lost(reason) {
    this.offset = null;
    const final = Boolean(this.refused);
    this.handlers.closed?.(this.refused || reason, final);
    if (final) return;
    this.timer = setTimeout(() => this.open(), 1000 * this.wait);
    this.wait = Math.min(2 * this.wait, LONGEST_WAIT);
  }

  receive(data) {
    if (typeof data !== "string") {
      this.received += 1;
      const message = decode(data);
      if (message) this.handlers[message.kind]?.(message);
      if (!this.controls) this.sendBinary("ack", { stamp: clock() });
      return;
    }
    const message = JSON.parse(data);
    if (!(message.type in SERVER_MESSAGES)) return;
    if (message.type === "ping") this.sendJson("pong", { number: message.number, stamp: clock() });
    if (message.type === "clock") this.offset = message.offset;
    if (message.type === "error" && message.closing) this.refused = message.reason;
    if (message.type === "welcome") {
      [this.id, this.key] = [message.id, message.key];
      this.hello.token = message.token;
      this.wait = FIRST_WAIT;
    }
    this.handlers[message.type]?.(message);
  }

  get up() {
    return this.socket.readyState === WebSocket.OPEN;
  }

  sendJson(type, fields) {
    if (this.up) this.socket.send(JSON.stringify({ type, ...fields }));
  }

  /** Poses and buttons of a frame of the page at `stamp`, s; it acknowledges what has come, and what was drawn. `correct`: a plan that it asks for may correct itself. */
  input(hands, visible, stamp, correct = false) {
    this.sendBinary("input", { hands, visible, stamp, drawn: this.drawn, correct });
    this.drawn = false;
  }

  /** The viewer's eyes in the room. */
  view(pose, stamp) {
    this.sendBinary("view", { pose, stamp });
  }

  stop() {
    this.sendBinary("stop", { stamp: clock() });
  }

  sendBinary(kind, fields) {
    if (this.up) this.socket.send(encode(kind, { received: this.received, ...fields }));
  }

  /** How old something of the server's time `time` is, s; null while the clocks have not met. */
  age(time) {
    return this.offset === null ? null : clock() + this.offset - time;
  }
}
