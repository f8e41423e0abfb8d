// Alignment: the base's pose in the room. The server runs the procedure; here the base is placed by eye.

import { Quaternion, Vector3 } from "three";

const AHEAD = 1.2; // m from the viewer, at which the base is put first
const UPWARDS = new Quaternion().setFromAxisAngle(new Vector3(1, 0, 0), -Math.PI / 2); // z up as y up

/** Of a session. `place`: the base's pose in the room as it is drawn, null before there is one. `progress`: the server's latest message. */
export class Alignment {
  constructor() {
    this.begin();
  }

  begin() {
    this.progress = null;
    this.place = null;
    this.carried = null;
    this.adjusting = false; // placed by eye although the server asks for a touch
  }

  receive(progress) {
    const leapt = progress.step === "place" && this.step !== "place";
    this.progress = progress;
    this.adjusting &&= progress.step === "check";
    if (progress.place) this.place = fromWire(progress.place);
    else if (leapt) this.place = null;
  }

  get step() {
    return this.adjusting ? "place" : (this.progress?.step ?? "place");
  }

  get done() {
    return this.step === "done";
  }

  get next() {
    return this.progress?.next ?? "";
  }

  /** On the last touch, in words. */
  get feedback() {
    return this.progress?.said ?? "";
  }

  /** Takes both controllers: `position` (Vector3) and the buttons `pressed`, null where not tracked; `eye`: the viewer's pose. Returns the user's request: "here", "touch" or "". */
  update({ left, right }, eye) {
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
