// A recording that is replayed without a server's robot: the binary messages `robot` of a session, one after the other,
// each with its length, u32, before it.

import { Playback } from "./playback.js";
import { STRIDE, decode } from "./wire.js";

const RATE = 1 / 72; // s between frames that are shown

export class Recording {
  constructor(buffer) {
    const view = new DataView(buffer), messages = [];
    for (let at = 0; at + 4 <= buffer.byteLength; ) {
      const size = view.getUint32(at, true);
      if (at + 4 + size > buffer.byteLength) break; // its last message is not whole
      const message = decode(buffer.slice(at + 4, at + 4 + size));
      if (message?.kind === "robot") messages.push(message);
      at += 4 + size;
    }
    this.playback = null;
    if (!messages.length) return;
    const begin = messages[0].time, duration = messages.at(-1).time - begin;
    const width = messages[0].rows.length;
    this.playback = new Playback({ step: RATE, duration: Math.max(duration, RATE), width });
    let at = 0;
    const frames = Math.floor(duration / RATE) + 1;
    for (let frame = 0; frame < frames; frame++) {
      while (at + 1 < messages.length && messages[at + 1].time - begin <= frame * RATE) at += 1;
      this.playback.add(frame, messages[at].rows, frame === frames - 1);
    }
  }
}
