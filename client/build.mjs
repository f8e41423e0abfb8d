// Builds the page: one script, one HTML file and an icon, which are committed, so that users need no Node.
//
//   node build.mjs            writes trunkline/live/page/
//   node build.mjs --check    compares it with what is there; ends with 1 where a byte differs
//
// The same sources give the same bytes: versions are those of package-lock.json, and nothing of the machine goes in.

import { existsSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const here = dirname(fileURLToPath(import.meta.url));
const page = join(here, "..", "trunkline", "live", "page");

/** Files of the page by name, as bytes. */
async function pageFiles() {
  const { outputFiles } = await build({
    absWorkingDir: here,
    entryPoints: ["src/main.js"],
    bundle: true,
    minify: true,
    format: "esm",
    target: "es2022",
    charset: "utf8",
    legalComments: "eof",
    loader: { ".css": "text" },
    write: false,
    logLevel: "warning",
  });
  return {
    "app.js": Buffer.from(outputFiles[0].contents),
    "index.html": readFileSync(join(here, "src", "index.html")),
    "icon.svg": readFileSync(join(here, "src", "icon.svg")),
  };
}

const files = await pageFiles();
if (process.argv.includes("--check")) {
  const stale = Object.keys(files).filter((name) => {
    const path = join(page, name);
    return !existsSync(path) || !readFileSync(path).equals(files[name]);
  });
  if (stale.length) {
    console.error(`trunkline/live/page: found other bytes in ${stale.join(", ")}, expected those of \`make client\``);
    process.exit(1);
  }
} else {
  mkdirSync(page, { recursive: true });
  for (const [name, bytes] of Object.entries(files)) writeFileSync(join(page, name), bytes);
}
