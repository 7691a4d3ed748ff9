// A screen across the room: what runs, the newest photographs, how good they are, kernels, devices, and the queue.

import { h, show } from "../dom.js";
import { onConnection, onEvent } from "../events.js";
import { age, decibels, duration, idOf, measuredDecibels, words } from "../format.js";
import { framesOf } from "../frames.js";
import { isNotJudged, NOT_JUDGED, picturesOf, wholeJob, worstExpected } from "../glance.js";
import { progressOf, updateProgress } from "../job_rows.js";
import { livePicture } from "../live_picture.js";
import { refresher } from "../loading.js";
import { noteNewPhotographs } from "../photographs.js";
import { columnsFor } from "../picture_source.js";
import { pointsOverTime } from "../wall_chart.js";
import { devicesByVersion, readDisplays, readQueue } from "../wall_facts.js";

/** Time for which a display is shown [ms]. */
const TURN = 15_000;
/** How often is read what no event tells: estimates, photographs, the age of things [ms]. */
const SLOW = 60_000;
/** Least time from one reading after events to the next [ms]. */
const SPACING = 5000;
/** What is older than this is said to be old [ms]. */
const OLD = 90_000;
/** Why jobs wait that nothing will start as things are. */
const STUCK = { REASON_NO_PROCESS: ["waits: no process has what it needs", "wait: no process has what they need"], REASON_PAUSED: ["is paused", "are paused"] };

export function wallPage(root) {
  const clock = h("time", {});
  const state = h("p", { class: "fresh" });
  const running = h("section", { class: "run" });
  const photograph = h("section", { class: "photograph" });
  const trend = h("section", { class: "trend" });
  const kernels = h("section", { class: "kernels" });
  const queue = h("section", { class: "queue" });
  root.className = "wall";
  show(root, h("div", { class: "top" }, h("h1", {}, "Lightpath"), state, h("a", { href: "#/" }, "Overview (Esc)"), clock), running, photograph, queue, trend, kernels);
  const points = pointsOverTime("PSNR of photographs over time");
  const shown = { display: 0, displays: null, more: false, facts: null, live: null, isConnected: null, readAt: { queue: 0, displays: 0 } };
  const ended = new AbortController();

  const refreshQueue = refresher(queue, async () => {
    shown.facts = await readQueue();
    shown.readAt.queue = Date.now();
    showQueue();
    showRunning();
    showClock();
  }, SPACING);
  const refreshDisplays = refresher(photograph, async () => {
    const { displays, more } = await readDisplays();
    shown.readAt.displays = Date.now();
    // Displays of which nothing is known get no turn while there are others.
    const known = displays.filter(({ photographs, kernels, devices }) => photographs.length + kernels.length + devices.length > 0);
    Object.assign(shown, { displays: known.length ? known : displays, more });
    showDisplay();
    showClock();
  }, SPACING);

  function showClock() {
    const now = new Date();
    clock.textContent = now.toLocaleTimeString([], { hour: "2-digit", minute: "2-digit" });
    const oldest = Math.min(...Object.values(shown.readAt));
    const isOld = oldest > 0 && now - oldest > OLD;
    const isLost = shown.isConnected === false;
    const when = oldest === 0 ? "nothing was read yet" : `shown is ${new Date(oldest).toLocaleTimeString([], { hour: "2-digit", minute: "2-digit", second: "2-digit" })}, ${duration(Math.round((now - oldest) / 1000))} old`;
    const text = isLost ? `No connection, trying again; ${when}` : isOld ? `Trying again; ${when}` : shown.isConnected ? "live" : "";
    if (state.textContent !== text) state.textContent = text;
    state.classList.toggle("lost", isLost || isOld);
  }

  function showQueue() {
    const { queue: numbers, emptyIn, failed, running: jobs } = shown.facts;
    const paused = numbers?.pauses.find(({ display }) => !display);
    const waiting = Number(numbers?.queued ?? 0);
    const done = new Date(Date.now() + emptyIn.seconds * 1000).toLocaleTimeString([], { hour: "2-digit", minute: "2-digit" });
    const left = emptyIn.seconds < 90 ? "in a minute" : `in ${duration(60 * Math.round(emptyIn.seconds / 60)).replace(" 0 s", "")}`;
    const stuck = [...emptyIn.stuck].map(([reason, count]) => h("span", { class: "bad" }, ` ${count} ${STUCK[reason][count === 1 ? 0 : 1]}.`));
    const end = !numbers ? "This token does not show the queue." : paused ? `Paused: ${paused.reason}` : waiting === 0 && jobs.length === 0 ? "Nothing waits."
      : !emptyIn.isKnown && stuck.length === 0 ? "It is not known yet when all have ended."
      : [emptyIn.isKnown && [`${stuck.length ? "The others end" : "Empty"} ${emptyIn.isLeast ? "not before" : "at about"} `, h("strong", {}, done), `, ${left}.`], ...stuck];
    const fact = (value, text, kind = "") => h("li", { class: kind }, h("strong", {}, value), ` ${text}`);
    show(queue, h("h2", {}, "Queue"), h("ul", {}, fact(numbers?.queued ?? "–", waiting === 1 ? "waits" : "wait"), fact(numbers?.running ?? jobs.length, Number(numbers?.running ?? jobs.length) === 1 ? "runs" : "run"), fact(failed, "failed in a day", failed ? "bad" : "")), h("p", {}, end));
  }

  function showRunning() {
    const { running: jobs, newest } = shown.facts;
    const job = jobs.find(({ kind }) => kind === "KIND_OPTIMIZE_HOLOGRAM") ?? jobs[0] ?? null;
    if (shown.live && shown.live.name !== job?.name) {
      shown.live.picture.end();
      shown.live = null;
    }
    const last = job ?? (newest && { ...newest, kind: "KIND_OPTIMIZE_HOLOGRAM", display: newest.spec.optimizeHologram.display });
    if (!last) return show(running, h("h2", {}, "Running"), h("p", {}, "No job runs, and no hologram was made yet."));
    if (job?.kind === "KIND_OPTIMIZE_HOLOGRAM") shown.live ??= { name: job.name, picture: livePicture(job.name) };
    const isHologram = last.kind === "KIND_OPTIMIZE_HOLOGRAM";
    const expected = job ? null : worstExpected(newest);
    const before = running.querySelector(".pair");
    const pair = before?.dataset.job === `${last.name} ${last.state}` ? before : h("div", { class: "pair", "data-job": `${last.name} ${last.state}` });
    show(running, h("h2", {}, job ? `Running${jobs.length > 1 ? `, and ${jobs.length - 1} more` : ""}` : "No job runs. The newest hologram"), pair,
      h("p", { class: "name" }, h("strong", {}, last.label || words(last.kind, "KIND")), ` on ${idOf(last.display)}${last.owner ? ` for ${last.owner}` : ""}`),
      job ? progressOf(job) ?? h("p", {}, "starts") : expected ? h("p", {}, h("strong", {}, expected.text), ` ${expected.note}`) : isNotJudged(newest) && h("p", {}, NOT_JUDGED));
    if (pair !== before && isHologram) void fill(pair, last, job ? shown.live.picture.element : null);
  }

  /** Fills the frames of a hologram: its target, and what it shows so far or at its end. */
  async function fill(pair, job, live) {
    if (live) {
      pair.append(h("div", { class: "live" }, live, h("p", { class: "none" }, "no picture yet")));
      live.querySelector("img").addEventListener("load", ({ target }) => pair.style.setProperty("--form", target.naturalWidth / target.naturalHeight));
    }
    await fillWith(pair, async () => {
      const whole = await wholeJob(job);
      return [whole, picturesOf(whole).slice(0, 2)];
    });
  }

  /** Puts pictures in front of what the pair has. `read` returns the job and its pictures. */
  async function fillWith(pair, read) {
    try {
      const [job, pictures] = await read();
      const { frames, form } = await framesOf(job, pictures, columnsFor(pair.clientWidth / 2 || 640), (title) => title, ended.signal);
      if (form) pair.style.setProperty("--form", form);
      pair.prepend(...frames.map(({ title, window }) => h("figure", {}, h("div", { class: "frame" }, window), h("figcaption", {}, title))));
    } catch (error) {
      // The next reading tries again.
      if (error.name !== "AbortError") delete pair.dataset.job;
    }
  }

  function showDisplay() {
    const { displays } = shown;
    if (displays.length === 0) {
      show(photograph, h("h2", {}, "Displays"), h("p", {}, "No display is declared yet."));
      return;
    }
    shown.display %= displays.length;
    const display = displays[shown.display];
    const turn = displays.length > 1 ? `, ${shown.display + 1} of ${displays.length}${shown.more ? "+" : ""}` : "";
    showPhotograph(display, turn);
    showTrend(display);
    showKernels(display);
  }

  function showPhotograph(display, turn) {
    const [newest] = display.photographs;
    const heading = h("h2", {}, `${idOf(display.name)}${turn}: newest photograph`);
    if (!newest) return show(photograph, heading, h("p", { class: "big" }, "No photograph yet."));
    const key = newest.photo;
    const before = photograph.querySelector(".pair");
    const pair = before?.dataset.job === key ? before : h("div", { class: "pair", "data-job": key });
    const target = newest.job && picturesOf(newest.job)[0];
    const { score, expected } = newest;
    show(photograph, heading, pair, h("p", { class: "scores" },
      Number.isFinite(score) ? h("span", {}, h("strong", {}, decibels(score)), " photographed")
        : !newest.job ? h("span", {}, "Of a hologram that no job here made.") : !newest.isAligned && h("span", {}, "Not scored: it has other pixels than the display."),
      expected && h("span", {}, h("strong", {}, expected.isExpected ? measuredDecibels(expected) : expected.text), ` ${expected.note}`)),
    h("p", {}, [newest.job?.label, age(new Date(newest.time).toISOString())].filter(Boolean).join(", ")));
    if (pair !== before) void fillWith(pair, async () => [newest.job, [target, { title: "photograph", ...newest.picture }].filter(Boolean)]);
  }

  function showTrend({ name, photographs }) {
    const scored = photographs.filter(({ score }) => Number.isFinite(score));
    points.update(scored.map(({ time, score, isIdeal }) => ({ time, value: score, series: isIdeal ? 2 : 1 })));
    const key = (series, text) => h("span", { class: `key series-${series}` }, text);
    const keys = [scored.some(({ isIdeal }) => !isIdeal) && key(1, "learned kernel"), scored.some(({ isIdeal }) => isIdeal) && key(2, "ideal kernel")];
    show(trend, h("h2", {}, `Photographs of ${idOf(name)}, dB`), scored.length ? [points.element, h("p", { class: "keys" }, keys)] : h("p", { class: "big" }, "No photograph with a score yet."));
  }

  function showKernels({ name, kernels: list, devices }) {
    const kernel = ({ id, active, drift, rollout }) => h("li", {}, h("strong", {}, id),
      h("p", {}, active ? `version ${active.version}, made ${age(active.createTime)}` : "no version is active", rollout ? ", a rollout runs" : ""),
      active && h("p", { class: drift && drift.meanDb < -3 ? "bad" : "" }, drift ? ["drift ", h("strong", {}, `${drift.meanDb >= 0 ? "+" : "−"}${Math.abs(drift.meanDb).toFixed(1)} dB`), `: ${drift.count === 1 ? "a photograph" : `${drift.count} photographs`} against expectation`]
        : "drift unknown: no photograph yet of a hologram that it judged"));
    const byVersion = devicesByVersion(devices);
    show(kernels, h("h2", {}, `Kernels of ${idOf(name)}`),
      list.length ? h("ul", {}, list.slice(0, 2).map(kernel), list.length > 2 && h("li", {}, `and ${list.length - 2} more kernels`)) : h("p", {}, "No kernel was learned yet."),
      h("p", { class: "devices" }, byVersion.length ? byVersion.slice(0, 3).map(([text, count]) => h("span", {}, h("strong", {}, count), ` × ${text} `)) : "No device has reported yet."));
  }

  function turn(by) {
    if (!shown.displays || shown.displays.length < 2) return;
    shown.display = (shown.display + by + shown.displays.length) % shown.displays.length;
    showDisplay();
  }

  let turning = setInterval(() => turn(1), TURN);
  const ticking = setInterval(showClock, 1000);
  const reading = setInterval(() => {
    if (document.hidden) return;
    void refreshQueue();
    void refreshDisplays();
  }, SLOW);
  const keys = (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "Escape" && !document.fullscreenElement) location.hash = "#/";
    if (event.key === "f") void document.documentElement.requestFullscreen?.().catch(() => {});
    const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!by) return;
    clearInterval(turning);
    turn(by);
    turning = setInterval(() => turn(1), TURN);
  };
  addEventListener("keydown", keys);
  const endConnection = onConnection((isConnected) => {
    shown.isConnected = isConnected;
    showClock();
  });
  const endEvents = onEvent((kind, data) => {
    noteNewPhotographs(kind, data);
    if (kind === "job" && data.name === shown.live?.name) shown.live.picture.refresh();
    if (kind === "job" && updateProgress(running, data)) return;
    if (["job", "queue", "reset"].includes(kind)) refreshQueue.soon();
    if (["display", "kernel", "device", "dataset", "reset"].includes(kind) || (kind === "job" && data.state === "STATE_SUCCEEDED")) refreshDisplays.soon();
  });
  const lock = keepAwake();
  showClock();
  return () => {
    endEvents();
    endConnection();
    removeEventListener("keydown", keys);
    [turning, ticking, reading].forEach(clearInterval);
    ended.abort();
    shown.live?.picture.end();
    points.end();
    lock();
  };
}

/** Keeps the screen on where the browser lets a page do so. Returns a function that ends this. */
function keepAwake() {
  let lock = null;
  let isWanted = true;
  const ask = async () => {
    if (document.hidden || !isWanted) return;
    lock = await navigator.wakeLock?.request("screen").catch(() => null);
    if (!isWanted) void lock?.release();
  };
  document.addEventListener("visibilitychange", ask);
  void ask();
  return () => {
    isWanted = false;
    document.removeEventListener("visibilitychange", ask);
    void lock?.release();
  };
}
