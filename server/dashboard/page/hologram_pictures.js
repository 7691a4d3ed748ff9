// The pictures of a hologram's job: targets, reconstructions, errors, holograms as phases, and photographs of them.

import { get } from "./api.js";
import { length, placeText } from "./format.js";

/** Jobs among which photographs of a hologram are looked for. */
const CAPTURES_MAX = 100;

/** The part of a file's range that values of so many bits have: files have 8 or 16 bits. */
function rangeOf(bitDepth) {
  const range = 2 ** bitDepth / (bitDepth <= 8 ? 255 : 65_535);
  return range < 1 ? range : undefined;
}

/** A hologram of grey levels as a picture of phases. */
export function phasePicture(label, digest, bitDepth = 8) {
  return { label, digest, kind: "phase", wish: { encoding: "linear", range: rangeOf(bitDepth) } };
}

/** A photograph, as a picture and for profiles. `bitDepth` 0: the bits of the file. */
export function photographPicture(label, digest, { group = "", encoding = "linear", bitDepth = 0 } = {}) {
  const wish = { encoding, range: bitDepth ? rangeOf(bitDepth) : undefined };
  return { label, digest, kind: "light", wish, group, profile: { encoding, isPhotograph: true } };
}

/** The region as `/picture` takes it, if targets fill it. */
function regionText({ targetArea, region }) {
  return targetArea === "AREA_REGION" && region ? [region.xPx, region.yPx, region.widthPx, region.heightPx].join() : undefined;
}

/** The target of a plane as the job sees it, and the parameters that subtract it from a reconstruction. */
function targetOf(spec, plane, wavelength, wavelengths) {
  const encoding = spec.targetEncoding === "ENCODING_LINEAR" ? "linear" : "srgb";
  const fit = spec.targetFit.replace("_UNSPECIFIED", "_CONTAIN");
  // Of three wavelengths the longest shows red, the middle one green and the shortest blue.
  const rank = [...wavelengths].sort((a, b) => b - a).indexOf(wavelength);
  const colour = wavelengths.length === 3 ? rank : undefined;
  return {
    digest: plane.target, fit, encoding, colour,
    minus: { minus: plane.target, minus_fit: fit.replace("FIT_", "").toLowerCase(), minus_encoding: encoding, minus_channel: ["red", "green", "blue"][colour], minus_region: regionText(spec) },
  };
}

/**
 * Pictures of one wavelength of a job's result. `photographs` are those that `photographsOf` found, and `area` is that of
 * `areaOf`.
 */
export function hologramPictures(spec, result, wavelength, bitDepth = 8, photographs = [], area = undefined) {
  const wavelengths = result.wavelengths.map(({ wavelengthM }) => wavelengthM);
  const shown = wavelength.planes.flatMap((plane, p) => {
    const at = placeText(plane.place);
    const target = targetOf(spec, spec.planes[p], wavelength.wavelengthM, wavelengths);
    return [
      { label: `target ${at}`, digest: target.digest, kind: "light", wish: { encoding: target.encoding }, fit: target.fit, area, group: at, profile: { encoding: target.encoding, colour: target.colour } },
      { label: `reconstruction ${at}`, digest: plane.reconstruction, kind: "light", group: at, profile: { encoding: "srgb" } },
      ...photographs.filter(({ at: place }) => place === at).map(({ photo }) => photographPicture(`photograph ${at}`, photo, { group: at })),
      // With a depth map each pixel of the target counts in one plane only, so a difference would not be an error.
      !spec.depthMap && { label: `error ${at}: reconstruction − target`, digest: plane.reconstruction, kind: "error", wish: target.minus },
    ].filter(Boolean);
  });
  if (spec.depthMap) shown.push({ label: "depth map, white at the first distance", digest: spec.depthMap, kind: "light", wish: { encoding: "linear" }, fit: shown[0].fit, area });
  wavelength.subframes.forEach(({ pattern }, s) => shown.push(phasePicture(`pattern${wavelength.subframes.length > 1 ? ` ${s + 1}` : ""}`, pattern, bitDepth)));
  return shown;
}

/** Targets and what the holograms of three wavelengths show of them together, in colour. `area` is that of `areaOf`. */
export function colourPictures(spec, result, area) {
  const [wavelength] = result.wavelengths;
  const wavelengths = result.wavelengths.map(({ wavelengthM }) => wavelengthM);
  return wavelength.planes.flatMap((plane, p) => {
    const at = placeText(plane.place);
    const { digest, encoding, fit } = targetOf(spec, spec.planes[p], wavelength.wavelengthM, wavelengths);
    return [
      { label: `target ${at}`, digest, kind: "light", wish: { encoding }, fit, area, group: at },
      { label: `reconstruction ${at}`, digest: result.colourReconstructions[p], kind: "light", group: at },
    ];
  });
}

/** The newest photograph of each place that a simulated display made of these patterns: `{pattern, at, photo}`. */
export async function photographsOf(display, patterns) {
  if (!display.simulatedBench) return [];
  const { jobs } = await get("jobs", { kind: "simulate_capture", state: "succeeded", display: display.name, pageSize: CAPTURES_MAX });
  const found = new Map();
  for (const { spec: { simulateCapture }, result } of jobs) {
    const [pattern, at] = [simulateCapture.pattern, placeText(simulateCapture.place)];
    const key = `${pattern} ${at}`;
    if (patterns.includes(pattern) && !found.has(key)) found.set(key, { pattern, at, photo: result.simulateCapture.photo });
  }
  return [...found.values()];
}

/** The judgement to believe: what a photograph is expected to show. */
export const headlineOf = (plane) => plane.judgements.find((judged) => judged.headline);

/** How well a hologram shows a plane, by its kernel in the engine, on the display's own orders; `undefined`: it was not measured. */
export function judgementOf(plane, stage, detector) {
  return plane.judgements.find((judged) => judged.model === "MODEL_ENGINE" && judged.orders === "ORDERS_OWN" && judged.rows === undefined && judged.kernelVersion === ""
    && judged.stage === `STAGE_${stage}` && judged.detector === `DETECTOR_${detector.toUpperCase()}`);
}
