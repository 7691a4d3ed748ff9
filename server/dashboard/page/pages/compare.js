// Two holograms' jobs side by side: what differs in their requests, their quality, and their pictures.

import { get } from "../api.js";
import { h, show } from "../dom.js";
import { decibels, idOf, number, placeText } from "../format.js";
import { expectedOf, isNotJudged, NOT_JUDGED, photographOf, planesOf, scoreOf } from "../glance.js";
import { hologramPictures, judgementOf } from "../hologram_pictures.js";
import { areaOf } from "../hologram_region.js";
import { stateOf } from "../job_rows.js";
import { emptyNote, refresher } from "../loading.js";
import { photographsOf } from "../photographs.js";
import { pictureViewer } from "../pictures.js";
import { differing, fieldsOf } from "../request_fields.js";
import { table } from "../table.js";

export function comparePage(root, _, query) {
  const names = (query.get("jobs") ?? "").split(",").filter(Boolean).slice(0, 2);
  const body = h("div", {});
  show(root, h("h1", {}, "Compare two jobs"), body);
  let viewer = null;
  if (names.length < 2) {
    show(body, emptyNote("Choose two jobs in the list of jobs."), h("p", {}, h("a", { href: "#/jobs?kind=optimize_hologram" }, "To the jobs")));
    return () => {};
  }
  refresher(body, async () => {
    const jobs = await Promise.all(names.map((id) => get(`jobs/${id}`)));
    const requests = jobs.map((job) => fieldsOf(job.spec));
    const fields = differing(requests);
    const [head, quality, pictures, target] = [headOf(jobs), await qualityOf(jobs), await picturesOf(jobs), await targetOfA(jobs[0])];
    viewer?.end();
    viewer = pictures.length ? pictureViewer([...target, ...pictures]) : null;
    show(body, h("ul", { class: "log" }, head),
      quality.length > 0 && h("section", {}, h("h2", {}, "Quality"), quality),
      h("section", {}, h("h2", {}, "Requests"), fields.length
        ? table("Fields that differ", ["Field", "A", "B"], fields.map((field) => h("tr", {}, h("th", { scope: "row" }, field), requests.map((request) => h("td", { class: "wide" }, request[field] ?? "–")))))
        : h("p", {}, "The requests are the same.")),
      viewer && h("section", {}, h("h2", {}, "Pictures"), viewer.element));
  });
  return () => viewer?.end();
}

function headOf(jobs) {
  return jobs.map((job, i) => h("li", {}, `${"AB"[i]}: `, h("a", { href: `#/${job.name}` }, job.label || idOf(job.name)), stateOf(job)));
}

/** Reconstruction and photograph of the first picture of each. */
async function picturesOf(jobs) {
  const lists = await Promise.all(jobs.map(async (job, i) => {
    const [first] = planesOf(job);
    if (!first) return [];
    const photograph = photographOf(job, await photographsOf(job.spec.optimizeHologram.display));
    return [{ label: `${"AB"[i]}: reconstruction`, digest: first.plane.reconstruction, kind: "light", group: "", profile: { encoding: "srgb" } },
      photograph && { ...photograph.picture, label: `${"AB"[i]}: photograph`, group: "" }].filter(Boolean);
  }));
  return lists.flat();
}

/** What photographs of both are expected to show, by the same model, and do show; the other models and detectors are folded. */
async function qualityOf(jobs) {
  const rows = await Promise.all(jobs.map(async (job, i) => {
    const planes = planesOf(job);
    const photograph = planes.length ? photographOf(job, await photographsOf(job.spec.optimizeHologram.display)) : undefined;
    const score = photograph ? await scoreOf(job, photograph) : null;
    const photographed = score !== null ? decibels(score) : photograph ? "not scored" : "no photograph";
    return planes.map((entry, p) => ({ ...entry, job: "AB"[i], isUnjudged: isNotJudged(job), photographed: p === 0 ? photographed : "–" }));
  }));
  const all = rows.flat();
  if (all.length === 0) return [];
  const same = sameModel(rows);
  const headline = table("PSNR of the pictures", ["Job", "Plane", ">Expected in a photograph", ">Photographed"], all.map(({ job, plane, kernel, photographed, isUnjudged }) => {
    const expected = same.find(plane, kernel);
    return h("tr", {}, h("th", { scope: "row" }, job), h("td", {}, placeText(plane.place)),
      h("td", { class: "right" }, expected ? [h("strong", {}, expected.text), !expected.isExpected && h("small", {}, expected.note)] : isUnjudged ? NOT_JUDGED : "–"), h("td", { class: "right" }, photographed));
  }));
  const models = table("Displayed holograms, each as the kernel of its own hologram predicts it: not for comparing A with B", ["Job", "Plane", "Kernel", ">PSNR, point", ">PSNR, pixel", ">PSNR, supersampled", ">SSIM, pixel"], all.map(({ job, plane, kernel }) =>
    h("tr", {}, h("th", { scope: "row" }, job), h("td", {}, placeText(plane.place)), h("td", {}, kernelText(kernel)),
      ["point", "pixel", "supersampled"].map((detector) => h("td", { class: "right" }, decibels(judgementOf(plane, "DISPLAYED", detector)?.psnrDb.value))),
      h("td", { class: "right" }, number(judgementOf(plane, "DISPLAYED", "pixel")?.ssim)))));
  return [h("p", { class: same.isSame ? "" : "note" }, same.text), headline, h("details", {}, h("summary", {}, "Other models and detectors"), models)];
}

const kernelText = (kernel) => (kernel ? kernel.split("/kernels/")[1].replace("/versions/", ", version ") : "ideal");

/**
 * How both holograms are judged by the same kernel: `{text, isSame, find(plane, kernel)}`. That is the version that gives both
 * headlines, else one that judged both.
 */
function sameModel(rows) {
  const entries = rows.flat();
  const by = new Set(entries.map(({ plane, kernel }) => expectedOf(plane, kernel)?.by ?? ""));
  if (by.size === 1) {
    const [kernel] = by;
    const text = kernel ? `Both are judged by ${kernelText(kernel)}.` : "Both are judged by the ideal kernel: no kernel of the display was active to say what a photograph shows.";
    return { text, isSame: true, find: expectedOf };
  }
  const models = rows.map((list) => new Set(list.flatMap(({ plane, kernel }) => plane.judgements.map((judged) => judged.kernelVersion || kernel))));
  const common = [...(models[0] ?? [])].filter((model) => model && models[1]?.has(model)).at(-1);
  if (!common) return { text: "A and B were judged by different kernels, and none judged both. Their figures cannot be compared: submit the older one again.", isSame: false, find: expectedOf };
  const find = (plane, kernel) => {
    const judged = plane.judgements.findLast((one) => (one.kernelVersion || kernel) === common && one.model === "MODEL_ENGINE" && one.orders === "ORDERS_OWN" && one.stage === "STAGE_DISPLAYED" && one.detector === "DETECTOR_PIXEL");
    return judged ? { text: decibels(judged.psnrDb.value), note: "at most" } : null;
  };
  return { text: `Different kernels were active when A and B were submitted. Both figures are by ${kernelText(common)}, which judged both, without its own error.`, isSame: false, find };
}

/** The target of the first plane as a picture, in a list; an empty list for other jobs than those of holograms. */
async function targetOfA({ spec, result }) {
  const wavelength = result?.optimizeHologram?.wavelengths[0];
  if (!wavelength) return [];
  const area = areaOf(spec.optimizeHologram, await get(spec.optimizeHologram.display));
  const [target] = hologramPictures(spec.optimizeHologram, result.optimizeHologram, wavelength, undefined, [], area);
  return [{ ...target, label: "target of A", group: "" }];
}
