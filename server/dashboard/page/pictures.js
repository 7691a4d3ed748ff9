// Pictures side by side with linked zoom and pan, or one over the other with a wipe or a blink.

import { h, show } from "./dom.js";
import { colourBar, LOOKS } from "./picture_looks.js";
import { columnsFor, fetchPicture } from "./picture_source.js";
import { fittedIn, profileOf } from "./profiles.js";

const ZOOM_MAX = 32;
const BLINK_MS = 700;
/** Rest after a movement before the shown part is fetched [ms]. */
const REST_MS = 200;
/** Pictures this far below the shown part of the page are fetched [CSS px]. */
const AHEAD = "800px";

/**
 * A viewer of pictures `{label, digest, kind, wish, fit, area, group}`.
 *
 * `kind` is `light`, `phase` or `error`, whose colours the user chooses, or `figure`, which is smooth and has its own.
 * `wish` has parameters of `/picture`, and `fit` says how a target is fitted to the other pictures, or to their `area`
 * `{left, top, width, height}` in parts of one. Pictures of light may have a `profile`, `{encoding, colour, isPhotograph}`.
 * `region`, such an area, is where light counts: in pictures of light and errors the rest is darkened, unless an element
 * around them has the class `regionless`. Wheel, `+` and `-` zoom; dragging and the arrow keys pan; all pictures follow.
 * Large pictures come at the shown size, and parts of them when they are enlarged. Returns `{element, end}`.
 */
export function pictureViewer(pictures, region = null) {
  const isSmooth = pictures.every(({ kind }) => kind === "figure");
  const view = { zoom: 1, x: 0.5, y: 0.5 };
  const looks = {};
  const ended = new AbortController();
  const frames = pictures.map(frame);
  const stage = h("div", { class: `pictures ${isSmooth ? "smooth" : ""}` }, frames.map(({ figure }) => figure));
  const wipe = h("input", { type: "range", min: 0, max: 100, value: 50, "aria-label": "Position of the wipe", hidden: true, oninput: apply });
  const mode = h("select", { "aria-label": "How pictures are compared", onchange: apply }, ["side by side", "wipe", "blink"].map((name) => h("option", {}, name)));
  const pick = (label, at) => h("select", { "aria-label": label, onchange: apply }, pictures.map((picture, i) => h("option", { value: i, selected: i === at }, picture.label)));
  const [first, second] = [pick("First picture", 0), pick("Second picture", Math.min(1, pictures.length - 1))];
  const pair = h("span", { class: "pair", hidden: true }, first, " with ", second);
  const smooth = h("label", {}, h("input", { type: "checkbox", checked: isSmooth, onchange: (event) => stage.classList.toggle("smooth", event.target.checked) }), " smooth");
  const reset = h("button", { type: "button", onclick: () => { Object.assign(view, { zoom: 1, x: 0.5, y: 0.5 }); apply(); } }, "Whole picture");
  const profile = profileOf(pictures.filter((picture) => picture.profile), ({ isRow, position }) => {
    for (const { line, kind } of frames) {
      line.hidden = position === null || !["light", "error"].includes(kind);
      line.classList.toggle("row", isRow);
      line.style[isRow ? "top" : "left"] = `${100 * position}%`;
      line.style[isRow ? "left" : "top"] = "0";
    }
  });
  const controls = h("div", { class: "controls" }, pictures.length > 1 && [mode, pair, wipe], Object.keys(LOOKS).map(lookChoice), profile.controls, reset, !isSmooth && smooth);
  const element = h("div", { class: "viewer" }, controls, stage, profile.element);
  let blink = 0;
  let rest = 0;
  let form = null;

  const near = new IntersectionObserver((entries) => {
    for (const { isIntersecting, target } of entries) {
      const entry = frames.find(({ figure }) => figure === target);
      if (isIntersecting && !entry.size) void loadWhole(entry);
    }
  }, { rootMargin: AHEAD });
  frames.forEach(({ figure }) => near.observe(figure));
  const resized = new ResizeObserver(() => {
    clearTimeout(rest);
    rest = setTimeout(refine, REST_MS);
  });
  resized.observe(stage);

  function frame({ label, digest, kind, wish = {}, fit, area }) {
    const whole = h("img", { alt: label, class: "whole", draggable: "false" });
    const detail = h("img", { alt: "", class: "detail", draggable: "false", hidden: true });
    const line = h("div", { class: "line", hidden: true });
    const outline = region && ["light", "error"].includes(kind) && h("div", { class: "region" });
    if (outline) lay(outline, region);
    const sheet = h("div", { class: "sheet" }, whole, detail, outline, line);
    const caption = h("span", {}, label);
    const bar = h("span", {});
    const figure = h("figure", { tabindex: 0, onwheel: wheel, onpointerdown: drag, onkeydown: key }, h("div", { class: "window" }, sheet), h("figcaption", {}, caption, bar));
    return { figure, sheet, whole, detail, line, caption, bar, label, digest, kind, wish, fit, area, size: null, columns: 0, abort: new AbortController() };
  }

  function lookChoice(kind) {
    looks[kind] = LOOKS[kind].choices[0];
    if (!pictures.some((picture) => picture.kind === kind)) return null;
    const select = h("select", { onchange: () => {
      looks[kind] = LOOKS[kind].choices[select.selectedIndex];
      frames.filter((entry) => entry.kind === kind && entry.size).forEach((entry) => void loadWhole(entry));
    } }, LOOKS[kind].choices.map(({ name }) => h("option", {}, name)));
    return h("label", {}, `${LOOKS[kind].title} `, select);
  }

  function wishOf(entry) {
    return { ...entry.wish, ...looks[entry.kind]?.wish };
  }

  /** Fetches the whole picture at the size at which it is shown. */
  async function loadWhole(entry) {
    entry.abort.abort();
    entry.abort = new AbortController();
    entry.detail.hidden = true;
    entry.columns = columnsFor(entry.figure.clientWidth);
    try {
      const { blob, widthPx, heightPx } = await fetchPicture(entry.digest, { ...wishOf(entry), width: entry.columns }, entry.abort.signal);
      entry.size = { widthPx, heightPx };
      const look = looks[entry.kind];
      show(entry.bar, look?.bar && colourBar(look.bar));
      fill(entry.whole, blob);
      place();
    } catch (error) {
      if (error.name !== "AbortError") entry.caption.textContent = `${entry.label}: ${error.message}`;
    }
    refine();
  }

  function fill(image, blob) {
    if (ended.signal.aborted) return;
    const url = URL.createObjectURL(blob);
    image.onload = () => URL.revokeObjectURL(url);
    image.src = url;
  }

  /** Gives all frames the form of the display, and every picture its place in the frame, as the server fits it. */
  function place() {
    const shown = frames.filter(({ size }) => size);
    const reference = shown.filter(({ fit }) => !fit).at(-1) ?? shown.at(-1);
    form = reference.size.widthPx / reference.size.heightPx;
    stage.style.setProperty("--form", form);
    for (const entry of shown) {
      entry.box = fittedIn(entry.size, form, entry);
      lay(entry.whole, entry.box);
      clip(entry.whole, entry.box, entry.area);
    }
  }

  /** Cuts off what a picture has outside its area. */
  function clip(image, box, area) {
    if (!area) return;
    const over = [area.top - box.top, box.left + box.width - area.left - area.width, box.top + box.height - area.top - area.height, area.left - box.left];
    image.style.clipPath = `inset(${over.map((part, i) => `${Math.max(0, (100 * part) / (i % 2 ? box.width : box.height))}%`).join(" ")})`;
  }

  /** Says how large the pictures are, and how many times as large they are shown. */
  function sayScales() {
    for (const entry of frames) {
      if (!entry.size || entry.figure.hidden) continue;
      const { widthPx, heightPx } = entry.size;
      const scale = Math.round((100 * entry.figure.clientWidth * entry.box.width * view.zoom * devicePixelRatio) / widthPx);
      entry.caption.textContent = `${entry.label}, ${widthPx} × ${heightPx} px${scale === 100 ? "" : `, shown at ${scale} %`}`;
    }
  }

  function lay(image, { left, top, width, height }) {
    for (const [side, part] of Object.entries({ left, top, width, height })) image.style[side] = `${100 * part}%`;
  }

  /** Fetches what is shown in more detail, where the fetched picture has fewer pixels than it could have. */
  function refine() {
    sayScales();
    for (const entry of frames) {
      if (!entry.size || entry.figure.hidden) continue;
      const columns = columnsFor(entry.figure.clientWidth);
      if (columns > entry.columns && entry.columns < entry.size.widthPx) void loadWhole(entry);
      else if (view.zoom > 1 && entry.columns < entry.size.widthPx) void loadDetail(entry, columns);
      else entry.detail.hidden = true;
    }
  }

  async function loadDetail(entry, columns) {
    const { box, size } = entry;
    const span = (middle, start, length, pixels) => {
      const ends = [-0.5, 0.5].map((side) => Math.min(1, Math.max(0, (middle + side / view.zoom - start) / length)));
      const from = Math.floor(ends[0] * pixels);
      return { from, count: Math.ceil(ends[1] * pixels) - from };
    };
    const x = span(view.x, box.left, box.width, size.widthPx);
    const y = span(view.y, box.top, box.height, size.heightPx);
    if (x.count < 1 || y.count < 1) return;
    entry.abort.abort();
    entry.abort = new AbortController();
    const region = [x.from, y.from, x.count, y.count].join();
    try {
      const { blob } = await fetchPicture(entry.digest, { ...wishOf(entry), width: columns, region }, entry.abort.signal);
      const part = {
        left: box.left + (x.from / size.widthPx) * box.width, top: box.top + (y.from / size.heightPx) * box.height,
        width: (x.count / size.widthPx) * box.width, height: (y.count / size.heightPx) * box.height,
      };
      lay(entry.detail, part);
      clip(entry.detail, part, entry.area);
      fill(entry.detail, blob);
      entry.detail.hidden = false;
    } catch (error) {
      if (error.name !== "AbortError") entry.caption.textContent = `${entry.label}: ${error.message}`;
    }
  }

  function apply() {
    const isPair = mode.value !== "side by side";
    reset.hidden = isSmooth && view.zoom === 1;
    stage.classList.toggle("stacked", isPair);
    pair.hidden = !isPair;
    wipe.hidden = mode.value !== "wipe";
    clearInterval(blink);
    frames.forEach(({ figure, sheet }, i) => {
      sheet.style.transform = `translate(${(0.5 - view.x) * 100 * view.zoom}%, ${(0.5 - view.y) * 100 * view.zoom}%) scale(${view.zoom})`;
      sheet.style.setProperty("--zoom", view.zoom);
      figure.hidden = isPair && i !== Number(first.value) && i !== Number(second.value);
      const isUpper = isPair && i === Number(second.value) && first.value !== second.value;
      figure.style.zIndex = isUpper ? 1 : 0;
      figure.querySelector(".window").style.clipPath = isUpper && mode.value === "wipe" ? `inset(0 0 0 ${wipe.value}%)` : "none";
      figure.style.visibility = "visible";
    });
    if (mode.value === "blink" && first.value !== second.value) {
      const upper = frames[Number(second.value)].figure;
      blink = setInterval(() => { upper.style.visibility = upper.style.visibility === "hidden" ? "visible" : "hidden"; }, BLINK_MS);
    }
    clearTimeout(rest);
    rest = setTimeout(refine, REST_MS);
  }

  function zoomBy(factor) {
    view.zoom = Math.min(ZOOM_MAX, Math.max(1, view.zoom * factor));
    pan(0, 0);
  }

  /** Moves the view by parts of what is shown. */
  function pan(dx, dy) {
    const edge = 0.5 / view.zoom;
    const clamp = (value) => Math.min(1 - edge, Math.max(edge, value));
    view.x = clamp(view.x + dx / view.zoom);
    view.y = clamp(view.y + dy / view.zoom);
    apply();
  }

  function wheel(event) {
    if (!event.ctrlKey && view.zoom === 1 && event.deltaY > 0) return;
    event.preventDefault();
    zoomBy(Math.exp(-event.deltaY / 300));
  }

  function drag(event) {
    const box = event.currentTarget.getBoundingClientRect();
    let [x, y] = [event.clientX, event.clientY];
    const move = (next) => {
      pan((x - next.clientX) / box.width, (y - next.clientY) / box.height);
      [x, y] = [next.clientX, next.clientY];
    };
    addEventListener("pointermove", move);
    for (const last of ["pointerup", "pointercancel"]) addEventListener(last, () => removeEventListener("pointermove", move), { once: true });
  }

  function key(event) {
    const moves = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] };
    if (event.key in moves) pan(...moves[event.key]);
    else if (event.key === "+" || event.key === "=") zoomBy(1.5);
    else if (event.key === "-") zoomBy(1 / 1.5);
    else return;
    event.preventDefault();
  }

  apply();
  return {
    element,
    end() {
      ended.abort();
      frames.forEach(({ abort }) => abort.abort());
      clearInterval(blink);
      clearTimeout(rest);
      near.disconnect();
      resized.disconnect();
      profile.end();
    },
  };
}
