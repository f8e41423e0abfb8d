// What the browser tests share: a server, a headless Chromium, an emulated Quest 3, and polling.
//
// The page's rules forbid `eval`, so nothing here bypasses them: conditions are polled by `evaluate`.

import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { mkdirSync } from "node:fs";
import { dirname, join } from "node:path";
import { createInterface } from "node:readline";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";
import { chromium } from "playwright-core";

const here = dirname(fileURLToPath(import.meta.url));
export const root = join(here, "..", "..");
export const PYTHON = process.env.TRUNKLINE_PYTHON ?? join(root, ".venv", "bin", "python");
const BROWSER = process.env.TRUNKLINE_BROWSER ?? "/usr/bin/chromium";
const LISTENS = process.env.TRUNKLINE_BROWSER_AT ?? "";
const PICTURES = process.env.TRUNKLINE_PICTURES ?? "";
const LONGEST = Number(process.env.TRUNKLINE_LONGEST ?? 120_000); // ms that anything may take; drawing by software on a shared core is slow
const DRAWN = 10; // Hz at most at which tests draw, so that they also pass beside other work
const BLIND = 36; // Hz at most without drawing
const FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--disable-background-networking"];

/** The server, round a plain robot: `url`, `command(text)` which gives its log. */
export async function serve() {
  const child = spawn(PYTHON, ["-m", "tests.ar.session.page_server", ...(PICTURES ? [] : ["--light"])], { cwd: root, stdio: ["pipe", "pipe", "inherit"] });
  const lines = createInterface({ input: child.stdout })[Symbol.asyncIterator]();
  const first = (await lines.next()).value ?? "";
  const [word, port, token] = first.split(" ");
  assert.equal(word, "ready", "the server did not start");
  return {
    origin: `http://127.0.0.1:${port}`,
    url: `http://127.0.0.1:${port}/#token=${token}`,
    async command(text = "log") {
      child.stdin.write(`${text}\n`);
      return JSON.parse((await lines.next()).value);
    },
    async close() {
      child.stdin.end();
      await new Promise((done) => child.once("exit", done));
    },
  };
}

/** How a browser is started. */
export const LAUNCHED = { executablePath: BROWSER, args: FLAGS, timeout: LONGEST };

/** The browser that listens already (`client/browser.mjs`), or a new one for this file. */
export const launch = () => (LISTENS ? chromium.connect(LISTENS, { timeout: LONGEST }) : chromium.launch(LAUNCHED));

/** A page at `url` of `server`, closed with the test; `wrongs` collects console errors, exceptions and requests elsewhere. Unless it is `drawn`, it does all but fill pixels. */
export async function open(t, browser, server, { url = server.url, headset = false, touch = false, drawn = true, width = PICTURES ? 1280 : 720, height = PICTURES ? 720 : 480 } = {}) {
  const context = await browser.newContext({ viewport: { width, height }, hasTouch: touch });
  t.after(() => context.close());
  const page = await context.newPage();
  const wrongs = [];
  page.on("console", (message) => ["error", "warning"].includes(message.type()) && !isOfDriver(message.text()) && wrongs.push(`${message.type()}: ${message.text()}`));
  page.on("pageerror", (error) => wrongs.push(`exception: ${error.message}`));
  page.on("request", (request) => {
    const { origin, protocol } = new URL(request.url());
    if (protocol !== "data:" && protocol !== "blob:" && origin !== server.origin) wrongs.push(`request: ${request.url()}`);
  });
  await page.addInitScript(calmly, drawn ? DRAWN : BLIND);
  if (!drawn) await page.addInitScript(blindly);
  if (headset) await page.addInitScript({ content: await emulator() });
  page.setDefaultTimeout(LONGEST);
  await page.goto(url);
  return { page, wrongs };
}

/** In the page: frames come at most `rate` times a second. */
function calmly(rate) {
  const request = globalThis.requestAnimationFrame.bind(globalThis);
  let last = 0;
  globalThis.requestAnimationFrame = (draw) => {
    const wait = Math.max(last + 1000 / rate - performance.now(), 0);
    return setTimeout(() => request((time) => {
      last = performance.now();
      draw(time);
    }), wait);
  };
  globalThis.cancelAnimationFrame = (handle) => clearTimeout(handle);
}

/** In the page: nothing is drawn, so that frames come fast. */
function blindly() {
  for (const { prototype } of [globalThis.WebGLRenderingContext, globalThis.WebGL2RenderingContext])
    for (const name of Object.getOwnPropertyNames(prototype).filter((name) => /^(draw(?!ing)|clear$)/.test(name)))
      prototype[name] = () => {};
}

/** Messages of software drawing, which are no fault of the page. */
const isOfDriver = (text) => /GPU stall due to ReadPixels|GL Driver Message|swiftshader|WebGL-/i.test(text);

let emulated;

/** The emulated headset as one script; the product's page never loads it. */
async function emulator() {
  emulated ??= (await build({
    stdin: { contents: 'export { XRDevice, metaQuest3 } from "iwer";', resolveDir: here },
    bundle: true, write: false, format: "iife", globalName: "iwer", logLevel: "error",
  })).outputFiles[0].text + `
    globalThis.headset = new iwer.XRDevice(iwer.metaQuest3, { stereoEnabled: false });
    headset.installRuntime({ forceInstall: true }); // else it leaves Chromium's own navigator.xr
    globalThis.guessed = false; // a true controller's position is not emulated, this one's would be
    Object.defineProperty(globalThis.XRPose.prototype, "emulatedPosition", { configurable: true, get: () => globalThis.guessed });
    headset.position.set(0, 1.5, 0);
    for (const side of ["left", "right"]) headset.controllers[side].position.set(side === "left" ? -0.2 : 0.2, 1.2, -0.3);
  `;
  return emulated;
}

/** Until `test` (run in the page with `argument`) is truthy; returns its result. */
export async function until(page, test, argument, what = test.toString()) {
  const end = Date.now() + LONGEST;
  for (;;) {
    const result = await page.evaluate(test, argument);
    if (result) return result;
    if (Date.now() > end) {
      const state = await page.evaluate(() => ({ state: globalThis.trunkline?.state, text: document.querySelector("#status")?.textContent }));
      assert.fail(`waited ${LONGEST / 1000} s for ${what}; page: ${JSON.stringify(state)}`);
    }
    await page.waitForTimeout(50);
  }
}

export const inMode = (page, mode) => until(page, (wanted) => globalThis.trunkline.state?.mode === wanted, mode, `mode ${mode}`);

/** Until these were the newest modes of the server; a page that draws slowly may miss one. */
export async function passed(page, server, modes) {
  const end = Date.now() + LONGEST;
  for (;;) {
    const latest = (await server.command()).filter((line) => line.startsWith("mode ")).map((line) => line.slice(5)).slice(-modes.length);
    if (latest.join() === modes.join()) return;
    if (Date.now() > end) assert.deepEqual(latest, modes);
    await page.waitForTimeout(100);
  }
}

/** A button of the emulated controller of a `side`. */
export const set = (page, side, button, value) =>
  page.evaluate(([hand, name, amount]) => globalThis.headset.controllers[hand].updateButtonValue(name, amount), [side, button, value]);

/** Waits until the page has drawn `count` frames, so that it has the effect of an input. */
export async function frames(page, count = 3) {
  const first = await page.evaluate(() => globalThis.trunkline.renderer.info.render.frame);
  await until(page, (least) => globalThis.trunkline.renderer.info.render.frame >= least, first + count);
}

export async function press(page, side, button) {
  await set(page, side, button, 1);
  await frames(page);
  await set(page, side, button, 0);
  await frames(page);
}

/** Puts a controller so that its ray, straight down and `length` m long, ends at a point of the base frame. */
export async function point(page, side, place, length = 0.6) {
  await page.evaluate(([hand, [x, y, z], up]) => {
    const { drawn } = globalThis.trunkline;
    const end = drawn.base.localToWorld(drawn.base.position.clone().set(x, y, z));
    const controller = globalThis.headset.controllers[hand];
    controller.position.set(end.x, end.y + up, end.z);
    controller.quaternion.set(-Math.SQRT1_2, 0, 0, Math.SQRT1_2); // its -z looks down
  }, [side, place, length]);
  await frames(page);
}

/** A picture for whoever looks, where TRUNKLINE_PICTURES names a folder. */
export async function picture(page, name) {
  if (!PICTURES) return;
  mkdirSync(PICTURES, { recursive: true });
  await page.screenshot({ path: join(PICTURES, `${name}.png`) });
}
