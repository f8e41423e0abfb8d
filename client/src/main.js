// The page: one connection, one scene, and hands from a headset or from mouse and keyboard. The server decides.

import { ACESFilmicToneMapping, Color, PerspectiveCamera, Quaternion, SRGBColorSpace, Vector3, WebGLRenderer } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import styles from "./page.css";
import { BACK } from "./colours.js";
import { Confirming } from "./confirming.js";
import { DesktopHands } from "./desktop.js";
import { Handles } from "./handles.js";
import { doubtQuestion, isDoubtful, lasts, ofDevice, success, whyLost, whyNothing } from "./hints.js";
import { Immersive, canImmerse } from "./immersive.js";
import { MeasuredArm, camerasText, correctionText } from "./measured.js";
import { Marks } from "./rays.js";
import { PagePanel, RoomPanel, predictionText, remedy, uiText } from "./panel.js";
import { Playback } from "./playback.js";
import { Quality, Stopwatch, isSoftware } from "./quality.js";
import { Recording } from "./recording.js";
import { RobotScene } from "./scene.js";
import { freeArea, look, shape } from "./views.js";
import { HANDS, MARKERS } from "./wire_table.js";
import { STRIDE, Wire, clock, noHand } from "./wire.js";

const TOKEN_KEY = "trunkline.token"; // of this tab, so that a reload need not pair again
const RIGID_HAND = "left"; // of the core, `core.rigid_hand`
const INPUT_RATE = 72; // Hz
const WIDE = 1200; // pixels of a page on which the keys do not cover the robot
const COARSE_KEY = "trunkline.coarse"; // of this tab too: drawing was slow, so the next page begins with what is drawn soonest
const LATELY = 3; // s for which an event counts as a cause of lost control
const STANDS = 6; // s for which a line about what was just done stands at most
const STILL = 0.3; // s without a grip, after which the core's targets are taken over
const OVER = new Set(["hold", "aim", "follow", "stopped"]); // modes in which no plan is shown; it may come before its mode does
const SHOWN_IN = new Set(["preview", "ready", "delay"]);
const BUSY = new Set(["plan", ...SHOWN_IN, "execute", "follow"]); // modes whose end has a reason to show
const LONGEST_STEP = 0.25; // s of a preview between two pictures at most: what is drawn slowly is played slowly, so that all is seen
const DESKTOP = { position: new Vector3(), quaternion: new Quaternion().setFromAxisAngle(new Vector3(1, 0, 0), -Math.PI / 2) };

const find = (id) => document.getElementById(id);
const sheet = new CSSStyleSheet(); // the page's rules allow no style but what comes with its own script
sheet.replaceSync(styles);
document.adoptedStyleSheets = [sheet];

class Page {
  constructor() {
    const antialias = !isSoftware() && !sessionStorage.getItem(COARSE_KEY);
    this.renderer = new WebGLRenderer({ canvas: find("view"), antialias, alpha: true });
    this.quality = new Quality(() => this.redraw(), devicePixelRatio, !antialias);
    this.stopwatch = new Stopwatch(this.renderer.getContext(), clock, (seconds) => this.pictureDone(seconds));
    this.renderer.outputColorSpace = SRGBColorSpace;
    this.renderer.xr.enabled = true;
    this.camera = new PerspectiveCamera(45, 1, 0.02, 30);
    this.camera.position.set(1.9, 1.25, 1.5);
    this.orbit = new OrbitControls(this.camera, this.renderer.domElement);
    this.orbit.target.set(0.25, 0.35, 0);
    this.drawn = new RobotScene();
    this.marks = new Marks(this.drawn.base, RIGID_HAND);
    this.measured = new MeasuredArm(this.drawn.base);
    this.board = new RoomPanel(this.drawn.scene);
    this.panel = new PagePanel(find);
    this.handles = new Handles(this.drawn.base);
    this.desktop = new DesktopHands(this.renderer.domElement, this.camera, this.orbit, this.drawn.base, this.marks, this.handles, RIGID_HAND, {
      stop: () => this.wire.stop(),
      reach: () => this.chooseReach(),
      correct: () => this.chooseCorrection(),
      deadman: (on) => find("grip").setAttribute("aria-pressed", String(on)),
      key: (code) => this.explain(code),
    });
    this.confirming = new Confirming((prediction) => this.warn(doubtQuestion(prediction), () => this.state?.mode !== "ready", Infinity));
    this.immersive = new Immersive(this.renderer, (type, fields) => this.wire?.sendJson(type, fields), () => this.leftHeadset());
    Object.assign(this, { state: null, lease: null, reason: null, frame: null, playback: null, prediction: null, recording: null });
    Object.assign(this, { lost: "", arrived: null, restsAt: 0, inputAt: null, worst: { gap: 0, at: -Infinity }, hiddenAt: -Infinity });
    this.reaches = { rigid: null, tip: null };
    this.ready = Promise.resolve(); // the scene, whose sizes a preview needs
    this.connect();
    this.buttons();
    this.stand(DESKTOP);
    this.redraw();
    addEventListener("resize", () => this.resize());
    document.addEventListener("visibilitychange", () => (this.hiddenAt = clock()));
    const panels = new ResizeObserver(() => this.resize());
    for (const id of ["status", "acts", "playing"]) panels.observe(find(id));
    const light = matchMedia("(prefers-color-scheme: light)");
    light.addEventListener("change", () => this.theme(light.matches));
    this.theme(light.matches);
    find("help").open = innerWidth >= WIDE;
    this.before = clock();
    this.hands = { left: noHand(), right: noHand() };
    // At a desk, hands do not wait for the picture: so slow drawing does not delay inputs.
    setInterval(() => this.immersive.session || this.send(this.atDesk(clock()), false, clock()), 1000 / INPUT_RATE);
    this.renderer.setAnimationLoop((_, frame) => this.draw(frame));
  }

  connect() {
    const token = new URLSearchParams(location.hash.slice(1)).get("token") ?? sessionStorage.getItem(TOKEN_KEY) ?? "";
    if (!token) return void this.pair("This page was opened without its token.");
    this.wire = new Wire(this.handlers(), { token });
  }

  pair(why) {
    find("why").textContent = why;
    find("pairing").hidden = false;
    find("code").focus();
  }

  handlers() {
    return {
      welcome: (message) => this.welcome(message),
      closed: (reason, final) => {
        [this.reason, this.ended] = [reason, final];
        if (this.wire.controls) this.lost = "Control was lost with the connection. Press “Take control” to go on.";
        this.wire.controls = false;
        this.state = this.lease = null;
        this.show(null);
        if (!final) return;
        sessionStorage.removeItem(TOKEN_KEY);
        this.pair(remedy(reason));
      },
      lease: (message) => {
        this.lease = message;
        const controlled = this.wire.controls;
        this.wire.controls = message.holder === this.wire.id;
        this.leaseChanged(controlled);
      },
      aligning: (message) => this.immersive.receive(message),
      state: (message) => this.changed(message),
      world: ({ world }) => {
        this.objects = world.things;
        this.desktop.objects = world.things.filter(({ support }) => support !== "held");
        this.drawn.showWorld(world);
      },
      robot: (message) => this.robot(message),
      shell: ({ rows }) => this.drawn.shell(rows),
      preview: (message) => this.ready.then(() => this.loaded && (message.kind ? this.piece(message) : this.show(message))),
      foreseen: (message) => {
        this.prediction = message;
        this.drawn.showPrediction(message);
      },
      measured: (message) => this.measured.receive(message, clock()),
      error: ({ reason, closing }) => closing || this.warn(reason),
    };
  }

  welcome({ token, package: digest }) {
    sessionStorage.setItem(TOKEN_KEY, token);
    find("pairing").hidden = true;
    this.reason = null;
    if (this.immersive.session) this.askForControl();
    if (this.loaded !== digest || this.token !== token) this.ready = this.load(digest, token);
    this.token = token;
  }

  async load(digest, token) {
    const answer = await fetch("scene.json", { headers: { Authorization: `Bearer ${token}` } });
    if (!answer.ok) return this.warn(`The scene was refused: ${answer.status}.`);
    const { certificate, ...scene } = await answer.json();
    this.drawn.load(scene);
    find("certificate").hidden = !certificate;
    find("certificate").href = certificate ?? "";
    this.drawn.coarsen(this.quality.isCoarse);
    this.drawn.everythingOnce(() => this.renderer.render(this.drawn.scene, this.camera));
    this.loaded = digest;
  }

  /** One line about what was just done; it stands for a while, at most until it has `ended`. */
  warn(text, ended = () => false, seconds = STANDS) {
    this.warning = { text, ended, until: clock() + seconds };
  }

  /** After a message `lease`; `controlled`: whether this page controlled before. */
  leaseChanged(controlled) {
    const now = clock();
    if (this.wire.controls) [this.lost, this.released] = ["", false];
    else if (controlled && !this.released) {
      const gap = Math.max(now - this.worst.at < LATELY ? this.worst.gap : 0, now - (this.inputAt ?? now));
      this.lost = whyLost({ gap, hidden: document.hidden || now - this.hiddenAt < LATELY });
    }
    if (!this.wire.controls) this.inputAt = null;
  }

  /** S until the arm rests after the last plan, as its preview had it. */
  get settles() {
    return Math.max(this.restsAt - clock(), 0);
  }

  /** Whether anything is offered that may be taken. */
  get offers() {
    const { rigid, tip, better } = this.state?.targets ?? {};
    return Boolean(rigid?.offer || tip?.offer || better || this.prediction?.offer);
  }

  /** Shows why a key does nothing, where it does nothing. */
  explain(code) {
    const { state, lease, wire, offers } = this;
    const now = { up: Boolean(wire?.up), controls: Boolean(wire?.controls), holder: lease?.holder ?? "", mode: state?.mode, gripped: this.desktop.deadman, offers, cameras: Boolean(this.measured.message) };
    const why = whyNothing(code, now), { mode } = now;
    if (why) this.warn(why, () => this.state?.mode !== mode || (Boolean(this.wire?.controls) !== now.controls) || this.desktop.deadman !== now.gripped);
  }

  chooseReach() {
    this.reachChosen = true; // the user's choice, which slow drawing does not change
    this.drawn.showReach(!this.drawn.reachShown);
  }

  /** Whether plans that are asked for from now on may correct themselves by cameras; without them they never do. */
  chooseCorrection() {
    if (this.measured.message) this.corrects = !this.corrects;
  }

  /** Whether the arm as cameras see it is drawn. */
  chooseMeasured() {
    if (this.measured.message) this.measured.shown = !this.measured.shown;
  }

  /** As well as drawing is fast. */
  redraw() {
    if (!this.reachChosen) this.drawn.showReach(this.quality.reach);
    if (this.quality.at > this.quality.best) sessionStorage.setItem(COARSE_KEY, "1");
    this.resize();
  }

  theme(isLight) {
    const scheme = isLight ? "light" : "dark";
    this.ground = new Color(BACK[scheme]);
    this.drawn.ground(scheme);
  }

  changed(state) {
    if (["delay", "execute"].includes(this.state?.mode) && state.mode === "aim" && state.robot === "done") this.arrived = this.phases.map(([name]) => name);
    else if (!["aim", "hold"].includes(state.mode)) this.arrived = null;
    if (state.mode === "execute" && this.state?.mode !== "execute") this.restsAt = clock() + (this.playback?.duration ?? 0);
    const wasBusy = BUSY.has(this.state?.mode) && !BUSY.has(state.mode);
    if (wasBusy && state.notice) this.warn(state.notice, () => BUSY.has(this.state?.mode)); // the state's notice ends once the core aims again
    this.state = state;
    if (OVER.has(state.mode)) this.show(null);
    for (const kind of ["rigid", "tip"]) {
      const reach = state.targets?.[kind]?.reach ?? null;
      const edge = this.reaches[kind] && reach && reach !== this.reaches[kind];
      if (edge && this.immersive.session) this.immersive.tick(this.marks.names[0] === (kind === "rigid" ? "mount" : "tip") ? "left" : "right");
      this.reaches[kind] = reach;
    }
  }

  robot(frame) {
    if (!this.loaded) return;
    this.frame = frame;
    this.drawn.pose(frame.rows);
  }

  /** A preview begins; null ends it. */
  show(message) {
    this.digest = message?.digest ?? "";
    this.planned = message;
    this.measured.bound(message?.correction);
    this.playback = message && new Playback({ ...message, width: this.drawn.count * STRIDE });
    this.phases = message?.phases ?? [];
    this.begins = message?.begins ?? 0;
    if (!message || this.prediction?.digest !== message.digest) {
      this.prediction = null;
      this.drawn.showPrediction(null);
    }
    if (!message) this.drawn.pretend(null);
    find("playing").hidden = !message;
  }

  piece({ sequence, rows, flags }) {
    this.playback?.add(sequence, rows, flags.has("last"));
  }

  buttons() {
    find("control").addEventListener("click", () => {
      this.released = Boolean(this.wire?.controls);
      if (this.released) this.wire.sendJson("lease", { action: "release" });
      else this.askForControl();
      find("view").focus(); // else Enter, which asks for a plan, would press this button again
    });
    find("stop").addEventListener("click", () => this.wire?.stop());
    tapped("plan", () => {
      this.explain("Enter");
      this.desktop.press("trigger");
      find("view").focus();
    });
    tapped("go", () => this.desktop.accept());
    tapped("follow", () => {
      this.explain("KeyF");
      this.desktop.press("stick_pressed");
    });
    tapped("reach", () => this.chooseReach());
    tapped("cameras", () => this.chooseMeasured());
    tapped("correct", () => this.chooseCorrection());
    for (const view of ["fit", "front", "side", "top"]) tapped(view, () => this.lookFrom(view));
    for (const step of document.querySelectorAll("#pad [data-step]")) {
      step.addEventListener("click", () => {
        this.explain(step.dataset.step);
        this.desktop.arrow({ code: step.dataset.step, altKey: find("tilt").getAttribute("aria-pressed") === "true", preventDefault() {} });
      });
    }
    tapped("tilt", () => find("tilt").setAttribute("aria-pressed", String(find("tilt").getAttribute("aria-pressed") !== "true")));
    tapped("which", () => (this.desktop.chosen = 1 - this.desktop.chosen));
    const grip = find("grip");
    grip.addEventListener("pointerdown", (event) => {
      grip.setPointerCapture(event.pointerId);
      this.desktop.hold(true);
    });
    grip.addEventListener("contextmenu", (event) => event.preventDefault()); // a finger that holds asks for one
    for (const kind of ["pointerup", "pointercancel", "lostpointercapture"]) grip.addEventListener(kind, () => this.desktop.hold(false));
    const scrub = find("scrub");
    scrub.addEventListener("input", () => this.playing?.pauseAt(Number(scrub.value)));
    for (const kind of ["change", "pointerup", "keyup"]) scrub.addEventListener(kind, () => this.playing && (this.playing.paused = false));
    find("pairing").addEventListener("submit", (event) => {
      event.preventDefault();
      const code = find("code").value;
      if (this.wire) this.wire.reconnect({ code, token: "" });
      else this.wire = new Wire(this.handlers(), { code });
    });
    find("recording").addEventListener("change", async ({ target }) => {
      const [file] = target.files;
      const recording = file && new Recording(await file.arrayBuffer());
      const fits = recording?.playback?.width === (this.drawn.count + MARKERS.length) * STRIDE;
      this.recording = fits ? recording : null;
      if (recording && !fits) this.warn("That file is no recording of this robot.");
      find("playing").hidden = !this.playing;
    });
    find("immerse").addEventListener("click", () => this.enterHeadset());
    canImmerse().then((can) => (find("immerse").hidden = !can));
  }

  askForControl() {
    this.wire?.sendJson("lease", { action: "ask" });
  }

  get playing() {
    return this.recording?.playback ?? this.playback;
  }

  async enterHeadset() {
    try {
      await this.immersive.enter();
    } catch (error) {
      return this.warn(`The headset did not start: ${error.message}`);
    }
    this.drawn.floor.visible = false;
    document.body.dataset.immersed = "";
    this.wire?.reconnect({ space: "room" });
  }

  leftHeadset() {
    this.drawn.floor.visible = true;
    delete document.body.dataset.immersed;
    this.board.hide();
    this.stand(DESKTOP);
    this.resize();
    this.wire?.reconnect({ space: "base" });
  }

  /** Puts the base at `place`, its pose in the room. */
  stand({ position, quaternion }) {
    this.drawn.base.position.copy(position);
    this.drawn.base.quaternion.copy(quaternion);
    this.drawn.base.updateMatrixWorld(true);
  }

  resize() {
    if (this.renderer.xr.isPresenting) return;
    const { innerWidth: width, innerHeight: height } = window;
    const [status, acts, playing] = ["status", "acts", "playing"].map((id) => find(id).getBoundingClientRect());
    for (const [name, { height }] of [["--acts", acts], ["--playing", playing]]) document.documentElement.style.setProperty(name, `${Math.ceil(height)}px`);
    const size = [width, height, this.quality.ratioOf(width * height)];
    if (size.join() !== this.size?.join()) {
      this.size = size;
      this.renderer.setPixelRatio(size[2]);
      this.renderer.setSize(width, height, false);
      this.stopwatch.cancel(); // that clears the picture: the next begins at once, and no pose in it was seen
    }
    if (!this.desktop.dragging) shape(this.camera, width, height, freeArea(width, height, status, acts));
  }

  lookFrom(view) {
    const targets = this.desktop.wanted.filter(Boolean).map((point) => this.desktop.inRoom(point));
    const all = [...(this.frame ? this.drawn.extent(this.frame.rows) : []), ...targets];
    if (all.length) look(this.camera, this.orbit, view, all);
    find("view").focus();
  }

  draw(frame) {
    const now = clock(), dt = Math.min(now - this.before, LONGEST_STEP);
    const immersed = Boolean(frame && this.immersive.session && this.immersive.space);
    if (!immersed && this.stopwatch.isRunning) return; // pictures that wait for each other would show a robot of long ago
    this.before = now;
    if (immersed) this.send(this.inHeadset(now, frame), true, now);
    this.play(dt);
    this.mark(this.hands, immersed);
    this.showStatus(immersed, dt);
    if (!immersed) this.orbit.update();
    this.drawn.coarsen(!immersed && this.quality.isCoarse);
    this.drawn.scene.background = immersed ? null : this.ground;
    this.renderer.render(this.drawn.scene, this.camera);
    this.frameInPicture = this.frame;
    if (immersed) this.acknowledge();
    else this.stopwatch.start(now);
  }

  /** The picture that was begun is there, `seconds` later. */
  pictureDone(seconds) {
    this.acknowledge();
    this.quality.took(seconds, clock());
  }

  /** A new pose of the robot is in the picture: without it, input does not move the robot. */
  acknowledge() {
    if (!this.wire || !this.frameInPicture || this.frameInPicture === this.drawnFrame || this.renderer.getContext().isContextLost()) return;
    this.drawnFrame = this.frameInPicture;
    this.wire.drawn = true;
  }

  inHeadset(now, frame) {
    const hands = this.immersive.frame(frame), { eye, alignment, controllers } = this.immersive;
    if (HANDS.some((side) => controllers[side]?.pressed.has("aside"))) this.chooseMeasured();
    if (alignment.place) this.stand(alignment.place);
    if (this.wire?.controls && this.wire.offset !== null) this.wire.view(eye, now);
    return hands;
  }

  atDesk(now) {
    const { desktop } = this;
    if (this.frame && !desktop.wanted[0]) this.beginAt(this.frame.rows);
    desktop.aiming = this.state?.mode === "aim";
    const hands = desktop.hands();
    if (HANDS.some((side) => hands[side].grip)) this.gripped = now;
    else if (now - (this.gripped ?? 0) > STILL) this.adopt();
    return hands;
  }

  /** Both hands' targets to where the robot's own mount and tip are. */
  beginAt(rows) {
    const units = this.drawn.bodies.map((name, index) => (/^unit_/.test(name) ? index : -1)).filter((index) => index >= 0);
    const base = this.drawn.bodies.indexOf("base");
    const at = (index) => new Vector3().fromArray(rows, index * STRIDE);
    const mount = base >= 0 ? at(base) : units.length ? at(units[0]) : new Vector3(0.5, 0, 0.6);
    this.desktop.begin(mount, units.length ? at(units.at(-1)) : new Vector3(0.5, 0, 0.2));
  }

  /** The core's targets where they differ from the hands': an offer was taken, or a plan has pinned them. */
  adopt() {
    const { rows } = this.frame ?? {};
    if (!rows || this.desktop.dragging) return;
    ["rigid_target", "tip_target"].forEach((name, index) => {
      const at = (this.drawn.count + MARKERS.indexOf(name)) * STRIDE;
      const hand = index === 0 ? this.desktop.rigid : 1 - this.desktop.rigid;
      if (Number.isFinite(rows[at]) && this.desktop.wanted[hand]) this.desktop.wanted[hand].fromArray(rows, at);
    });
  }

  send(hands, immersed, now) {
    this.hands = hands;
    if (!this.wire?.controls || this.wire.offset === null) return; // before the clocks have met, input does not count
    const gap = now - (this.inputAt ?? now);
    if (gap > this.worst.gap || now - this.worst.at > LATELY) this.worst = { gap, at: now };
    if (!immersed && !document.hidden) this.quality.input(gap, now);
    this.inputAt = now;
    const visible = immersed ? this.immersive.visible : !document.hidden;
    this.wire.input(this.confirming.filter(hands, this.state?.mode, this.prediction), visible, now, Boolean(this.corrects) && !immersed); // the board has no room for its bounds
  }

  play(dt) {
    const { playing } = this;
    if (!playing) return;
    const shows = this.recording || SHOWN_IN.has(this.state?.mode);
    if (shows && playing.advance(dt) && !this.recording) this.wire.sendJson("shown", { digest: this.digest });
    if (find("playing").hidden === Boolean(shows)) find("playing").hidden = !shows;
    this.drawn.pretend(playing.frames && shows ? playing.rows : null, playing.index * playing.width);
    const scrub = find("scrub"), at = playing.at.toFixed(2);
    if (scrub.max !== String(playing.duration)) scrub.max = String(playing.duration);
    if (!playing.paused && scrub.value !== at) scrub.value = at;
    const phase = this.phases.findLast(([, since]) => since <= this.begins + playing.at)?.[0];
    const text = `${playing.at.toFixed(1)} of ${playing.duration.toFixed(1)} s${phase && !this.recording ? `, ${phase}` : ""}`;
    if (find("played").textContent !== text) find("played").textContent = text;
    const caption = this.recording ? "A recording." : [predictionText(this.prediction), correctionText(this.planned, this.measured.message)].filter(Boolean).join(" ");
    find("foreseen").toggleAttribute("data-doubtful", !this.recording && isDoubtful(this.prediction));
    if (find("foreseen").textContent !== caption) find("foreseen").textContent = caption;
  }

  mark(hands, immersed) {
    const rows = this.frame?.rows;
    if (!rows || !this.loaded) return this.marks.hide();
    const starts = HANDS.map((side) => {
      if (!hands[side].tracked) return null;
      const start = new Vector3(...hands[side].position);
      return immersed ? this.drawn.base.worldToLocal(start) : start;
    });
    this.marks.update(rows, this.drawn.count, starts, this.state?.targets);
    this.drawn.placeShell(rows, this.drawn.count + MARKERS.indexOf("rigid_target"));
    const eye = new Vector3().setFromMatrixPosition((immersed ? this.renderer.xr.getCamera() : this.camera).matrixWorld);
    for (const target of Object.values(this.marks.targets)) target.face(eye);
    const { desktop, wire } = this, movable = !immersed && wire?.controls && ["aim", "follow"].includes(this.state?.mode);
    this.handles.place(movable ? desktop.wanted[desktop.chosen] : null, eye, this.camera.fov);
  }

  showStatus(immersed, dt) {
    const { wire, state, lease, reason } = this;
    const age = this.frame && wire ? wire.age(this.frame.time) : null;
    const stale = !wire?.up || (this.frame?.flags.has("stale") ?? false) || (age ?? 0) > 1;
    this.drawn.fade(stale);
    const device = immersed ? "controllers" : this.desktop.touches ? "touch" : "keys";
    const pressed = immersed ? HANDS.some((side) => this.hands[side].grip || this.hands[side].trigger) : this.desktop.isPressed;
    const status = uiText({ state, lease, id: wire?.id ?? "", age: this.rounded(age), up: Boolean(wire?.up && wire.id), reason, ended: this.ended, stale, device, pressed, awaits: Boolean(this.playing?.shownToEnd && !this.prediction), settles: this.settles });
    this.addNotices(status, device);
    this.measured.update(clock());
    const cameras = camerasText(this.measured.message);
    if (cameras) status.facts.Cameras = immersed && !this.measured.shown ? `hidden, stick to a side shows; ${cameras}` : cameras;
    if (state?.correction) status.facts.Correction = state.correction;
    if (immersed) {
      const { alignment } = this.immersive;
      if (!alignment.done && wire?.up) [status.title, status.next] = ["Where is the robot?", alignment.next];
      if (alignment.step === "lost") [status.mode, status.title] = ["lost", "Robot’s place lost"];
      const eye = this.renderer.xr.getCamera();
      this.board.show(status, predictionText(this.prediction) || alignment.feedback, eye, dt);
      return;
    }
    const picture = this.quality.hint(this.drawn.reachShown);
    if (picture) status.facts.Picture = ofDevice(picture, device);
    this.panel.show(status);
    document.body.toggleAttribute("data-touch", this.desktop.touches);
    const controls = Boolean(wire?.controls), stopped = state?.mode === "stopped";
    setText(find("go").firstChild, stopped ? "Go on " : "Take the offer ");
    find("go").hidden = !controls || !(stopped || (this.offers && !this.desktop.deadman));
    setText(find("which"), this.desktop.chosen === this.desktop.rigid ? "Mount" : "Tip");
    find("reach").setAttribute("aria-pressed", String(this.drawn.reachShown));
    for (const id of ["cameras", "correct"]) find(id).hidden = !this.measured.message;
    find("cameras").setAttribute("aria-pressed", String(this.measured.shown));
    find("correct").setAttribute("aria-pressed", String(Boolean(this.corrects)));
    setText(find("control"), controls ? "Release control" : lease?.holder ? "Ask for control" : "Take control");
    find("control").disabled = !wire?.up || wire.offset === null;
    const ready = state?.mode === "ready";
    setText(find("plan").firstChild, ready ? "Confirm " : "Ask for a plan ");
    find("plan").disabled = !controls || !["aim", "ready"].includes(state?.mode);
    find("grip").disabled = !controls;
  }

  /** Adds the page's own notices to the server's. */
  addNotices(status, device) {
    const { state, warning, lost, arrived } = this, up = Boolean(this.wire?.up);
    if (!lasts(state?.notice ?? "", { mode: state?.mode, targets: state?.targets, gripped: this.desktop.deadman })) status.notice = "";
    const current = warning && warning.until > clock() && !warning.ended() ? ofDevice(warning.text, device) : "";
    const added = current || (up ? lost : "");
    if (added && added !== status.notice) status.notice = status.notice ? `${status.notice}. ${added}` : added;
    const outcome = up && arrived && this.wire.controls ? success(arrived, this.objects ?? [], this.settles) : "";
    if (!status.notice && outcome) Object.assign(status, { notice: outcome, kind: "good" });
  }

  /** The age of the live robot, so that its number does not dance: it is written four times a second. */
  rounded(age) {
    if (age === null) return null;
    if (clock() - (this.agedAt ?? 0) > 0.25) [this.aged, this.agedAt] = [Math.max(age, 0), clock()];
    return this.aged;
  }
}

/** Calls `act` when the button `id` is pressed, also by a second finger, of which a browser makes no click. */
function tapped(id, act) {
  const button = find(id);
  button.addEventListener("click", act);
  button.addEventListener("pointerup", (event) => event.pointerType === "touch" && !event.isPrimary && !button.disabled && act());
}

function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

// For tests, which look and never act by it.
globalThis.trunkline = new Page();
