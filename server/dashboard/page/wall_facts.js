// What the wall shows: the queue, and each display with its photographs, kernels and devices.

import { get } from "./api.js";
import { idOf } from "./format.js";
import { expectedOf, jobOfPhotograph, keepJobs, planesOf, readHolograms, scoreOf } from "./glance.js";
import { photographsOf } from "./photographs.js";

/** Queued jobs whose expected starts are read. */
const QUEUED_MAX = 200;
const DISPLAYS_MAX = 12;
const KERNELS_MAX = 8;
/** Photographs of a display that are scored. */
const SCORED_MAX = 24;
/** Photographs from which the drift of a kernel is said. */
const DRIFT_PHOTOGRAPHS = 5;

/** The queue: numbers, what runs, what failed in the last day, and when it will be empty. `queue` is `null` for tokens that may not see it. */
export async function readQueue() {
  const [queue, running, failed, queued, newest] = await Promise.all([
    get("queue").catch((error) => (error.status === 403 ? null : Promise.reject(error))),
    get("jobs", { view: "basic", state: "running", pageSize: 20 }),
    get("jobs", { view: "basic", state: "failed", pageSize: 50 }),
    get("jobs", { state: "queued", pageSize: QUEUED_MAX }),
    get("jobs", { kind: "optimize_hologram", state: "succeeded", pageSize: 1 }),
  ]);
  keepJobs(newest.jobs);
  const failedLately = failed.summaries.filter((job) => Date.now() - Date.parse(job.endTime) < 86_400_000).length;
  return { queue, running: running.summaries, failed: failedLately, newest: newest.jobs[0] ?? null, emptyIn: emptyIn(running.summaries, queued.jobs, Boolean(queued.nextPageToken)) };
}

/**
 * Time until the queue is empty, by the server's forecast [s]: `{seconds, isKnown, isLeast, stuck}`. `isLeast`: the time of some jobs is
 * not known, as that of those that are `more` than were read. `stuck`: numbers of jobs that nothing will start as things are, by the reason.
 */
export function emptyIn(running, queued, more) {
  const stuck = new Map();
  const ends = running.map(({ progress }) => progress?.etaS);
  for (const { waiting, estimatedTimeS } of queued) {
    const start = waiting?.expectedStartTime && Math.max(0, (Date.parse(waiting.expectedStartTime) - Date.now()) / 1000);
    if (["REASON_NO_PROCESS", "REASON_PAUSED"].includes(waiting?.reason)) stuck.set(waiting.reason, (stuck.get(waiting.reason) ?? 0) + 1);
    else ends.push(start === undefined || estimatedTimeS === undefined ? undefined : start + estimatedTimeS);
  }
  const known = ends.filter((end) => end !== undefined);
  return { seconds: Math.max(0, ...known), isLeast: more || known.length < ends.length, isKnown: known.length > 0, stuck };
}

/** The displays, each as `readDisplay` has it, and whether there are more. */
export async function readDisplays() {
  const { displays, nextPageToken } = await get("displays", { pageSize: DISPLAYS_MAX });
  return { displays: await Promise.all(displays.map(readDisplay)), more: Boolean(nextPageToken) };
}

/**
 * A display: `{name, photographs, kernels, devices}`. Photographs are those with a known hologram, the newest first, with `job`,
 * `score` [dB] and `expected`; if there are none, those without.
 */
async function readDisplay({ name }) {
  const [{ kernels }, { devices }, photographs] = await Promise.all([
    get(`${name}/kernels`, { pageSize: KERNELS_MAX }),
    get(`${name}/devices`, { pageSize: 1000 }),
    photographsOf(name),
    readHolograms(name, 0),
  ]);
  const shown = [...photographs].sort((a, b) => b.time - a.time).map((photograph) => ({ ...photograph, job: jobOfPhotograph(photograph.pattern, photograph.at) }));
  const known = shown.filter(({ job }) => job).slice(0, SCORED_MAX);
  const scored = await Promise.all(known.map(withScore));
  const withVersions = await Promise.all(kernels.map(kernelFacts));
  return { name, devices, photographs: scored.length ? scored : shown.slice(0, 1), kernels: withVersions.map((kernel) => ({ ...kernel, drift: driftOf(scored, kernel.active) })) };
}

async function withScore(photograph) {
  const [{ plane, kernel }] = planesOf(photograph.job);
  return { ...photograph, score: await scoreOf(photograph.job, photograph), expected: expectedOf(plane, kernel), isIdeal: !kernel };
}

async function kernelFacts(kernel) {
  const active = kernel.activeVersion ? await get(`${kernel.name}/versions/${kernel.activeVersion}`) : null;
  return { name: kernel.name, id: idOf(kernel.name), active, rollout: kernel.rollout };
}

/**
 * How far the newest photographs are from what the active version expects of them, on average [dB]: `{meanDb, count}`. `null`:
 * no photograph is known that it expects something of.
 */
export function driftOf(photographs, active) {
  const off = photographs.filter(({ score, expected }) => active && Number.isFinite(score) && expected?.isExpected && expected.by === active.name)
    .slice(0, DRIFT_PHOTOGRAPHS).map(({ score, expected }) => score - expected.value);
  return off.length ? { meanDb: off.reduce((sum, one) => sum + one, 0) / off.length, count: off.length } : null;
}

/** Numbers of devices by what they have of the kernels, the most first: `[text, number]`. */
export function devicesByVersion(devices) {
  const found = new Map();
  for (const device of devices) {
    const text = device.kernels.map(({ version }) => (version ? `version ${version}` : "none")).join(", ") || "none";
    found.set(text, (found.get(text) ?? 0) + 1);
  }
  return [...found].sort((a, b) => b[1] - a[1]);
}
