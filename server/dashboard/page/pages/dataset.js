// One dataset: its pairs with their checks, its alignment, and what was found.

import { get } from "../api.js";
import { h, show } from "../dom.js";
import { onEvent } from "../events.js";
import { age, idOf, length, number, percent, placeText, words } from "../format.js";
import { refresher } from "../loading.js";
import { phasePicture, photographPicture } from "../hologram_pictures.js";
import { pager } from "../pager.js";
import { pictureViewer } from "../pictures.js";
import { table } from "../table.js";

export function datasetPage(root, [id]) {
  const name = `datasets/${id}`;
  const head = h("div", {});
  const alignment = h("div", {});
  const pairs = h("div", {});
  const pages = [""];
  const pictures = h("section", { "aria-live": "polite" });
  show(root, head, alignment, pictures, pairs);
  let chosen = null;
  let alignmentViewer = null;
  let pairViewer = null;

  const refresh = refresher(head, async () => {
    const [dataset, page, flagged] = await Promise.all([
      get(name), get(`${name}/pairs`, { pageSize: 100, pageToken: pages.at(-1) }), get(`${name}/pairs`, { withFindings: true })]);
    const findings = [...dataset.findings, ...flagged.pairs.flatMap((pair) => pair.findings)];
    const facts = [
      ["Display", h("a", { href: `#/${dataset.display}` }, idOf(dataset.display))],
      ["Wavelength", length(dataset.wavelengthM)],
      ["Distance", placeText(dataset.place)],
      ["Photographs", `${words(dataset.photoEncoding, "ENCODING")}${dataset.photoBitDepth ? `, ${dataset.photoBitDepth} bit` : ""}`],
      ["State", words(dataset.state, "STATE")],
      ["Created", age(dataset.createTime)],
    ];
    show(head, h("h1", { class: "name" }, id), h("dl", { class: "facts" }, facts.map(([term, value]) => [h("dt", {}, term), h("dd", {}, value)])),
      findings.length > 0 && h("section", {}, h("h2", {}, "Findings"), h("ul", {}, findings.map((finding) =>
        h("li", {}, h("strong", {}, words(finding.kind, "KIND")), finding.pair ? ` in ${finding.pair}` : "", finding.excludes ? " (left out)" : "", `: ${finding.message}`))),
        flagged.nextPageToken && h("p", {}, "More pairs have findings: ", h("code", {}, `lightpath dataset show ${id}`))));
    showAlignment(dataset.alignment);
    show(pairs, h("section", {}, h("h2", {}, `${dataset.pairCount} pairs${shares(dataset.splitCounts)}`), page.pairs.length > 0 && pairTable(dataset, page.pairs),
      pager(pages, page.nextPageToken, refresh)));
    if (!chosen && page.pairs.length) await showPair(page.pairs[0], dataset);
  });

  function showAlignment(found) {
    alignmentViewer?.end();
    alignmentViewer = null;
    if (!found) return show(alignment);
    if (found.before && found.after) alignmentViewer = pictureViewer([{ label: "before", digest: found.before, kind: "figure" }, { label: "after", digest: found.after, kind: "figure" }]);
    show(alignment, h("section", {}, h("h2", {}, "Alignment"), h("p", {}, found.explanation),
      h("dl", { class: "facts" }, [["Method", words(found.method, "METHOD")], ["Corrected", `${number(found.correctedPx)} px`], ["Left", `${number(found.residualPx)} px at ${found.points} points`]]
        .map(([term, value]) => [h("dt", {}, term), h("dd", {}, value)])),
      alignmentViewer?.element));
  }

  async function showPair(pair, { display, photoEncoding, photoBitDepth }) {
    chosen = pair;
    const { modulator: { bitDepth } } = await get(display);
    pairViewer?.end();
    const encoding = words(photoEncoding, "ENCODING");
    pairViewer = pictureViewer([photographPicture("photograph", pair.photo, { encoding, bitDepth: photoBitDepth }), phasePicture("pattern", pair.pattern, bitDepth)]);
    show(pictures, h("h2", {}, pair.id), pairViewer.element);
  }

  function pairTable(dataset, listed) {
    const row = (pair) => {
      const checks = pair.checks ?? {};
      const cells = [share(checks.saturated), share(checks.black), number(checks.contrast), number(checks.correlation), `${number(checks.misalignmentPx)} px`, `${number(checks.stretchPx)} px`, number(checks.vignetting)];
      return h("tr", {}, h("th", { scope: "row" }, h("button", { type: "button", class: "link", "data-key": pair.id, onclick: () => void showPair(pair, dataset) }, pair.id)),
        h("td", {}, words(pair.split, "SPLIT")), cells.map((cell) => h("td", { class: "right" }, pair.checks ? cell : "–")));
    };
    return table("Pairs with the checks of their photographs; choose one to see it", ["Pair", "Split", ">Saturated", ">Black", ">Contrast", ">Match", ">Off by", ">Stretched by", ">Vignetting"], listed.map(row));
  }

  const ends = onEvent((kind, data) => (kind === "reset" || (kind === "dataset" && data.name === name)) && refresh.soon());
  return () => {
    ends();
    alignmentViewer?.end();
    pairViewer?.end();
  };
}

/** A share of pixels, to a tenth of a per cent. */
const share = (part) => `${(100 * part).toFixed(1)} %`;

// How many pairs of a finalized dataset have which use.
function shares(counts) {
  if (!counts) return "";
  const { train, validation, test, excluded } = counts;
  return `: ${train} for training, ${validation} for validation, ${test} for the test${excluded ? `, ${excluded} left out` : ""}`;
}
