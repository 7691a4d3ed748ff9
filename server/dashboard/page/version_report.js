// What a kernel version learned, as its report shows it: amplitude and phase, the point spread, and more.

import { guarded, mayNot } from "./access.js";
import { get, post } from "./api.js";
import { h, show } from "./dom.js";
import { idOf } from "./format.js";
import { progressOf, stateOf, updateProgress } from "./job_rows.js";
import { refresher } from "./loading.js";
import { reportFigures } from "./report_figures.js";

/** Reports of a display among which that of the version is looked for. */
const REPORTS_MAX = 100;

/** The report of one version of a display's kernels. Returns `{element, choose, onJob, end}`. */
export function versionReport(display) {
  const element = h("div", { tabindex: -1 });
  let version = null;
  let isWanted = false;
  let job = null;
  let shown = "";
  let figures = null;

  const refresh = refresher(element, async () => {
    if (!version) return;
    job = await latest();
    if (isWanted && (!job || hasFailed(job))) {
      isWanted = false;
      shown = "";
      await post("jobs", { spec: { reportKernel: { kernelVersion: version.name } } });
      job = await latest();
    }
    const key = `${version.name} ${job?.name} ${job?.state}`;
    if (key === shown) return;
    shown = key;
    figures?.end();
    figures = job?.result ? reportFigures(job.result.reportKernel.figures) : null;
    show(element, h("section", {}, h("h2", {}, `What version ${version.version} learned`), summary(), figures?.element));
  });

  /** The newest job for the report of the version, or a succeeded one before it; `null`: there is none. */
  async function latest() {
    const { jobs } = await get("jobs", { kind: "report_kernel", display: `displays/${display}`, pageSize: REPORTS_MAX });
    const own = jobs.filter(({ spec }) => spec.reportKernel.kernelVersion === version.name);
    return own.find(({ state }) => state === "STATE_SUCCEEDED") ?? own[0] ?? null;
  }

  async function want() {
    // Who may not submit sees the report that somebody else made.
    isWanted = (await mayNot("submit")) === "";
    void refresh();
  }

  function summary() {
    const make = (text) => guarded(h("button", { type: "button", "data-key": "make report", onclick: () => void want() }, text), "submit");
    if (!job) return [h("p", {}, "The report of this version shows its amplitude, phase and point spread, and what limits the display. Nobody has made it yet."), make("Make the report")];
    const link = h("a", { href: `#/${job.name}` }, `job ${idOf(job.name).slice(0, 13)}`);
    if (job.state === "STATE_SUCCEEDED") return h("p", {}, "From the report of ", link, ".");
    return [h("p", {}, "The report is made by ", link, stateOf(job)), job.error && h("p", { class: "note bad" }, job.error.message), progressOf(job), hasFailed(job) && make("Make the report again")];
  }

  return {
    element,
    /** Shows the report of a version. */
    show(chosen) {
      version = chosen;
      isWanted = false;
      void refresh();
    },
    /** Shows the report of a version, brings it into sight, and makes it if there is none. */
    demand(chosen) {
      version = chosen;
      void want();
      element.scrollIntoView();
      element.focus({ preventScroll: true });
    },
    /** Takes an event about a job. */
    onJob(data) {
      if (data.name === job?.name && !updateProgress(element, data)) refresh.soon();
    },
    end() {
      figures?.end();
    },
  };
}

function hasFailed({ state }) {
  return state === "STATE_FAILED" || state === "STATE_CANCELLED";
}
