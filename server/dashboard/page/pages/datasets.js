// All datasets: the photographs from which kernels are learned.

import { get } from "../api.js";
import { h, show } from "../dom.js";
import { onEvent } from "../events.js";
import { age, idOf, length, placeText, words } from "../format.js";
import { emptyNote, refresher } from "../loading.js";
import { pager } from "../pager.js";
import { table } from "../table.js";

export function datasetsPage(root) {
  const list = h("div", {});
  const more = h("div", {});
  const pages = [""];
  show(root, h("h1", {}, "Datasets"), list, more);
  const refresh = refresher(list, async () => {
    const page = await get("datasets", { pageSize: 50, pageToken: pages.at(-1) });
    show(list, page.datasets.length ? table("Photographs of holograms", ["Dataset", "Display", "Wavelength", "Distance", ">Pairs", "State", "Findings on the whole", ">Created"], page.datasets.map(row))
      : emptyNote("There are no photographs yet. Send holograms with their photographs:", "lightpath dataset create bench-1 --display lab --distance 150mm"));
    show(more, pager(pages, page.nextPageToken, refresh));
  });
  return onEvent((kind) => (kind === "dataset" || kind === "reset") && refresh.soon());
}

function row(dataset) {
  const excluded = dataset.splitCounts?.excluded;
  return h("tr", {},
    h("th", { scope: "row" }, h("a", { href: `#/${dataset.name}`, "data-key": dataset.name }, idOf(dataset.name))),
    h("td", {}, h("a", { href: `#/${dataset.display}` }, idOf(dataset.display))),
    h("td", {}, length(dataset.wavelengthM)), h("td", {}, placeText(dataset.place)),
    h("td", { class: "right" }, dataset.pairCount), h("td", {}, words(dataset.state, "STATE")),
    h("td", {}, [dataset.findings.length || "none", excluded && `${excluded} pairs left out`].filter(Boolean).join(", ")),
    h("td", { class: "right" }, age(dataset.createTime)));
}
