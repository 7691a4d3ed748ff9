// Controls of a form with their labels, and problems that the server found, each beside the field that it names.

import { pictureUrl } from "../api.js";
import { h, show } from "../dom.js";
import { picturePath } from "../picture_source.js";
import { defaultOf } from "./options.js";

/** Columns of a small picture beside a name [px]. */
const THUMBNAIL_PX = 144;
/** So many files of a control are listed; a folder can have hundreds. */
const LISTED = 24;
/** What lists of pictures show, by their elements. */
const listed = new WeakMap();

/**
 * A labelled control. `field` is the name of the request's field, as the server names it in a problem. The first element
 * of the control gets the label.
 */
export function labelled(label, control, { field, unit } = {}) {
  return h("div", { class: "control", "data-field": field },
    h("label", { for: control.id }, label), h("span", { class: "field" }, control, unit && h("span", {}, unit)));
}

/** Controls under a common title. */
export function group(title, field, ...content) {
  return h("fieldset", { "data-field": field }, h("legend", {}, title), content);
}

export function select(id, choices, attributes = {}) {
  return h("select", { id, ...attributes }, choices.map(([value, text]) => h("option", { value }, text)));
}

/** The control of an option, `{input, element}`. */
export function optionControl(option) {
  const { path, label, choices, prefix, fallback, min, max, step = 1, isText, unit } = option;
  const id = `option-${path.replace(".", "-")}`;
  const field = path.replace(/[A-Z]/g, (letter) => `_${letter.toLowerCase()}`);
  if (typeof fallback === "boolean") {
    const input = h("input", { id, type: "checkbox" });
    return { input, element: h("div", { class: "control check", "data-field": field }, input, h("label", { for: id }, label)) };
  }
  const input = choices ? select(id, choices.map(([word, text]) => [`${prefix}_${word}`, text]))
    // A seed has more digits than a number of the browser keeps.
    : isText ? h("input", { id, inputmode: "numeric", pattern: "\\d{1,20}", required: true })
      : h("input", { id, type: "number", min, max, step, required: true });
  input.value = defaultOf(option);
  return { input, element: labelled(label, input, { field, unit }) };
}

/** A button that chooses files. It has no text of the browser's own about chosen files, which would know nothing of dropped ones. */
export function fileButton(id, text, onfiles, attributes = {}) {
  const input = h("input", { id, type: "file", class: "unseen", ...attributes, onchange: () => {
    onfiles([...input.files]);
    // The same file can be chosen again.
    input.value = "";
  } });
  return h("span", { class: "file-button" }, input, h("label", { for: id }, text));
}

/** The name of a field in a problem without the message around it: `requests[2].spec.optimize_hologram.seed` as `seed`. */
function fieldIn(path) {
  return path.replace(/^(requests\[\d+\]\.)?(spec\.)?(optimize_hologram\.)?/, "");
}

/**
 * Shows problems `{field, problem, fix}` of the server beside the controls of their fields, and removes those before.
 * Returns those for which there is no control.
 */
export function showProblems(form, problems) {
  for (const old of form.querySelectorAll(".problem")) old.remove();
  for (const input of form.querySelectorAll("[aria-invalid]")) {
    input.removeAttribute("aria-invalid");
    input.removeAttribute("aria-describedby");
  }
  const controls = [...form.querySelectorAll("[data-field]")];
  return problems.filter((problem, i) => {
    const name = fieldIn(problem.field);
    const fits = ({ dataset: { field } }) => name === field || name.startsWith(`${field}.`) || name.startsWith(`${field}[`);
    const control = controls.filter(fits).sort((a, b) => b.dataset.field.length - a.dataset.field.length)[0];
    if (!control) return true;
    const id = `problem-${i}`;
    // The problem goes on where the label ends: "is 0", "must be 1 to 24".
    control.append(h("p", { class: "problem", id }, sentence(problem)));
    const input = control.querySelector("input, select");
    input?.setAttribute("aria-invalid", "true");
    input?.setAttribute("aria-describedby", id);
    for (let parent = control.parentElement; parent; parent = parent.parentElement) if (parent.tagName === "DETAILS") parent.open = true;
    return false;
  });
}

export function sentence({ problem, fix }) {
  const text = fix ? `${problem}; ${fix}` : problem;
  return `${text.charAt(0).toUpperCase()}${text.slice(1)}.`;
}

/** A control that shows a list of pictures with a button that removes each. */
export function pictureList(element, pictures, onremove) {
  // Each change of the form asks for this, and drawing again would flicker.
  const key = pictures.map(({ name, drawn, stored }) => (drawn ? name : `${name} ${stored}`)).join("\n");
  const before = listed.get(element);
  listed.set(element, { key, pictures: [...pictures] });
  if (before?.key === key && before.pictures.every((picture, i) => picture === pictures[i])) return;
  show(element, pictures.slice(0, LISTED).map((picture, i) => h("li", {}, thumbnail(picture), h("span", { class: "name" }, picture.name),
    onremove && h("button", { type: "button", class: "link", "aria-label": `Remove ${picture.name}`, onclick: () => onremove(i) }, "remove"))),
  pictures.length > LISTED && h("li", {}, `and ${pictures.length - LISTED} more`));
}

function thumbnail(picture) {
  const image = h("img", { alt: "" });
  const draw = (url) => {
    image.onload = () => URL.revokeObjectURL(url);
    image.src = url;
  };
  if (picture.drawn) draw(URL.createObjectURL(picture.drawn));
  // Phases are no pictures; they have no thumbnail.
  else if (picture.stored) pictureUrl(picturePath(picture.stored, { width: THUMBNAIL_PX }), { cache: "default" }).then(draw, () => {});
  return image;
}
