// Builds the page of live sessions, one script, one HTML file and an icon, and what a certificate's page has inside, a
// script and a style sheet. They are committed, so that users need no Node.
//
//   node build.mjs            writes trunkline/ar/page/ and trunkline/report/certificate/page/
//   node build.mjs --check    compares it with what is there; ends with 1 where a byte differs
//
// The same sources give the same bytes: versions are those of package-lock.json, and nothing of the machine goes in.

import { existsSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { dirname, join, relative } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const here = dirname(fileURLToPath(import.meta.url));
const page = (name, file) => join(here, "..", "trunkline", name, "page", file);

/** The bytes of a script with all that it imports. */
async function bundled(entry) {
  const { outputFiles } = await build({
    absWorkingDir: here,
    entryPoints: [entry],
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
  return Buffer.from(outputFiles[0].contents);
}

/** What is built, bytes by path. */
async function built() {
  return {
    [page("ar", "app.js")]: await bundled("src/main.js"),
    [page("ar", "index.html")]: readFileSync(join(here, "src", "index.html")),
    [page("ar", "icon.svg")]: readFileSync(join(here, "src", "icon.svg")),
    [page("report/certificate", "viewer.js")]: await bundled("src/certificate/viewer.js"),
    [page("report/certificate", "page.css")]: readFileSync(join(here, "src", "certificate", "page.css")),
  };
}

const files = await built();
if (process.argv.includes("--check")) {
  const stale = Object.keys(files).filter((path) => !existsSync(path) || !readFileSync(path).equals(files[path]));
  if (stale.length) {
    const names = stale.map((path) => relative(join(here, ".."), path)).join(", ");
    console.error(`found other bytes in ${names}, expected those of \`make client\``);
    process.exit(1);
  }
} else {
  for (const [path, bytes] of Object.entries(files)) {
    mkdirSync(dirname(path), { recursive: true });
    writeFileSync(path, bytes);
  }
}
