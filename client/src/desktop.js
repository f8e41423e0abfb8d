// Two hands made of mouse and keyboard: the same poses and buttons that controllers send.
//
// A ray's length is the core's. So a hand is put where its ray ends at the wanted point, and sends no stick for it.

import { MathUtils, Matrix4, Plane, Quaternion, Raycaster, Vector2, Vector3 } from "three";
import { axisOf, onAxis, objectAt } from "./handles.js";
import { matrixOf } from "./geoms.js";
import { HANDS } from "./wire_table.js";
import { noHand } from "./wire.js";

const NEAR = 42; // pixels within which a marker is taken
const BESIDE = { mouse: 9, pen: 12, touch: 22 }; // pixels within which a handle is taken
const MARGIN = 0.01; // m about an object, which is small on the screen
const STEP = 0.01, FINE = 0.001, TILT = MathUtils.degToRad(2); // of an arrow
const WHEEL = 0.0006; // m a pixel of the wheel
const PRESS = 4; // inputs for which a press lasts, so that it arrives however slowly they are sent
const SETTLES = 0.7; // s for which a target keeps its grip after a step, until the core's filter is there; while aiming alone
const DOWN = new Vector3(0, 0, -1);
const ARROWS = { ArrowLeft: [-1, 0, 0], ArrowRight: [1, 0, 0], ArrowUp: [0, 1, 0], ArrowDown: [0, -1, 0], PageUp: [0, 0, 1], PageDown: [0, 0, -1] };

export class DesktopHands {
  /**
   * `acts`: what else keys do: `stop`, `reach` and `correct`; `deadman(on)` at each change of the dead man's key, `key(code)` at
   * each key pressed. Positions are in the base frame, z up.
   */
  constructor(canvas, camera, orbit, base, marks, handles, rigidHand, acts) {
    Object.assign(this, { canvas, camera, orbit, base, marks, handles, acts });
    this.objects = []; // an object onto which the tip's marker is dragged is marked by it
    this.axis = -1; // of the handle that is dragged
    this.touches = matchMedia("(pointer: coarse)").matches; // else there are keys
    this.rigid = HANDS.indexOf(rigidHand);
    this.wanted = [null, null];
    this.length = 0.6; // m, of the core's rays, from hand to end
    this.pointing = DOWN.clone();
    this.chosen = this.rigid;
    this.dragging = false;
    this.aiming = false; // whether the core aims
    this.deadman = false; // the dead man's key or button
    this.pressedInputs = {}; // by button: inputs for which it stays pressed
    this.pressedUntil = { trigger: 0, primary: 0, stick_pressed: 0, grip: 0, tilt: 0 }; // s, of the page
    this.listen();
  }

  listen() {
    const { canvas } = this;
    canvas.addEventListener("pointerdown", (event) => this.take(event));
    addEventListener("pointermove", (event) => this.drag(event));
    addEventListener("pointerup", () => this.drop());
    addEventListener("pointercancel", () => this.drop());
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    addEventListener("pointerdown", ({ pointerType }) => (this.touches = pointerType === "touch"), true);
    addEventListener("keydown", (event) => this.key(event));
    addEventListener("keyup", (event) => event.code === "KeyG" && this.hold(false));
    addEventListener("blur", () => this.letGo()); // a key let go elsewhere causes no event
    document.addEventListener("visibilitychange", () => document.hidden && this.letGo());
  }

  letGo() {
    this.hold(false);
    this.drop();
  }

  hold(on) {
    this.deadman = on;
    this.acts.deadman(on);
  }

  press(button, seconds = 0) {
    this.pressedUntil[button] = performance.now() / 1000 + seconds;
    this.pressedInputs[button] = PRESS;
  }

  /** An offer is taken by a hand that grips nothing: a target that still settles is let go. */
  accept() {
    this.pressedUntil.grip = this.pressedInputs.grip = 0;
    this.press("primary");
  }

  /** Where both targets begin: at the robot's own mount and tip, so that they are in view. */
  begin(mount, tip) {
    const soft = 1 - this.rigid;
    this.wanted[this.rigid] ??= mount.clone();
    this.wanted[soft] ??= tip.clone();
  }

  /** The length of the core's rays: from where the hand was to the ray's end. */
  measure(end, start) {
    const length = end.distanceTo(start);
    if (Number.isFinite(length) && length > 0.01) this.length = length;
  }

  take(event) {
    if (event.button !== 0 || !this.wanted[0]) return;
    this.canvas.focus();
    const [x, y] = this.pixel(event);
    const toScreen = (point) => this.toScreen(point);
    this.axis = this.handles.nearest(toScreen, x, y, BESIDE[event.pointerType] ?? BESIDE.mouse);
    const index = this.axis >= 0 ? this.chosen : this.marks.nearest(toScreen, x, y, NEAR);
    if (index < 0) return;
    this.chosen = index;
    this.dragging = true;
    this.orbit.enabled = false;
    this.canvas.setPointerCapture(event.pointerId);
    const point = this.inRoom(this.wanted[index]);
    const normal = new Vector3(0, 0, 1).transformDirection(this.camera.matrixWorld);
    this.plane = new Plane().setFromNormalAndCoplanarPoint(normal, point);
    this.grabbed = point.sub(this.onPlane(event) ?? point); // it does not leap to the pointer
    this.began = this.wanted[index].clone();
    this.slid = this.axis >= 0 ? onAxis(this.rayInBase(event), this.began, axisOf(this.axis)) : null;
  }

  drag(event) {
    if (!this.dragging) return;
    this.last = event;
    if (this.axis >= 0) {
      const slid = this.slid && onAxis(this.rayInBase(event), this.began, axisOf(this.axis));
      if (slid) this.wanted[this.chosen] = slid.sub(this.slid).add(this.began);
      return;
    }
    const object = this.chosen === this.rigid ? null : objectAt(this.rayInBase(event), this.objects, inverseOf, MARGIN);
    if (object) return void (this.wanted[this.chosen] = new Vector3(...object.position));
    const point = this.onPlane(event);
    if (point) this.wanted[this.chosen] = this.inBase(point.add(this.grabbed));
  }

  drop() {
    if (this.dragging) this.press("grip", SETTLES);
    this.dragging = false;
    this.axis = -1;
    this.orbit.enabled = true;
  }

  wheel(event) {
    if (!this.dragging) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    const ahead = new Vector3(0, 0, -1).transformDirection(this.camera.matrixWorld);
    this.plane.translate(ahead.multiplyScalar(-WHEEL * event.deltaY));
    if (this.last) this.drag(this.last);
  }

  key(event) {
    if (event.target instanceof HTMLInputElement && event.target.type !== "range") return;
    const { code } = event;
    if (code === "Space") {
      event.preventDefault();
      return this.acts.stop();
    }
    if (event.ctrlKey || event.metaKey) return;
    this.touches = false;
    const isButton = code === "Enter" && event.target instanceof HTMLElement && /^(BUTTON|SUMMARY)$/.test(event.target.tagName);
    if (!event.repeat && !isButton) this.acts.key(code);
    if (code === "KeyG" && !event.repeat) return this.hold(true);
    if (code in ARROWS && !(event.target instanceof HTMLInputElement)) return this.arrow(event);
    if (event.repeat) return;
    if (code === "Digit1" || code === "Digit2") this.chosen = code === "Digit1" ? this.rigid : 1 - this.rigid;
    else if (code === "Enter" && !isButton) this.press("trigger");
    else if (code === "KeyR") this.accept();
    else if (code === "KeyF") this.press("stick_pressed");
    else if (code === "KeyH") this.acts.reach();
    else if (code === "KeyC") this.acts.correct();
  }

  arrow(event) {
    event.preventDefault();
    if (!this.wanted[0]) return;
    const [right, up, away] = ARROWS[event.code];
    if (event.altKey) return this.tilt(right, up);
    // Along the base's axes that come nearest to what is right, up and away on the screen.
    const ahead = new Vector3(0, 0, -1).transformDirection(this.camera.matrixWorld);
    const across = this.directionInBase(new Vector3(1, 0, 0).transformDirection(this.camera.matrixWorld)).setZ(0).normalize();
    const forth = this.directionInBase(ahead).setZ(0).normalize();
    const step = event.shiftKey ? FINE : STEP;
    this.wanted[this.chosen].addScaledVector(across, step * right).addScaledVector(forth, step * away);
    this.wanted[this.chosen].z += step * up;
    this.press("grip", SETTLES);
  }

  /** The end effector's direction turned about the view's axes; the core limits it. */
  tilt(right, up) {
    const across = this.directionInBase(new Vector3(1, 0, 0).transformDirection(this.camera.matrixWorld)).setZ(0).normalize();
    const forth = new Vector3().crossVectors(new Vector3(0, 0, 1), across);
    this.pointing.applyAxisAngle(across, -TILT * up).applyAxisAngle(forth, -TILT * right).normalize();
    this.press("tilt", SETTLES);
  }

  /** Whether a key or the mouse is pressed; the core waits until none is. */
  get isPressed() {
    return this.deadman || this.dragging;
  }

  /** Both hands now, in the base frame. */
  hands() {
    const now = performance.now() / 1000;
    const down = (name) => now < this.pressedUntil[name] || this.pressedInputs[name] > 0;
    const hands = {};
    HANDS.forEach((side, index) => {
      const hand = noHand();
      hands[side] = hand;
      const wanted = this.wanted[index];
      if (!wanted) return;
      const tilting = this.aiming && down("tilt") && index === this.rigid;
      const turn = this.turn(index);
      const start = wanted.clone().addScaledVector(new Vector3(0, 0, -1).applyQuaternion(turn), -this.length);
      hand.tracked = true;
      hand.position = start.toArray();
      hand.quaternion = [turn.w, turn.x, turn.y, turn.z];
      const gripping = this.dragging || (this.aiming && down("grip")); // no grip lasts beyond the hand where a robot may move
      hand.grip = this.deadman || tilting || (gripping && index === this.chosen);
      hand.primary = down("primary") || tilting;
      hand.trigger = down("trigger") && index === this.rigid;
      hand.stick_pressed = down("stick_pressed") && index === this.rigid;
    });
    for (const name of Object.keys(this.pressedInputs)) this.pressedInputs[name] = Math.max(this.pressedInputs[name] - 1, 0);
    return hands;
  }

  /** A hand's turn: its ray away from the viewer, level; the rigid hand's own down is where the end effector points. */
  turn(index) {
    const down = index === this.rigid ? this.pointing : DOWN;
    const ahead = this.directionInBase(new Vector3(0, 0, -1).transformDirection(this.camera.matrixWorld));
    const level = ahead.addScaledVector(down, -ahead.dot(down));
    if (level.lengthSq() < 1e-6) level.set(-1, 0, 0).addScaledVector(down, down.x);
    const back = level.normalize().negate(), up = down.clone().negate();
    const right = new Vector3().crossVectors(up, back);
    return new Quaternion().setFromRotationMatrix(new Matrix4().makeBasis(right, up, back));
  }

  pixel(event) {
    const { left, top } = this.canvas.getBoundingClientRect();
    return [event.clientX - left, event.clientY - top];
  }

  toScreen(point) {
    const projected = this.inRoom(point).project(this.camera);
    const { clientWidth, clientHeight } = this.canvas;
    return [((projected.x + 1) / 2) * clientWidth, ((1 - projected.y) / 2) * clientHeight];
  }

  /** From the eye through a point of the screen, in the room. */
  ray(event) {
    const [x, y] = this.pixel(event);
    const at = new Vector2((2 * x) / this.canvas.clientWidth - 1, 1 - (2 * y) / this.canvas.clientHeight);
    const caster = new Raycaster();
    caster.setFromCamera(at, this.camera);
    return caster.ray;
  }

  rayInBase(event) {
    return this.ray(event).applyMatrix4(this.base.matrixWorld.clone().invert());
  }

  onPlane(event) {
    return this.ray(event).intersectPlane(this.plane, new Vector3());
  }

  inRoom(point) {
    return this.base.localToWorld(point.clone());
  }

  inBase(point) {
    return this.base.worldToLocal(point.clone());
  }

  directionInBase(direction) {
    return direction.clone().applyQuaternion(this.base.quaternion.clone().invert());
  }
}

const inverseOf = ({ position, quaternion }) => matrixOf(position, quaternion).invert();
