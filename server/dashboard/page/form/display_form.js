// The form that declares a display: what each has. The rest, such as its diffraction orders, is for the command line.

import { guarded } from "../access.js";
import { post } from "../api.js";
import { h, show } from "../dom.js";
import { errorNote } from "../loading.js";
import { labelled, showProblems } from "./controls.js";
import { styled } from "./style.js";

/** A form that declares a display. `onDeclared` is told of the new one. */
export function displayForm(onDeclared) {
  const input = (id, attributes) => h("input", { id: `display-${id}`, autocomplete: "off", required: true, ...attributes });
  const id = input("id", { maxlength: 63, placeholder: "lab" });
  const [widthPx, heightPx] = [input("width", { type: "number", min: 16, max: 8192, placeholder: "1920" }), input("height", { type: "number", min: 16, max: 8192, placeholder: "1080" })];
  const pitchUm = input("pitch", { type: "number", step: "any", min: 0, placeholder: "8" });
  const wavelengthsNm = input("wavelengths", { placeholder: "638, 520, 450" });
  const bits = input("bits", { type: "number", min: 1, max: 16, value: 8 });
  const isSimulated = h("input", { id: "display-simulated", type: "checkbox" });
  const submit = guarded(h("button", { type: "submit", class: "main" }, "Declare the display"), "administer");
  const notice = h("div", { role: "status" });
  const form = h("form", { class: "new", onsubmit: send }, h("div", { class: "columns" },
    labelled("Name: a-z, 0-9 and -", id, { field: "display.name" }),
    labelled("Width", widthPx, { field: "display.modulator.width_px", unit: "px" }), labelled("Height", heightPx, { field: "display.modulator.height_px", unit: "px" }),
    labelled("Pixel pitch", pitchUm, { field: "display.modulator.pixel_pitch_x_m", unit: "µm" }),
    labelled("Wavelengths, separated by commas", wavelengthsNm, { field: "display.wavelengths_m", unit: "nm" }),
    labelled("Depth of its grey levels", bits, { field: "display.modulator.bit_depth", unit: "bit" }),
    h("div", { class: "control check" }, isSimulated, h("label", { for: isSimulated.id }, "Simulate it, with a camera and the flaws of real optics"))),
  h("p", { class: "actions" }, submit), notice);

  async function send(event) {
    event.preventDefault();
    const wavelengthsM = wavelengthsNm.value.split(/[,;\s]+/).filter(Boolean).map((text) => fromUnit(text, -9));
    const modulator = { widthPx: Number(widthPx.value), heightPx: Number(heightPx.value), pixelPitchXM: fromUnit(pitchUm.value, -6), bitDepth: Number(bits.value), phase: {} };
    try {
      if (wavelengthsM.some((wavelength) => Number.isNaN(wavelength))) throw wrong("display.wavelengths_m", "has a part that is no number", "write nanometres such as 638, 520, 450");
      const name = `displays/${id.value.trim()}`;
      onDeclared(await post("displays", { name, modulator, wavelengthsM, ...(isSimulated.checked ? { simulatedBench: { seed: 1 } } : {}) }));
    } catch (error) {
      const others = showProblems(form, error.fields ?? []);
      show(notice, (others.length > 0 || !error.fields?.length) && errorNote(error));
      form.querySelector("[aria-invalid]")?.focus();
    }
  }

  void styled();
  return form;
}

/** A number of another unit in m, without a loss by a product of floats. */
const fromUnit = (text, exponent) => Number(`${Number(text)}e${exponent}`);

const wrong = (field, problem, fix) => Object.assign(new Error(`${field} ${problem}`), { fields: [{ field, problem, fix }] });
