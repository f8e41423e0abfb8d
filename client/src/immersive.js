// A session in the headset: passthrough, both controllers, anchors, a tick at the edge of reach.

import { Quaternion, Vector3 } from "three";
import { HANDS } from "./wire_table.js";
import { Alignment, toWire } from "./alignment.js";
import { fasten, placeOf, restore } from "./anchor.js";
import { noHand } from "./wire.js";

const BUTTONS = { trigger: 0, grip: 1, stick_pressed: 3, primary: 4, secondary: 5 }; // of WebXR's xr-standard mapping
const STICK = [2, 3]; // its axes
const ASIDE = [0.8, 0.4]; // of a stick that is pushed to a side: from where on, and from where on no longer
const LEAST_RATE = 72, MOST_RATE = 120; // Hz
const TICK = [0.6, 30]; // strength and ms
const CREEP = 0.0005, CREEP_TURN = 0.0005; // m and rad of an anchor that are not worth a message

export const canImmerse = async () => Boolean(await navigator.xr?.isSessionSupported("immersive-ar").catch(() => false));

export class Immersive {
  /** `sendJson(type, fields)`: to the server. `ended()`: called when the session ends. */
  constructor(renderer, sendJson, ended) {
    Object.assign(this, { renderer, sendJson, ended });
    this.session = null;
    this.alignment = new Alignment();
    this.buttons = { left: new Set(), right: new Set() };
  }

  /** From a user's click. */
  async enter() {
    const session = await navigator.xr.requestSession("immersive-ar", {
      requiredFeatures: ["local-floor"],
      optionalFeatures: ["anchors", "hand-tracking"],
    });
    this.session = session;
    this.alignment.begin();
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
    if (this.anchor) return this.sendAnchor(null);
    this.sendJson("alignment", { pose: null });
  }

  /** The server's progress of the alignment. */
  receive(progress) {
    if (!this.session) return;
    this.fastening ||= progress.fasten && !this.alignment.progress?.fasten;
    this.alignment.receive(progress);
    if (progress.step === "lost") this.sent = undefined; // the server waits for the anchor's pose
    if (progress.fasten || progress.anchor === this.anchorId) return;
    this.deleteAnchor();
    this.anchorId = progress.anchor;
    if (this.anchorId) this.restore(this.anchorId);
  }

  async restore(id) {
    const { session } = this, anchor = await restore(session, id);
    if (session === this.session && this.anchorId === id) this.anchor = anchor;
  }

  /** `anchorId`: of the anchor that the server follows. `sent`: its pose as last sent. */
  leaveAnchor() {
    [this.anchor, this.anchorId, this.sent, this.fastening] = [null, "", undefined, false];
  }

  /** Deletes an anchor that is of no use any more; a headset keeps only some. */
  deleteAnchor() {
    const { anchor, id } = this.anchor ?? {};
    anchor?.delete?.();
    if (anchor) this.session.deletePersistentAnchor?.(id)?.catch?.(() => {});
    this.leaveAnchor();
  }

  /** At each frame of the headset; returns both hands in the room's frame. */
  frame(frame) {
    const controllers = this.readControllers(frame);
    const viewer = frame.getViewerPose(this.space);
    this.eye = viewer && { position: vector(viewer.transform.position), quaternion: quaternion(viewer.transform.orientation) };
    if (this.fastening) this.fasten(frame);
    if (this.anchor) this.follow(frame);
    if (this.eye && !this.alignment.done) {
      const request = this.alignment.update(controllers, this.eye);
      if (request === "touch") this.sendJson("touch", {});
      if (request === "here") this.sendJson("alignment", { pose: toWire(this.alignment.place) });
    }
    return this.hands(controllers);
  }

  /** Fastens an anchor at the base's pose. */
  fasten(frame) {
    this.deleteAnchor();
    const { session } = this;
    fasten(frame, this.space, this.alignment.place).then((anchor) => {
      if (session === this.session && anchor) [this.anchor, this.anchorId] = [anchor, anchor.id];
    }).catch(() => {}); // without one, a recentring asks to align again
  }

  /** Sends the anchor's pose where it has changed. */
  follow(frame) {
    const place = placeOf(frame, this.space, this.anchor.anchor), { sent } = this;
    const crept = place && sent && place.position.distanceTo(sent.position) < CREEP && place.quaternion.angleTo(sent.quaternion) < CREEP_TURN;
    if (!crept && (place || sent !== null)) this.sendAnchor(place);
  }

  sendAnchor(place) {
    this.sent = place;
    this.sendJson("anchor", { id: this.anchor.id, pose: place && toWire(place) });
  }

  /** The tracked controllers: `buttons` that are down, and those `pressed` since the frame before; `aside` is a stick's. */
  readControllers(frame) {
    const controllers = { left: null, right: null };
    for (const source of this.session.inputSources) {
      if (!HANDS.includes(source.handedness) || !source.gamepad) continue;
      const pose = frame.getPose(source.targetRaySpace, this.space);
      const button = (name) => Boolean(source.gamepad.buttons[BUTTONS[name]]?.pressed);
      const stick = STICK.map((axis) => source.gamepad.axes[axis] ?? 0);
      const before = this.buttons[source.handedness];
      const buttons = new Set(Object.keys(BUTTONS).filter(button));
      if (isAside(stick, before.has("aside"))) buttons.add("aside");
      this.buttons[source.handedness] = buttons;
      // An emulated position is a guess of the headset's: no touch, no target.
      if (!pose || pose.emulatedPosition) continue;
      const { position, orientation } = pose.transform;
      controllers[source.handedness] = {
        source,
        position: vector(position),
        quaternion: quaternion(orientation),
        buttons,
        pressed: new Set([...buttons].filter((name) => !before.has(name))),
        grip: buttons.has("grip"),
        stick,
      };
    }
    this.controllers = controllers;
    return controllers;
  }

  /** As the wire has them. */
  hands(controllers) {
    const hands = { left: noHand(), right: noHand() };
    for (const side of HANDS) {
      const controller = controllers[side];
      // A stop counts from a controller that is not tracked, too.
      hands[side].secondary = this.buttons[side].has("secondary");
      if (!controller) continue;
      const { position: p, quaternion: q } = controller;
      for (const name of Object.keys(BUTTONS)) hands[side][name] = controller.buttons.has(name);
      const [right, back] = controller.stick;
      // WebXR's stick is negative forward, the wire's positive.
      Object.assign(hands[side], { tracked: true, position: p.toArray(), quaternion: [q.w, q.x, q.y, q.z], stick: [right, -back] });
    }
    return hands;
  }

  /** A tick in the hand of `side`. */
  tick(side) {
    const pad = this.controllers?.[side]?.source.gamepad;
    const motor = pad?.hapticActuators?.[0];
    if (motor?.pulse) motor.pulse(...TICK);
    else pad?.vibrationActuator?.playEffect?.("dual-rumble", { strongMagnitude: TICK[0], duration: TICK[1] });
  }
}

/** Whether a stick is to a side, which forward and back, for the ray's length, are not. `was`: before. */
const isAside = ([right, back], was) => Math.abs(right) > ASIDE[Number(was)] && Math.abs(right) > Math.abs(back);
const vector = ({ x, y, z }) => new Vector3(x, y, z);
const quaternion = ({ x, y, z, w }) => new Quaternion(x, y, z, w);
