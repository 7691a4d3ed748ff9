// The phase with which the search starts.

import { h, show } from "../dom.js";
import { fileButton, labelled, pictureList, select } from "./controls.js";
import { ownFile, storedFile } from "./files.js";

const KINDS = [["", "as the method needs it"], ["backPropagated", "the picture sent back to the display"], ["random", "random"], ["quadratic", "that of a lens"],
  ["constant", "the same everywhere"], ["given", "from files"]];
/** The number that belongs to each kind: its name, label, unit, and factor to the unit of the API. */
const NUMBERS = {
  backPropagated: ["rangeRad", "Range of its random part", "rad", 0],
  random: ["rangeRad", "Range", "rad", 1],
  quadratic: ["focalLengthM", "Focal length", "m", null],
  constant: ["phaseRad", "Phase", "rad", 0],
};

export function startControl(onChange) {
  let files = [];
  const kind = select("initial-phase", KINDS, { onchange: draw });
  const number = h("input", { id: "initial-number", type: "number", step: "any" });
  const numberHolder = h("div", {});
  const chosen = h("ul", { class: "chosen" });
  const given = h("div", {}, fileButton("initial-files", "Choose files, one for each wavelength…", (list) => {
    files = list.map(ownFile);
    draw();
    onChange();
  }, { accept: ".npy,.png,.bmp", multiple: true }), chosen);
  const element = h("div", { "data-field": "initial_phase" }, labelled("Initial phase", kind), numberHolder, given);

  function draw() {
    const wanted = NUMBERS[kind.value];
    show(numberHolder, wanted && labelled(wanted[1], number, { unit: wanted[2] }));
    number.placeholder = wanted ? (wanted[3] ?? "default") : "";
    given.hidden = kind.value !== "given";
    pictureList(chosen, files, (i) => { files.splice(i, 1); draw(); onChange(); });
  }

  draw();
  return {
    element,
    async read() {
      if (!kind.value) return undefined;
      if (kind.value === "given") return { given: { phases: await Promise.all(files.map((file) => file.digest())) } };
      return { [kind.value]: number.value === "" ? {} : { [NUMBERS[kind.value][0]]: Number(number.value) } };
    },
    fill(phase) {
      kind.value = Object.keys(phase ?? {})[0] ?? "";
      number.value = NUMBERS[kind.value] ? phase[kind.value][NUMBERS[kind.value][0]] ?? "" : "";
      files = (phase?.given?.phases ?? []).map((digest, i) => storedFile(`phase ${i + 1}`, digest));
      draw();
    },
  };
}
