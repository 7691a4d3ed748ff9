// Measures what many open dashboards and many streams of events cost a server, for docs/load.md. Run it after
// `lightpathd demo`; it takes ten minutes for the streams and one for the dashboards:
//
//     LIGHTPATH_BINARIES=target/release LIGHTPATH_DEMO_DATA=lightpath-demo/data node tests/browser/measure_streams.mjs

import { readFileSync } from "node:fs";
import { connect } from "node:http2";
import { createToken, startServer } from "./server.mjs";

const STREAMS = Number(process.env.LIGHTPATH_STREAMS ?? 1000);
const STREAMS_S = Number(process.env.LIGHTPATH_STREAMS_S ?? 600);
const DASHBOARDS = 200;
const DASHBOARDS_S = 30;
/** A token may have 500 streams and 100 connections, and a connection 256 streams. */
const TOKENS = 10;
const STREAMS_PER_CONNECTION = 50;
/** Least time from one reading of the overview to the next, as in `overview.js` [ms]. */
const SPACING = 10_000;
const TICKS_PER_S = 100;

const rest = (ms) => new Promise((rested) => setTimeout(rested, ms));
const tokens = [];
const server = await startServer({
  flags: ["--calls-per-s-max", "0", "--require-tokens", "true", "--queue-limit", "100000"],
  prepare: (dataDir) => {
    for (let i = 0; i < TOKENS; i += 1) tokens.push(createToken(dataDir, `wall-${i}`, i ? "viewer" : "admin"));
  },
});

/** Processor time [s] and memory [MB] of the server so far. */
function used() {
  const [, fields] = readFileSync(`/proc/${server.pid}/stat`, "utf8").split(") ");
  const words = fields.split(" ");
  const kib = Number(readFileSync(`/proc/${server.pid}/status`, "utf8").match(/VmRSS:\s+(\d+)/)[1]);
  return { cpu: (Number(words[11]) + Number(words[12])) / TICKS_PER_S, mb: kib / 1000 };
}

/** What `seconds` cost the server, as a share of a core. */
async function cost(seconds, during = () => {}) {
  const [before, begin] = [used(), performance.now()];
  await during(seconds);
  await rest(Math.max(0, begin + seconds * 1000 - performance.now()));
  const took = (performance.now() - begin) / 1000;
  return { share: (used().cpu - before.cpu) / took, cpu: used().cpu - before.cpu };
}

const percent = (share) => `${(100 * share).toFixed(2)} % of a core`;
const authorization = (i) => `Bearer ${tokens[i % TOKENS]}`;

/** Connections of HTTP/2, as browsers have them with TLS. */
const sessions = Array.from({ length: Math.ceil(Math.max(STREAMS, DASHBOARDS) / STREAMS_PER_CONNECTION) }, () => connect(server.url));

/** Reads events, and calls `onEvent(kind)` for each. Returns its state. */
function stream(i, onEvent = () => {}) {
  const state = { isOpen: false, events: 0, end: () => call.close() };
  const call = sessions[Math.floor(i / STREAMS_PER_CONNECTION)].request({ ":path": "/v1/events", authorization: authorization(i), accept: "text/event-stream" });
  call.on("response", (headers) => (state.isOpen = headers[":status"] === 200));
  call.on("close", () => (state.isOpen = false));
  call.on("error", () => (state.isOpen = false));
  call.setEncoding("utf8");
  call.on("data", (text) => {
    for (const [, kind] of text.matchAll(/^event: (.*)$/gm)) {
      state.events += 1;
      onEvent(kind);
    }
  });
  return state;
}

/** Asks as the page does: with the ETag of the last answer. */
function reader(i) {
  const etags = new Map();
  return (path) => new Promise((answered) => {
    const headers = { ":path": `/v1/${path}`, authorization: authorization(i), "accept-encoding": "gzip" };
    if (etags.has(path)) headers["if-none-match"] = etags.get(path);
    const call = sessions[Math.floor(i / STREAMS_PER_CONNECTION)].request(headers);
    call.on("response", (answer) => answer.etag && etags.set(path, answer.etag));
    call.on("data", () => {});
    call.on("close", answered);
  });
}

/** The overview of the page: its stream, and what it reads after events. */
function dashboard(i) {
  const read = reader(i);
  const overview = () => Promise.all(["queue", "jobs?view=basic&state=running&pageSize=20", "jobs?view=basic&state=failed&pageSize=50", "jobs?view=basic&pageSize=12"].map(read));
  let [timer, lastStart] = [0, 0];
  const state = stream(i, () => {
    timer ||= setTimeout(() => {
      [timer, lastStart] = [0, Date.now()];
      void overview();
    }, Math.max(0, lastStart + SPACING - Date.now()));
  });
  return state;
}

const admin = { authorization: authorization(0), "content-type": "application/json" };
const post = async (path, message) => (await fetch(`${server.url}/v1/${path}`, { method: "POST", headers: admin, body: JSON.stringify(message) })).json();
await post("queue:pause", { reason: "a measurement" });
const { jobs: [{ spec }] } = await (await fetch(`${server.url}/v1/jobs?kind=simulate_capture&pageSize=1`, { headers: admin })).json();

/** Submits a job every `pause` seconds. */
const submits = (pause) => async (seconds) => {
  for (let t = 0; t < seconds; t += pause) {
    const begin = Date.now();
    await post("jobs", { spec });
    await rest(begin + pause * 1000 - Date.now());
  }
};

await rest(2000);
console.log(`no dashboard: ${percent((await cost(10)).share)}`);
const dashboards = Array.from({ length: DASHBOARDS }, (_, i) => dashboard(i));
await rest(4000);
console.log(`${dashboards.filter(({ isOpen }) => isOpen).length} dashboards, nothing changes: ${percent((await cost(DASHBOARDS_S)).share)}`);
console.log(`${DASHBOARDS} dashboards, a job every 5 s: ${percent((await cost(DASHBOARDS_S, submits(5))).share)}`);
console.log(`${DASHBOARDS} dashboards, a job every second: ${percent((await cost(DASHBOARDS_S, submits(1))).share)}`);
dashboards.forEach(({ end }) => end());
await rest(2000);

const before = used().mb;
const streams = Array.from({ length: STREAMS }, (_, i) => stream(i));
await rest(4000);
const open = used().mb;
const { share, cpu } = await cost(STREAMS_S, submits(1));
const received = streams.reduce((sum, { events }) => sum + events, 0);
console.log(`${streams.filter(({ isOpen }) => isOpen).length} of ${STREAMS} streams are open after ${STREAMS_S} s, with an event every second: ${percent(share)}, ${(1e6 * cpu / received).toFixed(0)} µs for each event of each stream`);
console.log(`memory: ${before.toFixed(0)} MB before, ${open.toFixed(0)} MB with all streams, ${used().mb.toFixed(0)} MB at the end; each stream got ${Math.min(...streams.map(({ events }) => events))} to ${Math.max(...streams.map(({ events }) => events))} events`);
sessions.forEach((session) => session.destroy());
await server.stop();
