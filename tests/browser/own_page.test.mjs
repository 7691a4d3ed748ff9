// A page of one's own on another host: the server allows its origin, and its list of jobs is live.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { createServer } from "node:http";
import { after, before, test } from "node:test";
import { openPage, startBrowser } from "./browser.mjs";
import { startServer } from "./server.mjs";

const PAGE = readFileSync(new URL("../../docs/dashboard-of-your-own.html", import.meta.url));
let browser, server, site, origin;

before(async () => {
  site = createServer((_, response) => response.setHeader("content-type", "text/html").end(PAGE));
  await new Promise((ready) => site.listen(0, "127.0.0.1", ready));
  origin = `http://127.0.0.1:${site.address().port}`;
  browser = await startBrowser();
  server = await startServer({ flags: ["--cors-origins", origin] });
});
after(async () => {
  await browser?.close();
  await server?.stop();
  site?.close();
});

test("the page of docs/dashboard.md lists jobs and follows them", async () => {
  const page = await openPage(browser, origin);
  await page.goto(`${origin}/?server=${server.url}`);
  await page.getByText("live").waitFor();
  const { summaries } = await server.get("jobs?view=basic&pageSize=200");
  assert.equal(await page.locator("tr").count(), Math.min(20, summaries.length));
  const { jobs: [{ spec }] } = await server.get("jobs?kind=optimize_hologram&pageSize=1");
  Object.assign(spec.optimizeHologram, { iterations: 10_000, subframes: 8 });
  const { name } = await server.post("jobs", { spec });
  await page.locator("tr", { hasText: /^KIND_OPTIMIZE_HOLOGRAMSTATE_RUNNING\d+ of 10000$/ }).waitFor();
  await server.post(`${name}:cancel`, {});
  await page.locator("tr", { hasText: /^KIND_OPTIMIZE_HOLOGRAMSTATE_CANCELLED$/ }).waitFor();
  assert.deepEqual(page.problems.filter((problem) => !problem.startsWith(`a request to ${server.url}/v1/`)), []);
});

test("a server without this origin refuses the page", async () => {
  const strict = await startServer();
  const page = await openPage(browser, origin);
  await page.goto(`${origin}/?server=${strict.url}`);
  await page.getByText("no connection").waitFor();
  assert.equal(await page.locator("tr").count(), 0);
  await strict.stop();
});

test("the page can call methods of the gRPC API by gRPC-Web", async () => {
  const page = await openPage(browser, origin);
  await page.goto(`${origin}/?server=${server.url}`);
  const { type, bytes } = await page.evaluate(async (url) => {
    // GetDisplayRequest { name: "displays/demo" } in a frame of gRPC.
    const name = new TextEncoder().encode("displays/demo");
    const body = new Uint8Array([0, 0, 0, 0, name.length + 2, 10, name.length, ...name]);
    const headers = { "content-type": "application/grpc-web+proto", "x-grpc-web": "1" };
    const answer = await fetch(`${url}/lightpath.v1.DisplayService/GetDisplay`, { method: "POST", headers, body });
    return { type: answer.headers.get("content-type"), bytes: [...new Uint8Array(await answer.arrayBuffer())] };
  }, server.url);
  assert.equal(type, "application/grpc-web+proto");
  const size = new DataView(Uint8Array.from(bytes).buffer).getUint32(1);
  assert.match(String.fromCharCode(...bytes.slice(5, 5 + size)), /displays\/demo/);
  assert.equal(bytes[5 + size], 128, "trailers follow the message");
  assert.match(String.fromCharCode(...bytes.slice(10 + size)), /grpc-status:0/);
});
