// The stream of events: one for the whole page. It comes back after a lost connection, and names the last event that it
// received, so that none is missed.

import { ApiError, request } from "./api.js";

/** The server sends something every 15 s, so a longer silence is a lost connection [ms]. */
const SILENCE_MAX = 40_000;
const PAUSE_MIN = 500;
const PAUSE_MAX = 15_000;

const listeners = new Set();
const states = new Set();
let lastId = "";
let abort = null;
let running = false;
/** Whether events come; `null`: it is not known yet. */
let connected = null;

/** Calls `listener(kind, data)` for each event. Returns a function that ends this. */
export function onEvent(listener) {
  listeners.add(listener);
  return () => listeners.delete(listener);
}

/** Calls `listener(isConnected)` now, if it is known, and at every change. Returns a function that ends this. */
export function onConnection(listener) {
  states.add(listener);
  if (connected !== null) listener(connected);
  return () => states.delete(listener);
}

/** Follows the events until `stop`. A hidden page does not follow them, and comes back to what it missed. */
export function start() {
  if (running) return;
  running = true;
  void follow();
}

export function stop() {
  running = false;
  connected = null;
  lastId = "";
  abort?.abort();
}

document.addEventListener("visibilitychange", () => {
  if (running) abort?.abort();
});

function tell(isConnected) {
  connected = isConnected;
  for (const listener of states) listener(isConnected);
}

async function follow() {
  let pause = PAUSE_MIN;
  while (running) {
    if (document.hidden) {
      await new Promise((shown) => document.addEventListener("visibilitychange", shown, { once: true }));
      continue;
    }
    try {
      await receive(() => (pause = PAUSE_MIN));
    } catch (error) {
      if (error instanceof ApiError && (error.status === 401 || error.status === 403)) return stop();
    }
    if (!running || document.hidden) continue;
    tell(false);
    await new Promise((ended) => setTimeout(ended, pause * (0.5 + Math.random())));
    pause = Math.min(pause * 2, PAUSE_MAX);
  }
}

async function receive(onData) {
  abort = new AbortController();
  let timer = 0;
  const alive = () => {
    clearTimeout(timer);
    timer = setTimeout(() => abort.abort(), SILENCE_MAX);
  };
  try {
    alive();
    const headers = lastId ? { "last-event-id": lastId } : {};
    const response = await request("/v1/events", { headers, signal: abort.signal });
    tell(true);
    const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
    let text = "";
    for (;;) {
      const { value, done } = await reader.read();
      if (done) return;
      alive();
      onData();
      const parts = (text + value).split("\n\n");
      text = parts.pop();
      parts.forEach(handle);
    }
  } finally {
    clearTimeout(timer);
  }
}

function handle(part) {
  const fields = {};
  for (const line of part.split("\n")) {
    const colon = line.indexOf(": ");
    if (colon > 0) fields[line.slice(0, colon)] = line.slice(colon + 2);
  }
  if (fields.id) lastId = fields.id;
  if (fields.event && fields.data && fields.event !== "error") {
    const data = JSON.parse(fields.data);
    for (const listener of [...listeners]) listener(fields.event, data);
  }
}
