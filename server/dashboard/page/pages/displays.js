// All displays.

import { get } from "../api.js";
import { h, show } from "../dom.js";
import { onEvent } from "../events.js";
import { idOf, length } from "../format.js";
import { emptyNote, refresher } from "../loading.js";
import { table } from "../table.js";

export function displaysPage(root) {
  const list = h("div", {});
  const more = h("p", { class: "pager" });
  const pages = [""];
  show(root, h("h1", {}, "Displays"), list, more);
  const refresh = refresher(list, async () => {
    const page = await get("displays", { pageSize: 50, pageToken: pages.at(-1) });
    show(list, page.displays.length ? displayTable(page.displays) : emptyNote("No display is declared yet. Declare one:",
      "lightpath display create lab --resolution 1920x1080 --pixel-pitch 8um --wavelength 515nm"));
    const turn = (label, isPossible, move) => h("button", { type: "button", "data-key": label, disabled: !isPossible, onclick: () => { move(); void refresh(); } }, label);
    show(more, pages.length > 1 || page.nextPageToken ? [turn("Back", pages.length > 1, () => pages.pop()), " ", turn("Next", page.nextPageToken, () => pages.push(page.nextPageToken))] : null);
  });
  return onEvent((kind) => (kind === "display" || kind === "reset") && void refresh());
}

function displayTable(displays) {
  const row = (display) => h("tr", {},
    h("th", { scope: "row" }, h("a", { href: `#/${display.name}`, "data-key": display.name }, idOf(display.name))),
    h("td", {}, `${display.widthPx} × ${display.heightPx} px`),
    h("td", {}, length(display.pixelPitchM)),
    h("td", {}, display.wavelengthsM.map(length).join(", ")),
    h("td", {}, display.notes));
  return table("Declared displays", ["Display", "Size", "Pixel pitch", "Wavelengths", "Notes"], displays.map(row));
}
