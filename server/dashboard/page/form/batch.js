// Submission of the jobs of a form, and the progress of those that it submitted together.

import { ApiError, get, post } from "../api.js";
import { h, show } from "../dom.js";
import { onEvent } from "../events.js";
import { jobTable, updateProgress } from "../job_rows.js";
import { refresher } from "../loading.js";

/** Jobs of one call: the limit of the server. */
const TOGETHER = 200;
/** Files that are uploaded at the same time. */
const UPLOADS = 4;

/** Ids of the latest requests, so that sending the same again after a lost answer makes no second job. */
let latest = { text: "", ids: [] };

/** Uploads and submits jobs. Tells `onProgress(done)` of the uploads. Returns the jobs. */
export async function submitAll(jobs, requestOf, onProgress) {
  const requests = [];
  let next = 0;
  let done = 0;
  const work = async () => {
    while (next < jobs.length) {
      const i = next;
      next += 1;
      try {
        requests[i] = await requestOf(jobs[i]);
      } catch (error) {
        throw jobs.length > 1 && error instanceof ApiError ? new ApiError(error.status, `${jobs[i][0].name}: ${error.message}`, error) : error;
      }
      done += 1;
      onProgress(done);
    }
  };
  await Promise.all(Array.from({ length: UPLOADS }, work));
  const text = JSON.stringify(requests);
  if (text !== latest.text) latest = { text, ids: requests.map(newId) };
  const named = requests.map((request, i) => ({ ...request, requestId: latest.ids[i] }));
  const submitted = [];
  for (let i = 0; i < named.length; i += TOGETHER) submitted.push(...(await post("jobs:submitAll", { requests: named.slice(i, i + TOGETHER) })).jobs);
  latest = { text: "", ids: [] };
  return submitted;
}

function newId() {
  return `dashboard-${[...crypto.getRandomValues(new Uint8Array(16))].map((byte) => byte.toString(16).padStart(2, "0")).join("")}`;
}

/** The progress of submitted jobs. Returns `{element, end}`. */
export function batchProgress(batch, jobs) {
  const bar = h("progress", { max: jobs.length, value: 0, "aria-label": "Holograms that are done" });
  const text = h("p", { role: "status" });
  const list = h("div", {});
  const element = h("section", {}, h("h2", {}, `${jobs.length} holograms`), bar, text, list);
  const names = new Set(jobs.map(({ name }) => name));
  let shown = [];
  const refresh = refresher(list, async () => {
    const { summaries } = await get("jobs", { view: "basic", batch, pageSize: 1000 });
    shown = summaries.filter(({ name }) => names.has(name)).reverse();
    draw();
  });

  function draw() {
    const count = (state) => shown.filter((job) => job.state === state).length;
    const [succeeded, failed] = [count("STATE_SUCCEEDED"), count("STATE_FAILED") + count("STATE_CANCELLED")];
    bar.value = succeeded + failed;
    text.replaceChildren(`${succeeded} of ${jobs.length} are done${failed ? `, ${failed} failed` : ""}. They are the batch `,
      h("a", { href: `#/jobs?batch=${encodeURIComponent(batch)}` }, batch), ". This page may be left: the server goes on.");
    show(list, jobTable("Holograms of these pictures", shown));
  }

  const end = onEvent((kind, data) => {
    if (kind === "reset") refresh.soon();
    if (kind !== "job" || !names.has(data.name) || updateProgress(list, data)) return;
    shown = shown.map((job) => (job.name === data.name ? data : job));
    draw();
    // A list that is under way may not know of this event yet.
    refresh.soon();
  });
  return { element, end };
}
