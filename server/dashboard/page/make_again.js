// How to make a hologram again: on the command line, in Python, and as a call over HTTP.

import { mayNot } from "./access.js";
import { hasToken } from "./api.js";
import { DEFAULT_SERVER, lightpath } from "./command_line.js";
import { h } from "./dom.js";
import { namesOf } from "./form/files.js";
import { defaultOf, defaultPhase, isSame, middleOf, OPTIONS, valueOf } from "./form/options.js";
import { idOf } from "./format.js";

/** Columns of a program. */
const COLUMNS = 90;

/** A length as the command line and Python read it, without a loss: `150mm`, `515nm`, or all its digits in m. */
export function exactLength(metres) {
  for (const [unit, exponent] of metres < 1e-4 && metres > 0 ? [["nm", -9]] : [["mm", -3]]) {
    const text = String(Number((metres * 10 ** -exponent).toPrecision(12)));
    if (Number(`${text}e${exponent}`) === metres) return `${text}${unit}`;
  }
  return `${metres}m`;
}

/** A word or path as a shell reads it. */
function quoted(text) {
  return /^[\w./:=,@+-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`;
}

/** The word of an enumeration's value on the command line and in Python. */
function wordOf({ prefix }, value) {
  return value.slice(prefix.length + 1).toLowerCase().replaceAll("_", "-");
}

/** The options of a request that differ from their defaults, as `[option, word or number]`. */
function chosenOptions(spec) {
  return OPTIONS.filter((option) => !option.onlyIf || option.onlyIf(spec))
    .map((option) => [option, valueOf(option, spec)])
    .filter(([option, value]) => value !== defaultOf(option))
    // The command line and Python set the single iteration of double phase like any other number.
    .map(([option, value]) => [option, option.prefix ? wordOf(option, value) : value]);
}

/** The files of a request, as `{digest, name}`: each once, with a name of its own. */
function filesOf(job) {
  const spec = job.spec.optimizeHologram;
  const targets = [...new Set(spec.planes.map(({ target }) => target))];
  const names = namesOf(job.label, targets.length).map((name) => name.split(/[\\/]/).pop());
  const files = targets.map((digest, i) => ({ digest, name: names.indexOf(names[i]) === i ? names[i] : `${i + 1}-${names[i]}` }));
  const add = (digest, name) => digest && !files.some((file) => file.digest === digest) && files.push({ digest, name });
  add(spec.depthMap, "depth-map.png");
  add(spec.weightMask, "weights.png");
  (spec.initialPhase?.given?.phases ?? []).forEach((digest, i) => add(digest, `initial-phase-${i + 1}.npy`));
  return files;
}

/** The kernel of a request: `undefined` if the server chooses the same one by itself or each plane has its own. */
function kernelOf(job) {
  const choice = job.spec.optimizeHologram.kernel;
  if (choice?.version) return choice.version;
  return choice?.ideal ? "ideal" : undefined;
}

function startOf(spec, nameOf) {
  const phase = spec.initialPhase;
  if (!phase || isSame(phase, defaultPhase(spec))) return null;
  const [kind, { rangeRad, focalLengthM, phaseRad, phases }] = Object.entries(phase)[0];
  const words = {
    random: () => ["random", rangeRad], backPropagated: () => ["back-propagated", rangeRad],
    quadratic: () => [focalLengthM === undefined ? "quadratic" : `quadratic:${focalLengthM}m`],
    constant: () => [`constant:${phaseRad ?? 0}`], given: () => [phases.map(nameOf).join(",")],
  };
  const [word, range] = words[kind]();
  return { word, range };
}

/** The lines of a shell that fetch the files of a job. */
function fetching(files) {
  const token = hasToken() ? ` --header "authorization: Bearer $LIGHTPATH_TOKEN"` : "";
  return files.map(({ digest, name }) => `curl --fail${token} --output ${quoted(name)} ${location.origin}/v1/artifacts/${digest}/content`);
}

/** The command that makes the hologram of a job on its display. */
export function commandLine(job, display) {
  const spec = job.spec.optimizeHologram;
  const files = filesOf(job);
  const nameOf = (digest) => files.find((file) => file.digest === digest).name;
  const distances = spec.planes.map(({ place }) => exactLength(place.distanceM));
  const isOne = new Set(spec.planes.map(({ target }) => target)).size === 1 && (spec.planes.length === 1 || spec.depthMap);
  const parts = [`${lightpath()} hologram optimize${isOne ? ` ${quoted(nameOf(spec.planes[0].target))}` : ""}`, `--display ${idOf(spec.display)}`];
  if (isOne) parts.push(`--distance ${distances.join(",")}`);
  else parts.push(...spec.planes.map(({ target, weight }, i) => `--plane ${quoted(`${distances[i]}=${nameOf(target)}${(weight ?? 1) === 1 ? "" : `:${weight}`}`)}`));
  if (display.wavelengthsM.length > 1) parts.push(`--wavelength ${spec.wavelengthsM.map(exactLength).join(",")}`);
  if (spec.depthMap) parts.push(`--depth-map ${nameOf(spec.depthMap)}`);
  const kernel = kernelOf(job);
  if (kernel) parts.push(`--kernel ${kernel}`);
  for (const [{ flag }, value] of chosenOptions(spec)) parts.push(value === true ? flag : `${flag} ${value}`);
  const start = startOf(spec, nameOf);
  if (start) parts.push(`--initial-phase ${quoted(start.word)}${start.range === undefined ? "" : ` --phase-range ${start.range}`}`);
  if (spec.region && !isSame(spec.region, middleOf(display.modulator))) parts.push(`--region ${[spec.region.xPx, spec.region.yPx, spec.region.widthPx, spec.region.heightPx].join(",")}`);
  if (spec.weightMask) parts.push(`--weight-mask ${nameOf(spec.weightMask)}`);
  parts.push(spec.wavelengthsM.length > 1 || spec.subframes > 1 ? "-o hologram/" : "-o hologram.png");
  return [...fetching(files), parts.join(" \\\n  ")].join("\n");
}

/** The program in Python that makes the hologram of a job. */
export function pythonLines(job, display) {
  const spec = job.spec.optimizeHologram;
  const files = filesOf(job);
  const text = JSON.stringify;
  const nameOf = (digest) => text(files.find((file) => file.digest === digest).name);
  const list = (items) => (items.length === 1 ? items[0] : `[${items.join(", ")}]`);
  const given = [`distance=${list(spec.planes.map(({ place }) => text(exactLength(place.distanceM))))}`];
  if (display.wavelengthsM.length > 1) given.push(`wavelength=${list(spec.wavelengthsM.map((wavelength) => text(exactLength(wavelength))))}`);
  if (spec.depthMap) given.push(`depth_map=${nameOf(spec.depthMap)}`);
  const kernel = kernelOf(job);
  if (kernel) given.push(`kernel=${text(kernel)}`);
  for (const [{ python, isText }, value] of chosenOptions(spec)) {
    if (python) given.push(`${python}=${value === true ? "True" : isText || typeof value === "number" ? value : text(value)}`);
  }
  const start = spec.initialPhase && !isSame(spec.initialPhase, defaultPhase(spec)) ? messageOf(spec.initialPhase) : null;
  if (start) given.push(`initial_phase=${spec.initialPhase.given?.phases.length === 1 ? nameOf(spec.initialPhase.given.phases[0]) : `lightpath.v1.OptimizeHologram.InitialPhase(${start})`}`);
  if (spec.region && !isSame(spec.region, middleOf(display.modulator))) given.push(`region=(${[spec.region.xPx, spec.region.yPx, spec.region.widthPx, spec.region.heightPx].join(", ")})`);
  if (spec.weightMask) given.push(`weight_mask=${nameOf(spec.weightMask)}`);
  const targets = new Set(spec.planes.map(({ target }) => target)).size === 1 ? nameOf(spec.planes[0].target) : list(spec.planes.map(({ target }) => nameOf(target)));
  const isMany = spec.wavelengthsM.length > 1 || spec.subframes > 1;
  const lacks = [spec.planes.some(({ weight }) => (weight ?? 1) !== 1) && "weights of distances", chosenOptions(spec).some(([{ python }]) => !python) && "blocks for speckle"].filter(Boolean);
  return `${lacks.length > 0 ? `# Not the same hologram: Python has no options for ${lacks.join(" and ")}.\n` : ""}import lightpath

with lightpath.connect(${location.origin === DEFAULT_SERVER ? "" : text(location.origin)}) as lab:
    hologram = lab.display(${text(idOf(spec.display))}).optimize(
        ${wrapped([targets, ...given], " ".repeat(8))})
    hologram.${isMany ? 'save_all("hologram")' : 'save("hologram.png")'}`;
}

/** Arguments with commas, in lines of at most `COLUMNS` columns. */
function wrapped(given, indent) {
  const lines = [];
  for (const argument of given) {
    const longer = lines.length > 0 ? `${lines.at(-1)}, ${argument}` : argument;
    if (lines.length > 0 && indent.length + longer.length < COLUMNS) lines[lines.length - 1] = longer;
    else lines.push(argument);
  }
  return lines.join(`,\n${indent}`);
}

/** An initial phase as the fields of a message in Python. */
function messageOf(phase) {
  return Object.entries(phase).map(([kind, fields]) => {
    const snake = (name) => name.replace(/[A-Z]/g, (letter) => `_${letter.toLowerCase()}`);
    return `${snake(kind)}={${Object.entries(fields).map(([name, value]) => `"${snake(name)}": ${JSON.stringify(value)}`).join(", ")}}`;
  }).join(", ");
}

/** The call over HTTP that submits the request of a job of any kind. */
function curl(job) {
  const token = hasToken() ? ` --header "authorization: Bearer $LIGHTPATH_TOKEN"` : "";
  return `curl ${location.origin}/v1/jobs${token} --header 'content-type: application/json' --data '${JSON.stringify({ spec: job.spec }).replaceAll("'", "'\\''")}'`;
}

/** How to make a job again, in each language; with a link to the form for a hologram. `display` is that of a hologram. */
export function makeAgain(job, display) {
  const hologram = job.spec.optimizeHologram && display;
  const change = h("a", { class: "button", href: `#/new?job=${idOf(job.name)}` }, "Change it…");
  void mayNot("submit").then((refusal) => { change.hidden = refusal !== ""; });
  return h("section", {}, h("h2", {}, "Make it again"),
    hologram && [h("p", { class: "actions" }, change),
      code("On the command line", commandLine(job, display), true), code("In Python", pythonLines(job, display))],
    code("Over HTTP", curl(job), !hologram));
}

function code(title, text, isOpen = false) {
  const button = h("button", { type: "button", "aria-label": `Copy: ${title}`, onclick: () => void copy(text, button, block) }, "Copy");
  const block = h("pre", { tabindex: 0 }, h("code", {}, text));
  return h("details", { open: isOpen }, h("summary", {}, title), h("div", { class: "copied" }, block, button));
}

/** Copies a text. Where a browser forbids it, as on pages from plain http, the text is selected, to be copied by keys. */
async function copy(text, button, block) {
  try {
    await navigator.clipboard.writeText(text);
    button.textContent = "Copied";
  } catch {
    getSelection().selectAllChildren(block);
    button.textContent = "Selected: press Ctrl+C";
  }
  setTimeout(() => { button.textContent = "Copy"; }, 2500);
}
