// What one sees of a job at a glance: its pictures, and the figure to believe.

import { get } from "./api.js";
import { decibels, measuredDecibels, placeText } from "./format.js";
import { headlineOf, hologramPictures } from "./hologram_pictures.js";
import { simulated } from "./photographs.js";
import { fetchPsnr } from "./picture_source.js";

/** Jobs whose requests and results are kept. */
const KEPT_MAX = 500;
const kept = new Map();
/** Names of the jobs of holograms that are kept, by the pattern and the place of their first picture. */
const byPattern = new Map();

/** The whole job of a summary, from memory if it has not ended otherwise since. */
export async function wholeJob({ name, state }) {
  const known = kept.get(name);
  if (known?.state === state) return known;
  const job = await get(name);
  keepJobs([job]);
  return job;
}

/** Whether the whole job is in memory. */
export const isKept = ({ name, state }) => kept.get(name)?.state === state;

export function keepJobs(jobs) {
  for (const job of jobs) {
    kept.set(job.name, job);
    const first = job.result?.optimizeHologram?.wavelengths[0];
    // Of several patterns that the eye sees as one, a photograph of one says nothing.
    if (first?.subframes.length === 1) byPattern.set(`${first.subframes[0].pattern} ${placeText(first.planes[0].place)}`, job.name);
  }
  for (const name of kept.keys()) {
    if (kept.size <= KEPT_MAX) break;
    kept.delete(name);
  }
}

/** Holograms among which those of photographs are looked for, and the time for which they are not read again [ms]. */
const HOLOGRAMS_MAX = 100;
const HOLOGRAMS_KEPT_MS = 60_000;
const hologramsRead = new Map();

/** Brings the newest holograms of a display `displays/{id}` into memory, so that those of photographs are found. */
export function readHolograms(display, keptMs = HOLOGRAMS_KEPT_MS) {
  const known = hologramsRead.get(display);
  if (known && Date.now() - known.time < keptMs) return known.read;
  const read = get("jobs", { display, kind: "optimize_hologram", state: "succeeded", pageSize: HOLOGRAMS_MAX }).then(({ jobs }) => keepJobs(jobs));
  hologramsRead.set(display, { time: Date.now(), read });
  read.catch(() => hologramsRead.delete(display));
  return read;
}

/** The job in memory of whose first picture a pattern and a place, as text, are; `undefined`: none. */
export const jobOfPhotograph = (pattern, at) => kept.get(byPattern.get(`${pattern} ${at}`));

/** The job of the hologram that a job shows or photographs, if it is in memory. */
export function hologramOf(job) {
  const capture = job.spec.simulateCapture;
  return capture ? jobOfPhotograph(capture.pattern, placeText(capture.place)) : job.spec.optimizeHologram ? job : undefined;
}

/**
 * What a photograph of one picture of a hologram is expected to show: `{text, note, value, std, isExpected, by}`. `kernel` is the
 * version for which the hologram was computed; empty: the ideal kernel. `by` is the version that judges; empty: the
 * hologram's own kernel. `null`: it was not measured.
 */
export function expectedOf(plane, kernel) {
  const judged = plane && headlineOf(plane);
  if (!judged) return null;
  const { psnrDb, stage, kernelVersion } = judged;
  const isExpected = stage === "STAGE_PHOTOGRAPHED";
  const note = isExpected ? "expected" : kernelVersion || kernel ? "at most" : "if the optics are ideal";
  return { text: isExpected ? measuredDecibels(psnrDb) : decibels(psnrDb.value), note, value: psnrDb.value, std: isExpected ? psnrDb.std : undefined, isExpected, by: kernelVersion || kernel };
}

/** Whether a hologram was made without any judgement. */
export const isNotJudged = (job) => job.result?.optimizeHologram?.judged === "JUDGING_NONE";

export const NOT_JUDGED = "not judged (judge none)";

/** The planes of a hologram's result, over all its wavelengths, with the kernel of each. */
export function planesOf(job) {
  const planes = job.result?.optimizeHologram?.wavelengths.flatMap(({ wavelengthM, planes }) => planes.map((plane) => ({ wavelengthM, plane }))) ?? [];
  return planes.map((entry, i) => ({ ...entry, kernel: job.kernels[i]?.kernelVersion ?? "" }));
}

/** The lowest of what photographs of a hologram's pictures are expected to show, and the number of pictures; `null`: unknown. */
export function worstExpected(job) {
  const all = planesOf(job).map(({ plane, kernel }) => expectedOf(plane, kernel)).filter(Boolean);
  if (all.length === 0) return null;
  return { ...all.reduce((worst, one) => (one.value < worst.value ? one : worst)), pictures: all.length };
}

/** Pictures of a job `{title, label, digest, wish, fit}`, at most a target, a reconstruction and a photograph of `photographs`. */
export function picturesOf(job, photographs = []) {
  const shownJob = hologramOf(job);
  const hologram = shownJob?.spec.optimizeHologram;
  const shown = photographOf(job, photographs);
  const photograph = shown && { title: "photograph", ...shown.picture };
  if (!hologram) return photograph ? [photograph] : [];
  const target = { title: "target", label: "target", digest: hologram.planes[0].target, wish: { encoding: hologram.targetEncoding === "ENCODING_LINEAR" ? "linear" : "srgb" }, fit: hologram.targetFit };
  const result = shownJob.result?.optimizeHologram;
  if (!result) return [target, photograph].filter(Boolean);
  const [plane] = result.wavelengths[0].planes;
  return [target, { title: "reconstruction", label: "reconstruction", digest: result.colourReconstructions[0] || plane.reconstruction, wish: {} },
    photograph].filter(Boolean);
}

/** The newest photograph of the first picture of a hologram, or that which a job took. */
export function photographOf(job, photographs) {
  const own = job.result?.simulateCapture?.photo;
  if (own) return { photo: own, ...simulated(own) };
  const first = job.result?.optimizeHologram?.wavelengths[0];
  if (!first) return undefined;
  const at = placeText(first.planes[0].place);
  return first.subframes.length > 1 ? undefined : photographs.find((photograph) => photograph.pattern === first.subframes[0].pattern && photograph.at === at);
}

/** PSNR of a photograph of a hologram against its target in the job's region, as `fetchPsnr` has it [dB]; `null`: it cannot be known. */
export async function scoreOf(job, photograph, signal) {
  const result = job?.result?.optimizeHologram;
  const error = result && hologramPictures(job.spec.optimizeHologram, result, result.wavelengths[0]).find(({ kind }) => kind === "error");
  if (!error || !photograph?.isAligned) return null;
  const { region } = job.spec.optimizeHologram;
  const part = region ? [region.xPx, region.yPx, region.widthPx, region.heightPx].join(",") : undefined;
  const fitted = job.spec.optimizeHologram.targetArea === "AREA_REGION" ? { minus_region: part } : {};
  return fetchPsnr(photograph.photo, { ...fitted, ...error.wish, encoding: photograph.picture.wish.encoding, region: part }, signal);
}
