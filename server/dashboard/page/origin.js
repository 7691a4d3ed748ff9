// Where kernel versions come from: the job, the datasets, the seed and the program that made them.

import { get } from "./api.js";
import { h } from "./dom.js";
import { idOf, length, placeText } from "./format.js";
import { table } from "./table.js";

/** The learning from which a version comes, whether it was on this server, and how the version came from it. */
function learningOf(lineage) {
  const made = lineage?.imported ?? lineage ?? {};
  const how = made.interpolated ? "interpolated" : "learned";
  return { learning: made[how], here: !lineage?.imported && Boolean(made[how]), how };
}

/** A table of the origins of kernel versions, given as `[title, version]`; `null` stands for the ideal kernel. `heading` is that of the titles. */
export function originTable(heading, versions) {
  const row = ([title, version]) => {
    const first = h("th", { scope: "row" }, title);
    if (!version) return h("tr", {}, first, h("td", {}, "ideal"), h("td", { colspan: 5 }, "computed, not learned"));
    const { lineage } = version;
    const kernel = version.name.split("/versions/")[0];
    const { learning, here, how } = learningOf(lineage);
    const datasets = (learning?.datasets ?? []).map((dataset) => h("div", {}, here ? h("a", { href: `#/${dataset.name}` }, idOf(dataset.name)) : `${dataset.name ? idOf(dataset.name) : ""} of another server`,
      ` ${placeText(dataset.place)}`, dataset.digest && h("small", { title: dataset.digest }, dataset.digest.slice(0, 15))));
    return h("tr", {}, first,
      h("td", {}, h("a", { href: `#/${kernel}` }, `${idOf(kernel)}, version ${version.version}`)),
      h("td", {}, here ? h("a", { href: `#/${learning.job}` }, idOf(learning.job).slice(0, 13)) : "imported", how === "interpolated" && ", interpolated", lineage?.imported?.note && h("small", {}, lineage.imported.note)),
      h("td", {}, datasets),
      h("td", { class: "right" }, learning?.parentVersion ? `version ${idOf(learning.parentVersion)}` : "–"),
      h("td", { class: "right" }, learning?.parameters?.seed ?? "–"),
      h("td", { class: "right" }, lineage?.codeVersion || "–"));
  };
  return table("Kernels, and what they were learned from", [heading, "Kernel", "Learned by", "Datasets", ">Continues", ">Seed", ">Lightpath"], versions.map(row));
}

/** The kernel versions through which a hologram's job looks, as `[plane, version]`; `null` stands for the ideal kernel. */
export async function versionsOfHologram(job) {
  return Promise.all(job.kernels.map(async ({ wavelengthM, place, kernelVersion }) =>
    [`${length(wavelengthM)}, ${placeText(place)}`, kernelVersion ? await get(kernelVersion) : null]));
}
