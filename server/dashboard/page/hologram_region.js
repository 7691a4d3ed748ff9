// The region in which a hologram's pictures count, and the area that its targets fill.

import { middleOf } from "./form/options.js";

/** The region in which a hologram's pictures count, in parts of the display: `{left, top, width, height}`. */
export function regionOf({ region }, { modulator }) {
  const { xPx = 0, yPx = 0, widthPx, heightPx } = region ?? middleOf(modulator);
  return { left: xPx / modulator.widthPx, top: yPx / modulator.heightPx, width: widthPx / modulator.widthPx, height: heightPx / modulator.heightPx };
}

/** The part of the display to which targets are fitted; `undefined`: the whole of it. */
export function areaOf(spec, display) {
  return spec.targetArea === "AREA_REGION" ? regionOf(spec, display) : undefined;
}
