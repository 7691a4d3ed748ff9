// Measures the overview in Chromium on a server with many queued jobs, for docs/load.md. Run it after `lightpathd demo`:
//
//     LIGHTPATH_BINARIES=target/release LIGHTPATH_DEMO_DATA=lightpath-demo/data LIGHTPATH_JOBS=100000 node tests/browser/measure.mjs

import { openPage, startBrowser } from "./browser.mjs";
import { startServer } from "./server.mjs";

const JOBS = Number(process.env.LIGHTPATH_JOBS ?? 1000);
/** Calls under way at once: enough to keep the server busy. */
const CALLS = 32;
const RUNS = 10;

const median = (values) => [...values].sort((a, b) => a - b)[Math.floor(values.length / 2)];
const server = await startServer({ flags: ["--calls-per-s-max", "0", "--queue-limit", String(JOBS + 100)] });
const browser = await startBrowser();
await server.post("queue:pause", { reason: "a measurement" });
const { jobs: [{ spec }] } = await server.get("jobs?kind=simulate_capture&pageSize=1");
let left = JOBS;
await Promise.all(Array.from({ length: CALLS }, async () => {
  while (left-- > 0) await server.post("jobs", { spec });
}));
console.log(`${(await server.get("queue")).queued} queued jobs`);

/** Opens the overview, and measures the time until the newest jobs are shown, and the bytes that were moved. */
async function open() {
  const page = await openPage(browser, server.url);
  const network = await page.context().newCDPSession(page);
  await network.send("Network.enable");
  const moved = { bytes: 0 };
  network.on("Network.dataReceived", ({ encodedDataLength }) => (moved.bytes += encodedDataLength));
  network.on("Network.responseReceived", ({ response }) => (moved.bytes += response.encodedDataLength));
  const begin = performance.now();
  await page.goto(server.url);
  await page.locator(".shot").first().waitFor();
  return { page, moved, took: performance.now() - begin };
}

const openings = [];
for (let i = 0; i < RUNS; i += 1) {
  const { page, moved, took } = await open();
  await page.waitForLoadState("load");
  await page.locator(".card h3").first().waitFor();
  openings.push({ took, bytes: moved.bytes });
  await page.context().close();
}
console.log(`interactive after ${Math.round(median(openings.map(({ took }) => took)))} ms, ${Math.round(median(openings.map(({ bytes }) => bytes)) / 1000)} kB moved`);

// What it costs to ask again for an unchanged list.
const list = `${server.url}/v1/jobs?view=basic&pageSize=12`;
const etag = (await fetch(list)).headers.get("etag");
const again = await fetch(list, { headers: { "if-none-match": etag } });
const head = [...again.headers].reduce((sum, [name, value]) => sum + name.length + value.length + 4, 17);
console.log(`an unchanged list: status ${again.status}, some ${head + (await again.arrayBuffer()).byteLength} bytes`);

// From the answer to a submit, which means that the job is on disk, to its card on the page.
const { page } = await open();
await page.waitForFunction(() => document.querySelector("#connection").textContent === "live");
const delays = [];
for (let i = 0; i < RUNS; i += 1) {
  // Longer than the page waits between two readings.
  await new Promise((rested) => setTimeout(rested, 1500));
  const { name } = await server.post("jobs", { spec });
  const begin = performance.now();
  await page.waitForFunction((name) => document.querySelector(".shot")?.dataset.job === name, name, { polling: "raf" });
  delays.push(performance.now() - begin);
}
console.log(`a submitted job is on the page after ${Math.round(median(delays))} ms (median of ${RUNS}; ${Math.round(Math.max(...delays))} ms at most)`);
await browser.close();
await server.stop();
