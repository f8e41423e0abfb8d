// Rays with their length, targets, and what is offered: each with a colour, a shape and a word of its own.

import {
  BoxGeometry, BufferGeometry, CylinderGeometry, EdgesGeometry, Float32BufferAttribute, Group, LineBasicMaterial,
  LineSegments, Mesh, MeshBasicMaterial, RingGeometry, SphereGeometry, TorusGeometry, Vector3,
} from "three";
import { HANDS, MARKERS } from "./wire_table.js";
import { MOUNT, OFFER, TIP, WRONG } from "./colours.js";
import { Label } from "./label.js";
import { STRIDE } from "./wire.js";

const UP = new Vector3(0, 1, 0);
const RAY_RADIUS = 0.0025; // m
const MARK = { rigid_target: MOUNT, tip_target: TIP };

export class Marks {
  /** `base`: the group of the robot's frame. `rigidHand`: whose ray holds the mount's target. */
  constructor(base, rigidHand = "left") {
    this.colours = HANDS.map((side) => (side === rigidHand ? MOUNT : TIP));
    this.names = HANDS.map((side) => (side === rigidHand ? "mount" : "tip"));
    this.rays = this.colours.map((colour) => new Ray(colour));
    this.targets = { rigid: new Target(MOUNT, new BoxGeometry(0.045, 0.045, 0.045)), tip: new Target(TIP, new SphereGeometry(0.022, 20, 14)) };
    for (const ray of this.rays) base.add(ray.group);
    for (const target of Object.values(this.targets)) base.add(target.group);
    this.ends = HANDS.map(() => new Vector3(NaN, NaN, NaN));
  }

  /** `rows` of a frame, the markers' from row `first` on; `starts` of both rays in the base frame, null where not tracked. */
  update(rows, first, starts, targets) {
    const at = (name) => (first + MARKERS.indexOf(name)) * STRIDE;
    HANDS.forEach((side, index) => {
      this.ends[index].fromArray(rows, at(`${side}_ray`));
      this.rays[index].update(starts[index], this.ends[index]);
    });
    for (const kind of ["rigid", "tip"]) {
      const end = this.ends[this.names.indexOf(kind === "rigid" ? "mount" : "tip")];
      this.targets[kind].update(rows, at(`${kind}_target`), targets?.[kind] ?? null, end, kind === "tip" ? (targets?.thing ?? "") : "");
    }
  }

  hide() {
    for (const ray of this.rays) ray.group.visible = false;
    for (const target of Object.values(this.targets)) target.group.visible = false;
  }

  /** Which hand's ray end or target is nearest to a point of the screen, within `pixels`; -1 for none. */
  nearest(toScreen, x, y, pixels) {
    const positions = [this.targets.rigid, this.targets.tip].map(({ group }) => (group.visible ? group.position : null));
    let best = -1, least = pixels;
    HANDS.forEach((_, index) => {
      const target = positions[this.names[index] === "mount" ? 0 : 1];
      for (const point of [this.ends[index], target]) {
        if (!point || !Number.isFinite(point.x)) continue;
        const [u, v] = toScreen(point);
        const away = Math.hypot(u - x, v - y);
        if (away < least) [best, least] = [index, away];
      }
    });
    return best;
  }
}

class Ray {
  constructor(colour) {
    this.group = new Group();
    this.line = new Mesh(new CylinderGeometry(RAY_RADIUS, RAY_RADIUS, 1, 8), new MeshBasicMaterial({ color: colour }));
    this.end = new Mesh(new SphereGeometry(0.008, 12, 8), this.line.material);
    this.label = new Label(colour);
    this.group.add(this.line, this.end, this.label.sprite);
    this.group.visible = false;
  }

  update(start, end) {
    this.group.visible = Boolean(start) && Number.isFinite(end.x);
    if (!this.group.visible) return;
    const along = new Vector3().subVectors(end, start), length = along.length();
    this.line.position.addVectors(start, end).multiplyScalar(0.5);
    this.line.scale.set(1, Math.max(length, 1e-4), 1);
    this.line.quaternion.setFromUnitVectors(UP, along.divideScalar(length || 1));
    this.end.position.copy(end);
    this.label.sprite.position.lerpVectors(start, end, 0.55);
    this.label.set(`${length.toFixed(2)} m`);
  }
}

/** A target: a frame about a solid, a ring where it is out of reach, and a line to the point that is offered. */
class Target {
  constructor(colour, shape) {
    this.group = new Group();
    this.solid = new Mesh(shape, new MeshBasicMaterial({ color: colour, transparent: true, opacity: 0.75 }));
    // Visible through the robot, in which a target begins: a ring, and the solid once more, faintly.
    const through = { color: colour, transparent: true, depthTest: false, depthWrite: false };
    this.faint = new Mesh(shape, new MeshBasicMaterial({ ...through, opacity: 0.35 }));
    this.halo = new Mesh(new RingGeometry(0.04, 0.045, 40), new MeshBasicMaterial({ ...through, opacity: 0.9 }));
    this.faint.renderOrder = this.halo.renderOrder = 5;
    this.edges = new LineSegments(new EdgesGeometry(shape, 30), new LineBasicMaterial({ color: 0xffffff }));
    this.ring = new Mesh(new TorusGeometry(0.05, 0.006, 8, 32), new MeshBasicMaterial({ color: WRONG }));
    this.cross = [1, -1].map((way) => {
      const bar = new Mesh(new BoxGeometry(0.1, 0.009, 0.009), this.ring.material);
      bar.rotation.z = (way * Math.PI) / 4;
      this.ring.add(bar);
      return bar;
    });
    this.label = new Label(colour);
    this.offer = new Mesh(new TorusGeometry(0.028, 0.005, 8, 28), new MeshBasicMaterial({ color: OFFER }));
    this.way = new LineSegments(new BufferGeometry(), new LineBasicMaterial({ color: OFFER }));
    this.way.geometry.setAttribute("position", new Float32BufferAttribute(new Float32Array(6), 3));
    this.way.frustumCulled = false;
    this.group.add(this.solid, this.faint, this.halo, this.edges, this.ring, this.label.sprite, this.offer, this.way);
    this.label.sprite.position.set(0.04, 0, 0.035);
    this.colour = colour;
    this.group.visible = false;
  }

  /** Before a target is set, its outline through the robot is at the `end` of its ray. `object`: name of what it marks. */
  update(rows, at, target, end, object) {
    const isSet = Number.isFinite(rows[at]);
    this.group.visible = isSet || Number.isFinite(end.x);
    if (!this.group.visible) return;
    this.solid.visible = this.edges.visible = isSet;
    if (isSet) this.group.position.fromArray(rows, at);
    else this.group.position.copy(end);
    const outside = target?.reach === "outside", blocked = target?.reach === "blocked";
    this.ring.visible = outside || blocked;
    this.label.set(reachText(target) || object, outside || blocked ? 0xffb08a : 0xffffff);
    const offer = target?.offer ?? null;
    this.offer.visible = this.way.visible = Boolean(offer);
    if (offer) {
      this.offer.position.fromArray(offer).sub(this.group.position);
      const ends = this.way.geometry.attributes.position;
      this.offer.position.toArray(ends.array, 3);
      ends.needsUpdate = true;
    }
  }

  /** Rings face the viewer, who is at `eye` in the room. */
  face(eye) {
    this.ring.lookAt(eye);
    this.halo.lookAt(eye);
    this.offer.lookAt(eye);
  }
}

function reachText(target) {
  if (!target) return "";
  if (target.reach === "outside") return `${Math.round(1000 * target.outside_by)} mm out of reach`;
  if (target.reach === "blocked") return `inside ${target.solid}`;
  return target.reach === "unknown" ? "reach unknown" : "";
}
