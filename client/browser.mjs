// One headless Chromium for all files of tests: prints where it listens, and ends with its input.

import { chromium } from "playwright-core";
import { LAUNCHED } from "./test/harness.mjs";

const server = await chromium.launchServer(LAUNCHED);
console.log(server.wsEndpoint());
process.stdin.resume();
process.stdin.once("end", () => server.close());
