// Builds elements. Texts become text nodes, so that no text from the server is ever read as HTML.

/**
 * An element with attributes and children.
 *
 * Attributes that are functions are listeners (`onclick`), `true` is an attribute without a value, and `null`, `false`
 * and `undefined` are left out. Children may be elements, texts, numbers, lists of them, or `null`.
 */
export function h(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (typeof value === "function") element.addEventListener(name.slice(2), value);
    else element.setAttribute(name, value === true ? "" : String(value));
  }
  element.append(...children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

/** Longest time for which a press delays what is to be shown [ms]. Not every press ends with an event: lists of choices take it. */
const PRESS_MAX = 3000;

/** Longest time from the end of a touch to its click [ms]. */
const CLICK_MAX = 400;

/** The element that the pointer presses, and what is to be shown when it is released, by the element that shows it. */
let pressed = null;
let pressTimer = 0;
const waiting = new Map();

/**
 * Replaces the children of an element, and keeps the focus on the element with the same id or `data-key`. What the
 * pointer presses is replaced when it is released: a browser drops the click on an element that goes between the two.
 */
export function show(parent, ...children) {
  const nodes = children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false);
  if (pressed && parent.contains(pressed)) waiting.set(parent, nodes);
  else replace(parent, nodes);
}

function replace(parent, nodes) {
  waiting.delete(parent);
  const focused = parent.contains(document.activeElement) ? document.activeElement : null;
  const key = focused?.id || focused?.dataset.key;
  parent.replaceChildren(...nodes);
  if (!key || focused.isConnected) return;
  for (const element of parent.querySelectorAll("[id], [data-key]")) {
    if (element.id === key || element.dataset.key === key) element.focus({ preventScroll: true });
  }
}

function release() {
  clearTimeout(pressTimer);
  pressed = null;
  for (const [parent, nodes] of [...waiting]) replace(parent, nodes);
}

addEventListener("pointerdown", (event) => {
  release();
  if (event.button !== 0) return;
  pressed = event.target;
  pressTimer = setTimeout(release, PRESS_MAX);
}, true);
// The click follows `pointerup`: that of a mouse at once, that of a finger a little later.
addEventListener("pointerup", (event) => setTimeout(release, event.pointerType === "mouse" ? 0 : CLICK_MAX), true);
for (const end of ["click", "pointercancel"]) addEventListener(end, () => setTimeout(release), true);
addEventListener("blur", release);
