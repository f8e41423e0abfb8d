// An arm as one tube through its points, thinner towards the tip, coloured along its length.

import { BufferAttribute, BufferGeometry, CatmullRomCurve3, Mesh, Vector3 } from "three";

const AROUND = 14, ALONG = 72;
const GAMMA = 2.2; // from a colour of the screen to one of light


export class Tube extends Mesh {
  constructor(material) {
    const geometry = new BufferGeometry(), count = AROUND * (ALONG + 1);
    for (const name of ["position", "normal", "color"]) geometry.setAttribute(name, new BufferAttribute(new Float32Array(3 * count), 3));
    const faces = [];
    for (let row = 0; row < ALONG; row++) {
      for (let k = 0; k < AROUND; k++) {
        const a = row * AROUND + k, b = row * AROUND + ((k + 1) % AROUND);
        faces.push(a, b, a + AROUND, b, b + AROUND, a + AROUND);
      }
    }
    geometry.setIndex(faces);
    super(geometry, material);
    this.frustumCulled = false;
  }

  /** Through `points` (flat, m), `radii` (m) and `colours` (rgb) of each. */
  follow(points, radii, colours) {
    const places = radii.map((_, i) => new Vector3(...points.slice(3 * i, 3 * i + 3)));
    const curve = new CatmullRomCurve3(places, false, "centripetal");
    const { position, normal, color } = this.geometry.attributes;
    const tangent = new Vector3(), side = new Vector3(), other = new Vector3(), way = new Vector3();
    for (let row = 0; row <= ALONG; row++) {
      const at = row / ALONG, low = Math.min(Math.floor(at * (radii.length - 1)), radii.length - 2), share = at * (radii.length - 1) - low;
      const mixed = (from, to) => from + share * (to - from);
      const place = curve.getPoint(at), radius = mixed(radii[low], radii[low + 1]);
      curve.getTangent(at, tangent);
      if (row === 0) side.set(1, 0, 0).addScaledVector(tangent, -tangent.x).normalize();
      else side.addScaledVector(tangent, -side.dot(tangent)).normalize();
      other.crossVectors(tangent, side);
      for (let k = 0; k < AROUND; k++) {
        const angle = (2 * Math.PI * k) / AROUND, index = row * AROUND + k;
        way.set(0, 0, 0).addScaledVector(side, Math.cos(angle)).addScaledVector(other, Math.sin(angle));
        normal.setXYZ(index, way.x, way.y, way.z);
        position.setXYZ(index, place.x + radius * way.x, place.y + radius * way.y, place.z + radius * way.z);
        color.setXYZ(index, ...colours[low].map((value, c) => mixed(value, colours[low + 1][c]) ** GAMMA));
      }
    }
    for (const attribute of [position, normal, color]) attribute.needsUpdate = true;
  }
}
