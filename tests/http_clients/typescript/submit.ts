// Submits a hologram with the client that was generated from the OpenAPI document, follows it by its events, and downloads its
// pattern.
//
// Usage: node submit.js URL TARGET

import assert from "node:assert/strict";
import { createHash } from "node:crypto";
import { readFileSync } from "node:fs";
import createClient from "openapi-fetch";
import type { components, paths } from "./lightpath.js";

type Job = components["schemas"]["Job"];
type Request = components["schemas"]["SubmitJobRequest"];

const WAIT_MS = 60_000;
const [url, picture] = process.argv.slice(2);
assert(url && picture);
const client = createClient<paths>({ baseUrl: url, signal: AbortSignal.timeout(WAIT_MS) });

/** The data of an answer that is no refusal. */
function accepted<T>({ data, error }: { data?: T; error?: unknown }): T {
  if (data === undefined) throw new Error(`refused: ${JSON.stringify(error)}`);
  return data;
}

function request(target: string, iterations: number): Request {
  const planes = [{ place: { distanceM: 0.02 }, target }];
  return { spec: { optimizeHologram: { display: "displays/typescript", planes, iterations } } };
}

/** The last state of a job, from its server-sent events. */
async function ended(name: string): Promise<Job> {
  const job = name.replace("jobs/", "");
  const { response } = await client.GET("/v1/jobs/{job}:watch", { params: { path: { job } }, parseAs: "stream" });
  assert.equal(response.status, 200);
  const events = (await response.text()).split("\n\n").filter((event) => event.startsWith("event: message"));
  const data = events.at(-1)?.split("\n").find((line) => line.startsWith("data: "));
  assert(data);
  return JSON.parse(data.slice("data: ".length)) as Job;
}

const display = { name: "displays/typescript", modulator: { widthPx: 96, heightPx: 64, pixelPitchXM: 8e-6 }, wavelengthsM: [515e-9] };
accepted(await client.POST("/v1/displays", { body: display }));
const target = accepted(await client.POST("/v1/artifacts", {
  // The generated type of bytes is a text.
  body: "",
  bodySerializer: () => readFileSync(picture),
  headers: { "content-type": "application/octet-stream" },
}));

const refused = await client.POST("/v1/jobs", { body: request(target.digest, 20_000) });
assert.equal(refused.error?.reason, "INVALID_FIELD");
assert.deepEqual(refused.error.fields.map(({ problem, fix }) => [problem, fix]), [["is 20000", "must be 1 to 10000"]]);

const params = { header: { "Idempotency-Key": "typescript-1" } };
const submit = async () => accepted(await client.POST("/v1/jobs", { body: request(target.digest, 5), params }));
const submitted = await submit();
assert.equal((await submit()).name, submitted.name);
const job = await ended(submitted.name);
assert.equal(job.state, "STATE_SUCCEEDED");
const digest = job.result?.optimizeHologram?.wavelengths[0]?.subframes[0]?.pattern;
assert(digest);
const pattern = accepted(await client.GET("/v1/artifacts/{digest}/content", {
  params: { path: { digest } },
  parseAs: "arrayBuffer",
}));
const found = `sha256-${createHash("sha256").update(new Uint8Array(pattern)).digest("hex")}`;
assert.equal(found, digest);
console.log(`TypeScript: ${job.name} made ${digest}`);
