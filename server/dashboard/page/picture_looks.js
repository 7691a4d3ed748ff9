// How pictures of light, phases and errors are coloured, and the bars that say what the colours mean.

import { pictureUrl } from "./api.js";
import { h } from "./dom.js";
import { number } from "./format.js";

/** Decades of the logarithmic scale. */
const DECADES = 3;

/** Choices of the user for each kind of picture: `{name, wish, bar}`; the first one holds until another is chosen. */
export const LOOKS = {
  light: {
    title: "Light as",
    choices: [
      { name: "a picture", wish: {}, bar: null },
      { name: "colours", wish: { colormap: "sequential" }, bar: { map: "sequential", from: "0", to: "1", unit: "light; white is 1" } },
      { name: `colours, ${DECADES} decades`, wish: { colormap: "sequential", log: DECADES }, bar: { map: "sequential", from: `10⁻³`, to: "1", unit: "light, logarithmic" } },
    ],
  },
  phase: {
    title: "Phases as",
    choices: [
      { name: "colours", wish: { colormap: "cyclic" }, bar: { map: "cyclic", from: "0", to: "2π", unit: "rad, as grey levels of the display" } },
      { name: "grey levels", wish: {}, bar: null },
    ],
  },
  error: {
    title: "Error up to",
    choices: [0.2, 0.05, 0.1, 0.5, 1].map((range) => ({
      name: `±${100 * range} %`,
      wish: { colormap: "diverging", range },
      bar: { map: "diverging", from: `−${number(range)}`, to: `+${number(range)}`, unit: "light; white is 1" },
    })),
  },
};

/** A colour bar with the values at its ends and the unit. */
export function colourBar({ map, from, to, unit }) {
  const colours = h("img", { alt: "" });
  pictureUrl(`/v1/colormaps/${map}`, { cache: "default" }).then((url) => {
    colours.onload = () => URL.revokeObjectURL(url);
    colours.src = url;
  }, () => colours.remove());
  return h("span", { class: "bar" }, h("span", {}, from), colours, h("span", {}, to), h("small", {}, unit));
}
