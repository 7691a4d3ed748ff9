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

/** Replaces the children of an element, and keeps the focus on the element with the same id or `data-key`. */
export function show(parent, ...children) {
  const focused = parent.contains(document.activeElement) ? document.activeElement : null;
  const key = focused?.id || focused?.dataset.key;
  parent.replaceChildren(...children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false));
  if (!key || focused.isConnected) return;
  for (const element of parent.querySelectorAll("[id], [data-key]")) {
    if (element.id === key || element.dataset.key === key) element.focus({ preventScroll: true });
  }
}
