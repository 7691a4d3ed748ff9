// What a page shows while it waits, when there is nothing, and when something failed.

import { lightpath } from "./command_line.js";
import { h, show } from "./dom.js";

/** Says what went wrong, and what to do. `retries`: the page tries again by itself. */
export function errorNote(error, retries = false) {
  const advice =
    error.status === 403 ? "Sign in with a token whose role allows this, or ask an admin for one." :
    error.status !== 0 ? error.fix || null :
    retries ? "The page tries again by itself." : "Try again when the server can be reached.";
  return h("div", { class: "note bad", role: "alert" }, h("p", {}, error.message), advice && h("p", {}, advice));
}

export function emptyNote(text, command) {
  return h("div", { class: "note" }, h("p", {}, text), command && h("pre", {}, h("code", {}, command.replace(/^lightpath(?= )/, lightpath()))));
}

/** Least time from one reading after an event to the next, so that many dashboards and busy queues cost little [ms]. */
const SPACING = 1000;
/** Time from a reading that did not reach the server to the next [ms]. */
const RETRY_PAUSE = 3000;

/**
 * Runs `work`, which fills `root`, now and whenever the returned function is called; calls during a run are one more
 * run. It tries again by itself when the server cannot be reached. Its method `soon`, for events, runs it at once, or
 * `spacing` [ms] after the run before.
 */
export function refresher(root, work, spacing = SPACING) {
  let runs = 0;
  let timer = 0;
  let retry = 0;
  let lastStart = 0;
  let again = false;
  let active = false;
  const run = async () => {
    if (active) {
      again = true;
      return;
    }
    active = true;
    do {
      again = false;
      clearTimeout(retry);
      lastStart = Date.now();
      try {
        await work();
      } catch (error) {
        if (error.name !== "AbortError" && root.isConnected) {
          if (runs === 0 || error.status !== 0) show(root, errorNote(error, true));
          if (error.status === 0) retry = setTimeout(() => root.isConnected && void run(), RETRY_PAUSE);
        }
      }
      runs += 1;
    } while (again);
    active = false;
  };
  run.soon = () => {
    timer ||= setTimeout(() => {
      timer = 0;
      if (root.isConnected) void run();
    }, Math.max(0, lastStart + spacing - Date.now()));
  };
  void run();
  return run;
}
