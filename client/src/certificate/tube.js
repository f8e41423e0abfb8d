// An arm as one tube through its points, thinner towards the tip, coloured along its length.

import { BufferAttribute, BufferGeometry, CatmullRomCurve3, Mesh, Vector3 } from "three";

const GAMMA = 2.2; // from a colour of the screen to one of light


export class Tube extends Mesh {
  /** Of `along` rings of `around` points each. */
  constructor(material, along = 72, around = 14) {
    const geometry = new BufferGeometry(), count = around * (along + 1);
    for (const name of ["position", "normal", "color"]) geometry.setAttribute(name, new BufferAttribute(new Float32Array(3 * count), 3));
    const faces = [];
    for (let row = 0; row < along; row++) {
      for (let k = 0; k < around; k++) {
        const a = row * around + k, b = row * around + ((k + 1) % around);
        faces.push(a, b, a + around, b, b + around, a + around);
      }
    }
    geometry.setIndex(faces);
    super(geometry, material);
    this.frustumCulled = false;
    Object.assign(this, { along, around });
  }

  /** Through `points` (flat, m), `radii` (m) and `colours` (rgb) of each. */
  follow(points, radii, colours) {
    const { along, around } = this;
    const places = radii.map((_, i) => new Vector3(...points.slice(3 * i, 3 * i + 3)));
    const curve = new CatmullRomCurve3(places, false, "centripetal");
    const { position, normal, color } = this.geometry.attributes;
    const tangent = new Vector3(), side = new Vector3(), binormal = new Vector3(), outward = new Vector3();
    for (let row = 0; row <= along; row++) {
      const at = row / along, low = Math.min(Math.floor(at * (radii.length - 1)), radii.length - 2), share = at * (radii.length - 1) - low;
      const mixed = (from, to) => from + share * (to - from);
      const place = curve.getPoint(at), radius = mixed(radii[low], radii[low + 1]);
      curve.getTangent(at, tangent);
      if (row === 0) side.set(1, 0, 0).addScaledVector(tangent, -tangent.x).normalize();
      else side.addScaledVector(tangent, -side.dot(tangent)).normalize();
      binormal.crossVectors(tangent, side);
      for (let k = 0; k < around; k++) {
        const angle = (2 * Math.PI * k) / around, index = row * around + k;
        outward.set(0, 0, 0).addScaledVector(side, Math.cos(angle)).addScaledVector(binormal, Math.sin(angle));
        normal.setXYZ(index, outward.x, outward.y, outward.z);
        position.setXYZ(index, place.x + radius * outward.x, place.y + radius * outward.y, place.z + radius * outward.z);
        color.setXYZ(index, ...colours[low].map((value, c) => mixed(value, colours[low + 1][c]) ** GAMMA));
      }
    }
    for (const attribute of [position, normal, color]) attribute.needsUpdate = true;
  }
}
