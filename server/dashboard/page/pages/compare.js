// Two holograms' jobs side by side: what differs in their requests, their quality, and their pictures.

import { get } from "../api.js";
import { h, show } from "../dom.js";
import { decibels, idOf, length, measuredDecibels, number, placeText } from "../format.js";
import { headlineOf, hologramPictures, judgementOf } from "../hologram_pictures.js";
import { stateOf } from "../job_rows.js";
import { emptyNote, refresher } from "../loading.js";
import { pictureViewer } from "../pictures.js";
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
    const requests = jobs.map((job) => flat(job.spec));
    const fields = [...new Set(requests.flatMap((request) => Object.keys(request)))].filter((field) => requests[0][field] !== requests[1][field]);
    const planes = jobs.map((job) => job.result?.optimizeHologram?.wavelengths[0].planes ?? []);
    const pictures = planes.map((list, i) => list[0] && { label: `${"AB"[i]}: reconstruction`, digest: list[0].reconstruction, kind: "light", group: "", profile: { encoding: "srgb" } }).filter(Boolean);
    viewer?.end();
    viewer = pictures.length ? pictureViewer([...targetOfA(jobs[0]), ...pictures]) : null;
    const head = jobs.map((job, i) => h("li", {}, `${"AB"[i]}: `, h("a", { href: `#/${job.name}` }, idOf(job.name)), stateOf(job)));
    const quality = planes.flatMap((list, i) => list.map((plane) => h("tr", {}, h("th", { scope: "row" }, "AB"[i]), h("td", {}, placeText(plane.place)),
      h("td", { class: "right" }, headlineOf(plane) ? measuredDecibels(headlineOf(plane).psnrDb) : "–"),
      ["point", "pixel", "supersampled"].map((detector) => h("td", { class: "right" }, decibels(judgementOf(plane, "DISPLAYED", detector)?.psnrDb.value))),
      h("td", { class: "right" }, number(judgementOf(plane, "DISPLAYED", "pixel")?.ssim)))));
    show(body, h("ul", { class: "log" }, head),
      h("section", {}, h("h2", {}, "Requests"), fields.length
        ? table("Fields that differ", ["Field", "A", "B"], fields.map((field) => h("tr", {}, h("th", { scope: "row" }, field), requests.map((request) => h("td", { class: "wide" }, request[field] ?? "–")))))
        : h("p", {}, "The requests are the same.")),
      quality.length > 0 && h("section", {}, h("h2", {}, "Quality"), table("Quality of the displayed holograms", ["Job", "Plane", ">PSNR in a photograph, expected", ">PSNR, point", ">PSNR, pixel", ">PSNR, supersampled", ">SSIM, pixel"], quality)),
      viewer && h("section", {}, h("h2", {}, "Pictures"), viewer.element));
  });
  return () => viewer?.end();
}

/** The target of the first plane as a picture, in a list; an empty list for other jobs than those of holograms. */
function targetOfA({ spec, result }) {
  const wavelength = result?.optimizeHologram?.wavelengths[0];
  if (!wavelength) return [];
  const [target] = hologramPictures(spec.optimizeHologram, result.optimizeHologram, wavelength);
  return [{ ...target, label: "target of A", group: "" }];
}

/** The fields of a message with their paths, such as `optimizeHologram.planes.0.place.distanceM`. */
function flat(value, path = "") {
  if (value === null || typeof value !== "object") return { [path]: String(value) };
  return Object.assign({}, ...Object.entries(value).map(([name, inner]) => flat(inner, path ? `${path}.${name}` : name)));
}
