// A certificate's page from disk: what it draws, at both widths and on paper, by keyboard, its accessibility.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { pathToFileURL } from "node:url";
import { PYTHON, launch, picture, root, until } from "./harness.mjs";

const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
let browser, folder, address;

before(async () => {
  folder = mkdtempSync(join(tmpdir(), "certificate-"));
  const file = process.env.TRUNKLINE_CERTIFICATE ?? join(folder, "certificate.html"); // one to look at, or a small arm's
  if (!process.env.TRUNKLINE_CERTIFICATE) execFileSync(PYTHON, ["-m", "tests.report.certificate.sample", file], { cwd: root, stdio: "inherit" });
  address = pathToFileURL(file).href;
  browser = await launch();
});
after(async () => {
  await browser?.close();
  rmSync(folder, { recursive: true });
});

/** The page, `width` pixels wide; `wrongs` collects errors and requests. */
async function open(t, width, height = 900) {
  const page = await browser.newPage({ viewport: { width, height } });
  t.after(() => page.close());
  const wrongs = [];
  page.on("console", (message) => message.type() === "error" && wrongs.push(message.text()));
  page.on("pageerror", (error) => wrongs.push(error.message));
  page.on("request", (request) => /^(file|data):/.test(request.url()) || wrongs.push(request.url()));
  await page.goto(address);
  await until(page, () => document.body.dataset.replay === "ready");
  return { page, wrongs };
}

const statusText = (page) => page.evaluate(() => document.querySelector("#now").textContent);

/** The longest trial, in which the arm moves. */
const moving = (page) => page.evaluate(() => {
  const { trials } = globalThis.viewer.replays;
  return String(trials.reduce((best, { frames }, number) => (frames > trials[best].frames ? number : best), 0));
});

/** How many colours the canvas has. */
const colours = (page) => page.evaluate(() => {
  globalThis.viewer.draw();
  const { width, height } = globalThis.viewer.canvas, gl = globalThis.viewer.renderer.getContext(), bytes = new Uint8Array(4 * width * height);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
  const values = new Set();
  for (let i = 0; i < bytes.length; i += 4) values.add((bytes[i] << 16) | (bytes[i + 1] << 8) | bytes[i + 2]);
  return values.size;
});

for (const width of [1280, 400]) {
  test(`at ${width} pixels it fits, draws, is accessible and asks nothing of a network`, async (t) => {
    const { page, wrongs } = await open(t, width);
    await picture(page, `certificate-${width}-first`);
    assert.equal(await page.evaluate(() => document.documentElement.scrollWidth), width, "it scrolls sideways");
    await page.selectOption("#trial", await moving(page));
    await page.locator("#player").scrollIntoViewIfNeeded();
    assert.ok((await colours(page)) > 50, "nothing is drawn");
    await picture(page, `certificate-${width}-over`);
    await page.check("input[value=beside]");
    assert.ok(await page.isVisible("#left"));
    assert.ok((await colours(page)) > 50, "nothing is drawn");
    await picture(page, `certificate-${width}-beside`);
    await page.evaluate(() => document.querySelectorAll("details").forEach((details) => (details.open = true)));
    await page.evaluate(AXE); // by the debugger's protocol, which the page's rules do not bind
    const { violations } = await page.evaluate(() => globalThis.axe.run());
    assert.deepEqual(violations.map(({ id, nodes }) => `${id}: ${nodes[0].html}`), []);
    assert.deepEqual(wrongs, []);
  });
}

test("scrubber, speed, play and the view work from the keyboard", async (t) => {
  const { page, wrongs } = await open(t, 1280);
  await page.selectOption("#trial", await moving(page));
  const before = await statusText(page);
  await page.focus("#scrubber");
  for (let step = 0; step < 5; step++) await page.keyboard.press("ArrowRight");
  assert.notEqual(await statusText(page), before);
  await page.focus("#view");
  const theta = await page.evaluate(() => globalThis.viewer.turned.theta);
  await page.keyboard.press("ArrowRight");
  assert.ok((await page.evaluate(() => globalThis.viewer.turned.theta)) > theta);
  const radius = await page.evaluate(() => globalThis.viewer.turned.radius);
  await page.keyboard.press("+");
  assert.ok((await page.evaluate(() => globalThis.viewer.turned.radius)) < radius);
  await page.selectOption("#speed", "2");
  await page.keyboard.press("Tab");
  await page.focus("#play");
  await page.keyboard.press("Enter");
  await until(page, () => !globalThis.viewer.playing && globalThis.viewer.frame === globalThis.viewer.trial.frames - 1);
  assert.equal(await page.textContent("#play"), "Play");
  assert.deepEqual(wrongs, []);
});

test("errors that it shows are those of the points that it draws", async (t) => {
  const { page } = await open(t, 1280);
  const { error, text } = await page.evaluate(() => {
    const { replays, number, frame } = globalThis.viewer, { measured, simulated } = replays.frame(number, frame);
    const last = measured.length - 3;
    return { error: 1e3 * Math.hypot(...[0, 1, 2].map((k) => measured[last + k] - simulated[last + k])), text: document.querySelector("#now").textContent };
  });
  assert.ok(text.endsWith(`tip ${error.toFixed(1)} mm`), text);
});

test("on A4 paper a picture stands where the replay is", async (t) => {
  const { page } = await open(t, 794, 1123);
  const pdf = await page.pdf({ preferCSSPageSize: true, printBackground: true });
  const boxes = [...pdf.toString("latin1").matchAll(/\/MediaBox\s*\[\s*0 0 ([\d.]+) ([\d.]+)\s*\]/g)];
  assert.ok(boxes.length >= 2, `${boxes.length} pages`);
  for (const [, width, height] of boxes) {
    assert.ok(Math.abs(width - 595) < 2 && Math.abs(height - 842) < 2, `${width} x ${height} points, expected A4`);
  }
  await page.emulateMedia({ media: "print" });
  assert.ok(await page.isVisible(".still img"));
  assert.ok(!(await page.isVisible("#player")));
  assert.ok((await page.evaluate(() => document.documentElement.scrollWidth)) <= 794, "it is cut off at the right");
  await picture(page, "certificate-paper");
});
