// Small pictures of a job, each in a frame of the display's form.

import { h } from "./dom.js";
import { hologramOf } from "./glance.js";
import { fetchPicture } from "./picture_source.js";

const FITS = { FIT_COVER: "cover", FIT_STRETCH: "stretch" };

/**
 * Fetches pictures as `picturesOf` has them, at most `columns` wide. Returns `{frames, form}`: of each `{title, digest, image,
 * window}`, and the width of the display relative to its height; `undefined`: unknown. `label(title)` describes a picture.
 */
export async function framesOf(job, pictures, columns, label, signal) {
  const loaded = await Promise.all(pictures.map(async ({ title, digest, wish, fit }) => {
    const image = h("img", { alt: label(title), class: FITS[fit] ?? "" });
    const { blob, widthPx, heightPx } = await fetchPicture(digest, { ...wish, width: columns }, signal);
    const url = URL.createObjectURL(blob);
    image.onload = () => URL.revokeObjectURL(url);
    image.src = url;
    return { title, digest, image, widthPx, heightPx, window: h("div", { class: "window" }, image) };
  }));
  const display = loaded.find(({ title }) => title !== "target");
  const target = loaded.find(({ title }) => title === "target");
  if (display && target) place(target.image, hologramOf(job).spec.optimizeHologram, display);
  return { frames: loaded, form: display && display.widthPx / display.heightPx };
}

/** Shows a target where it lies on the display: in the region of interest, if it fills that. */
function place(image, { targetArea, region }, { widthPx, heightPx }) {
  if (targetArea !== "AREA_REGION" || !region) return;
  const parts = { left: region.xPx / widthPx, top: region.yPx / heightPx, width: region.widthPx / widthPx, height: region.heightPx / heightPx };
  for (const [side, part] of Object.entries(parts)) image.style[side] = `${100 * part}%`;
}
