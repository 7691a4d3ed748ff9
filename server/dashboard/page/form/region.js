// The region in which a picture counts.

import { h } from "../dom.js";
import { group } from "./controls.js";

const SIDES = [["xPx", "left"], ["yPx", "top"], ["widthPx", "width"], ["heightPx", "height"]];

/** Four numbers. Empty ones have their values from the default, which the fields show. */
export function regionControl() {
  const inputs = SIDES.map(([name, label]) => h("input", { id: `region-${name}`, type: "number", min: 0, step: 1, "aria-label": `Region: ${label}` }));
  const element = group("Region in which the picture counts", "region",
    h("span", { class: "field" }, inputs.map((input, i) => [input, h("span", {}, SIDES[i][1])]), h("span", {}, "px")));
  return {
    element,
    setMiddle(middle) {
      inputs.forEach((input, i) => { input.placeholder = middle[SIDES[i][0]]; });
    },
    /** The region for a request; `null`: the default. */
    read() {
      if (inputs.every(({ value }) => value === "")) return null;
      return Object.fromEntries(SIDES.map(([name], i) => [name, Number(inputs[i].value || inputs[i].placeholder)]));
    },
    fill(region) {
      inputs.forEach((input, i) => { input.value = region ? region[SIDES[i][0]] : ""; });
    },
  };
}
