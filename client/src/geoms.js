// Triangles of the model's geoms, merged into one geometry whose vertices each belong to a body.

import {
  BoxGeometry, BufferAttribute, BufferGeometry, CapsuleGeometry, Color, CylinderGeometry, Matrix4, PlaneGeometry,
  Quaternion, SphereGeometry, Vector3,
} from "three";
import { mergeGeometries, toCreasedNormals } from "three/addons/utils/BufferGeometryUtils.js";

const SIDES = 24; // of what is round
const CREASE = (40 * Math.PI) / 180; // faces that meet at less are shaded as one surface
const UPRIGHT = new Matrix4().makeRotationX(Math.PI / 2); // three's cylinders stand along y, MuJoCo's along z

const SHAPES = {
  plane: ([x, y]) => (x > 0 && y > 0 ? new PlaneGeometry(2 * x, 2 * y) : null), // one without end is not drawn
  sphere: ([radius]) => new SphereGeometry(radius, SIDES, SIDES / 2),
  ellipsoid: (size) => new SphereGeometry(1, SIDES, SIDES / 2).scale(...size),
  capsule: ([radius, half]) => new CapsuleGeometry(radius, 2 * half, SIDES / 4, SIDES).applyMatrix4(UPRIGHT),
  cylinder: ([radius, half]) => new CylinderGeometry(radius, radius, 2 * half, SIDES).applyMatrix4(UPRIGHT),
  box: ([x, y, z]) => new BoxGeometry(2 * x, 2 * y, 2 * z),
};

/** A mesh as JSON has it, shaded with creases. */
export function meshGeometry({ vertices, faces }) {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(vertices), 3));
  geometry.setIndex(faces);
  return toCreasedNormals(geometry, CREASE);
}

/** `{body, shape, size, position, quaternion, rgba, mesh}` merged; null where nothing is drawn. */
export function mergedGeoms(geoms, meshes) {
  const shaded = new Map();
  const parts = [];
  for (const { body, shape, size, position, quaternion, rgba, mesh } of geoms) {
    if (shape === "mesh" && !shaded.has(mesh)) shaded.set(mesh, meshGeometry(meshes[mesh]));
    const geometry = shape === "mesh" ? shaded.get(mesh).clone() : SHAPES[shape]?.(size)?.toNonIndexed();
    if (!geometry) continue;
    geometry.applyMatrix4(matrixOf(position, quaternion));
    geometry.deleteAttribute("uv");
    parts.push(painted(geometry, body, rgba));
  }
  return parts.length ? mergeGeometries(parts) : null;
}

/** The matrix of a pose; quaternions are (w, x, y, z) in JSON and on the wire. */
export function matrixOf(position, [w, x, y, z]) {
  return new Matrix4().compose(new Vector3(...position), new Quaternion(x, y, z, w), new Vector3(1, 1, 1));
}

/** With each vertex's colour, and its body as the one bone that moves it. */
function painted(geometry, body, [red, green, blue]) {
  const count = geometry.attributes.position.count;
  const colour = new Color().setRGB(red, green, blue, "srgb");
  const colours = new Float32Array(3 * count), bodies = new Uint16Array(4 * count), weights = new Float32Array(4 * count);
  for (let i = 0; i < count; i++) {
    colours.set([colour.r, colour.g, colour.b], 3 * i);
    bodies[4 * i] = Math.max(body, 0);
    weights[4 * i] = 1;
  }
  geometry.setAttribute("color", new BufferAttribute(colours, 3));
  geometry.setAttribute("skinIndex", new BufferAttribute(bodies, 4));
  geometry.setAttribute("skinWeight", new BufferAttribute(weights, 4));
  return geometry;
}
