// How light was propagated, why by this method, and where its limits are.

import { h } from "./dom.js";
import { length, number, percent, words } from "./format.js";
import { table } from "./table.js";

/** A section about validity reports, given as `[plane, report]`; `null` without reports. */
export function propagationSection(reports) {
  if (reports.length === 0) return null;
  const row = ([plane, report]) => h("tr", {}, h("th", { scope: "row" }, plane), h("td", {}, words(report.method, "PROPAGATION_METHOD")),
    [`${length(rounded(report.criticalDistanceXM))} × ${length(rounded(report.criticalDistanceYM))}`, percent(report.bandKeptArea), number(report.fresnelNumber),
      `${number((report.diffractionAngleRad * 180) / Math.PI)}°`, report.spreadM === undefined ? "unbounded" : length(rounded(report.spreadM)),
      report.neglectedPhaseRad ? `${number(report.neglectedPhaseRad)} rad` : "none"].map((text) => h("td", { class: "right" }, text)));
  const titles = ["Plane", "Method", ">Critical distance, x × y", ">Light in the window", ">Fresnel number", ">Steepest angle", ">Moves sideways up to", ">Neglected phase"];
  const reasons = new Map(reports.map(([plane, report]) => [`${report.method} ${report.explanation} ${report.warnings.map(({ text }) => text)}`, { plane, ...report }]));
  return h("section", {}, h("h2", {}, "Propagation"),
    [...reasons.values()].map(({ plane, method, explanation, warnings }) => [
      h("p", {}, h("strong", { class: "sentence" }, words(method, "PROPAGATION_METHOD")), `${reasons.size > 1 ? `, ${plane}` : ""}: ${explanation}`),
      warnings.length > 0 && h("ul", { class: "checks" }, warnings.map(({ code, text }) => h("li", { class: "failed" }, h("strong", {}, words(code, "")), `: ${text}`))),
    ]),
    table("Up to the critical distance, a frame padded to twice its size samples all light of the pixels", titles, reports.map(row)));
}

function rounded(metres) {
  return Number(metres.toPrecision(4));
}
