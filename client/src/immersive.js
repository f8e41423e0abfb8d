// A session in the headset: passthrough, both controllers, anchors, a tick at the edge of reach.

import { Quaternion, Vector3 } from "three";
import { HANDS } from "./wire_table.js";
import { Aligning, inverse } from "./aligning.js";
import { fasten, placeOf, restore } from "./anchor.js";
import { clock, noHand } from "./wire.js";

const BUTTONS = { trigger: 0, grip: 1, stick_pressed: 3, primary: 4, secondary: 5 }; // of WebXR's xr-standard mapping
const STICK = [2, 3]; // its axes
const LEAST_RATE = 72, MOST_RATE = 120; // Hz
const PATIENCE = 10; // s that a restored anchor may stay lost
const TICK = [0.6, 30]; // strength and ms
const CREEP = 0.002, CREEP_TURN = 0.002; // m and rad by which an anchor may creep: a new alignment voids a plan

export const canImmerse = async () => Boolean(await navigator.xr?.isSessionSupported("immersive-ar").catch(() => false));

export class Immersive {
  /** `told(pose)` hears of every new place of the room in the base frame, null where it is lost. `ended()`: the session. */
  constructor(renderer, told, ended) {
    Object.assign(this, { renderer, told, ended });
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
    this.anchor = null;
    this.restoring = false;
    this.sent = null;
    this.lost = "";
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
    this.anchor = await restore(session);
    [this.restoring, this.until] = [Boolean(this.anchor), clock() + PATIENCE];
  }

  leave() {
    return this.session?.end();
  }

  get visible() {
    return this.session?.visibilityState === "visible";
  }

  /** The room's frame has leapt: what stood in it is elsewhere. An anchor stays with the room. */
  recentred() {
    if (this.anchor) return;
    this.tell(null);
    this.aligning.begin();
  }

  /** What happens at a frame of the headset; returns both hands in the room's frame. */
  frame(time, frame, flange) {
    const seen = this.controllers(frame);
    const viewer = frame.getViewerPose(this.space);
    const { aligning } = this;
    if (this.anchor) this.follow(frame, time);
    if (viewer && !aligning.done && !this.restoring) {
      const { position, orientation } = viewer.transform;
      const eye = { position: vector(position), quaternion: quaternion(orientation) };
      aligning.hear(time, seen, eye, flange);
      if (aligning.done) this.aligned(frame);
    }
    return this.hands(seen);
  }

  aligned(frame) {
    this.tell(inverse(this.aligning.place));
    if (this.anchor && this.aligning.kept) return;
    this.anchor?.delete?.();
    this.anchor = null;
    const session = this.session;
    fasten(frame, this.space, this.aligning.place).then((anchor) => {
      if (session === this.session) this.anchor = anchor;
    }).catch(() => {}); // without one, a recentring asks to align again
  }

  /** The base's place by its anchor. */
  follow(frame, time) {
    const place = placeOf(frame, this.space, this.anchor);
    if (!place && this.restoring && time > this.until) {
      [this.anchor, this.restoring, this.lost] = [null, false, ""]; // it is not found again: align anew
      return;
    }
    if (!place) {
      if (this.aligning.done && !this.lost) this.tell(null);
      this.lost = "The headset has lost the robot’s place. Look around; the robot holds until it is found.";
      return;
    }
    this.lost = "";
    if (this.restoring) {
      this.restoring = false;
      this.aligning.restored(place);
    }
    if (!this.aligning.done) return;
    const now = inverse(place);
    const crept = this.sent
      && now.position.distanceTo(this.sent.position) < CREEP && now.quaternion.angleTo(this.sent.quaternion) < CREEP_TURN;
    if (crept) return;
    this.aligning.place = place;
    this.tell(now);
  }

  tell(pose) {
    this.sent = pose;
    this.told(pose);
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

  /** As the wire has them. While the base is aligned, buttons mean that, and the robot hears of none but stop. */
  hands(seen) {
    const hands = { left: noHand(), right: noHand() };
    for (const side of HANDS) {
      const one = seen[side];
      // A stop counts from a controller that is not tracked, too.
      hands[side].secondary = this.held[side].has("secondary");
      if (!one) continue;
      const { position: p, quaternion: q } = one;
      const given = this.aligning.done ? one.held : new Set(["secondary"].filter((name) => one.held.has(name)));
      for (const name of Object.keys(BUTTONS)) hands[side][name] = given.has(name);
      const [right, back] = this.aligning.done ? one.stick : [0, 0];
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
