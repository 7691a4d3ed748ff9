// The photographs of a display: those of a simulated one, and those of datasets.

import { get } from "./api.js";
import { placeText } from "./format.js";
import { photographPicture } from "./hologram_pictures.js";

/** Simulated photographs that are read, the newest. */
const CAPTURES_MAX = 100;
/** Datasets whose pairs are read, the newest ones, and pairs of each. */
const DATASETS_MAX = 2;
const PAIRS_MAX = 200;
/** Time for which photographs are not read again [ms]: without an event of new ones, and with one. */
const KEPT_MS = 60_000;
export const PHOTOGRAPHS_SPACING = 10_000;

const kept = new Map();

/**
 * The photographs of a display `displays/{id}`, the newest first: `{pattern, photo, at, time, picture, isAligned}`. `at` is the
 * place as text, `time` that of the photograph or of its dataset, `picture` shows it, and `isAligned` says that it has the
 * display's pixels, so that it can be compared with a target.
 */
export function photographsOf(name) {
  const known = kept.get(name);
  if (known && Date.now() - known.time < (known.isOld ? PHOTOGRAPHS_SPACING : KEPT_MS)) return known.read;
  const read = Promise.all([captures(name), pairs(name)]).then((lists) => lists.flat());
  kept.set(name, { time: Date.now(), read });
  read.catch(() => kept.delete(name));
  return read;
}

/** Notes that photographs are to be read anew, if an event may tell of new ones. Returns whether it does. */
export function noteNewPhotographs(kind, data) {
  const isCapture = kind === "job" && data.kind === "KIND_SIMULATE_CAPTURE" && data.state === "STATE_SUCCEEDED";
  if (!isCapture && kind !== "reset" && kind !== "dataset") return false;
  for (const [name, known] of kept) if (!isCapture || name === data.display) known.isOld = true;
  return true;
}

/** What all simulated photographs have in common: they have the display's pixels. */
export const simulated = (photo) => ({ picture: photographPicture("photograph", photo), isAligned: true });

async function captures(display) {
  const { jobs } = await get("jobs", { kind: "simulate_capture", state: "succeeded", display, pageSize: CAPTURES_MAX });
  return jobs.map(({ spec: { simulateCapture: { pattern, place } }, result: { simulateCapture: { photo } }, endTime }) =>
    ({ pattern, photo, at: placeText(place), time: Date.parse(endTime), ...simulated(photo) }));
}

async function pairs(display) {
  const [{ modulator }, { datasets }] = await Promise.all([get(display), get("datasets", { display, pageSize: 200 })]);
  const newest = datasets.filter(({ pairCount }) => pairCount > 0).sort((a, b) => Date.parse(b.createTime) - Date.parse(a.createTime)).slice(0, DATASETS_MAX);
  const lists = await Promise.all(newest.map(async (dataset) => {
    const { pairs } = await get(`${dataset.name}/pairs`, { pageSize: PAIRS_MAX });
    const encoding = dataset.photoEncoding === "ENCODING_SRGB" ? "srgb" : "linear";
    return pairs.map(({ pattern, photo, checks }) => ({
      pattern, photo, at: placeText(dataset.place), time: Date.parse(dataset.createTime),
      picture: photographPicture("photograph", photo, { encoding, bitDepth: dataset.photoBitDepth ?? 0 }),
      isAligned: !dataset.alignment && checks?.photoWidthPx === modulator.widthPx && checks?.photoHeightPx === modulator.heightPx,
    }));
  }));
  return lists.flat();
}
