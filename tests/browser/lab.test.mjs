// What a lab looks at: the gallery of jobs, a sweep, and the wall.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { openPage, startBrowser } from "./browser.mjs";
import { startServer } from "./server.mjs";

let browser, server, spec;
before(async () => {
  browser = await startBrowser();
  server = await startServer();
  const { jobs } = await server.get("jobs?kind=optimize_hologram&pageSize=1");
  [{ spec }] = jobs;
});
after(async () => {
  await browser?.close();
  await server?.stop();
});

const headlineOf = (job) => job.result.optimizeHologram.wavelengths[0].planes[0].judgements.find(({ headline }) => headline).psnrDb.value.toFixed(1);

test("the gallery shows holograms with their photographs, and the figure to believe", async () => {
  const page = await openPage(browser, server.url);
  const widths = [];
  page.on("request", (request) => {
    const url = new URL(request.url());
    if (/^\/v1\/artifacts\/.*\/picture$/.test(url.pathname)) widths.push(Number(url.searchParams.get("width")));
  });
  await page.goto(`${server.url}/#/jobs?kind=optimize_hologram`);
  const card = page.locator(".shot").first();
  await card.getByText("photographed").waitFor();
  const job = await server.get(await card.getAttribute("data-job"));
  const [expected, photographed] = (await card.locator(".figure strong").allInnerTexts()).map((text) => text.split(" ")[0]);
  assert.equal(expected, headlineOf(job));
  assert.ok(Math.abs(expected - photographed) < 2, `${expected} dB were expected, the photograph has ${photographed} dB`);
  await page.waitForFunction(() => [...document.querySelector(".shot").querySelectorAll("img")].filter((image) => image.naturalWidth > 0).length === 3);
  assert.ok(widths.length > 0 && Math.max(...widths) <= 256, `small pictures are enough: ${Math.max(...widths)} columns`);

  // A picture is dragged out as the file itself.
  const dragged = await card.getByRole("img", { name: /^reconstruction/ }).evaluate((image) => {
    const data = new DataTransfer();
    image.dispatchEvent(new DragEvent("dragstart", { dataTransfer: data, bubbles: true }));
    return data.getData("DownloadURL");
  });
  const [type, name, ...url] = dragged.split(":");
  assert.deepEqual([type, name.endsWith("-reconstruction.png")], ["image/png", true]);
  const { reconstruction } = job.result.optimizeHologram.wavelengths[0].planes[0];
  assert.equal(url.join(":"), `${server.url}/v1/artifacts/${reconstruction}/content`);

  await page.getByLabel("Show as").selectOption("table");
  await page.getByRole("table").waitFor();
  await page.reload();
  await page.getByRole("table").waitFor();
  assert.equal(await page.locator(".shot").count(), 0, "the address keeps the choice");
  assert.deepEqual(page.problems, []);
});

test("a sweep is a table and a plot over the parameters that differ", async () => {
  const requests = [[2, "DETECTOR_POINT"], [8, "DETECTOR_PIXEL"]].map(([iterations, detector]) =>
    ({ spec: { optimizeHologram: { ...spec.optimizeHologram, iterations, detector, kernel: { active: {} } } }, batch: "short", label: "leaf.png" }));
  await server.post("jobs:submitAll", { requests });
  const page = await openPage(browser, server.url);
  await page.goto(`${server.url}/#/batch/short`);
  await page.getByText("2 succeeded.").waitFor({ timeout: 60_000 });
  const sweep = page.getByRole("region", { name: /^What differs/ });
  await page.waitForFunction(() => document.querySelectorAll("td strong").length === 2);
  assert.deepEqual(await sweep.getByRole("columnheader").allInnerTexts(), ["Job", "iterations", "detector", "Expected", "Photographed"]);
  const { jobs } = await server.get("jobs?batch=short&order=oldest_first");
  const rows = (await sweep.getByRole("row").allInnerTexts()).slice(1).map((row) => row.replaceAll(/\s+/g, " "));
  jobs.forEach((job, i) => assert.ok(rows[i].startsWith(`leaf.png ${[2, 8][i]} ${["point", "pixel"][i]} ${headlineOf(job)}`), rows[i]));
  await page.getByText("detector point").waitFor();
  await page.getByLabel("PSNR in a photograph over").selectOption("detector");
  await page.getByText("iterations 2").waitFor();
  assert.ok(page.url().includes("over=optimizeHologram.detector"));
  assert.deepEqual(page.problems, []);
});

test("the wall fits any screen, is readable from afar, and outlives a restart of the server", async () => {
  const page = await openPage(browser, server.url);
  await page.goto(`${server.url}/#/wall`);
  await page.getByText(/photographed$/).waitFor();
  await page.getByText("Nothing waits.").waitFor();
  await page.getByText(/^drift/).waitFor();
  for (const [width, height] of [[1920, 1080], [2560, 1440], [3840, 2160]]) {
    await page.setViewportSize({ width, height });
    const found = await page.evaluate(() => {
      const isShown = (element) => element.checkVisibility() && [...element.childNodes].some((node) => node.nodeType === Node.TEXT_NODE && node.textContent.trim());
      const texts = [...document.querySelectorAll("main *")].filter(isShown);
      const cut = [...document.querySelectorAll(".wall section")].filter((section) => section.scrollHeight > section.clientHeight + 1 || section.scrollWidth > section.clientWidth + 1);
      return { least: Math.min(...texts.map((text) => parseFloat(getComputedStyle(text).fontSize))), cut: cut.map((section) => section.className), scrolls: document.documentElement.scrollHeight > innerHeight || document.documentElement.scrollWidth > innerWidth };
    });
    assert.deepEqual([found.cut, found.scrolls], [[], false], `${width} px`);
    assert.ok(found.least >= 0.0145 * width, `${found.least} px are small on a screen of ${width} px`);
  }

  const optimizeHologram = { ...spec.optimizeHologram, iterations: 10_000, subframes: 8, kernel: { ideal: {} } };
  const { name } = await server.post("jobs", { spec: { optimizeHologram }, label: "night.png" });
  await page.getByText("night.png").waitFor();
  await page.waitForFunction(() => document.querySelector(".live-picture img")?.naturalWidth > 0);
  await server.restart(() => page.getByText(/^No connection, trying again; shown is .* old$/).waitFor());
  await page.locator(".fresh", { hasText: /^live$/ }).waitFor();
  await server.post(`${name}:cancel`, {});
  await page.getByText("No job runs. The newest hologram").waitFor();

  await page.keyboard.press("Escape");
  await page.getByRole("heading", { level: 1, name: "Overview" }).waitFor();
  // The page noted the losses of the job while it showed the wall.
  await page.evaluate((name) => (location.hash = `#/${name}`), name);
  await page.getByRole("img", { name: /^Loss: / }).waitFor();
  assert.deepEqual(page.problems.filter((problem) => !/ERR_(CONNECTION|INCOMPLETE|EMPTY)/.test(problem)), []);
});
