// Two hands made of mouse and keyboard: the same poses and buttons that controllers send.
//
// A ray's length is the core's. So a hand is put where its ray ends at the wanted point, and sends no stick for it.

import { MathUtils, Matrix4, Plane, Quaternion, Raycaster, Vector2, Vector3 } from "three";
import { axisOf, onAxis, thingAt } from "./handles.js";
import { matrixOf } from "./geoms.js";
import { HANDS } from "./wire_table.js";
import { noHand } from "./wire.js";

const NEAR = 42; // pixels within which a marker is taken
const BESIDE = { mouse: 9, pen: 12, touch: 22 }; // pixels within which a handle is taken
const MARGIN = 0.01; // m about a thing, which is small on the screen
const STEP = 0.01, FINE = 0.001, TILT = MathUtils.degToRad(2); // of an arrow
const WHEEL = 0.0006; // m a pixel of the wheel
const PRESS = 4; // inputs in which a key's press is held, so that it is heard however slowly they are sent
const SETTLES = 0.7; // s for which a target keeps its grip after a step, until the core's filter is there; while aiming alone
const DOWN = new Vector3(0, 0, -1);
const ARROWS = { ArrowLeft: [-1, 0, 0], ArrowRight: [1, 0, 0], ArrowUp: [0, 1, 0], ArrowDown: [0, -1, 0], PageUp: [0, 0, 1], PageDown: [0, 0, -1] };

export class DesktopHands {
  /**
   * `acts`: what else keys do: `stop`, `reach`; `held(on)` is told of the dead man's key, `pressed(code)` of
   * each key. Positions are in the base frame, z up.
   */
  constructor(canvas, camera, orbit, base, marks, handles, rigidHand, acts) {
    Object.assign(this, { canvas, camera, orbit, base, marks, handles, acts });
    this.things = []; // what a tip's marker that is dragged onto it marks
    this.axis = -1; // of the handle that is dragged
    this.touches = matchMedia("(pointer: coarse)").matches; // else there are keys
    this.rigid = HANDS.indexOf(rigidHand);
    this.wanted = [null, null];
    this.length = 0.6; // m, of the core's rays; it tells where they end
    this.pointing = DOWN.clone();
    this.chosen = this.rigid;
    this.dragging = false;
    this.aiming = false; // whether the core aims
    this.dead = false; // the dead man's key or button
    this.left = {}; // inputs in which a button is still to be held
    this.until = { trigger: 0, primary: 0, stick_pressed: 0, grip: 0, tilt: 0 };
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
    addEventListener("blur", () => this.letGo()); // a key let go elsewhere is never heard of
    document.addEventListener("visibilitychange", () => document.hidden && this.letGo());
  }

  letGo() {
    this.hold(false);
    this.drop();
  }

  hold(on) {
    this.dead = on;
    this.acts.held(on);
  }

  press(button, seconds = 0) {
    this.until[button] = performance.now() / 1000 + seconds;
    this.left[button] = PRESS;
  }

  /** An offer is taken by a hand that grips nothing: a target that still settles is let go. */
  accept() {
    this.until.grip = this.left.grip = 0;
    this.press("primary");
  }

  /** Where both targets begin: at the robot's own mount and tip, so that they are seen. */
  begin(mount, tip) {
    const other = 1 - this.rigid;
    this.wanted[this.rigid] ??= mount.clone();
    this.wanted[other] ??= tip.clone();
  }

  /** What the core's rays say of their length: how far each end is from where its hand was. */
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
    const thing = this.chosen === this.rigid ? null : thingAt(this.rayInBase(event), this.things, inverseOf, MARGIN);
    if (thing) return void (this.wanted[this.chosen] = new Vector3(...thing.position));
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
    if (!event.repeat && !isButton) this.acts.pressed(code);
    if (code === "KeyG" && !event.repeat) return this.hold(true);
    if (code in ARROWS && !(event.target instanceof HTMLInputElement)) return this.arrow(event);
    if (event.repeat) return;
    if (code === "Digit1" || code === "Digit2") this.chosen = code === "Digit1" ? this.rigid : 1 - this.rigid;
    else if (code === "Enter" && !isButton) this.press("trigger");
    else if (code === "KeyR") this.accept();
    else if (code === "KeyF") this.press("stick_pressed");
    else if (code === "KeyH") this.acts.reach();
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

  /** Whether the user holds anything that the core waits to be let go. */
  get isHeld() {
    return this.dead || this.dragging;
  }

  /** Both hands now, in the base frame. */
  hands() {
    const now = performance.now() / 1000;
    const down = (name) => now < this.until[name] || this.left[name] > 0;
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
      const mine = this.dragging || (this.aiming && down("grip")); // no grip lasts beyond the hand where a robot may move
      hand.grip = this.dead || tilting || (mine && index === this.chosen);
      hand.primary = down("primary") || tilting;
      hand.trigger = down("trigger") && index === this.rigid;
      hand.stick_pressed = down("stick_pressed") && index === this.rigid;
    });
    for (const name of Object.keys(this.left)) this.left[name] = Math.max(this.left[name] - 1, 0);
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
    const seen = this.inRoom(point).project(this.camera);
    const { clientWidth, clientHeight } = this.canvas;
    return [((seen.x + 1) / 2) * clientWidth, ((1 - seen.y) / 2) * clientHeight];
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
