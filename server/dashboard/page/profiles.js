// The light along a line through pictures, as a chart.

import { chart } from "./chart.js";
import { h, show } from "./dom.js";
import { number } from "./format.js";
import { errorNote } from "./loading.js";
import { fetchPicture, valuesOf } from "./picture_source.js";

/** Rest after the line was moved before its light is fetched [ms]. */
const REST_MS = 150;

/**
 * Controls and a chart of the light along a line through pictures `{label, digest, fit, group, profile}`. Pictures of one
 * `group`, such as a plane, are in a chart together. `onLine({isRow, position})` is told where the line is, from 0 to 1;
 * `null`: there is none. Returns `{controls, element, end}`.
 */
export function profileOf(pictures, onLine) {
  const groups = [...new Set(pictures.map(({ group }) => group))];
  const direction = h("select", { onchange: move }, ["none", "horizontal", "vertical"].map((name) => h("option", {}, name)));
  const position = h("input", { type: "range", min: 0, max: 1, step: 0.001, value: 0.5, "aria-label": "Position of the line", hidden: true, oninput: move });
  const group = h("select", { "aria-label": "Pictures of the profile", hidden: true, onchange: move }, groups.map((name) => h("option", {}, name)));
  const element = h("div", { class: "profile" });
  let abort = new AbortController();
  let rest = 0;
  let plot = null;

  function move() {
    const isShown = direction.value !== "none";
    position.hidden = !isShown;
    group.hidden = !isShown || groups.length < 2;
    onLine({ isRow: direction.value === "horizontal", position: isShown ? Number(position.value) : null });
    clearTimeout(rest);
    if (isShown) rest = setTimeout(() => void draw(), REST_MS);
    else clear();
  }

  function clear() {
    abort.abort();
    plot?.end();
    plot = null;
    show(element);
  }

  async function draw() {
    abort.abort();
    abort = new AbortController();
    const isRow = direction.value === "horizontal";
    try {
      const shown = pictures.filter((picture) => picture.group === groups[group.selectedIndex]);
      const lines = await linesOf(shown, isRow, Number(position.value), abort.signal);
      const title = `Light along a ${direction.value} line at ${isRow ? "row" : "column"} ${lines.at}`;
      plot?.end();
      plot = chart({ title, xLabel: isRow ? "column [px]" : "row [px]", yLabel: "light; white is 1", xs: lines.xs, series: lines.series });
      show(element, plot.element);
    } catch (error) {
      if (error.name !== "AbortError") show(element, errorNote(error));
    }
  }

  return {
    controls: pictures.length > 0 && [h("label", {}, "Line profile ", direction), position, group],
    element,
    end() {
      clearTimeout(rest);
      clear();
    },
  };
}

/**
 * The light of pictures along a line: `{at, xs, series}`. Positions are pixels of the first picture without a `fit`; the
 * line of a target is where its fitted picture has it.
 */
async function linesOf(pictures, isRow, position, signal) {
  const sized = await Promise.all(pictures.map(async (picture) => ({ ...picture, ...(await fetchPicture(picture.digest, { width: 1 }, signal)) })));
  const display = sized.find(({ fit }) => !fit) ?? sized[0];
  const [length, across] = isRow ? [display.widthPx, display.heightPx] : [display.heightPx, display.widthPx];
  const at = Math.min(across - 1, Math.floor(position * across));
  const series = await Promise.all(sized.map(async (picture) => {
    const values = await lightAlong(picture, display, isRow, (at + 0.5) / across, length, signal);
    return { label: picture.label, values, isPhotograph: picture.profile.isPhotograph };
  }));
  scalePhotographs(series);
  return { at, xs: Array.from({ length }, (_, i) => i), series };
}

/**
 * The place of a picture of this size in a frame of the form `width / height`, as the server fits a target to the whole
 * frame or to its `area`: `{left, top, width, height}` in parts of one.
 */
export function fittedIn({ widthPx, heightPx }, form, { fit, area = { left: 0, top: 0, width: 1, height: 1 } }) {
  const relative = ((widthPx / heightPx / form) * area.height) / area.width;
  const scale = { FIT_COVER: Math.max, FIT_STRETCH: () => 1 }[fit] ?? Math.min;
  const [width, height] = [scale(1, relative) * area.width, scale(1, 1 / relative) * area.height];
  return { left: area.left + (area.width - width) / 2, top: area.top + (area.height - height) / 2, width, height };
}

/** The light of a picture at `length` points of a line; `null` where the fitted picture has none. */
async function lightAlong(picture, display, isRow, position, length, signal) {
  const box = fittedIn(picture, display.widthPx / display.heightPx, picture);
  const parts = [[box.left, box.width], [box.top, box.height]];
  const [along, across] = isRow ? parts : [parts[1], parts[0]];
  const inside = (at, [start, part]) => (at - start) / part;
  const [stored, width] = isRow ? [picture.heightPx, picture.widthPx] : [picture.widthPx, picture.heightPx];
  const at = Math.floor(inside(position, across) * stored);
  // What a picture has outside its area is not shown.
  const { left, top, width: areaWidth, height: areaHeight } = picture.area ?? { left: 0, top: 0, width: 1, height: 1 };
  const ends = isRow ? [[left, areaWidth], [top, areaHeight]] : [[top, areaHeight], [left, areaWidth]];
  const isShown = (place, [start, part]) => place >= start && place < start + part;
  if (at < 0 || at >= stored || !isShown(position, ends[1])) return Array(length).fill(null);
  const region = (isRow ? [0, at, width, 1] : [at, 0, 1, width]).join();
  const { blob } = await fetchPicture(picture.digest, { region, encoding: picture.profile.encoding }, signal);
  const light = lightOf(await valuesOf(blob), picture.profile);
  const lightAt = (place) => (isShown(place, ends[0]) ? light[Math.floor(inside(place, along) * light.length)] : undefined) ?? null;
  return Array.from({ length }, (_, i) => lightAt((i + 0.5) / length));
}

/** Linear light from the values of a file. */
function lightOf(colours, { encoding, colour }) {
  const linear = (value) => (encoding === "linear" ? value : value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4);
  if (colour !== undefined) return colours[colour].map(linear);
  return colours[0].map((_, i) => (linear(colours[0][i]) + linear(colours[1][i]) + linear(colours[2][i])) / 3);
}

/** Scales photographs, whose exposure is free, to the first other picture: the least sum of squared differences. */
function scalePhotographs(series) {
  const wanted = series.find(({ isPhotograph }) => !isPhotograph);
  if (!wanted) return;
  for (const line of series.filter(({ isPhotograph }) => isPhotograph)) {
    const product = (other) => line.values.reduce((sum, value, i) => sum + (value ?? 0) * (other[i] ?? 0), 0);
    const gain = product(wanted.values) / product(line.values);
    if (!Number.isFinite(gain) || gain <= 0) continue;
    line.values = line.values.map((value) => (value === null ? null : gain * value));
    line.label = `${line.label} × ${number(gain)}`;
  }
}
