// Three arrows at the chosen target along the base's axes: dragged, they move it along one of them.

import { CylinderGeometry, ConeGeometry, Group, Mesh, MeshBasicMaterial, Ray, Vector3 } from "three";
import { mergeGeometries } from "three/addons/utils/BufferGeometryUtils.js";

const AXES = [new Vector3(1, 0, 0), new Vector3(0, 1, 0), new Vector3(0, 0, 1)];
const COLOURS = [0xe8705a, 0x7ccf6a, 0x6aa9f0]; // x, y, z, as usual for such handles; their direction distinguishes them as well
const FROM = 0.06, LONG = 0.13; // m at 1 m from the eye, of an arrow that begins beside the target's ring
const LARGEST = 2.5, SMALLEST = 0.5;

export class Handles {
  constructor(base) {
    const shaft = new CylinderGeometry(0.0025, 0.0025, LONG - FROM, 6).translate(0, (LONG + FROM) / 2, 0);
    const arrow = mergeGeometries([shaft, new ConeGeometry(0.008, 0.024, 12).translate(0, LONG, 0)]);
    this.group = new Group();
    this.arrows = AXES.map((axis, index) => {
      const drawn = { color: COLOURS[index], transparent: true, depthTest: false, depthWrite: false };
      const mesh = new Mesh(arrow, new MeshBasicMaterial(drawn));
      mesh.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), axis);
      mesh.renderOrder = 6;
      return mesh;
    });
    this.group.add(...this.arrows);
    this.group.visible = false;
    base.add(this.group);
  }

  /** At `point` of the base frame, as large wherever `eye` is; null hides them. */
  place(point, eye, fov = 45) {
    this.group.visible = point !== null;
    if (!point) return;
    this.group.position.copy(point);
    const away = this.group.getWorldPosition(new Vector3()).distanceTo(eye) * Math.tan((fov * Math.PI) / 360) / 0.414;
    this.group.scale.setScalar(Math.min(Math.max(away / 2, SMALLEST), LARGEST));
  }

  /** The axis whose arrow is within `pixels` of a point of the screen, -1 for none. */
  nearest(toScreen, x, y, pixels) {
    if (!this.group.visible) return -1;
    const at = (axis, length) => toScreen(this.group.position.clone().addScaledVector(axis, length * this.group.scale.x));
    let best = -1, least = pixels;
    AXES.forEach((axis, index) => {
      const [from, to] = [at(axis, FROM), at(axis, LONG + 0.012)];
      const [dx, dy] = [to[0] - from[0], to[1] - from[1]], long = dx * dx + dy * dy;
      if (long < 100) return; // it points at the viewer: how far it is dragged is undefined
      const share = Math.min(Math.max(((x - from[0]) * dx + (y - from[1]) * dy) / long, 0), 1);
      const away = Math.hypot(x - from[0] - share * dx, y - from[1] - share * dy);
      if (away < least) [best, least] = [index, away];
    });
    return best;
  }
}

/** Where on the line through `point` along `axis` the line of `ray` comes nearest; all in one frame. */
export function onAxis(ray, point, axis) {
  const between = new Vector3().subVectors(point, ray.origin), along = axis.dot(ray.direction);
  const share = 1 - along * along;
  if (share < 1e-3) return null; // end on: along the line of sight
  const offset = (along * between.dot(ray.direction) - between.dot(axis)) / share;
  return point.clone().addScaledVector(axis, offset);
}

export const axisOf = (index) => AXES[index];

/** The nearest of the `objects` that `ray` meets, both in the base frame, or comes within `margin` m of; null for none. */
export function objectAt(ray, objects, toLocal, margin) {
  let best = null, least = Infinity;
  for (const object of objects) {
    const inverse = toLocal(object);
    const local = new Ray(ray.origin.clone().applyMatrix4(inverse), ray.direction.clone().transformDirection(inverse));
    const half = new Vector3(object.diameter / 2, object.diameter / 2, (object.shape === "sphere" ? object.diameter : object.height) / 2).addScalar(margin);
    const distance = meets(local, half);
    if (distance !== null && distance < least) [best, least] = [object, distance];
  }
  return best;
}

/** How far along a ray, m, it enters the box of these half sizes about the origin; null where it misses. */
function meets({ origin, direction }, half) {
  let from = 0, to = Infinity;
  for (const axis of ["x", "y", "z"]) {
    const [low, high] = [-1, 1].map((side) => (side * half[axis] - origin[axis]) / direction[axis]);
    if (!Number.isFinite(low) && Math.abs(origin[axis]) > half[axis]) return null;
    if (!Number.isFinite(low)) continue;
    [from, to] = [Math.max(from, Math.min(low, high)), Math.min(to, Math.max(low, high))];
  }
  return from <= to ? from : null;
}
