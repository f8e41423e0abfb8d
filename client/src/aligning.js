// How the base gets its place in the room. The server decides and says what is next; here it is put in place by eye.

import { Quaternion, Vector3 } from "three";

const AHEAD = 1.2; // m from the viewer, at which the base is put first
const UPWARDS = new Quaternion().setFromAxisAngle(new Vector3(1, 0, 0), -Math.PI / 2); // z up as y up

/** Of a session: `place` is the base's pose in the room as it is drawn, null until it is known; `told` what the server said last. */
export class Aligning {
  constructor() {
    this.begin();
  }

  begin() {
    this.told = null;
    this.place = null;
    this.carried = null;
    this.adjusting = false; // put there by eye though the server asks for a touch
  }

  heard(told) {
    const leapt = told.step === "place" && this.step !== "place";
    this.told = told;
    this.adjusting &&= told.step === "check";
    if (told.place) this.place = fromWire(told.place);
    else if (leapt) this.place = null;
  }

  get step() {
    return this.adjusting ? "place" : (this.told?.step ?? "place");
  }

  get done() {
    return this.step === "done";
  }

  get next() {
    return this.told?.next ?? "";
  }

  get said() {
    return this.told?.said ?? "";
  }

  /** `hands` with `position` (Vector3) and the buttons that were `pressed`, null where not tracked; `eye`: the viewer's pose. What the user wants: "here", "touch" or "". */
  hear({ left, right }, eye) {
    if (!this.place) this.put(eye);
    const { step } = this;
    if (step === "place") this.carry(left, right);
    if ((step === "place" || step === "check") && right?.pressed.has("stick_pressed")) return "touch";
    if (step === "check" && right?.pressed.has("primary")) this.adjusting = true;
    else if (step === "place" && (right?.pressed.has("primary") || left?.pressed.has("primary"))) return "here";
    return "";
  }

  /** Before the viewer, as high as a table. */
  put(eye) {
    const ahead = new Vector3(0, 0, -1).applyQuaternion(eye.quaternion).setY(0).normalize();
    const position = eye.position.clone().addScaledVector(ahead, AHEAD);
    position.y = Math.max(eye.position.y - 0.9, 0);
    const yaw = new Quaternion().setFromAxisAngle(new Vector3(0, 1, 0), Math.atan2(ahead.x, ahead.z) + Math.PI / 2);
    this.place = { position, quaternion: yaw.multiply(UPWARDS) }; // its x towards the viewer
  }

  /** Both grips carry it: along with their middle, and turned about the vertical with them. */
  carry(left, right) {
    if (!left?.grip || !right?.grip) return void (this.carried = null);
    const middle = left.position.clone().add(right.position).multiplyScalar(0.5);
    const angle = Math.atan2(right.position.x - left.position.x, right.position.z - left.position.z);
    if (this.carried) {
      const turned = angle - this.carried.angle;
      const about = new Quaternion().setFromAxisAngle(new Vector3(0, 1, 0), turned);
      const position = this.place.position.clone().sub(this.carried.middle).applyQuaternion(about).add(middle);
      this.place = { position, quaternion: about.multiply(this.place.quaternion) };
    }
    this.carried = { middle, angle };
  }
}

/** A pose as JSON has it; quaternions are w, x, y, z there. */
export const toWire = ({ position, quaternion: q }) => ({ position: position.toArray(), quaternion: [q.w, q.x, q.y, q.z] });

const fromWire = ({ position, quaternion: [w, x, y, z] }) => ({ position: new Vector3(...position), quaternion: new Quaternion(x, y, z, w) });
