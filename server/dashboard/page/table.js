// Tables that scroll within themselves on narrow screens.

import { h } from "./dom.js";

/** A table. Titles that begin with `>` are those of columns aligned to the right, such as numbers. */
export function table(caption, titles, rows) {
  const heading = (title) => h("th", { scope: "col", class: title.startsWith(">") && "right" }, title.replace(/^>/, ""));
  return h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": caption },
    h("table", {}, h("caption", {}, caption), h("thead", {}, h("tr", {}, titles.map(heading))), h("tbody", {}, rows)));
}
