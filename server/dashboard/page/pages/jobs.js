// The list of jobs: filters, search, pages, cancel and retry.

import { guarded } from "../access.js";
import { get, post } from "../api.js";
import { h, show } from "../dom.js";
import { onEvent } from "../events.js";
import { idOf, words } from "../format.js";
import { gallery } from "../gallery.js";
import { isKept, keepJobs } from "../glance.js";
import { jobTable, updateProgress } from "../job_rows.js";
import { emptyNote, errorNote, refresher } from "../loading.js";
import { pager } from "../pager.js";
import { noteNewPhotographs } from "../photographs.js";

const STATES = ["queued", "running", "succeeded", "failed", "cancelled"];
const KINDS = ["optimize_hologram", "learn_kernel", "simulate_capture", "evaluate_kernel", "prepare_dataset", "report_kernel", "verify_hologram", "suggest_holograms", "capture_photos"];
const FILTERS = ["text", "state", "kind", "display", "owner", "batch", "since"];
/** Jobs of which this many are not in memory are read together. */
const TOGETHER = 4;
const SINCE = [["", "any time"], ["3600", "the last hour"], ["86400", "the last day"], ["604800", "the last week"]];

export function jobsPage(root, _, query) {
  const pages = [""];
  const list = h("div", { "aria-live": "off" });
  const shots = gallery({ choice, actions });
  const notice = h("div", { role: "status" });
  const compare = h("p", { class: "note", role: "status", hidden: true });
  const chosen = new Set();
  let since = "";
  const displays = h("datalist", { id: "displays" });
  const form = h("form", { class: "filters", role: "search", onsubmit: (event) => event.preventDefault() },
    input("text", "Search", "id, batch, dataset…"),
    select("state", "State", [["", "all"], ...STATES.map((state) => [state, state])]),
    select("kind", "Kind", [["", "all"], ...KINDS.map((kind) => [kind, kind.replaceAll("_", " ")])]),
    input("display", "Display", "all", "displays"), input("owner", "Owner", "all"), input("batch", "Batch", "all"),
    select("since", "Submitted in", SINCE), select("view", "Show as", [["", "gallery"], ["table", "table"]]), displays);
  show(root, h("h1", {}, "Jobs"), form, notice, compare, list);

  function input(name, label, placeholder, list) {
    return h("label", {}, label, h("input", { name, placeholder, list, value: query.get(name) ?? "", autocomplete: "off", oninput: later, maxlength: 128 }));
  }
  function select(name, label, options) {
    return h("label", {}, label, h("select", { name, onchange: changed },
      options.map(([value, text]) => h("option", { value, selected: (query.get(name) ?? "") === value }, text))));
  }
  let timer = 0;
  function later() {
    clearTimeout(timer);
    timer = setTimeout(changed, 250);
  }
  function changed() {
    const given = [...FILTERS, "view"].map((name) => [name, form.elements[name].value.trim()]).filter(([, value]) => value);
    const text = new URLSearchParams(given).toString();
    history.replaceState(null, "", `#/jobs${text ? `?${text}` : ""}`);
    pages.length = 1;
    void refresh();
  }

  const refresh = refresher(list, async () => {
    const value = (name) => form.elements[name].value.trim();
    const display = value("display") && `displays/${value("display")}`;
    // The tokens of further pages belong to one time.
    if (pages.length === 1) since = value("since") && new Date(Math.floor(Date.now() / 60_000) * 60_000 - value("since") * 1000).toISOString();
    const filters = { state: value("state"), kind: value("kind"), display, owner: value("owner"), batch: value("batch"), since, text: value("text") };
    const wish = { pageSize: 50, pageToken: pages.at(-1), ...filters };
    const page = await get("jobs", { view: "basic", ...wish });
    const isGallery = value("view") !== "table";
    if (isGallery && page.summaries.filter((job) => !isKept(job)).length > TOGETHER) keepJobs((await get("jobs", wish)).jobs);
    shots.show(isGallery ? page.summaries : []);
    show(list, filters.batch && h("p", {}, h("a", { href: `#/batch/${encodeURIComponent(filters.batch)}` }, `Compare the jobs of ${filters.batch}`)),
      page.summaries.length ? isGallery ? shots.element : jobTable(`Jobs, page ${pages.length}`, page.summaries, actions, choice)
      : emptyNote(FILTERS.some(value) ? "No job fits these filters." : "There are no jobs yet. Send a picture to a display:",
        FILTERS.some(value) ? null : "lightpath hologram optimize picture.png --display lab --distance 150mm"),
    pager(pages, page.nextPageToken, refresh));
  });

  function choice(job) {
    const id = idOf(job.name);
    return h("input", { type: "checkbox", "data-key": `choose ${id}`, "aria-label": `Compare ${words(job.kind, "KIND")} ${id}`, checked: chosen.has(id), onchange: (event) => {
      if (event.target.checked) chosen.add(id);
      else chosen.delete(id);
      showChosen();
    } });
  }

  function showChosen() {
    const ids = [...chosen];
    compare.hidden = ids.length === 0;
    show(compare, ids.length === 2 ? h("a", { href: `#/compare?jobs=${ids.join(",")}` }, "Compare the two chosen jobs")
      : ids.length === 1 ? "Choose one more job to compare." : "Only two jobs can be compared.");
  }

  function actions(job) {
    const act = (verb, done) => guarded(h("button", { type: "button", "data-key": `${verb} ${job.name}`, "aria-label": `${verb} ${words(job.kind, "KIND")} ${idOf(job.name)}`, onclick: async () => {
      try {
        await post(`${job.name}:${verb.toLowerCase()}`);
        show(notice, h("p", {}, `${idOf(job.name)} ${done}`));
      } catch (error) {
        show(notice, errorNote(error));
      }
      void refresh();
    } }, verb), "submit");
    if (["STATE_QUEUED", "STATE_RUNNING"].includes(job.state) && !job.cancelRequested) return act("Cancel", "is cancelled.");
    if (["STATE_FAILED", "STATE_CANCELLED"].includes(job.state)) return act("Retry", "is back in the queue.");
    return null;
  }

  get("displays", { pageSize: 200 }).then((answer) => show(displays, answer.displays.map(({ name }) => h("option", { value: idOf(name) }))), () => {});
  const ends = onEvent((kind, data) => {
    if (noteNewPhotographs(kind, data)) shots.photographed();
    if (kind === "reset" || (kind === "job" && !updateProgress(list, data))) refresh.soon();
  });
  return () => {
    clearTimeout(timer);
    ends();
    shots.end();
  };
}
