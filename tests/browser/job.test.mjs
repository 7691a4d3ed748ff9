// What a hologram's job shows: pictures in colours, errors, lines through the light, how it propagated, and its origin.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { createHash } from "node:crypto";
import { mkdtempSync, readdirSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { after, before, test } from "node:test";
import { dropSquare, openPage, startBrowser } from "./browser.mjs";
import { startServer } from "./server.mjs";

let browser, server, target;
before(async () => {
  browser = await startBrowser();
  server = await startServer();
  const page = await openPage(browser, server.url);
  await page.goto(`${server.url}/`);
  await dropSquare(page);
  await page.getByText("square.png").waitFor();
  await page.getByLabel("Iterations").fill("30");
  await page.getByRole("button", { name: "Make the hologram" }).click();
  await page.waitForURL(/#\/jobs\//);
  const { spec } = await server.get(page.url().split("#/")[1]);
  target = spec.optimizeHologram.planes[0].target;
  await page.context().close();
});
after(async () => {
  await browser?.close();
  await server?.stop();
});

/** Submits a hologram of the square, waits for its end, and opens its job. `page.pictures` collects the queries of pictures. */
async function openHologram(fields, options) {
  const spec = { optimizeHologram: { display: "displays/demo", planes: [{ place: { distanceM: 0.015 }, target }], iterations: 30, ...fields } };
  const { name } = await server.post("jobs", { spec });
  const page = await openPage(browser, server.url, options);
  page.pictures = [];
  page.on("request", (request) => {
    const { pathname, searchParams } = new URL(request.url());
    if (/^\/v1\/artifacts\/.*\/picture$/.test(pathname)) page.pictures.push(Object.fromEntries(searchParams));
  });
  await page.goto(`${server.url}/#/${name}`);
  await page.getByRole("heading", { level: 1, name: "optimize hologram succeeded" }).waitFor({ timeout: 60_000 });
  await page.getByRole("img", { name: /^pattern/ }).scrollIntoViewIfNeeded();
  await page.waitForFunction(() => [...document.querySelectorAll("img.whole")].every((image) => image.naturalWidth > 0));
  return { page, job: await server.get(name) };
}

test("errors and phases have colours with bars, and the user chooses them", async () => {
  const { page } = await openHologram({});
  const error = page.pictures.find(({ minus }) => minus === target);
  assert.deepEqual([error.minus_fit, error.colormap, error.range], ["contain", "diverging", "0.2"]);
  assert.ok(page.pictures.some(({ colormap, encoding }) => colormap === "cyclic" && encoding === "linear"), "phases are cyclic");
  await page.getByText("+0.2", { exact: true }).waitFor();
  await page.getByLabel("Error up to").selectOption("±5 %");
  await page.getByText("+0.05", { exact: true }).waitFor();
  await page.getByLabel("Light as").selectOption("colours, 3 decades");
  await page.getByText("light, logarithmic").first().waitFor();
  assert.equal(page.pictures.filter(({ log }) => log === "3").length, 2, "target and reconstruction");
  await page.waitForFunction(() => [...document.querySelectorAll(".bar img")].every((image) => image.naturalWidth === 256));
  assert.deepEqual(page.problems, []);
});

test("a line shows the light of target and reconstruction", async () => {
  const { page } = await openHologram({});
  await page.getByLabel("Line profile").selectOption("horizontal");
  const plot = page.locator(".profile .u-over");
  await plot.scrollIntoViewIfNeeded();
  const { width, height } = await plot.boundingBox();
  const light = async (column, row) => {
    await plot.hover({ position: { x: (width * column) / 159, y: height / 2 } });
    const line = page.locator(".profile .u-series", { hasText: row });
    return Number(await line.locator(".u-value").textContent());
  };
  // The square is white between the columns 40 and 100.
  assert.deepEqual([await light(20, "target"), await light(70, "target"), await light(120, "target")], [0, 1, 0]);
  assert.ok(await light(70, "reconstruction") > 0.7 && await light(120, "reconstruction") < 0.3);
  await page.getByLabel("Position of the line").fill("0.15");
  await page.getByText("at row 14").waitFor();
  assert.equal(await light(70, "target"), 0, "above the square");
  assert.deepEqual(page.problems, []);
});

test("a photograph of the hologram is shown beside it, scaled in the profile", async () => {
  const first = await openHologram({ seed: 7 });
  const { pattern } = first.job.result.optimizeHologram.wavelengths[0].subframes[0];
  const capture = await server.post("jobs", { spec: { simulateCapture: { display: "displays/demo", place: { distanceM: 0.015 }, pattern } } });
  const { page } = first;
  await page.goto(`${server.url}/#/${capture.name}`);
  await page.getByRole("heading", { level: 1, name: "simulate capture succeeded" }).waitFor();
  await page.goto(`${server.url}/#/${first.job.name}`);
  await page.getByRole("img", { name: /^photograph/ }).waitFor();
  await page.getByLabel("Line profile").selectOption("vertical");
  await page.getByText(/photograph 15 mm × \d/).waitFor();
  assert.deepEqual(page.problems, []);
});

test("the propagation with its reason, and the origin of the kernel", async () => {
  const { page, job } = await openHologram({});
  const { propagation } = job.result.optimizeHologram.wavelengths[0].planes[0];
  await page.getByText(propagation.explanation).waitFor();
  await page.getByRole("region", { name: /critical distance/ }).getByText("band response").waitFor();
  const origin = page.getByRole("region", { name: "Kernels, and what they were learned from" });
  const version = await server.get(job.kernels[0].kernelVersion);
  await origin.getByRole("link", { name: `version ${version.version}` }).waitFor();
  await origin.getByText(version.lineage.codeVersion).waitFor();
  assert.deepEqual(page.problems, []);
});

test("files come byte for byte, the region is drawn, and the hologram can be made again and changed", async () => {
  const fields = { planes: [{ place: { distanceM: 0.0151 }, target }], iterations: 3, seed: "12345678901234567890", region: { xPx: 16, yPx: 24, widthPx: 80, heightPx: 48 },
    initialPhase: { random: { rangeRad: 0.5 } }, loss: { speckle: 0.01 }, targetFit: "FIT_COVER", method: "HOLOGRAM_METHOD_ADAM", learningRate: 0.25, kernel: { ideal: {} }, quantizationAware: true };
  const { page, job } = await openHologram(fields);
  const [{ subframes, planes }] = job.result.optimizeHologram.wavelengths;
  const wanted = { "Pattern for the SLM": subframes[0].pattern, Phase: subframes[0].phase, Reconstruction: planes[0].reconstruction, Target: target };
  for (const [title, digest] of Object.entries(wanted)) {
    const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name: `Download ${title}`, exact: true }).click()]);
    const found = createHash("sha256").update(readFileSync(await download.path())).digest("hex");
    assert.equal(`sha256-${found}`, digest, title);
  }
  await page.getByText(/reconstruction 15.1 mm, 160 × 96 px, shown at \d+ %/).waitFor();
  const places = await page.evaluate(() => [...document.querySelectorAll(".pictures .region")].map(({ style }) => [style.left, style.top, style.width, style.height].join()));
  assert.deepEqual(places, Array(3).fill("10%,25%,50%,50%"), "target, reconstruction and error");
  await page.getByLabel(/light that the picture does not need/).uncheck();
  assert.equal(await page.locator(".pictures .region:visible").count(), 0);
  // The shown commands are those of a shell: they fetch the target, and submit the same request.
  const folder = mkdtempSync(join(tmpdir(), "lightpath-again-"));
  const path = `${resolve(process.env.LIGHTPATH_BINARIES)}:${process.env.PATH}`;
  const commands = await page.locator("details", { hasText: "On the command line" }).locator("code").textContent();
  execFileSync("bash", ["-ec", commands], { cwd: folder, env: { ...process.env, PATH: path }, stdio: "ignore" });
  assert.deepEqual(readdirSync(folder).sort(), ["hologram.png", "target"]);
  rmSync(folder, { recursive: true });
  const latest = async () => (await server.get("jobs?kind=optimize_hologram&pageSize=1")).jobs[0];
  const again = await latest();
  assert.notEqual(again.name, job.name);
  assert.deepEqual(again.spec, job.spec);
  await page.getByRole("link", { name: "Change it…" }).click();
  await page.getByText(/MB of memory/).waitFor();
  await page.getByRole("button", { name: "Make the hologram" }).click();
  await page.waitForURL((url) => url.hash.startsWith("#/jobs/") && !url.hash.endsWith(job.name));
  assert.deepEqual((await latest()).spec, job.spec, "the form takes over every field");
  assert.deepEqual(page.problems, []);
});

test("large pictures come at the shown size, and their parts in detail when they are enlarged", async () => {
  await server.post("displays", { name: "displays/large", modulator: { widthPx: 800, heightPx: 450, pixelPitchXM: 8e-6 }, wavelengthsM: [5.15e-7] });
  const { page } = await openHologram({ display: "displays/large", planes: [{ place: { distanceM: 0.05 }, target }], method: "HOLOGRAM_METHOD_DOUBLE_PHASE", iterations: 1 });
  const widths = await page.evaluate(() => [...document.querySelectorAll("img.whole")].map((image) => image.naturalWidth));
  assert.ok(widths.every((width) => width <= 640), `${widths} px are more than the page shows`);
  assert.ok(page.pictures.every(({ width, region }) => width && !region));
  const figure = page.locator("figure", { has: page.getByRole("img", { name: /^reconstruction/ }) });
  await figure.focus();
  for (let i = 0; i < 8; i += 1) await page.keyboard.press("+");
  await page.waitForFunction(() => [...document.querySelectorAll("img.detail:not([hidden])")].filter((image) => image.naturalWidth > 0).length === 3);
  // 1.5^8 = 25.6 times: 800 / 25.6 columns are in sight.
  const detail = await figure.locator("img.detail").evaluate((image) => image.naturalWidth);
  assert.ok(detail >= 31 && detail <= 33, `${detail} columns`);
  await page.getByRole("button", { name: "Whole picture" }).click();
  assert.match(await figure.locator(".sheet").evaluate((sheet) => sheet.style.transform), /scale\(1\)/);
  assert.deepEqual(page.problems, []);
});

test("a running hologram shows what it has reached, on its page and on the overview", async () => {
  const spec = { optimizeHologram: { display: "displays/demo", planes: [{ place: { distanceM: 0.015 }, target }], iterations: 10_000, subframes: 8 } };
  const { name } = await server.post("jobs", { spec });
  const page = await openPage(browser, server.url);
  const sizes = async () => (await page.waitForFunction(() => {
    const image = document.querySelector(".live-picture:not([hidden]) img");
    return image?.naturalWidth > 0 && [image.naturalWidth, image.naturalHeight];
  })).jsonValue();
  await page.goto(`${server.url}/#/${name}`);
  assert.deepEqual(await sizes(), [160, 96]);
  const first = await page.locator(".live-picture img").getAttribute("src");
  await page.waitForFunction((src) => document.querySelector(".live-picture img").src !== src, first);
  await page.goto(`${server.url}/#/`);
  assert.deepEqual(await sizes(), [160, 96]);
  await server.post(`${name}:cancel`, {});
  await page.getByText("No job runs now.").waitFor();
  assert.equal(await page.locator(".live-picture").count(), 0);
  assert.deepEqual(page.problems, []);
});
