// A robot that is drawn: a skinned mesh, a bone a body. One of few faces, for pages without a graphics card, is moved by
// this script: skinning by software takes longer than the rest of its picture.

import { Bone, BufferGeometry, DynamicDrawUsage, Group, Mesh, MeshBasicMaterial, Quaternion, Skeleton, SkinnedMesh, Vector3 } from "three";
import { STRIDE } from "./wire.js";

const UNIT_SCALE = new Vector3(1, 1, 1);
const place = new Vector3(), turn = new Quaternion(), vector = new Vector3();

export class Robot extends Group {
  /** `order`: its place among what is drawn. A `veiled` robot hides its own far side: one that is looked through. */
  constructor(geometry, material, bodies, order, veiled = false) {
    super();
    this.bones = Array.from({ length: bodies }, () => new Bone());
    for (const bone of this.bones) bone.matrixAutoUpdate = bone.matrixWorldAutoUpdate = false;
    const skeleton = new Skeleton(this.bones);
    this.skinnedMeshes = [skinned(geometry, material, skeleton, order)];
    if (veiled) this.skinnedMeshes.push(skinned(geometry, new MeshBasicMaterial({ colorWrite: false }), skeleton, order - 1)); // first its depth alone
    this.add(...this.skinnedMeshes);
    Object.assign(this, { material, order, coarseMesh: null, isMoved: false, visible: false });
  }

  /** To the poses from number `start` of `rows` on. */
  pose(rows, start = 0) {
    this.bones.forEach((bone, index) => {
      const at = start + index * STRIDE;
      place.fromArray(rows, at);
      turn.set(rows[at + 4], rows[at + 5], rows[at + 6], rows[at + 3]);
      if (Number.isFinite(place.x)) bone.matrixWorld.compose(place, turn, UNIT_SCALE);
      else bone.matrixWorld.makeScale(0, 0, 0); // a body without a pose
    });
    this.isMoved = true;
  }

  /** Before each picture: drawn with the few faces of `shape`, or, where that is null, as it is. */
  drawWith(shape) {
    if (shape && this.coarseMesh?.shape !== shape) this.coarseMesh = coarseMeshOf(shape, this.material, this.order);
    if (shape && (this.isMoved || !this.coarseMesh.parent)) moveVertices(this.coarseMesh, this.bones);
    this.isMoved = false;
    if (shape && !this.coarseMesh.parent) this.remove(...this.skinnedMeshes).add(this.coarseMesh);
    else if (!shape && this.coarseMesh?.parent) this.remove(this.coarseMesh).add(...this.skinnedMeshes);
  }
}

/** A mesh whose bones are in the frame of its parent, not in the room's: `detached`, bound by the identity. */
function skinned(geometry, material, skeleton, order) {
  const mesh = new SkinnedMesh(geometry, material);
  mesh.bindMode = "detached";
  mesh.bind(skeleton, mesh.matrix.clone());
  return asRobot(mesh, order);
}

function asRobot(mesh, order) {
  mesh.renderOrder = order;
  mesh.frustumCulled = false; // its bounds are those of the bodies' own frames
  return mesh;
}

/** Of the same colours as `shape`, whose vertices are in the frames of their bodies. */
function coarseMeshOf(shape, material, order) {
  const geometry = new BufferGeometry().setIndex(shape.index).setAttribute("color", shape.attributes.color);
  for (const name of ["position", "normal"]) geometry.setAttribute(name, shape.attributes[name].clone().setUsage(DynamicDrawUsage));
  return Object.assign(asRobot(new Mesh(geometry, material), order), { shape });
}

function moveVertices({ geometry, shape }, bones) {
  const { position, normal } = geometry.attributes, rest = shape.attributes;
  for (let i = 0; i < position.count; i++) {
    const { matrixWorld } = bones[rest.skinIndex.getX(i)];
    vector.fromBufferAttribute(rest.position, i).applyMatrix4(matrixWorld).toArray(position.array, 3 * i);
    vector.fromBufferAttribute(rest.normal, i).transformDirection(matrixWorld).toArray(normal.array, 3 * i);
  }
  position.needsUpdate = normal.needsUpdate = true;
}
