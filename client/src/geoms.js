// Triangles of the model's geoms, merged into one geometry whose vertices each belong to a body.

import {
  Box3, BoxGeometry, BufferAttribute, BufferGeometry, CapsuleGeometry, Color, CylinderGeometry, Matrix4, PlaneGeometry,
  Quaternion, SphereGeometry, Vector3,
} from "three";
import { mergeGeometries, mergeVertices, toCreasedNormals } from "three/addons/utils/BufferGeometryUtils.js";

const SIDES = 24, FEW = 12; // of what is round, and where it is drawn with few faces
const CREASE = (40 * Math.PI) / 180; // faces that meet at less are shaded as one surface
const SAME = 1e-5; // m between vertices that are drawn as one, and of their normals
const UPRIGHT = new Matrix4().makeRotationX(Math.PI / 2); // three's cylinders stand along y, MuJoCo's along z

const SHAPES = {
  plane: ([x, y]) => (x > 0 && y > 0 ? new PlaneGeometry(2 * x, 2 * y) : null), // one without end is not drawn
  sphere: ([radius], sides) => new SphereGeometry(radius, sides, sides / 2),
  ellipsoid: (size, sides) => new SphereGeometry(1, sides, sides / 2).scale(...size),
  capsule: ([radius, half], sides) => new CapsuleGeometry(radius, 2 * half, sides / 4, sides).applyMatrix4(UPRIGHT),
  cylinder: ([radius, half], sides) => new CylinderGeometry(radius, radius, 2 * half, sides).applyMatrix4(UPRIGHT),
  box: ([x, y, z]) => new BoxGeometry(2 * x, 2 * y, 2 * z),
};

/** A mesh with the first vertex in each cube of `cell` m, of a small mesh a quarter of it, in place of all others there: a few
 * of its faces, which are drawn sooner (Rossignac and Borrel 1993). */
export function clustered({ vertices, faces }, cell) {
  const firsts = new Map(), corners = [], axes = [0, 1, 2];
  const { x, y, z } = new Box3().setFromArray(vertices).getSize(new Vector3());
  const side = Math.min(cell, Math.max(x, y, z) / 4);
  const first = (vertex) => {
    const key = axes.map((axis) => Math.floor(vertices[3 * vertex + axis] / side)).join();
    if (!firsts.has(key)) firsts.set(key, vertex);
    return firsts.get(key);
  };
  for (let face = 0; face < faces.length; face += 3) {
    const [a, b, c] = faces.slice(face, face + 3).map(first);
    if (a !== b && b !== c && c !== a) corners.push(a, b, c);
  }
  return { vertices, faces: corners };
}

/** A mesh as JSON has it, shaded with creases. */
export function meshGeometry({ vertices, faces }) {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(vertices), 3));
  geometry.setIndex(faces);
  return mergeVertices(toCreasedNormals(geometry, CREASE), SAME); // a vertex is moved and lit once, not for each of its faces
}

/** `{body, shape, size, position, quaternion, rgba, mesh}` merged; null where nothing is drawn. cell: m, of meshes that are
 * drawn with few faces; 0 leaves them as they are. */
export function mergedGeoms(geoms, meshes, cell = 0) {
  const shaded = new Map();
  const parts = [];
  for (const { body, shape, size, position, quaternion, rgba, mesh } of geoms) {
    if (shape === "mesh" && !shaded.has(mesh)) shaded.set(mesh, meshGeometry(cell ? clustered(meshes[mesh], cell) : meshes[mesh]));
    const geometry = shape === "mesh" ? shaded.get(mesh).clone() : SHAPES[shape]?.(size, cell ? FEW : SIDES);
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
