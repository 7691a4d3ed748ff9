// New holograms: pictures are dropped or chosen, and become jobs as the form says. The address may name a job to begin with.

import { get } from "../api.js";
import { h, show } from "../dom.js";
import { mayNot } from "../access.js";
import { batchProgress, submitAll } from "../form/batch.js";
import { showProblems } from "../form/controls.js";
import { estimateOf } from "../form/estimate.js";
import { displayForm } from "../form/display_form.js";
import { droppedFiles } from "../form/files.js";
import { hologramForm } from "../form/hologram_form.js";
import { styled } from "../form/style.js";
import { errorNote } from "../loading.js";

let dropped = null;

/** Takes pictures that are dropped anywhere on the page to the page for a new hologram. */
export function acceptDrops(open) {
  document.addEventListener("dragover", (event) => event.dataTransfer.types.includes("Files") && event.preventDefault());
  document.addEventListener("drop", (event) => {
    if (![...event.dataTransfer.items].some(({ kind }) => kind === "file")) return;
    event.preventDefault();
    dropped = droppedFiles(event.dataTransfer);
    open();
  });
}

export function newPage(root, _, query) {
  const notice = h("div", { role: "status" });
  const body = h("div", {});
  show(root, h("h1", {}, "New hologram"), body);
  const submit = h("button", { type: "submit", class: "main" }, "Make the hologram");
  const form = h("form", { class: "new", onsubmit: send });
  let fields = null;
  let estimate = null;
  let progress = null;
  let hasLeft = false;

  function changed() {
    const count = fields?.jobs().length ?? 1;
    submit.textContent = count > 1 ? `Make ${count} holograms` : "Make the hologram";
    estimate?.soon();
  }

  async function send(event) {
    event.preventDefault();
    const jobs = fields.jobs();
    const missing = fields.missing();
    if (missing.length > 0) {
      showProblems(form, missing);
      form.querySelector("[aria-invalid]")?.focus();
      return;
    }
    submit.disabled = true;
    try {
      const say = (done) => show(notice, h("p", {}, jobs.length > 1 ? `${done} of ${jobs.length} pictures are uploaded…` : "The picture is uploaded…"),
        jobs.length > 1 && h("progress", { max: jobs.length, value: done, "aria-label": "Uploaded pictures" }));
      say(0);
      const submitted = await submitAll(jobs, fields.requestOf, say);
      if (hasLeft) return;
      if (submitted.length === 1) location.hash = `#/${submitted[0].name}`;
      else showBatch(submitted);
    } catch (error) {
      const others = showProblems(form, error.fields ?? []);
      show(notice, (others.length > 0 || !error.fields?.length) && errorNote(error));
      form.querySelector("[aria-invalid]")?.focus();
      submit.disabled = false;
    }
  }

  function showBatch(submitted) {
    estimate.end();
    progress = batchProgress(submitted[0].batch, submitted);
    show(body, progress.element, h("p", {}, h("button", { type: "button", onclick: () => {
      progress.end();
      submit.disabled = false;
      show(notice);
      fields.clear();
      show(body, form);
    } }, "More holograms")));
    scrollTo(0, 0);
  }

  async function take() {
    if (!dropped || !fields) return;
    const files = dropped;
    dropped = null;
    fields.take(await files);
  }

  async function begin() {
    const [{ displays }, refusal, job] = await Promise.all([get("displays", { pageSize: 200 }), mayNot("submit"), query.get("job") && get(`jobs/${query.get("job")}`), styled()]);
    if (hasLeft) return;
    if (refusal) {
      show(body, h("p", { class: "note" }, `${refusal} Ask an admin for a token that may make holograms.`));
      return;
    }
    if (displays.length === 0) {
      show(body, h("p", {}, "A hologram needs a display. Declare yours:"), displayForm(() => void begin()));
      return;
    }
    fields = hologramForm(displays, changed);
    estimate = estimateOf(form, fields);
    show(form, fields.element, h("div", { class: "send" }, estimate.element, h("p", { class: "actions" }, submit), notice));
    show(body, form);
    if (job) await fields.fill(job);
    else await fields.begin();
    await take();
    changed();
  }

  begin().catch((error) => show(body, errorNote(error)));
  addEventListener("picturedrop", take);
  return () => {
    hasLeft = true;
    removeEventListener("picturedrop", take);
    estimate?.end();
    progress?.end();
  };
}
