// Takes the pictures of docs/dashboard.md. Run it after `lightpathd demo`:
//
//     LIGHTPATH_BINARIES=target/release LIGHTPATH_DEMO_DATA=lightpath-demo/data node tests/browser/pictures.mjs docs

import { join } from "node:path";
import { openPage, startBrowser } from "./browser.mjs";
import { startServer } from "./server.mjs";

const folder = process.argv[2];
const server = await startServer();
const browser = await startBrowser();
const { summaries } = await server.get("jobs?view=basic&kind=optimize_hologram&pageSize=200");
const { kernels: [kernel] } = await server.get("displays/demo/kernels");
const [held] = summaries;

// A job that runs while the overview is shown.
const { spec } = await server.get(held.name);
Object.assign(spec.optimizeHologram, { iterations: 10_000, subframes: 8 });
const running = await server.post("jobs", { spec, owner: "ada", batch: "night" });

async function take(name, address, scheme, act, height = 800) {
  const page = await openPage(browser, server.url, { width: 1200, height, scheme });
  await page.goto(`${server.url}/#${address}`);
  await page.getByRole("heading", { level: 1 }).waitFor();
  await act(page);
  await page.screenshot({ path: join(folder, `dashboard-${name}.png`) });
  await page.context().close();
}

const drawn = (page) => page.waitForFunction(() => document.querySelector("img.whole") && [...document.querySelectorAll("img.whole")].every((image) => image.naturalWidth > 0));
await take("gallery", "/jobs?kind=optimize_hologram&state=succeeded", "dark", (page) => page.waitForFunction(() => [...document.querySelectorAll(".shot")].slice(0, 8).every((shot) => shot.textContent.includes("photographed") && [...shot.querySelectorAll("img")].every((image) => image.naturalWidth > 0))));
await take("overview", "/", "dark", (page) => page.waitForFunction(() => document.querySelector("progress")?.value > 100 && document.querySelector(".live-picture img")?.naturalWidth > 0));
await take("wall", "/wall", "dark", (page) => page.waitForFunction(() => document.querySelectorAll(".wall .pair img").length === 4 && [...document.querySelectorAll(".wall .pair img")].every((image) => image.naturalWidth > 0) && document.querySelector(".points circle")), 675);
await server.post(`${running.name}:cancel`, {});
await take("job", `/${held.name}`, "dark", async (page) => {
  await drawn(page);
  await page.getByLabel("Line profile").selectOption("horizontal");
  await page.locator(".profile canvas").waitFor();
}, 1100);
await take("kernel", `/${kernel.name}`, "light", (page) => page.locator(".chart canvas").waitFor());
await browser.close();
await server.stop();
