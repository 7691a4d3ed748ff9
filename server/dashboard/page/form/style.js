// The style of forms, which pages without one do without.

import { h } from "../dom.js";

const STYLE = "/page/form/form.css";

/** Loads the style once. */
export function styled() {
  if (document.querySelector(`link[href="${STYLE}"]`)) return Promise.resolve();
  return new Promise((done) => document.head.append(h("link", { rel: "stylesheet", href: STYLE, onload: done, onerror: done })));
}
