// Who may do what: signing in, a viewer's limits, and requests forged by a page of another site.

import assert from "node:assert/strict";
import { createServer } from "node:http";
import { after, before, test } from "node:test";
import { dropSquare, openPage, startBrowser } from "./browser.mjs";
import { createToken, startServer } from "./server.mjs";

let browser, guarded, open;
before(async () => {
  browser = await startBrowser();
  // A server that requires tokens starts only if it has one.
  guarded = await startServer({ flags: ["--require-tokens"], prepare: (dataDir) => createToken(dataDir, "root", "admin") });
  open = await startServer();
});
after(async () => {
  await browser?.close();
  await Promise.all([guarded?.stop(), open?.stop()]);
});

test("the page asks for a token, refuses a wrong one, and forgets it on reload", async () => {
  const page = await openPage(browser, guarded.url);
  await page.goto(`${guarded.url}/#/jobs`);
  await page.getByRole("heading", { name: "Sign in" }).waitFor();
  await page.getByLabel("Token").fill("wrong");
  await page.getByRole("button", { name: "Sign in" }).click();
  await page.getByText("The server did not accept this token.").waitFor();
  await page.getByLabel("Token").fill(createToken(guarded.dataDir, "wall", "viewer"));
  await page.getByRole("button", { name: "Sign in" }).click();
  await page.getByRole("heading", { name: "Jobs" }).waitFor();
  await page.locator(".shot").first().waitFor();
  assert.equal(await page.evaluate(() => JSON.stringify([{ ...localStorage }, { ...sessionStorage }, document.cookie])), '[{},{},""]');
  await page.reload();
  await page.getByRole("heading", { name: "Sign in" }).waitFor();
  assert.deepEqual(page.problems.filter((problem) => !problem.includes("401")), []);
});

test("a viewer is offered nothing that the server would refuse", async () => {
  const page = await openPage(browser, guarded.url);
  await page.goto(`${guarded.url}/`);
  const token = createToken(guarded.dataDir, "desk", "viewer");
  await page.getByLabel("Token").fill(token);
  await page.getByRole("button", { name: "Sign in" }).click();
  await page.getByRole("link", { name: "Displays", exact: true }).click();
  await page.getByRole("link", { name: "demo" }).click();
  await page.getByRole("link", { name: /nm-/ }).click();
  const promote = page.getByRole("button", { name: "Promote 2", disabled: true });
  assert.equal(await promote.getAttribute("title"), "Your token has the role viewer; this needs the role curator or admin.");
  const offered = () => page.getByRole("button", { name: /^(Promote|Roll back|Make|Cancel|Retry)/, disabled: false }).count();
  assert.equal(await offered(), 0);
  assert.equal(await page.getByRole("link", { name: "New hologram" }).count(), 0);
  await dropSquare(page);
  await page.getByText("Your token has the role viewer; this needs the role submitter, curator or admin.").waitFor();
  assert.equal(await offered(), 0);
  const listed = await fetch(`${guarded.url}/v1/jobs?view=basic&kind=optimize_hologram`, { headers: { authorization: `Bearer ${token}` } });
  const { summaries: [{ name }] } = await listed.json();
  await page.goto(`${guarded.url}/#/${name}`);
  await page.getByText("On the command line").waitFor();
  assert.equal(await page.getByRole("link", { name: "Change it…" }).count(), 0);
  assert.deepEqual(page.problems.filter((problem) => !problem.includes("401")), []);
});

test("a page of another site can neither change nor read anything", async () => {
  const site = createServer((_, response) => response.setHeader("content-type", "text/html").end("<title>another site</title>"));
  await new Promise((ready) => site.listen(0, "127.0.0.1", ready));
  const context = await browser.newContext();
  const page = await context.newPage();
  await page.goto(`http://127.0.0.1:${site.address().port}/`);
  const answers = await page.evaluate(async (url) => {
    const attempts = [
      ["/v1/queue:pause", { method: "POST", body: "{}", mode: "no-cors" }],
      ["/v1/queue:pause", { method: "POST", body: '{"reason":"forged"}', headers: { "content-type": "application/json" } }],
      ["/v1/jobs", {}],
      ["/v1/events", {}],
    ];
    return Promise.all(attempts.map(([path, options]) => fetch(url + path, options).then((answer) => answer.type, () => "refused")));
  }, open.url);
  assert.deepEqual(answers, ["opaque", "refused", "refused", "refused"]);
  await page.setContent(`<iframe src="${open.url}/"></iframe>`);
  await page.waitForTimeout(500);
  assert.match(page.frames()[1].url(), /^chrome-error:/, "the page must not be shown in a frame");
  assert.deepEqual((await open.get("queue")).pauses, []);
  await context.close();
  site.close();
});
