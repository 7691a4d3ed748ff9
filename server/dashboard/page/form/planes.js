// Distances of a hologram, and the pictures that it shows there.

import { h, show } from "../dom.js";
import { ACCEPTED, ownFile } from "./files.js";
import { fileButton, group, labelled, pictureList, select } from "./controls.js";

const PLANES_MAX = 16;
const CONTENTS = [["same", "the whole picture, each"], ["depth", "the parts that a map of depths gives them"], ["own", "a picture of its own, each"]];

/**
 * Rows of distances, and what they show. `onChange` is told of changes for which the form gets no `input` event, such as a
 * chosen file or another row.
 */
export function planesControl(onChange) {
  let rows = [];
  let depthMap = null;
  const list = h("div", { class: "planes" });
  const options = h("datalist", { id: "distances" });
  const contents = select("contents", CONTENTS, { onchange: draw });
  const contentsControl = labelled("They show", contents);
  const add = h("button", { type: "button", onclick: () => {
    rows.push(row(Number(rows.at(-1)?.distance.value ?? 140) + 10));
    draw();
    rows.at(-1).distance.focus();
    onChange();
  } }, "Add a distance");
  const mapList = h("ul", { class: "chosen" });
  const map = h("div", { class: "control", "data-field": "depth_map" }, h("p", { class: "hint" }, "Map of depths, grey: white is at the first distance, black at the last"),
    fileButton("depth-map", "Choose the map…", ([file]) => { depthMap = ownFile(file); draw(); onChange(); }, { accept: ACCEPTED }), mapList);
  const element = group("Distance from the display to the picture", "planes", list, options, h("p", {}, add), contentsControl, map);

  function row(distanceMm, picture = null, weight = 1) {
    return {
      distance: h("input", { type: "number", step: "any", required: true, list: "distances", value: distanceMm }),
      weight: h("input", { type: "number", min: 0, max: 1000, step: "any", value: weight }),
      picture,
    };
  }

  function draw() {
    const several = rows.length > 1;
    show(list, rows.map((each, i) => {
      const own = several && contents.value === "own";
      each.distance.id = i === 0 ? "distance" : `distance-${i}`;
      each.weight.id = `weight-${i}`;
      each.distance.setAttribute("aria-label", several ? `Distance ${i + 1}` : "Distance");
      each.weight.setAttribute("aria-label", `Weight of distance ${i + 1}`);
      const chosen = h("ul", { class: "chosen" });
      pictureList(chosen, each.picture ? [each.picture] : [], () => { each.picture = null; draw(); onChange(); });
      return h("div", { class: "plane", "data-field": `planes[${i}]` },
        h("span", { class: "field" }, each.distance, h("span", {}, "mm")),
        several && h("span", { class: "field weight" }, h("span", {}, "weight"), each.weight),
        several && h("button", { type: "button", class: "link", "aria-label": `Remove distance ${i + 1}`, onclick: () => { rows.splice(i, 1); draw(); onChange(); } }, "remove"),
        own && h("span", { class: "own-picture", "data-field": `planes[${i}].target` }, fileButton(`picture-${i}`, each.picture ? "Another picture…" : "Choose its picture…", ([file]) => {
          each.picture = ownFile(file);
          draw();
          onChange();
        }, { accept: ACCEPTED }), chosen));
    }));
    contentsControl.hidden = !several;
    map.hidden = !several || contents.value !== "depth";
    add.disabled = rows.length >= PLANES_MAX;
    pictureList(mapList, depthMap ? [depthMap] : [], () => { depthMap = null; draw(); onChange(); });
  }

  rows = [row(150)];
  draw();
  return {
    element,
    /** `same`, `depth` or `own`. */
    get contents() {
      return rows.length > 1 ? contents.value : "same";
    },
    get distancesM() {
      return rows.map(({ distance }) => metresOf(distance.value));
    },
    get depthMap() {
      return this.contents === "depth" ? depthMap : null;
    },
    /** The pictures of the distances, `null` where one is missing. */
    get pictures() {
      return rows.map(({ picture }) => picture);
    },
    /** The planes for a request, with targets in their order. */
    planes(targets) {
      return rows.map(({ weight }, i) => ({ place: { distanceM: this.distancesM[i] }, target: targets[i], ...(rows.length > 1 && weight.value !== "1" && { weight: Number(weight.value) }) }));
    },
    /** Gives pictures to the distances that have none, or to all, from the first one. */
    take(pictures) {
      const from = rows.every(({ picture }) => picture) ? 0 : rows.findIndex(({ picture }) => !picture);
      pictures.slice(0, rows.length - from).forEach((picture, i) => { rows[from + i].picture = picture; });
      draw();
    },
    clear() {
      for (const each of rows) each.picture = null;
      draw();
    },
    fill(planes, wanted, map) {
      rows = planes.map(({ distanceM, picture, weight }) => row(Number((distanceM * 1000).toPrecision(12)), picture, weight));
      depthMap = map;
      contents.value = wanted;
      draw();
    },
    suggest(places) {
      show(options, places.map((distanceM) => h("option", { value: Number((distanceM * 1000).toPrecision(12)) })));
    },
  };
}

/** A number of mm in m, as exactly as its digits say it. */
function metresOf(millimetres) {
  return /e/i.test(millimetres) ? Number(millimetres) / 1000 : Number(`${millimetres}e-3`);
}
