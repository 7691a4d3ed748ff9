// All displays.

import { get } from "../api.js";
import { h, show } from "../dom.js";
import { onEvent } from "../events.js";
import { displayForm } from "../form/display_form.js";
import { idOf, length } from "../format.js";
import { emptyNote, refresher } from "../loading.js";
import { pager } from "../pager.js";
import { simulatedMark } from "../simulated.js";
import { table } from "../table.js";

export function displaysPage(root) {
  const list = h("div", {});
  const more = h("div", {});
  const pages = [""];
  const declare = h("details", { ontoggle: () => declare.open && declare.children.length === 1 && declare.append(displayForm(({ name }) => (location.hash = `#/${name}`))) }, h("summary", {}, "Declare a display"));
  show(root, h("h1", {}, "Displays"), list, more, declare);
  const refresh = refresher(list, async () => {
    const page = await get("displays", { pageSize: 50, pageToken: pages.at(-1) });
    show(list, page.displays.length ? displayTable(page.displays) : emptyNote("No display is declared yet. Declare one below, or with all its properties:",
      "lightpath display create lab --resolution 1920x1080 --pixel-pitch 8um --wavelength 515nm"));
    show(more, pager(pages, page.nextPageToken, refresh));
  });
  return onEvent((kind) => (kind === "display" || kind === "reset") && refresh.soon());
}

function displayTable(displays) {
  const row = (display) => h("tr", {},
    h("th", { scope: "row" }, h("a", { href: `#/${display.name}`, "data-key": display.name }, idOf(display.name)), simulatedMark(display)),
    h("td", {}, `${display.modulator.widthPx} × ${display.modulator.heightPx} px`),
    h("td", {}, length(display.modulator.pixelPitchXM)),
    h("td", {}, display.wavelengthsM.map(length).join(", ")),
    h("td", {}, display.notes));
  return table("Declared displays", ["Display", "Size", "Pixel pitch", "Wavelengths", "Notes"], displays.map(row));
}
