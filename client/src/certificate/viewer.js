// The replay of a certificate: the measured and the simulated arm, side by side or one over the other.

import {
  AmbientLight, AxesHelper, Box3, Color, DirectionalLight, GridHelper, MeshBasicMaterial, MeshLambertMaterial, PerspectiveCamera, Scene,
  Spherical, Vector3, WebGLRenderer,
} from "three";
import { cividis, gradient } from "./cividis.js";
import { Replays, visiblePoints } from "./replays.js";
import { Tube } from "./tube.js";

const MEASURED = [0.93, 0.55, 0.1]; // orange, where the colours of errors are blue to yellow
const TURN = 0.12, ZOOM = 1.15; // rad and times, of a key
const WIDER = 1.06; // times the arm, of the net that stands for the measured one around the simulated
const NEAREST = 0.15, FARTHEST = 5; // m

const find = (id) => document.getElementById(id);

class Viewer {
  constructor(replays) {
    this.replays = replays;
    this.canvas = find("view");
    this.renderer = new WebGLRenderer({ canvas: this.canvas, antialias: true, preserveDrawingBuffer: true });
    this.renderer.setScissorTest(true);
    this.scene = new Scene();
    this.scene.background = new Color(0xf3f4f6);
    const sun = new DirectionalLight(0xffffff, 2.0);
    sun.position.set(1, 1.5, 2);
    this.simulated = new Tube(new MeshLambertMaterial({ vertexColors: true }));
    this.measured = new Tube(new MeshLambertMaterial({ vertexColors: true }));
    this.net = new Tube(new MeshBasicMaterial({ color: 0xa34700, wireframe: true }), 36, 12);
    const axes = new AxesHelper(0.08);
    this.floor = new GridHelper(1, 10, 0xb9bfc6, 0xd6dade);
    this.floor.rotation.x = Math.PI / 2; // three's lies across y; z is along the arm
    this.scene.add(new AmbientLight(0xffffff, 1.3), sun, this.simulated, this.measured, this.net, axes, this.floor);
    this.camera = new PerspectiveCamera(40, 1, 0.01, 20);
    this.camera.up.set(0, 0, 1);
    this.turned = new Spherical(1.3, 1.35, 0.7);
    this.middle = new Vector3(0, 0, -0.25);
    this.playing = false;
    this.at = 0; // s
    this.listen();
    this.choose(0);
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  get trial() {
    return this.replays.trials[this.number];
  }

  listen() {
    find("trial").append(...this.groups());
    find("trial").addEventListener("change", () => this.choose(Number(find("trial").value)));
    find("play").addEventListener("click", () => this.play(!this.playing));
    find("scrubber").addEventListener("input", () => this.seek(Number(find("scrubber").value) / this.replays.rate));
    for (const input of document.querySelectorAll("input[name=layout]")) input.addEventListener("change", () => this.draw());
    this.canvas.addEventListener("keydown", (event) => this.key(event));
    this.canvas.addEventListener("pointerdown", (event) => this.canvas.setPointerCapture(event.pointerId));
    this.canvas.addEventListener("pointermove", (event) => {
      if (event.buttons) this.turn(-event.movementX / 150, -event.movementY / 150);
    });
    this.canvas.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && document.activeElement !== this.canvas) return; // else the page could not be scrolled
      event.preventDefault();
      this.zoom(Math.exp(event.deltaY / 600));
    }, { passive: false });
    find("scale").style.background = gradient();
  }

  /** Options of the list of trials, by split and kind. */
  groups() {
    const groups = new Map();
    this.replays.trials.forEach(({ name, group }, number) => {
      if (!groups.has(group)) groups.set(group, Object.assign(document.createElement("optgroup"), { label: group }));
      groups.get(group).append(new Option(name, String(number)));
    });
    return groups.values();
  }

  choose(number) {
    this.number = number;
    this.scale = this.replays.scale(number);
    find("largest").textContent = `${this.scale} mm and more`;
    find("scrubber").max = String(this.trial.frames - 1);
    for (const id of ["scrubber", "play"]) find(id).disabled = this.trial.frames < 2;
    const box = new Box3();
    for (let frame = 0; frame < this.trial.frames; frame += Math.max(1, Math.floor(this.trial.frames / 20))) {
      const { simulated } = this.replays.frame(number, frame);
      for (let i = 0; i < simulated.length; i += 3) box.expandByPoint(new Vector3(...simulated.slice(i, i + 3)));
    }
    box.getCenter(this.middle);
    this.turned.radius = Math.min(Math.max(1.75 * box.getSize(new Vector3()).length(), NEAREST), FARTHEST);
    this.floor.position.z = box.min.z - 0.02;
    this.play(false);
    this.seek(0);
  }

  play(on) {
    this.playing = on && this.trial.frames > 1;
    find("play").textContent = this.playing ? "Pause" : "Play";
    if (!this.playing) return;
    if (this.frame >= this.trial.frames - 1) this.at = 0;
    let last = performance.now();
    const step = (now) => {
      if (!this.playing) return;
      this.seek(this.at + ((now - last) / 1e3) * Number(find("speed").value));
      last = now;
      if (this.frame >= this.trial.frames - 1) this.play(false);
      else requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  seek(at) {
    this.at = Math.min(Math.max(at, 0), (this.trial.frames - 1) / this.replays.rate);
    this.frame = Math.round(this.at * this.replays.rate);
    const { measured, simulated, errors } = this.replays.frame(this.number, this.frame);
    const colours = errors.map((error) => cividis(error / this.scale));
    this.simulated.follow(simulated, this.replays.radii, colours);
    const visible = visiblePoints(measured, this.replays.radii);
    const orange = visible.values.map(() => MEASURED);
    this.measured.follow(visible.points, visible.values, orange);
    this.net.follow(visible.points, visible.values.map((radius) => WIDER * radius), orange);
    const distances = errors.slice(1).filter(Number.isFinite), tip = errors.at(-1);
    const mean = distances.reduce((sum, error) => sum + error, 0) / Math.max(distances.length, 1);
    find("scrubber").value = String(this.frame);
    find("scrubber").setAttribute("aria-valuetext", `${this.at.toFixed(2)} s`);
    find("now").textContent = `${this.at.toFixed(2)} s: mean ${mean.toFixed(1)} mm, tip ${Number.isFinite(tip) ? `${tip.toFixed(1)} mm` : "not seen"}`;
    this.draw();
  }

  key(event) {
    const acts = {
      ArrowLeft: () => this.turn(-TURN, 0), ArrowRight: () => this.turn(TURN, 0), ArrowUp: () => this.turn(0, -TURN),
      ArrowDown: () => this.turn(0, TURN), "+": () => this.zoom(1 / ZOOM), "-": () => this.zoom(ZOOM), " ": () => this.play(!this.playing),
    };
    if (!(event.key in acts)) return;
    event.preventDefault();
    acts[event.key]();
  }

  turn(around, up) {
    this.turned.theta += around;
    this.turned.phi = Math.min(Math.max(this.turned.phi + up, 0.05), Math.PI - 0.05);
    this.draw();
  }

  zoom(times) {
    this.turned.radius = Math.min(Math.max(this.turned.radius * times, NEAREST), FARTHEST);
    this.draw();
  }

  draw() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    const { theta, phi, radius } = this.turned;
    this.camera.position.set(Math.sin(phi) * Math.cos(theta), Math.sin(phi) * Math.sin(theta), Math.cos(phi)).multiplyScalar(radius).add(this.middle);
    this.camera.lookAt(this.middle);
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    const beside = document.querySelector("input[name=layout]:checked").value === "beside";
    const views = beside ? [[0, width / 2, [this.measured]], [width / 2, width / 2, [this.simulated]]] : [[0, width, [this.simulated, this.net]]];
    for (const [left, wide, tubes] of views) {
      for (const tube of [this.measured, this.simulated, this.net]) tube.visible = tubes.includes(tube);
      this.camera.aspect = wide / height;
      this.camera.updateProjectionMatrix();
      this.renderer.setViewport(left, 0, wide, height);
      this.renderer.setScissor(left, 0, wide, height);
      this.renderer.render(this.scene, this.camera);
    }
    find("left").hidden = find("right").hidden = !beside;
  }
}

const element = find("replays");
if (element) {
  try {
    globalThis.viewer = new Viewer(new Replays(JSON.parse(element.textContent)));
    document.body.dataset.replay = "ready";
  } catch (error) {
    find("replay-note").textContent = `No replay: this browser does not draw in 3D (${error.message}). The picture shows some poses.`;
    document.body.dataset.replay = "none";
  }
}
