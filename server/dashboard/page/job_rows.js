// A job as a row of a list.

import { h } from "./dom.js";
import { age, between, duration, idOf, words } from "./format.js";
import { table } from "./table.js";

export function stateOf(job) {
  const state = words(job.state, "STATE");
  return h("span", { class: `state ${state}` }, job.cancelRequested && state === "running" ? "cancelling" : state);
}

export function progressOf(job) {
  const progress = job.progress;
  if (!progress?.stepsTotal || job.state !== "STATE_RUNNING") return null;
  const label = `${progress.stage}: ${progress.step} of ${progress.stepsTotal}`;
  // After its last step a job still judges and stores what it made.
  const eta = progress.etaS === undefined || progress.step >= progress.stepsTotal ? "" : `, ${duration(Math.max(1, progress.etaS))} left`;
  return h("div", { class: "progress", "data-job": job.name },
    h("progress", { max: progress.stepsTotal, value: progress.step, "aria-label": `Progress of ${idOf(job.name)}` }),
    h("span", {}, label + eta));
}

/** Shows a job's new progress wherever `root` shows its old one; `false`: nowhere. */
export function updateProgress(root, job) {
  const shown = [...root.querySelectorAll(".progress")].filter((element) => element.dataset.job === job.name);
  for (const element of shown) {
    const fresh = progressOf(job);
    if (!fresh) return false;
    element.replaceWith(fresh);
  }
  return shown.length > 0;
}

/** What a queued job waits for and when it starts; empty: nothing is known. */
export function waitOf(job) {
  const start = job.waiting?.expectedStartTime;
  const left = start ? `, about ${duration(Math.max(0, Math.round((Date.parse(start) - Date.now()) / 1000)) || 1)}` : "";
  return job.waitsFor ? job.waitsFor + left : "";
}

function timeOf(job) {
  if (job.state === "STATE_QUEUED" && job.waitsFor) return waitOf(job);

  if (job.state === "STATE_RUNNING") return progressOf(job) ?? "starts";
  if (job.error && job.state !== "STATE_SUCCEEDED") return h("span", { class: "reason" }, job.error.message);
  const took = between(job.startTime, job.endTime);
  return took === null ? "" : `took ${duration(took)}`;
}

/** A table of jobs. `more` makes a last cell for actions, `choice` a first one. */
export function jobTable(caption, jobs, more = null, choice = null) {
  const row = (job) => h("tr", {},
    choice && h("td", {}, choice(job)),
    h("td", {}, stateOf(job)),
    h("th", { scope: "row" }, h("a", { href: `#/${job.name}`, "data-key": job.name }, words(job.kind, "KIND")),
      h("small", {}, [job.label, idOf(job.name).slice(0, 13)].filter(Boolean).join(" · "))),
    h("td", {}, idOf(job.display)),
    h("td", {}, job.owner, job.owner && job.batch && " · ", job.batch && h("a", { href: `#/batch/${encodeURIComponent(job.batch)}` }, job.batch)),
    h("td", { class: "wide" }, timeOf(job)),
    h("td", { class: "right" }, h("time", { datetime: job.createTime, title: job.createTime }, age(job.createTime))),
    more && h("td", { class: "right" }, more(job)));
  const titles = [...(choice ? ["Compare"] : []), "State", "Job", "Display", "Owner · batch", "Progress", ">Submitted", ...(more ? [">Actions"] : [])];
  return table(caption, titles, jobs.map(row));
}
