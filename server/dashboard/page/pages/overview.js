// What the server does now.

import { get } from "../api.js";
import { h, show } from "../dom.js";
import { onEvent } from "../events.js";
import { age, idOf, words } from "../format.js";
import { jobTable, progressOf, stateOf } from "../job_rows.js";
import { emptyNote, refresher } from "../loading.js";

const LATEST = 12;

export function overviewPage(root) {
  const tiles = h("dl", { class: "tiles", "aria-label": "The queue" });
  const pauses = h("div", {});
  const running = h("div", { class: "cards" });
  const latest = h("div", {});
  show(root, h("h1", {}, "Overview"), tiles, pauses,
    h("section", {}, h("h2", {}, "Running"), running),
    h("section", {}, h("h2", {}, "Latest jobs"), latest));

  const refresh = refresher(latest, async () => {
    const [queue, runningJobs, failed, jobs, displays] = await Promise.all([
      get("queue").catch((error) => (error.status === 403 ? null : Promise.reject(error))),
      get("jobs", { view: "basic", state: "running", pageSize: 20 }),
      get("jobs", { view: "basic", state: "failed", pageSize: 50 }),
      get("jobs", { view: "basic", pageSize: LATEST }),
      get("displays", { pageSize: 100 }),
    ]);
    const more = (page) => (page.nextPageToken ? "+" : "");
    const lastDay = failed.summaries.filter((job) => Date.now() - Date.parse(job.finishTime) < 86_400_000).length;
    const tile = (label, value, href, kind = "") => h("div", { class: `tile ${kind}` }, h("dt", {}, label), h("dd", {}, h("a", { href }, value)));
    show(tiles,
      tile("running", queue?.running ?? runningJobs.summaries.length, "#/jobs?state=running"),
      tile("queued", queue?.queued ?? "–", "#/jobs?state=queued"),
      tile("failed in the last day", `${lastDay}${lastDay === failed.summaries.length ? more(failed) : ""}`, "#/jobs?state=failed", lastDay ? "bad" : ""),
      tile("displays", `${displays.displays.length}${more(displays)}`, "#/displays"));
    show(pauses, (queue?.pauses ?? []).map((pause) => h("p", { class: "note" },
      `${pause.display ? idOf(pause.display) : "The whole queue"} is paused since ${age(pause.since)}: ${pause.reason}`)));
    show(running, runningJobs.summaries.length ? runningJobs.summaries.map(card) : emptyNote("No job runs now."));
    show(latest, jobs.summaries.length
      ? jobTable(`The ${jobs.summaries.length} newest jobs`, jobs.summaries)
      : emptyNote("There are no jobs yet. Send a picture to a display:", "lightpath hologram optimize picture.png --display lab --distance 150mm"));
  });

  const ends = onEvent((kind, data) => {
    if (kind === "job" && data.state === "STATE_RUNNING") {
      const shown = [...running.querySelectorAll("[data-job]")].find((element) => element.dataset.job === data.name);
      const old = shown?.querySelector(".progress");
      const fresh = progressOf(data);
      if (old && fresh) return old.replaceWith(fresh);
    }
    if (kind === "job" || kind === "queue" || kind === "display" || kind === "reset") void refresh();
  });
  return ends;
}

function card(job) {
  return h("article", { class: "card", "data-job": job.name },
    h("h3", {}, h("a", { href: `#/${job.name}`, "data-key": `card ${job.name}` }, words(job.kind, "KIND")), " ", stateOf(job)),
    h("p", {}, `on ${idOf(job.display)}`, job.owner ? ` for ${job.owner}` : ""),
    progressOf(job) ?? h("p", {}, "starts"));
}
