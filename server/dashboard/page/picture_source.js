// A picture of the server, drawn by it as a user wants to see it: at the shown size, in part, in colours.

import { request } from "./api.js";

/** Pictures are fetched in steps of this width, so that a slightly wider window finds them in the browser's cache [px]. */
const WIDTH_STEP = 128;
/** More columns than a frame has on any screen [px]. */
const WIDTH_MAX = 2048;

/** Path of a picture. `wish` has parameters of `/picture`, such as `colormap`. */
export function picturePath(digest, wish = {}) {
  const query = new URLSearchParams(Object.entries(wish).filter(([, value]) => value !== null && value !== undefined));
  return `/v1/artifacts/${digest}/picture?${query}`;
}

/** Number of columns to fetch for an element of this width. */
export function columnsFor(widthCssPx) {
  const columns = Math.ceil((widthCssPx * devicePixelRatio) / WIDTH_STEP) * WIDTH_STEP;
  return Math.min(WIDTH_MAX, Math.max(WIDTH_STEP, columns));
}

/** Fetches a picture: `{blob, widthPx, heightPx}` with the size of the whole of it. */
export async function fetchPicture(digest, wish, signal) {
  const response = await request(picturePath(digest, wish), { signal, cache: "default" });
  const [widthPx, heightPx] = response.headers.get("picture-size").split("x").map(Number);
  return { blob: await response.blob(), widthPx, heightPx };
}

/** The values of a picture of one row or one column, from 0 to 1: one list of them for each of red, green and blue. */
export async function valuesOf(blob) {
  const bitmap = await createImageBitmap(blob, { colorSpaceConversion: "none", premultiplyAlpha: "none" });
  const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d");
  context.drawImage(bitmap, 0, 0);
  const { data } = context.getImageData(0, 0, bitmap.width, bitmap.height);
  return [0, 1, 2].map((colour) => Array.from({ length: data.length / 4 }, (_, i) => data[4 * i + colour] / 255));
}

/**
 * PSNR of a photograph against the picture that `wish` subtracts [dB]; `null`: the server does not say it. Gain and black level of
 * the camera do not count, as in what the server expects of a photograph.
 */
export async function fetchPsnr(digest, wish, signal) {
  const response = await request(picturePath(digest, { ...wish, width: 1 }), { signal, cache: "default" });
  const psnr = response.headers.get("picture-psnr-with-offset");
  return psnr === null ? null : Number(psnr);
}
