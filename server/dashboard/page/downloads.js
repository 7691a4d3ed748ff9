// Files of a hologram's job, as the server stores them.

import { get, request } from "./api.js";
import { h, show } from "./dom.js";
import { namesOf } from "./form/files.js";
import { length, placeText } from "./format.js";
import { errorNote } from "./loading.js";
import { table } from "./table.js";

const PATTERN = "Pattern for the SLM";
/** So many files are listed at once; more have to be asked for. */
const FEW = 8;
/** Ends of file names by how files begin. */
const BEGINNINGS = [[[0x89, 0x50, 0x4e, 0x47], "png"], [[0xff, 0xd8], "jpg"], [[0x49, 0x49], "tif"], [[0x4d, 0x4d], "tif"], [[0x42, 0x4d], "bmp"], [[0x93, 0x4e], "npy"]];

/**
 * The files of a hologram, as `{title, file, digest, detail}`. The end of a target's name is told by its content, if its
 * name has none.
 */
export function filesOfHologram(job, { modulator }, photographs) {
  const spec = job.spec.optimizeHologram;
  const { wavelengths, colourReconstructions = [] } = job.result.optimizeHologram;
  const targets = [...new Set(spec.planes.map(({ target }) => target))];
  const names = namesOf(job.label, targets.length);
  const stem = names[0].split(/[\\/]/).pop().replace(/\.\w+$/, "") || "hologram";
  const bits = modulator.bitDepth ?? 8;
  const size = `${modulator.widthPx} × ${modulator.heightPx} px`;
  const files = [];
  for (const { wavelengthM, subframes, planes } of wavelengths) {
    const colour = wavelengths.length > 1 ? length(wavelengthM) : "";
    const titleOf = (...parts) => parts.filter(Boolean).join(", ");
    const nameOf = (kind, end, ...parts) => `${[stem, kind, ...parts].filter(Boolean).join("-").replaceAll(" ", "")}.${end}`;
    subframes.forEach(({ pattern, phase }, i) => {
      const subframe = subframes.length > 1 ? `subframe ${i + 1}` : "";
      files.push({ title: titleOf(PATTERN, colour, subframe), file: nameOf("pattern", "png", colour, subframe), digest: pattern, detail: `PNG, ${size}, ${bits} bits${bits > 8 ? " in a file of 16" : bits < 8 ? " in a file of 8" : ""}` });
      files.push({ title: titleOf("Phase", colour, subframe), file: nameOf("phase", "npy", colour, subframe), digest: phase, detail: "NumPy, float32, radians before response, carrier and rounding" });
    });
    planes.forEach(({ place, reconstruction }) => {
      const at = spec.planes.length > 1 ? placeText(place) : "";
      files.push({ title: titleOf("Reconstruction", colour, at), file: nameOf("reconstruction", "png", colour, at), digest: reconstruction, detail: `PNG, ${size}, sRGB` });
    });
  }
  colourReconstructions.forEach((digest, i) => files.push({ title: `Reconstruction in colour, ${placeText(spec.planes[i].place)}`, file: `${stem}-colour-${placeText(spec.planes[i].place).replaceAll(" ", "")}.png`, digest, detail: `PNG, ${size}, sRGB` }));
  targets.forEach((digest, i) => files.push({ title: targets.length > 1 ? `Target ${i + 1}` : "Target", file: names[i].split(/[\\/]/).pop(), digest, detail: "as it was uploaded" }));
  photographs.forEach(({ at, photo }, i) => files.push({ title: `Photograph, ${at}`, file: `${stem}-photograph${photographs.length > 1 ? `-${i + 1}` : ""}.png`, digest: photo, detail: "as the camera took it" }));
  return files;
}

/** A section with a button for each file. */
export function downloads(files) {
  const notice = h("div", { role: "status" });
  const row = ({ title, file, digest, detail }) => h("tr", {}, h("th", { scope: "row" }, title),
    h("td", {}, h("button", { type: "button", "aria-label": `Download ${title}`, onclick: () => void download(digest, file).then(() => show(notice), (error) => show(notice, errorNote(error))) }, "Download")), h("td", { class: "wide" }, file), h("td", {}, detail));
  return h("section", {}, h("h2", {}, "Files"), notice, h("details", { open: files.length <= FEW }, h("summary", {}, `${files.length} files`),
    table("Files of the hologram, byte for byte as the job made them", ["File", "Action", "Name", "Form"], files.map(row))));
}

/** A button that saves the patterns of these jobs, one file after the other. */
export function patternsButton(jobs) {
  const notice = h("span", { role: "status" });
  async function save() {
    const displays = new Map();
    const used = new Set();
    for (const [i, job] of jobs.entries()) {
      show(notice, `${i} of ${jobs.length} are saved`);
      const name = job.spec.optimizeHologram.display;
      if (!displays.has(name)) displays.set(name, await get(name));
      for (const { title, digest, file } of filesOfHologram(job, displays.get(name), [])) {
        if (!title.startsWith(PATTERN)) continue;
        // Holograms of one picture, as of a sweep, have the same name.
        const own = used.has(file) ? `${i + 1}-${file}` : file;
        used.add(own);
        await download(digest, own);
      }
    }
    show(notice, "All are saved.");
  }
  const button = h("button", { type: "button", "data-key": "patterns", onclick: () => {
    button.disabled = true;
    void save().catch((error) => show(notice, errorNote(error))).then(() => (button.disabled = false));
  } }, `Download the patterns of ${jobs.length} holograms`);
  return h("p", { class: "actions" }, button, notice);
}

/** Saves an artifact as a file. The token goes with the request, which a plain link could not do. */
async function download(digest, file) {
  const blob = await (await request(`/v1/artifacts/${digest}/content`)).blob();
  const beginning = new Uint8Array(await blob.slice(0, 4).arrayBuffer());
  const known = BEGINNINGS.find(([bytes]) => bytes.every((byte, i) => byte === beginning[i]));
  const url = URL.createObjectURL(blob);
  h("a", { href: url, download: /\.\w+$/.test(file) || !known ? file : `${file}.${known[1]}` }).click();
  setTimeout(() => URL.revokeObjectURL(url), 60_000);
}
