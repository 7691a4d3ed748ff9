// What users do: make a hologram from a dropped picture, promote and roll back, cancel, look at the gallery, at a sweep and at
// the wall, and keep the page open through a restart of the server.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { dropSquare, openPage, startBrowser } from "./browser.mjs";
import { startServer } from "./server.mjs";

let browser, server;
before(async () => {
  browser = await startBrowser();
  server = await startServer();
});
after(async () => {
  await browser?.close();
  await server?.stop();
});

test("a dropped picture becomes a hologram, and its job is seen to finish", async () => {
  const page = await openPage(browser, server.url);
  await page.goto(`${server.url}/`);
  await page.getByRole("heading", { name: "Overview" }).waitFor();
  await dropSquare(page);
  await page.getByText("square.png").waitFor();
  await page.getByLabel("Iterations").fill("30");
  await page.getByRole("button", { name: "Make the hologram" }).click();
  await page.getByRole("heading", { level: 1, name: "optimize hologram succeeded" }).waitFor();
  await page.getByText(/^square\.png, .*, submitted/).waitFor();
  await page.getByRole("img", { name: /^reconstruction/ }).waitFor();
  const shown = await page.waitForFunction(() => {
    const images = [...document.querySelectorAll(".pictures img.whole")];
    return images.length === 4 && images.every((image) => image.naturalWidth > 0) && images.map((image) => [image.naturalWidth, image.naturalHeight]);
  });
  assert.deepEqual(await shown.jsonValue(), [[160, 96], [160, 96], [160, 96], [160, 96]]);
  await page.getByLabel("How pictures are compared").selectOption("wipe");
  await page.getByLabel("Position of the wipe").fill("25");
  assert.match(await page.locator(".pictures .window").nth(1).evaluate((element) => element.style.clipPath), /25%/);
  assert.deepEqual(page.problems, []);
});

test("several dropped pictures become a hologram each, and a wrong value is named at its field", async () => {
  // A small display without kernels, so that nothing else judges the holograms.
  await server.post("displays", { name: "displays/small", modulator: { widthPx: 64, heightPx: 48, pixelPitchXM: 8e-6 }, wavelengthsM: [5.15e-7] });
  const page = await openPage(browser, server.url);
  await page.goto(`${server.url}/#/new`);
  await page.getByLabel("Display", { exact: true }).selectOption("small");
  await dropSquare(page, ["near.png", "far.png"]);
  await page.getByText("2 pictures: a hologram of each.").waitFor();
  assert.doesNotMatch(await page.locator("form").innerText(), /no file/i);
  await page.getByText(/for each of 2 holograms and .* of memory/).waitFor();
  await page.getByLabel("Iterations").fill("2");
  await page.getByLabel("Subframes").fill("0");
  await page.getByText("Is 0; must be 1 to 24; leave it out for the default 1.").waitFor();
  assert.equal(await page.getByLabel("Subframes").getAttribute("aria-invalid"), "true");
  await page.getByLabel("Subframes").fill("2");
  await page.getByText(/of memory/).waitFor();
  await page.getByRole("button", { name: "Make 2 holograms" }).click();
  await page.getByText(/^2 of 2 are done/).waitFor({ timeout: 60_000 });
  await page.getByRole("row", { name: /near\.png/ }).getByText("succeeded").waitFor();
  const batch = await page.getByRole("link", { name: /^pictures 2/ }).first().textContent();
  const { jobs } = await server.get(`jobs?batch=${encodeURIComponent(batch)}`);
  assert.deepEqual(jobs.map(({ label, spec: { optimizeHologram: { iterations, subframes } } }) => [label, iterations, subframes]), [["far.png", 2, 2], ["near.png", 2, 2]]);
  assert.notEqual(jobs[0].spec.optimizeHologram.planes[0].target, jobs[1].spec.optimizeHologram.planes[0].target);
  assert.deepEqual(page.problems.filter((problem) => !problem.includes("400")), []);
});

test("colours, distances and a map of depths go into one request", async () => {
  await server.post("displays", { name: "displays/colours", modulator: { widthPx: 160, heightPx: 96, pixelPitchXM: 8e-6 }, wavelengthsM: [6.38e-7, 5.2e-7, 4.5e-7] });
  const page = await openPage(browser, server.url);
  await page.goto(`${server.url}/#/new`);
  await page.getByLabel("Display", { exact: true }).selectOption("colours");
  for (const colour of ["520 nm", "638 nm"]) await page.getByLabel(colour).check();
  await page.getByRole("button", { name: "Add a distance" }).click();
  await page.getByLabel("Distance 1", { exact: true }).fill("140");
  await page.getByLabel("Distance 2", { exact: true }).fill("-12.7");
  const posted = async () => {
    const [request] = await Promise.all([page.waitForRequest(/jobs:estimate$/), page.getByText(/of memory/).waitFor()]);
    return request.postDataJSON().spec.optimizeHologram;
  };
  await page.getByLabel("They show").selectOption("own");
  const [own] = await Promise.all([posted(), dropSquare(page, ["near.png", "far.png"])]);
  assert.deepEqual([own.wavelengthsM, own.planes.map(({ place }) => place.distanceM)], [[4.5e-7, 5.2e-7, 6.38e-7], [0.14, -0.0127]]);
  assert.notEqual(own.planes[0].target, own.planes[1].target);
  await page.getByLabel("They show").selectOption("depth");
  await dropSquare(page);
  await page.getByRole("button", { name: "Make the hologram" }).click();
  await page.getByText("The map is missing; choose it.").waitFor();
  const [depth] = await Promise.all([posted(), page.getByLabel("Choose the map…").setInputFiles({ name: "depth.png", mimeType: "image/png", buffer: await page.screenshot({ clip: { x: 0, y: 0, width: 160, height: 96 } }) })]);
  assert.match(depth.depthMap, /^sha256-/);
  assert.equal(depth.planes[0].target, depth.planes[1].target);
  assert.deepEqual(page.problems, []);
});

test("a picture is uploaded from a page that may not use the browser's cryptography, too", async () => {
  const page = await openPage(browser, server.url);
  await page.addInitScript(() => Object.defineProperty(crypto, "subtle", { value: undefined }));
  await page.goto(`${server.url}/`);
  await dropSquare(page);
  await page.getByText("square.png").waitFor();
  await page.getByLabel("Iterations").fill("2");
  await page.getByRole("button", { name: "Make the hologram" }).click();
  await page.getByRole("heading", { level: 1, name: "optimize hologram succeeded" }).waitFor();
  assert.deepEqual(page.problems, []);
});

test("a version is promoted with a reason and rolled back, and another open page sees it", async () => {
  const { kernels: [kernel] } = await server.get("displays/demo/kernels");
  const [page, other] = [await openPage(browser, server.url), await openPage(browser, server.url)];
  await page.goto(`${server.url}/#/${kernel.name}`);
  await other.goto(`${server.url}/#/${kernel.name}`);
  await other.getByText(`Version ${kernel.activeVersion} is active.`).waitFor();
  await page.getByRole("button", { name: "Promote 2" }).click();
  await page.getByText(/The promotion gate accepts/).waitFor();
  await page.getByLabel(/Reason/).fill("a test");
  await page.getByRole("dialog").getByRole("button", { name: "Promote" }).click();
  await other.getByText("Version 2 is active.").waitFor();
  assert.equal((await server.get(kernel.name)).activeVersion, 2);
  await page.getByRole("button", { name: "Roll back 2" }).click();
  await page.getByLabel(/Reason/).fill("the test is over");
  await page.getByRole("dialog").getByRole("button", { name: "Roll back" }).click();
  await other.getByText(`Version ${kernel.activeVersion} is active.`).waitFor();
  await other.getByText(/the test is over/).waitFor();
  assert.deepEqual([...page.problems, ...other.problems], []);
});

test("a gate that measured nothing says so, and does not look as if all were well", async () => {
  const { kernels: [kernel] } = await server.get("displays/demo/kernels");
  const page = await openPage(browser, server.url);
  await page.goto(`${server.url}/#/${kernel.name}`);
  await page.getByRole("button", { name: "Promote 3" }).click();
  await page.getByText("The promotion gate accepts this version, though it was not measured.").waitFor();
  const check = page.getByRole("dialog").getByRole("listitem").first();
  assert.match(await check.innerText(), /^Not measured: /);
  assert.equal(await check.getAttribute("class"), "unmeasured");
  assert.deepEqual(page.problems, []);
});

test("a click reaches a button whose table is drawn again while it is pressed", async () => {
  const { kernels: [kernel] } = await server.get("displays/demo/kernels");
  const page = await openPage(browser, server.url);
  await page.goto(`${server.url}/#/${kernel.name}`);
  const button = page.getByRole("button", { name: "Promote 2" });
  await button.hover();
  await page.mouse.down();
  await server.post(`${kernel.name}:setAlias`, { alias: "pressed", version: 2 });
  await page.getByText(/pressed: none → 2/).waitFor();
  await page.mouse.up();
  await page.getByRole("button", { name: "Cancel" }).click();
  await page.getByRole("row").getByText("pressed", { exact: true }).waitFor();
  assert.deepEqual(page.problems, []);
});

test("two versions are compared, and a report shows what was learned", async () => {
  const { kernels: [kernel] } = await server.get("displays/demo/kernels");
  const page = await openPage(browser, server.url);
  await page.goto(`${server.url}/#/${kernel.name}`);
  await page.getByLabel("First version").selectOption("version 1");
  await page.getByLabel("Second version").selectOption("version 2");
  await page.getByRole("button", { name: "Compare versions" }).click();
  const picture = page.getByRole("img", { name: "Amplitude and phase of versions 1 and 2" });
  await picture.waitFor();
  assert.ok(await picture.evaluate((image) => image.decode().then(() => image.naturalWidth > 100)));
  await page.getByRole("button", { name: "Report 1" }).click();
  await page.getByRole("heading", { name: "What version 1 learned" }).waitFor();
  for (const title of ["Amplitude and phase of the kernel, and of its ratio to the ideal one", "Contrast of stripes, over their spatial frequency"]) {
    const figure = page.getByRole("img", { name: title });
    await figure.waitFor({ timeout: 60_000 });
    await figure.scrollIntoViewIfNeeded();
    await figure.evaluate((image) => image.naturalWidth > 0 || new Promise((drawn) => image.addEventListener("load", drawn)));
  }
  assert.ok(await page.getByRole("img", { name: /^Point spread function/ }).isVisible());
  const origin = page.getByRole("region", { name: "Kernels, and what they were learned from" });
  assert.equal(await origin.getByRole("link", { name: "demo-photographs" }).count(), 2, "two of the versions were learned");
  assert.deepEqual(page.problems, []);
});

test("two chosen jobs are compared", async () => {
  const page = await openPage(browser, server.url);
  await page.goto(`${server.url}/#/jobs?kind=optimize_hologram&state=succeeded`);
  const photographed = page.locator(".shot", { hasText: "photographed" });
  await photographed.nth(1).waitFor();
  const [a, b] = await photographed.evaluateAll((cards) => cards.map((card) => card.dataset.job));
  await page.locator(`[data-job="${a}"]`).getByRole("checkbox").check();
  await page.getByText("Choose one more job").waitFor();
  await page.locator(`[data-job="${b}"]`).getByRole("checkbox").check();
  await page.getByRole("link", { name: "Compare the two chosen jobs" }).click();
  await page.getByText("Fields that differ").waitFor();
  await page.getByText("Both are judged by 515nm-15mm, version 1.").waitFor();
  const quality = page.getByRole("region", { name: "PSNR of the pictures" });
  for (const job of ["A", "B"]) assert.match(await quality.getByRole("row", { name: new RegExp(`^${job} `) }).innerText(), /15 mm\s+\d\d\.\d.* dB\s+\d\d\.\d dB/, "expected and photographed");
  assert.equal(await page.getByText("PSNR, supersampled").isVisible(), false, "models that cannot be compared are folded");
  // The target, and of each job the reconstruction and the photograph.
  await page.waitForFunction(() => [...document.querySelectorAll(".pictures img.whole")].filter((image) => image.naturalWidth > 0).length === 5);
  assert.deepEqual(page.problems, []);
});

test("a page that could not reach the server tries again by itself", async () => {
  const { summaries: [a, b] } = await server.get("jobs?view=basic&kind=optimize_hologram");
  const page = await openPage(browser, server.url);
  await page.route("**/v1/jobs/*", (route) => route.abort("connectionrefused"));
  await page.goto(`${server.url}/#/compare?jobs=${[a, b].map(({ name }) => name.split("/").at(-1)).join(",")}`);
  await page.getByText("The page tries again by itself.").waitFor();
  await page.unroute("**/v1/jobs/*");
  await page.getByText("Fields that differ").waitFor();
  assert.deepEqual(page.problems.filter((problem) => !/ERR_CONNECTION/.test(problem)), []);
});

test("a running job is watched through a restart of the server, and cancelled", async () => {
  const { summaries: [{ name }] } = await server.get("jobs?view=basic&kind=optimize_hologram");
  const { spec } = await server.get(name);
  spec.optimizeHologram.iterations = 10_000;
  spec.optimizeHologram.kernel = { ideal: {} };
  spec.optimizeHologram.subframes = 8;
  const job = await server.post("jobs", { spec, owner: "ada" });
  const page = await openPage(browser, server.url);
  await page.goto(`${server.url}/#/${job.name}`);
  await page.getByRole("progressbar").waitFor();
  await server.restart(() => page.getByText("connection lost").waitFor());
  await page.locator("#connection", { hasText: "live" }).waitFor();
  await page.getByRole("button", { name: "Cancel" }).click();
  await page.getByRole("heading", { level: 1, name: "optimize hologram cancelled" }).waitFor();
  assert.equal((await server.get(job.name)).state, "STATE_CANCELLED");
  await page.goto(`${server.url}/#/jobs?owner=ada&state=cancelled`);
  await page.getByRole("button", { name: /^Retry/ }).waitFor();
  assert.deepEqual(page.problems.filter((problem) => !/ERR_(CONNECTION|INCOMPLETE|EMPTY|SOCKET)/.test(problem)), []);
});

test("the API's page finds calls, and shows their parameters and answers", async () => {
  const page = await openPage(browser, server.url);
  await page.goto(`${server.url}/`);
  // By key: the footer moves while the overview loads, and a mouse that is released elsewhere than it was pressed does not
  // click.
  await page.getByRole("link", { name: "The API over HTTP" }).press("Enter");
  await page.getByText("GET /v1/jobs", { exact: true }).waitFor();
  assert.equal(await page.locator("details").count(), await page.evaluate(async () => {
    const { paths } = await (await fetch("/openapi.json")).json();
    return Object.values(paths).flatMap(Object.keys).length;
  }));
  await page.getByLabel("Calls that contain").fill("promote");
  await page.getByText(/^POST .*:promote$/).click();
  const body = page.getByRole("region", { name: "Body" });
  await body.getByText("expectedActiveVersion").waitFor();
  await page.getByRole("region", { name: "Answer" }).getByText("activeVersion").first().waitFor();
  await page.getByLabel("Calls that contain").fill("no such call");
  await page.getByText("No call contains this text.").waitFor();
  assert.deepEqual(page.problems, []);
});

/** What a photograph of a hologram's first picture is expected to show [dB]. */
const headlineOf = (job) => job.result.optimizeHologram.wavelengths[0].planes[0].judgements.find(({ headline }) => headline).psnrDb.value.toFixed(1);

test("the gallery shows holograms with their photographs, and the figure to believe", async () => {
  const page = await openPage(browser, server.url);
  const widths = [];
  page.on("request", (request) => {
    const url = new URL(request.url());
    if (/^\/v1\/artifacts\/.*\/picture$/.test(url.pathname)) widths.push(Number(url.searchParams.get("width")));
  });
  await page.goto(`${server.url}/#/jobs?kind=optimize_hologram`);
  const name = await page.locator(".shot", { hasText: "photographed" }).first().getAttribute("data-job");
  const card = page.locator(`[data-job="${name}"]`);
  const job = await server.get(name);
  const [expected, photographed] = (await card.locator(".figure strong").allInnerTexts()).map((text) => text.split(" ")[0]);
  assert.equal(expected, headlineOf(job));
  assert.ok(Math.abs(expected - photographed) < 2, `${expected} dB were expected, the photograph has ${photographed} dB`);
  await page.waitForFunction((name) => [...document.querySelectorAll(`[data-job="${name}"] img`)].filter((image) => image.naturalWidth > 0).length === 3, name);
  assert.ok(widths.length > 0 && Math.max(...widths) <= 256, `small pictures are enough: ${Math.max(...widths)} columns`);

  // A picture is dragged out as the file itself.
  const dragged = await card.getByRole("img", { name: /^reconstruction/ }).evaluate((image) => {
    const data = new DataTransfer();
    image.dispatchEvent(new DragEvent("dragstart", { dataTransfer: data, bubbles: true }));
    return data.getData("DownloadURL");
  });
  const [type, fileName, ...url] = dragged.split(":");
  assert.deepEqual([type, fileName.endsWith("-reconstruction.png")], ["image/png", true]);
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
  // A job of the demo, whose display has an active kernel.
  const { jobs: [{ spec }] } = await server.get("jobs?kind=optimize_hologram&display=displays/demo&order=oldest_first&pageSize=1");
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
  const saved = [];
  const both = new Promise((done) => page.on("download", (download) => saved.push(download.suggestedFilename()) === 2 && done()));
  await page.getByRole("button", { name: "Download the patterns of 2 holograms" }).click();
  await page.getByText("All are saved.").waitFor();
  await both;
  assert.deepEqual(saved, ["leaf-pattern.png", "2-leaf-pattern.png"]);
  await page.getByText("detector point").waitFor();
  await page.getByLabel("PSNR in a photograph over").selectOption("detector");
  await page.getByText("iterations 2").waitFor();
  assert.ok(page.url().includes("over=optimizeHologram.detector"));
  assert.deepEqual(page.problems, []);
});

test("a display is declared, and a hologram for it begins with all its colours", async () => {
  const page = await openPage(browser, server.url);
  await page.goto(`${server.url}/#/displays`);
  await page.getByText("Declare a display").click();
  await page.getByLabel("Name: a-z, 0-9 and -").fill("colours");
  await page.getByLabel("Width").fill("160");
  await page.getByLabel("Height").fill("96");
  await page.getByLabel("Pixel pitch").fill("8");
  await page.getByLabel("Wavelengths, separated by commas").fill("638, 520 and 450");
  await page.getByRole("button", { name: "Declare the display" }).click();
  await page.getByText("Has a part that is no number; write nanometres such as 638, 520, 450.").waitFor();
  await page.getByLabel("Wavelengths, separated by commas").fill("6380, 520, 450");
  await page.getByRole("button", { name: "Declare the display" }).click();
  await page.getByText(/^Is 0\.00000638; must be/).waitFor();
  await page.getByLabel("Wavelengths, separated by commas").fill("638, 520, 450");
  await page.getByRole("button", { name: "Declare the display" }).click();
  await page.getByRole("heading", { level: 1, name: "colours" }).waitFor();
  const { modulator, wavelengthsM } = await server.get("displays/colours");
  assert.deepEqual([modulator.pixelPitchXM, wavelengthsM], [8e-6, [450e-9, 520e-9, 638e-9]]);
  await page.goto(`${server.url}/#/new`);
  await page.getByLabel("Display", { exact: true }).selectOption("displays/colours");
  for (const colour of ["638 nm", "520 nm", "450 nm"]) assert.ok(await page.getByLabel(colour).isChecked(), colour);
  assert.deepEqual(page.problems.filter((problem) => !/400/.test(problem)), []);
});

test("the wall fits any screen, is readable from afar, and outlives a restart of the server", async () => {
  const page = await openPage(browser, server.url);
  await page.goto(`${server.url}/#/wall`);
  await page.getByText(/photographed$/).waitFor();
  await page.getByText("Nothing waits.").waitFor();
  await page.getByText(/^drift/).waitFor();
  for (const [width, height] of [[1920, 1080], [3840, 2160]]) {
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

  const { jobs: [{ spec }] } = await server.get("jobs?kind=optimize_hologram&pageSize=1");
  const optimizeHologram = { ...spec.optimizeHologram, iterations: 10_000, subframes: 8, kernel: { ideal: {} } };
  const stuck = await server.post("jobs", { spec: { optimizeHologram }, needs: ["gpu"] });
  await page.getByText("1 waits: no process has what it needs.").waitFor();
  await server.post(`${stuck.name}:cancel`, {});
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
  assert.deepEqual(page.problems.filter((problem) => !/ERR_(CONNECTION|INCOMPLETE|EMPTY|SOCKET)/.test(problem)), []);
});
