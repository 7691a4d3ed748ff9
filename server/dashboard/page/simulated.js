// The mark of displays that exist only as a simulation.

import { h } from "./dom.js";

/** A mark to stand behind the name of a simulated display. Nothing for a real one. */
export function simulatedMark(display) {
  // The space is for those who hear the page.
  return display.simulatedBench ? [" ", h("span", { class: "state" }, "simulated")] : null;
}
