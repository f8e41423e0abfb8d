// A session in the headset: passthrough, both controllers, anchors, a tick at the edge of reach.

import { Quaternion, Vector3 } from "three";
import { HANDS } from "./wire_table.js";
import { Aligning, toWire } from "./aligning.js";
import { fasten, placeOf, restore } from "./anchor.js";
import { noHand } from "./wire.js";

const BUTTONS = { trigger: 0, grip: 1, stick_pressed: 3, primary: 4, secondary: 5 }; // of WebXR's xr-standard mapping
const STICK = [2, 3]; // its axes
const LEAST_RATE = 72, MOST_RATE = 120; // Hz
const TICK = [0.6, 30]; // strength and ms
const CREEP = 0.0005, CREEP_TURN = 0.0005; // m and rad of an anchor that are not worth a message

export const canImmerse = async () => Boolean(await navigator.xr?.isSessionSupported("immersive-ar").catch(() => false));

export class Immersive {
  /** `say(type, fields)`: to the server. `ended()`: the session. */
  constructor(renderer, say, ended) {
    Object.assign(this, { renderer, say, ended });
    this.session = null;
    this.aligning = new Aligning();
    this.held = { left: new Set(), right: new Set() };
  }

  /** From a user's click. */
  async enter() {
    const session = await navigator.xr.requestSession("immersive-ar", {
      requiredFeatures: ["local-floor"],
      optionalFeatures: ["anchors", "hand-tracking"],
    });
    this.session = session;
    this.aligning.begin();
    this.leaveAnchor();
    session.addEventListener("end", () => {
      this.session = null;
      this.ended();
    });
    this.renderer.xr.setReferenceSpaceType("local-floor");
    await this.renderer.xr.setSession(session);
    const rates = [...(session.supportedFrameRates ?? [])].filter((rate) => rate >= LEAST_RATE && rate <= MOST_RATE);
    if (rates.length) await session.updateTargetFrameRate(Math.max(...rates)).catch(() => {});
    this.space = this.renderer.xr.getReferenceSpace();
    this.space.addEventListener("reset", () => this.recentred());
  }

  leave() {
    return this.session?.end();
  }

  get visible() {
    return this.session?.visibilityState === "visible";
  }

  /** The room's frame has leapt: what stood in it is elsewhere. An anchor stays with the room. */
  recentred() {
    if (this.anchor) return this.tell(null);
    this.say("alignment", { pose: null });
  }

  /** What the server says of the alignment. */
  heard(told) {
    if (!this.session) return;
    this.fastening ||= told.fasten && !this.aligning.told?.fasten;
    this.aligning.heard(told);
    if (told.step === "lost") this.sent = undefined; // it waits to hear where the anchor is
    if (told.fasten || told.anchor === this.wanted) return;
    this.deleteAnchor();
    this.wanted = told.anchor;
    if (this.wanted) this.restore(this.wanted);
  }

  async restore(id) {
    const { session } = this, found = await restore(session, id);
    if (session === this.session && this.wanted === id) this.anchor = found;
  }

  /** `wanted`: id of the anchor that the server knows. `sent`: where it was told to be. */
  leaveAnchor() {
    [this.anchor, this.wanted, this.sent, this.fastening] = [null, "", undefined, false];
  }

  /** One that is worth nothing any more; a headset keeps only some. */
  deleteAnchor() {
    const { anchor, id } = this.anchor ?? {};
    anchor?.delete?.();
    if (anchor) this.session.deletePersistentAnchor?.(id)?.catch?.(() => {});
    this.leaveAnchor();
  }

  /** What happens at a frame of the headset; returns both hands in the room's frame. */
  frame(frame) {
    const seen = this.controllers(frame);
    const viewer = frame.getViewerPose(this.space);
    this.eye = viewer && { position: vector(viewer.transform.position), quaternion: quaternion(viewer.transform.orientation) };
    if (this.fastening) this.fasten(frame);
    if (this.anchor) this.follow(frame);
    if (this.eye && !this.aligning.done) {
      const wish = this.aligning.hear(seen, this.eye);
      if (wish === "touch") this.say("touch", {});
      if (wish === "here") this.say("alignment", { pose: toWire(this.aligning.place) });
    }
    return this.hands(seen);
  }

  /** An anchor where the server says that the base is. */
  fasten(frame) {
    this.deleteAnchor();
    const { session } = this;
    fasten(frame, this.space, this.aligning.place).then((found) => {
      if (session === this.session && found) [this.anchor, this.wanted] = [found, found.id];
    }).catch(() => {}); // without one, a recentring asks to align again
  }

  /** Tells where the anchor is. */
  follow(frame) {
    const place = placeOf(frame, this.space, this.anchor.anchor), { sent } = this;
    const crept = place && sent && place.position.distanceTo(sent.position) < CREEP && place.quaternion.angleTo(sent.quaternion) < CREEP_TURN;
    if (!crept && (place || sent !== null)) this.tell(place);
  }

  tell(place) {
    this.sent = place;
    this.say("anchor", { id: this.anchor.id, pose: place && toWire(place) });
  }

  /** The controllers that are tracked, with buttons that are held and those `pressed` since the frame before. */
  controllers(frame) {
    const found = { left: null, right: null };
    for (const source of this.session.inputSources) {
      if (!HANDS.includes(source.handedness) || !source.gamepad) continue;
      const pose = frame.getPose(source.targetRaySpace, this.space);
      const button = (name) => Boolean(source.gamepad.buttons[BUTTONS[name]]?.pressed);
      const held = new Set(Object.keys(BUTTONS).filter(button));
      const before = this.held[source.handedness];
      this.held[source.handedness] = held;
      // An emulated position is a guess of the headset's: no touch, no target.
      if (!pose || pose.emulatedPosition) continue;
      const { position, orientation } = pose.transform;
      found[source.handedness] = {
        source,
        position: vector(position),
        quaternion: quaternion(orientation),
        held,
        pressed: new Set([...held].filter((name) => !before.has(name))),
        grip: held.has("grip"),
        stick: STICK.map((axis) => source.gamepad.axes[axis] ?? 0),
      };
    }
    this.seen = found;
    return found;
  }

  /** As the wire has them. */
  hands(seen) {
    const hands = { left: noHand(), right: noHand() };
    for (const side of HANDS) {
      const one = seen[side];
      // A stop counts from a controller that is not tracked, too.
      hands[side].secondary = this.held[side].has("secondary");
      if (!one) continue;
      const { position: p, quaternion: q } = one;
      for (const name of Object.keys(BUTTONS)) hands[side][name] = one.held.has(name);
      const [right, back] = one.stick;
      // WebXR's stick is negative forward, the wire's positive.
      Object.assign(hands[side], { tracked: true, position: p.toArray(), quaternion: [q.w, q.x, q.y, q.z], stick: [right, -back] });
    }
    return hands;
  }

  /** A tick in the hand of `side`. */
  tick(side) {
    const pad = this.seen?.[side]?.source.gamepad;
    const motor = pad?.hapticActuators?.[0];
    if (motor?.pulse) motor.pulse(...TICK);
    else pad?.vibrationActuator?.playEffect?.("dual-rumble", { strongMagnitude: TICK[0], duration: TICK[1] });
  }
}

const vector = ({ x, y, z }) => new Vector3(x, y, z);
const quaternion = ({ x, y, z, w }) => new Quaternion(x, y, z, w);
