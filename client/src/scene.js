// What is drawn in the robot's base frame: robot, ghost, world, reach. A robot is one skinned mesh, a bone a body.

import {
  Bone, BufferAttribute, BufferGeometry, Color, DoubleSide, GridHelper, Group, HemisphereLight, DirectionalLight, Mesh,
  MeshBasicMaterial, MeshLambertMaterial, Scene, Skeleton, SkinnedMesh, Line, LineBasicMaterial, CatmullRomCurve3,
  TubeGeometry, Vector3, Quaternion, FrontSide,
} from "three";
import { GHOST, MOUNT, REACH, TIP } from "./colours.js";
import { mergedGeoms } from "./geoms.js";
import { STRIDE } from "./wire.js";

const UNIT_SCALE = new Vector3(1, 1, 1);
const CELL = 0.035; // m, of meshes that are drawn with few faces
const WIDEST = 4; // m, of an obstacle that is drawn; the floor is wider
const OBJECT = "object"; // the body of the object, where the model has one
const FADED = 0.35; // of a live robot without new poses
const SQUARE = 0.25, SQUARES = 16; // m of a square of the floor, and how many; index.html has the width as text
const GRID = { dark: [0x4a5663, 0x343e49], light: [0x8b98a5, 0xb9c3cc] };
const STAND = { at: [-0.04, 0], half: 0.11, gap: 0.03 }; // m, beneath a base that stands higher than `gap` above the floor
const STRING = { long: 0.15, radius: 0.0015, hook: 0.006 }; // m, of what hangs
const METAL = [0.45, 0.48, 0.52, 1], THREAD = [0.8, 0.8, 0.78, 1];
const WOOD = [0.55, 0.47, 0.38, 1], GRASPABLE = [0.35, 0.7, 0.9, 1];

export class RobotScene {
  constructor() {
    this.scene = new Scene();
    this.base = new Group(); // all of the robot's base frame, z up; an alignment gives its pose in the room
    this.scene.add(this.base, new HemisphereLight(0xffffff, 0x6d747e, 1.35));
    const sun = new DirectionalLight(0xffffff, 1.5);
    sun.position.set(1.5, 3, 2);
    this.scene.add(sun);
    this.ground("dark");
    this.reachShown = true;
    this.isCoarse = false;
  }

  /** The floor's grid for a "dark" or a "light" ground. */
  ground(scheme) {
    const height = this.floor?.position.z ?? 0, visible = this.floor?.visible ?? true;
    this.floor?.removeFromParent();
    this.floor?.dispose();
    this.floor = new GridHelper(SQUARES * SQUARE, SQUARES, ...GRID[scheme]);
    this.floor.rotation.x = Math.PI / 2; // three's lies across y, the base's z is up
    this.floor.position.z = height;
    this.floor.visible = visible;
    this.base.add(this.floor);
  }

  /** The scene as the server has it, anew. */
  load({ bodies, geoms, meshes, shell, reach }) {
    for (const old of [this.live, this.ghost, this.veil, this.still, this.reach, this.tipReach]) old?.removeFromParent();
    this.count = bodies.length;
    this.bodies = bodies;
    const bodily = geoms.filter(({ body }) => body >= 0), moving = mergedGeoms(bodily, meshes);
    this.still = this.reach = this.tipReach = this.shapes = null;
    const still = mergedGeoms(geoms.filter(({ body, size }) => body < 0 && size[0] < WIDEST / 2), meshes); // not the floor
    if (moving) {
      this.live = skinned(moving, new MeshLambertMaterial({ vertexColors: true }), bodies.length);
      const glass = new MeshLambertMaterial({ color: GHOST, emissive: GHOST, emissiveIntensity: 0.4, transparent: true, opacity: 0.6, depthWrite: false });
      this.ghost = skinned(moving, glass, bodies.length);
      // First its depth alone, so that what is behind its own surface does not shine through.
      const depth = new MeshBasicMaterial({ colorWrite: false });
      this.veil = new SkinnedMesh(moving, depth);
      this.veil.bindMode = "detached";
      this.veil.bind(this.ghost.skeleton, this.ghost.bindMatrix);
      this.veil.frustumCulled = false;
      this.shapes = { fine: moving, coarse: null, makeCoarse: () => mergedGeoms(bodily, meshes, CELL) };
      this.isCoarse = false;
      [this.live.renderOrder, this.veil.renderOrder, this.ghost.renderOrder] = [0, 1, 2];
      this.ghost.visible = this.veil.visible = this.live.visible = false;
      this.base.add(this.live, this.veil, this.ghost);
    }
    if (still) this.base.add((this.still = new Mesh(still, new MeshLambertMaterial({ vertexColors: true }))));
    if (reach) this.base.add((this.reach = shellMesh(new Float32Array(reach.vertices), reach.faces, MOUNT, 0.05)));
    if (shell) {
      const { around, along } = shell;
      this.tipReach = shellMesh(new Float32Array(3 * around * along), lattice(around, along), REACH, 0.14);
      this.tipReach.visible = false;
      this.base.add(this.tipReach);
      if (this.shellPoints) this.shell(this.shellPoints);
    }
    this.showReach(this.reachShown);
    if (this.world) this.showWorld(this.world);
  }

  /** Robots with few faces, the preview's without what hides its own far side; or as they are. */
  coarsen(isCoarse) {
    if (isCoarse === this.isCoarse || !this.shapes) return;
    this.isCoarse = isCoarse;
    if (isCoarse) this.shapes.coarse ??= this.shapes.makeCoarse();
    for (const robot of [this.live, this.veil, this.ghost]) robot.geometry = isCoarse ? this.shapes.coarse : this.shapes.fine;
  }

  /** Draws by `draw` what is hidden or not there yet as well: to compile it later would take longer than an input may. */
  everythingOnce(draw) {
    this.pretend(new Float32Array(this.count * STRIDE).fill(NaN));
    this.showPrediction({ tip: [[0, 0, 0], [0, 0, 1e-6]], spread: [0, 0] });
    const hidden = [];
    this.scene.traverse((node) => node.visible || hidden.push(node));
    for (const node of hidden) node.visible = true;
    draw();
    for (const node of hidden) node.visible = false;
    this.pretend(null);
    this.showPrediction(null);
  }

  /** The robot as it is: rows of poses, of which the first are the bodies'. */
  pose(rows) {
    if (!this.live) return;
    setPoses(this.live, rows, 0);
    this.live.visible = true;
  }

  /** Grey where the robot's pose is out of date. */
  fade(stale) {
    if (!this.live || this.faded === stale) return;
    this.faded = stale;
    this.live.material.color = new Color(stale ? FADED : 1, stale ? FADED : 1, stale ? FADED : 1);
  }

  /** The preview's robot by the poses from number `start` of `rows` on; null hides it. */
  pretend(rows, start = 0) {
    if (!this.ghost) return;
    this.ghost.visible = rows !== null;
    this.veil.visible = this.ghost.visible && !this.isCoarse;
    if (rows) setPoses(this.ghost, rows, start);
  }

  /** The tip's reach for gravity as it is at the target: points in the frame of the mount's target. */
  shell(points) {
    this.shellPoints = points; // it may come before the scene
    if (this.tipReach?.geometry.attributes.position.array.length !== points.length) return;
    this.tipReach.geometry.attributes.position.copyArray(points).needsUpdate = true;
    this.tipReach.filled = true;
  }

  /** Where the mount's target is, as a row of a frame; NaN hides what is about it. */
  placeShell(rows, row) {
    if (!this.tipReach) return;
    const at = row * STRIDE;
    const isPlaced = Number.isFinite(rows[at]) && this.tipReach.filled;
    this.tipReach.visible = isPlaced && this.reachShown;
    if (!isPlaced) return;
    this.tipReach.position.fromArray(rows, at);
    this.tipReach.quaternion.set(rows[at + 4], rows[at + 5], rows[at + 6], rows[at + 3]);
  }

  /** All that is to be in view, in the room: bodies as in `rows`, and objects. */
  extent(rows) {
    const bodies = (this.bodies ?? []).map((_, index) => new Vector3().fromArray(rows, index * STRIDE));
    const objects = (this.world?.things ?? []).map(({ position }) => new Vector3(...position));
    return [...bodies, ...objects].filter(({ x }) => Number.isFinite(x)).map((point) => this.base.localToWorld(point));
  }

  showReach(visible) {
    this.reachShown = visible;
    if (this.reach) this.reach.visible = visible;
    if (this.tipReach) this.tipReach.visible = visible && Boolean(this.tipReach.filled);
  }

  /** Obstacles and objects as the server has them, but for those that the model has. */
  showWorld(world) {
    this.world = world;
    this.worldMesh?.removeFromParent();
    this.worldMesh?.geometry.dispose();
    const objects = this.bodies?.includes(OBJECT) ? [] : world.things;
    const wide = ({ low, high }) => high[0] - low[0] > WIDEST;
    this.floor.position.z = Math.min(0, ...world.boxes.map((obstacle) => (wide(obstacle) ? obstacle.high[2] : obstacle.low[2])));
    const obstacles = this.still ? [] : world.boxes.filter((obstacle) => !wide(obstacle));
    const geoms = obstacles.map(({ low, high }) => ({
      body: -1, shape: "box", quaternion: [1, 0, 0, 0], rgba: WOOD,
      position: low.map((x, axis) => (x + high[axis]) / 2), size: low.map((x, axis) => (high[axis] - x) / 2),
    }));
    for (const { shape, diameter, height, position, quaternion } of objects) {
      const [radius, half] = [diameter / 2, height / 2];
      const size = shape === "sphere" ? [radius] : shape === "cylinder" ? [radius, half] : [radius, radius, half];
      const primitive = shape === "sphere" || shape === "cylinder" ? shape : "box";
      geoms.push({ body: -1, shape: primitive, size, position, quaternion, rgba: GRASPABLE });
    }
    geoms.push(...standOf(this.floor.position.z), ...world.things.filter(({ support }) => support === "hanging").flatMap(stringOf));
    const merged = mergedGeoms(geoms, []);
    this.worldMesh = merged && new Mesh(merged, new MeshLambertMaterial({ vertexColors: true }));
    if (this.worldMesh) this.base.add(this.worldMesh);
  }

  /** The tip's path in the preview, and how far the robot's tip may be from it, where that is predicted; null hides both. */
  showPrediction(prediction) {
    for (const old of this.predictionMeshes ?? []) {
      old.removeFromParent();
      old.geometry.dispose();
    }
    this.predictionMeshes = [];
    if (!prediction || prediction.tip.length < 2) return;
    const points = prediction.tip.map((point) => new Vector3(...point));
    const path = new Line(new BufferGeometry().setFromPoints(points), new LineBasicMaterial({ color: TIP }));
    this.predictionMeshes = [path];
    this.base.add(path);
    if (!prediction.spread.length) return;
    const band = new MeshBasicMaterial({ color: TIP, transparent: true, opacity: 0.16, depthWrite: false, side: FrontSide });
    const tube = new Mesh(spreadTube(points, prediction.spread), band);
    tube.renderOrder = 3;
    this.predictionMeshes.push(tube);
    this.base.add(tube);
  }
}

const IDENTITY = [1, 0, 0, 0];

/** What the base stands on, where the floor is `below` it: no obstacle of the model, but else it would float. */
function standOf(below) {
  if (below > -STAND.gap) return [];
  const post = { position: [...STAND.at, below / 2], size: [STAND.half, STAND.half, -below / 2] };
  const foot = { position: [...STAND.at, below + 0.01], size: [2 * STAND.half, 2 * STAND.half, 0.01] };
  return [post, foot].map((geom) => ({ body: -1, shape: "box", quaternion: IDENTITY, rgba: METAL, ...geom }));
}

/** The string by which an object hangs, and its hook. */
function stringOf({ position: [x, y, z], diameter, height, shape, quaternion }) {
  const [w, a, b] = quaternion, upright = Math.abs(1 - 2 * (a * a + b * b) / (w * w + a * a + b * b + quaternion[3] ** 2));
  const top = z + (shape === "sphere" ? diameter : upright * height + (1 - upright) * diameter) / 2, { long, radius, hook } = STRING;
  const thread = { shape: "cylinder", position: [x, y, top + long / 2], size: [radius, long / 2] };
  return [thread, { shape: "sphere", position: [x, y, top + long], size: [hook] }].map((geom) => ({ body: -1, quaternion: IDENTITY, rgba: THREAD, ...geom }));
}

/** A mesh whose bones are in the frame of its parent, not in the room's: `detached`, bound by the identity. */
function skinned(geometry, material, count) {
  const mesh = new SkinnedMesh(geometry, material);
  const bones = Array.from({ length: count }, () => new Bone());
  for (const bone of bones) bone.matrixAutoUpdate = bone.matrixWorldAutoUpdate = false;
  mesh.bindMode = "detached";
  mesh.bind(new Skeleton(bones), mesh.matrix.clone());
  mesh.frustumCulled = false; // its bounds are those of the bodies' own frames
  return mesh;
}

const place = new Vector3(), turn = new Quaternion();

function setPoses({ skeleton }, rows, start) {
  skeleton.bones.forEach((bone, index) => {
    const at = start + index * STRIDE;
    place.fromArray(rows, at);
    turn.set(rows[at + 4], rows[at + 5], rows[at + 6], rows[at + 3]);
    if (Number.isFinite(place.x)) bone.matrixWorld.compose(place, turn, UNIT_SCALE);
    else bone.matrixWorld.makeScale(0, 0, 0); // a body without a pose
  });
}

/** A surface that one looks through, and that hides nothing. */
function shellMesh(points, faces, color, opacity) {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(points, 3));
  geometry.setIndex(faces);
  const mesh = new Mesh(geometry, new MeshBasicMaterial({ color, opacity, transparent: true, depthWrite: false, side: DoubleSide }));
  mesh.frustumCulled = false;
  mesh.renderOrder = 4;
  return mesh;
}

/** Triangles of `around` × `along` points, along fastest, the way around closed. */
function lattice(around, along) {
  const faces = [];
  for (let i = 0; i < around; i++)
    for (let j = 0; j + 1 < along; j++) {
      const [a, b] = [i * along + j, ((i + 1) % around) * along + j];
      faces.push(a, b, b + 1, a, b + 1, a + 1);
    }
  return faces;
}

/** A tube about a path whose radius is the spread at each of its points. */
function spreadTube(points, spread, sides = 12) {
  const segments = Math.min(points.length - 1, 80);
  const geometry = new TubeGeometry(new CatmullRomCurve3(points), segments, 1, sides);
  const { position, normal } = geometry.attributes;
  const curve = new CatmullRomCurve3(points), centre = new Vector3();
  for (let ring = 0; ring <= segments; ring++) {
    curve.getPointAt(ring / segments, centre);
    const at = curve.getUtoTmapping(ring / segments) * (points.length - 1), before = Math.floor(at);
    const after = Math.min(before + 1, points.length - 1);
    const radius = spread[before] + (spread[after] - spread[before]) * (at - before);
    for (let side = 0; side <= sides; side++) {
      const i = ring * (sides + 1) + side;
      position.setXYZ(i, centre.x + radius * normal.getX(i), centre.y + radius * normal.getY(i), centre.z + radius * normal.getZ(i));
    }
  }
  return geometry;
}
