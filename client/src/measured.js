// The arm as cameras see it: its markers, a line through them, and how far the tips are apart; the bounds of a correction.

import { BufferGeometry, Float32BufferAttribute, Group, Line, LineBasicMaterial, Mesh, MeshBasicMaterial, SphereGeometry } from "three";
import { OFFER, TIP, WRONG } from "./colours.js";
import { Label } from "./label.js";

const MEASURED = 0xffffff; // white, on top of the robot; where a plan has arrived, by whether its preview held
const MOST = 100; // markers
const FAR = 2; // times the radius: with normal scatter, beyond 90 % is one tip in ten, beyond twice that at most one in 1000
const OLD = 0.5; // s without a message, after which nothing is drawn

export class MeasuredArm {
  /** `base`: the group of the robot's frame. */
  constructor(base) {
    const through = { color: MEASURED, depthTest: false, depthWrite: false, transparent: true, opacity: 0.9 };
    this.group = new Group();
    this.stroke = new LineBasicMaterial(through);
    this.line = new Line(new BufferGeometry(), this.stroke);
    this.line.geometry.setAttribute("position", new Float32BufferAttribute(new Float32Array(3 * (MOST + 1)), 3));
    this.line.frustumCulled = false;
    this.line.renderOrder = 7;
    this.material = new MeshBasicMaterial(through);
    this.dot = new SphereGeometry(0.006, 12, 8);
    this.dots = [];
    this.label = new Label(MEASURED);
    this.group.add(this.line, this.label.sprite);
    const glass = { color: TIP, transparent: true, opacity: 0.3, depthWrite: false };
    this.bounds = new Mesh(new SphereGeometry(1, 32, 20), new MeshBasicMaterial(glass));
    this.bounds.renderOrder = 4;
    this.bounds.visible = this.group.visible = false;
    base.add(this.group, this.bounds);
    [this.shown, this.message, this.at] = [true, null, 0];
  }

  /** A message `measured` that came at `now`, s. */
  receive(message, now) {
    [this.message, this.at] = [message, now];
    const points = [...message.markers.slice(0, MOST), message.tip].filter(Boolean), { position } = this.line.geometry.attributes;
    points.forEach((point, index) => position.set(point, 3 * index));
    position.needsUpdate = true;
    this.line.geometry.setDrawRange(0, points.length);
    while (this.dots.length < points.length) {
      const dot = new Mesh(this.dot, this.material);
      dot.renderOrder = 7;
      this.dots.push(dot);
      this.group.add(dot);
    }
    this.dots.forEach((dot, index) => {
      dot.visible = index < points.length;
      if (dot.visible) dot.position.fromArray(points[index]);
    });
    const { tip, apart } = message;
    const colour = colourOf(message);
    for (const material of [this.material, this.stroke]) material.color.set(colour);
    this.label.set(tip && apart !== null ? `${(1000 * apart).toFixed(1)} mm` : "", colour);
    if (tip) this.label.sprite.position.fromArray(tip);
    this.label.sprite.visible = Boolean(tip) && apart !== null;
  }

  /** At `now`, s: what is old is not drawn. */
  update(now) {
    if (this.message && now - this.at > OLD) this.message = null;
    this.group.visible = this.shown && Boolean(this.message) && !this.message.fault;
  }

  /** Where a correction keeps the tip, as the message `preview` has it; null for nowhere. */
  bound(correction) {
    this.bounds.visible = Boolean(correction);
    if (!correction) return;
    this.bounds.position.fromArray(correction.target);
    this.bounds.scale.setScalar(correction.astray);
  }
}

/** Of the measured arm: by whether its tip is within what the preview stated, where it stated anything. */
export function colourOf({ from_preview: off, radius }) {
  return radius === null ? MEASURED : off <= radius ? OFFER : off <= FAR * radius ? TIP : WRONG;
}

/** What cameras see, in words; "" without any. */
export function camerasText(message) {
  if (!message) return "";
  if (message.fault) return `not relied on: ${message.fault}`;
  const visible = message.markers.filter(Boolean).length;
  const apart = message.apart === null ? "tip not seen" : `tip ${(1000 * message.apart).toFixed(1)} mm from the twin’s`;
  const bodies = `${visible} of ${message.markers.length} bodies, ${Math.round(message.rate)} Hz`;
  return `${bodies}; ${apart}${heldText(message)}${message.frame && `; ${message.frame}`}`;
}

/** Whether the tip is where the preview of the plan that ran last stated it, in words; "" where it stated nothing. */
function heldText({ from_preview: off, radius }) {
  if (radius === null) return "";
  const mm = (metres) => (1000 * metres).toFixed(1);
  return `, ${mm(off)} mm from its preview’s end, ${off <= radius ? "within" : off <= FAR * radius ? "beyond" : "far beyond"} the ${mm(radius)} mm stated`;
}

/** By how much a plan may correct itself, as the message `preview` says, and whether `cameras` are relied on as yet; why
 * not, where it was asked to; else "". */
export function correctionText(preview, cameras) {
  if (!preview) return "";
  const { correction, uncorrected } = preview, mm = (metres) => `${+(1000 * metres).toFixed(1)} mm`;
  if (!correction) return uncorrected ? `It will not correct itself: ${uncorrected}.` : "";
  const { steps, longest, astray } = correction;
  return `You confirm as well that it corrects itself by the cameras once it has arrived, while the grip is held: by ${steps} steps at most, each of up to ${mm(longest)} of cable, ${mm(steps * longest)} in all, the tip within ${mm(astray)} of its target.${cameras?.fault ? " Cameras are not relied on now: as long as that is so, it will not." : ""}`;
}
