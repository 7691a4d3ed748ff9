// The form of a hologram: its pictures, optics and options, and the requests that they make.

import { get } from "../api.js";
import { h, show } from "../dom.js";
import { idOf, length } from "../format.js";
import { fileButton, group, labelled, optionControl, pictureList, select } from "./controls.js";
import { ACCEPTED, namesOf, ownFile, picturesAmong, storedFile } from "./files.js";
import { kernelControl } from "./kernels.js";
import { defaultOf, defaultPhase, isSame, middleOf, OPTIONS, put, valueOf } from "./options.js";
import { planesControl } from "./planes.js";
import { regionControl } from "./region.js";
import { startControl } from "./start.js";

/** So many wavelengths show the colours of a picture. */
const COLOURS = 3;

/**
 * The controls of a hologram on one of these displays. `onChange` is told of every change. Returns `{element, take, fill,
 * clear, jobs, missing, requestOf, begin}`: `take` takes files, `fill` a job's request, `jobs` lists what is to be made,
 * `missing` what it lacks, and `requestOf` uploads the files of a job and returns its request.
 */
export function hologramForm(displays, onChange) {
  let pictures = [];
  let mask = null;
  const display = select("display", displays.map(({ name }) => [name, idOf(name)]), { onchange: () => void changeDisplay() });
  const wavelengths = h("div", { class: "choices" });
  const wavelengthGroup = group("Wavelengths", "wavelengths_m", wavelengths);
  const kernel = kernelControl();
  const planes = planesControl(changed);
  const start = startControl(changed);
  const chosen = h("ul", { class: "chosen" });
  const picturesHint = h("p", { class: "hint" });
  const picturesControl = group("Pictures", "planes[0].target", h("p", {},
    fileButton("picture", "Choose pictures…", (files) => take(files), { accept: ACCEPTED, multiple: true }), " ",
    fileButton("folder", "Choose a folder…", (files) => take(picturesAmong(files)), { webkitdirectory: true })), picturesHint, chosen);
  const controls = new Map(OPTIONS.map((option) => [option, optionControl(option)]));
  const region = regionControl();
  const maskList = h("ul", { class: "chosen" });
  const maskControl = h("div", { class: "control", "data-field": "weight_mask" }, h("p", { class: "hint" }, "Weights of the pixels, grey: black ones do not count"),
    fileButton("weight-mask", "Choose the weights…", ([file]) => { mask = ownFile(file); changed(); }, { accept: ACCEPTED }), maskList);
  const priority = h("input", { id: "priority", type: "number", min: -100, max: 100, value: 0 });
  const batch = h("input", { id: "batch", maxlength: 128, autocomplete: "off" });
  const elements = (isAdvanced) => OPTIONS.filter((option) => Boolean(option.isAdvanced) === isAdvanced).map((option) => controls.get(option).element);
  const more = h("details", {}, h("summary", {}, "More options"), h("div", { class: "columns" }, elements(true), start.element), region.element, maskControl,
    h("div", { class: "columns" }, labelled("Batch", batch, { field: "batch" }), labelled("Priority; lower numbers run first", priority, { field: "priority" })));
  const element = h("div", { class: "hologram-form" }, picturesControl,
    h("div", { class: "columns" }, labelled("Display", display, { field: "display" }), kernel.element),
    wavelengthGroup, planes.element, h("div", { class: "columns" }, elements(false)), more);
  element.addEventListener("input", changed);

  function changed() {
    const own = planes.contents === "own";
    show(picturesHint, own ? "Each distance has its picture, below." : pictures.length > 1 ? `${pictures.length} pictures: a hologram of each.`
      : pictures.length === 0 ? "Or drop pictures or folders anywhere on this page. Each picture becomes a hologram." : null);
    pictureList(chosen, own ? [] : pictures, (i) => { pictures.splice(i, 1); changed(); });
    pictureList(maskList, mask ? [mask] : [], () => { mask = null; changed(); });
    const values = Object.fromEntries(OPTIONS.map((option) => [option.path, read(option)]));
    for (const option of OPTIONS) {
      const { element: shown, input } = controls.get(option);
      shown.hidden = Boolean(option.onlyIf && !option.onlyIf(values));
      input.disabled = shown.hidden;
    }
    const isDoublePhase = values.method === "HOLOGRAM_METHOD_DOUBLE_PHASE";
    controls.get(OPTIONS[0]).element.hidden = isDoublePhase;
    void kernel.offer(wavelengthsM(), planes.distancesM).catch(() => {});
    onChange();
  }

  function read(option) {
    const { input } = controls.get(option);
    if (typeof option.fallback === "boolean") return input.checked;
    return option.choices || option.isText ? input.value : Number(input.value);
  }

  function wavelengthsM() {
    return [...wavelengths.querySelectorAll("input")].filter(({ checked }) => checked).map(({ value }) => Number(value));
  }

  /** Reads what the chosen display has. `wanted` are wavelengths to choose, otherwise those of colours, or the first one. */
  async function changeDisplay(wanted, keepsDistance = false) {
    const found = displays.find(({ name }) => name === display.value);
    region.setMiddle(middleOf(found.modulator));
    show(wavelengths, found.wavelengthsM.map((wavelength, i) => h("label", {}, h("input", { type: "checkbox", value: wavelength, checked: wanted ? wanted.includes(wavelength) : i === 0 || found.wavelengthsM.length === COLOURS }), ` ${length(wavelength)}`)));
    wavelengthGroup.hidden = found.wavelengthsM.length === 1;
    const { kernels } = await get(`${found.name}/kernels`, { pageSize: 100 });
    kernel.setKernels(kernels);
    planes.suggest([...new Set(kernels.map(({ place }) => place.distanceM))]);
    const active = kernels.find(({ activeVersion }) => activeVersion);
    if (active && !keepsDistance && planes.distancesM.length === 1) planes.fill([{ distanceM: active.place.distanceM }], "same", null);
    await kernel.offer(wavelengthsM(), planes.distancesM);
    changed();
  }

  function take(files) {
    if (files.length === 0) return;
    const taken = files.map(ownFile);
    if (planes.contents === "own") planes.take(taken);
    else pictures = taken;
    if (taken.length > 1 && batch.value === "" && planes.contents !== "own") {
      const folder = files[0].webkitRelativePath?.split("/")[0];
      batch.value = folder || `pictures ${new Date().toISOString().slice(0, 16).replace("T", " ")}`;
    }
    changed();
  }

  /** What is to be made: the pictures of each job, one for each distance. A missing picture is `null`. */
  function jobs() {
    if (planes.contents === "own") return [planes.pictures];
    return (pictures.length > 0 ? pictures : [null]).map((picture) => planes.distancesM.map(() => picture));
  }

  /** Files that are still to be chosen, as problems of their fields. */
  function missing() {
    const fix = "choose it, or drop it on this page";
    const targets = planes.contents === "own" ? planes.pictures : pictures.length > 0 ? [] : [null];
    const found = targets.flatMap((picture, i) => (picture ? [] : [{ field: `planes[${i}].target`, problem: "the picture is missing", fix }]));
    if (planes.contents === "depth" && !planes.depthMap) found.push({ field: "depth_map", problem: "the map is missing", fix: "choose it" });
    return found;
  }

  /** Uploads the files of a job, and returns its request. */
  async function requestOf(shown) {
    const targets = await Promise.all(shown.map((picture) => picture?.digest() ?? ""));
    const spec = { display: display.value, planes: planes.planes(targets) };
    const own = wavelengthsM();
    if (!wavelengthGroup.hidden) spec.wavelengthsM = own;
    for (const option of OPTIONS) {
      const value = read(option);
      if (controls.get(option).element.hidden || value === defaultOf(option)) continue;
      put(spec, option.path, value);
    }
    // Double phase needs one iteration.
    if (spec.method === "HOLOGRAM_METHOD_DOUBLE_PHASE") spec.iterations = 1;
    const choice = kernel.read();
    if (choice) spec.kernel = choice;
    if (planes.depthMap) spec.depthMap = await planes.depthMap.digest();
    if (mask) spec.weightMask = await mask.digest();
    const phase = await start.read();
    if (phase) spec.initialPhase = phase;
    const counts = region.read();
    if (counts) spec.region = counts;
    const names = [...new Set(shown.map((picture) => picture?.name).filter(Boolean))];
    return { spec: { optimizeHologram: spec }, label: labelOf(names.join(", ")), batch: batch.value.trim(), priority: Number(priority.value) };
  }

  /** Takes over the request of a job. */
  async function fill(job) {
    const spec = job.spec.optimizeHologram;
    const found = displays.find(({ name }) => name === spec.display);
    if (found) display.value = spec.display;
    const targets = [...new Set(spec.planes.map(({ target }) => target))];
    const names = namesOf(job.label, targets.length);
    const stored = new Map(targets.map((digest, i) => [digest, storedFile(names[i], digest)]));
    pictures = targets.length === 1 ? [...stored.values()] : [];
    planes.fill(spec.planes.map(({ place, target, weight }) => ({ distanceM: place.distanceM, picture: targets.length > 1 ? stored.get(target) : null, weight })),
      targets.length > 1 ? "own" : spec.depthMap ? "depth" : "same", spec.depthMap ? storedFile("the map of the job", spec.depthMap) : null);
    mask = spec.weightMask ? storedFile("the weights of the job", spec.weightMask) : null;
    for (const option of OPTIONS) {
      const { input } = controls.get(option);
      if (typeof option.fallback === "boolean") input.checked = Boolean(valueOf(option, spec));
      else input.value = valueOf(option, spec);
    }
    start.fill(isSame(spec.initialPhase, defaultPhase(spec)) ? undefined : spec.initialPhase);
    const isMiddle = !spec.region || (found && isSame(spec.region, middleOf(found.modulator)));
    region.fill(isMiddle ? null : spec.region);
    priority.value = job.priority;
    const isAdvanced = OPTIONS.some((option) => option.isAdvanced && valueOf(option, spec) !== defaultOf(option));
    more.open = isAdvanced || !isMiddle || mask !== null || !isSame(spec.initialPhase, defaultPhase(spec));
    await changeDisplay(spec.wavelengthsM, true);
    kernel.fill(spec.kernel);
    changed();
  }

  /** Forgets the pictures, but keeps the options. */
  function clear() {
    pictures = [];
    planes.clear();
    batch.value = "";
    changed();
  }

  return { element, take, fill, clear, jobs, missing, requestOf, begin: () => changeDisplay() };
}

/** File names as the label of a job: at most 128 bytes, without a part of a character at the end. */
function labelOf(names) {
  const bytes = new TextEncoder().encode(names.replace(/\p{Cc}/gu, " "));
  return new TextDecoder().decode(bytes.slice(0, 128)).replace(/\ufffd+$/, "");
}
