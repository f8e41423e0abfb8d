// Where the robot is looked at from: front, side, top, and all of it in what the panels leave free of the window.

import { Box3, MathUtils, Sphere, Vector3 } from "three";

const UPRIGHT = 45; // degrees of view, of the shorter side of what is free
const WIDEST = 95; // degrees, of the window's height
const LARGE = { width: 900, height: 480 }; // pixels of a window whose panels stand at its corners
const LEAST = 120; // pixels
const MARGIN = 1.5; // of the distance from which all is just seen: a preview covers the foot of the window
/** From the robot, in the room, where the base's x is x, and its z is up. */
const FROM = { front: [1, 0.12, 0], side: [0, 0.12, 1], top: [0.001, 1, 0] };

/** Turns the camera about all `points` of the room, which then fill the free area; "fit" keeps the direction. */
export function look(camera, orbit, view, points) {
  const ahead = FROM[view] ? new Vector3(...FROM[view]).normalize() : new Vector3().subVectors(camera.position, orbit.target).normalize();
  const all = new Box3().setFromPoints(points).getBoundingSphere(new Sphere());
  orbit.target.copy(all.center);
  camera.position.copy(all.center).addScaledVector(ahead, (MARGIN * all.radius) / Math.sin(MathUtils.degToRad(UPRIGHT / 2)));
  orbit.update();
  camera.updateMatrixWorld();
}

/** What the state's panel and the actions' leave of a small window of `width` by `height`; of a large one, all. */
export function freeArea(width, height, state, acts) {
  if (width >= LARGE.width && height >= LARGE.height) return { left: 0, top: 0, width, height };
  const beside = width > 1.2 * height;
  const [left, top] = beside ? [state.right, 0] : [0, state.bottom];
  return { left, top, width: Math.max(width - left, LEAST), height: Math.max(acts.top - top, LEAST) };
}

/** The camera for a window: what it looks at is in the middle of its `free` area, whose shorter side it views by UPRIGHT. */
export function shape(camera, width, height, free) {
  const half = Math.tan(MathUtils.degToRad(UPRIGHT / 2)) * (height / Math.min(free.width, free.height));
  camera.aspect = width / height;
  camera.fov = Math.min(2 * MathUtils.radToDeg(Math.atan(half)), WIDEST);
  camera.setViewOffset(width, height, width / 2 - free.left - free.width / 2, height / 2 - free.top - free.height / 2, width, height);
  camera.updateProjectionMatrix();
}
