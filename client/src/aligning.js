// How the base gets its place in the room: put there by eye, touched, or restored. One step at a time, in words.

import { Quaternion, Vector3 } from "three";
import { Dwell, LIMIT, MARK, Pivot, TOUCHES, expectedError, fit, inBase, isApart, worst } from "./align.js";

const AHEAD = 1.2; // m from the viewer, at which the base is put first
const UPWARDS = new Quaternion().setFromAxisAngle(new Vector3(1, 0, 0), -Math.PI / 2); // z up as y up
const AT = new Vector3(0.6, 0, 0.3); // of the base frame, m: where the tip works
const mm = (metres) => `${(1000 * metres).toFixed(1)} mm`;

/** Of a session: `place` is the base's pose in the room, null until it is known; `done` whether it may be relied on. */
export class Aligning {
  constructor() {
    this.begin();
  }

  begin() {
    this.step = "place"; // place, tip, touch, check, done
    this.place = null;
    this.byEye = true;
    this.kept = false; // whether an anchor's place has stood the check
    this.tip = new Vector3();
    this.room = [];
    this.base = [];
    this.said = "";
    this.dwell = new Dwell();
    this.pivot = new Pivot();
    this.carried = null;
  }

  get done() {
    return this.step === "done";
  }

  /** With the place of an anchor of another day: one touch says whether it still holds. */
  restored(place) {
    this.place = place;
    this.byEye = false;
    this.step = "check";
  }

  get next() {
    return {
      place: "Hold both grips to carry the robot to its place. A: it stands there. Stick pressed: touch it instead.",
      tip: "Rest the controller’s tip in a dent, and turn the controller about it.",
      touch: `Hold the tip still on the flange’s mark, touch ${this.room.length + 1} of ${TOUCHES}. Move the robot between touches.`,
      check: "Hold the tip still on the flange’s mark once: it says whether the base still is where it was. Stick pressed: align anew. A: put it there by eye.",
      done: "",
    }[this.step];
  }

  /**
   * `hands` by side with `position` (Vector3), `quaternion` and buttons that were `pressed`, null where not tracked;
   * `eye`: the viewer's pose. `flange`: the mark in the base frame as the robot is, null where unknown.
   */
  hear(time, hands, eye, flange) {
    const right = hands.right, left = hands.left;
    if (!this.place) this.put(eye);
    if (this.step === "place") {
      this.carry(left, right);
      if (right?.pressed.has("stick_pressed")) this.step = "tip";
      else if (right?.pressed.has("primary") || left?.pressed.has("primary")) {
        this.step = "done";
        this.said = "Put there by eye: good enough for a simulated robot alone.";
      }
      return;
    }
    if (!right) return void (this.dwell.hear(time, null));
    if (this.step === "tip") {
      const tip = this.pivot.hear(right.position, right.quaternion);
      if (tip) [this.tip, this.step] = [tip, "touch"];
      return;
    }
    if (this.step === "check" && right.pressed.has("stick_pressed")) return void (this.step = "tip");
    if (this.step === "check" && right.pressed.has("primary")) return void ([this.step, this.byEye] = ["place", true]);
    if (this.step !== "touch" && this.step !== "check") return;
    const point = this.tip.clone().applyQuaternion(right.quaternion).add(right.position);
    const touched = this.dwell.hear(time, point);
    if (touched && flange) this.touched(touched, flange);
  }

  touched(point, flange) {
    if (this.step === "check") {
      const off = inBase(inverse(this.place), point).distanceTo(flange);
      this.said = `The base is within ${mm(off)} of where it was.`;
      if (off <= LIMIT) return void ([this.step, this.kept] = ["done", true]);
      this.said = `The touch is ${mm(off)} off, more than ${mm(LIMIT)}: align again.`;
      return void (this.step = "tip");
    }
    if (!isApart(flange, this.base)) return void (this.said = "Move the robot further before the next touch.");
    this.room.push(point);
    this.base.push(flange.clone());
    this.said = "";
    if (this.room.length < TOUCHES) return;
    const pose = fit(this.room, this.base), { index, off } = worst(this.room, this.base);
    if (off > LIMIT) {
      this.said = `Touch ${index + 1} is ${mm(off)} off the others; touch there again.`;
      this.room.splice(index, 1);
      this.base.splice(index, 1);
      return;
    }
    this.said = `Aligned; expected error where the tip works ${mm(expectedError(pose, this.room, this.base, AT))}.`;
    this.place = inverse(pose);
    this.byEye = false;
    this.step = "done";
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

/** The mark that is touched, in the base frame, from rows of poses; null where the robot has no such body. */
export function markOf(bodies, rows, stride) {
  const index = bodies?.indexOf(MARK.body) ?? -1;
  if (index < 0 || !rows) return null;
  const at = index * stride;
  const turn = new Quaternion(rows[at + 4], rows[at + 5], rows[at + 6], rows[at + 3]);
  return new Vector3(...MARK.place).applyQuaternion(turn).add(new Vector3().fromArray(rows, at));
}

/** Of a pose; of the base in the room, the room's in the base, which is what the server calls the alignment. */
export function inverse({ position, quaternion }) {
  const back = quaternion.clone().invert();
  return { position: position.clone().negate().applyQuaternion(back), quaternion: back };
}
