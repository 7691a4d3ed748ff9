// Each page at three widths, in light and dark: it fits, nothing fails, and axe-core finds nothing serious.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { after, before, test } from "node:test";
import { openPage, startBrowser } from "./browser.mjs";
import { startServer } from "./server.mjs";

const AXE = readFileSync(new URL("./node_modules/axe-core/axe.min.js", import.meta.url), "utf8");
let browser, server, addresses;

before(async () => {
  browser = await startBrowser();
  server = await startServer();
  const { summaries } = await server.get("jobs?view=basic&pageSize=200");
  const { kernels } = await server.get("displays/demo/kernels");
  const job = (kind) => summaries.find((summary) => summary.kind === kind).name;
  const holograms = summaries.filter(({ kind }) => kind === "KIND_OPTIMIZE_HOLOGRAM").map(({ name }) => name.split("/")[1]);
  addresses = [
    ["overview", "/", "Overview"],
    ["jobs", "/jobs?state=succeeded", "Jobs"],
    ["jobs as a table", "/jobs?view=table", "Jobs"],
    ["wall", "/wall", "Lightpath"],
    ["hologram", `/${job("KIND_OPTIMIZE_HOLOGRAM")}`, "optimize hologram"],
    ["learning", `/${job("KIND_LEARN_KERNEL")}`, "learn kernel"],
    ["photograph", `/${job("KIND_SIMULATE_CAPTURE")}`, "simulate capture"],
    ["displays", "/displays", "Displays"],
    ["display", "/displays/demo", "demo"],
    ["kernel", `/${kernels[0].name}`, kernels[0].name.split("/").pop()],
    ["datasets", "/datasets", "Datasets"],
    ["dataset", "/datasets/demo-photographs", "demo-photographs"],
    ["comparison", `/compare?jobs=${holograms[0]},${holograms[1]}`, "Compare two jobs"],
    ["new hologram", "/new", "New hologram"],
    ["API", "/api", "The API over HTTP"],
    ["an unknown job", "/jobs/none", null],
    ["an unknown page", "/nowhere", "This page does not exist"],
  ];
});
after(async () => {
  await browser?.close();
  await server?.stop();
});

for (const scheme of ["dark", "light"]) {
  for (const width of [390, 1280, 2560]) {
    test(`pages at ${width} px, ${scheme}`, async () => {
      const page = await openPage(browser, server.url, { width, scheme });
      for (const [name, address, heading] of addresses) {
        await page.goto(`${server.url}/#${address}`);
        if (heading) await page.getByRole("heading", { level: 1, name: heading }).waitFor();
        else await page.getByRole("alert").waitFor();
        await page.waitForFunction(() => document.querySelector("#connection").textContent === "live");
        if (["overview", "displays", "display"].includes(name)) await page.getByText("simulated", { exact: true }).waitFor();
        if (name === "hologram") await page.waitForFunction(() => [...document.images].every((image) => image.complete));
        if (name === "new hologram") await page.getByText("More options").click();
        const overflow = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
        assert.ok(overflow <= 0, `${name} is ${overflow} px too wide`);
        await page.evaluate(AXE);
        const violations = await page.evaluate(() => axe.run().then((result) => result.violations
          .filter(({ impact }) => impact === "serious" || impact === "critical")
          .map(({ id, nodes }) => `${id}: ${nodes[0].html}`)));
        assert.deepEqual(violations, [], name);
      }
      assert.deepEqual(page.problems.filter((problem) => !problem.includes("404")), []);
      await page.context().close();
    });
  }
}
