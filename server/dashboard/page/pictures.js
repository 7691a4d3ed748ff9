// Pictures of a job, side by side with linked zoom and pan, or one over the other with a wipe or a blink.

import { pictureUrl } from "./api.js";
import { h } from "./dom.js";

/** Path of the bytes of an artifact. */
export const content = (digest) => `/v1/artifacts/${digest}/content`;

const ZOOM_MAX = 32;
const BLINK_MS = 700;

/**
 * A viewer of pictures `{label, path}`. Wheel, `+` and `-` zoom; dragging and the arrow keys pan; all pictures follow.
 * Pixels are shown as squares, unless `isSmooth`. Returns `{element, end}`.
 */
export function pictureViewer(pictures, isSmooth = false) {
  const view = { zoom: 1, x: 0.5, y: 0.5 };
  const urls = [];
  const abort = new AbortController();
  const frames = pictures.map(frame);
  const stage = h("div", { class: `pictures ${isSmooth ? "smooth" : ""}` }, frames);
  const wipe = h("input", { type: "range", min: 0, max: 100, value: 50, "aria-label": "Position of the wipe", hidden: true, oninput: apply });
  const modes = ["side by side", "wipe", "blink"];
  const mode = h("select", { "aria-label": "How pictures are compared", onchange: apply }, modes.map((name) => h("option", {}, name)));
  const pick = (label, at) => h("select", { "aria-label": label, onchange: apply }, pictures.map((picture, i) => h("option", { value: i, selected: i === at }, picture.label)));
  const [first, second] = [pick("First picture", 0), pick("Second picture", Math.min(1, pictures.length - 1))];
  const pair = h("span", { class: "pair", hidden: true }, first, " with ", second);
  const smooth = h("label", {}, h("input", { type: "checkbox", checked: isSmooth, onchange: (event) => stage.classList.toggle("smooth", event.target.checked) }), " smooth");
  const reset = h("button", { type: "button", onclick: () => { Object.assign(view, { zoom: 1, x: 0.5, y: 0.5 }); apply(); } }, "Whole picture");
  const controls = h("div", { class: "controls" }, pictures.length > 1 && [mode, pair, wipe], reset, smooth);
  const element = h("div", { class: "viewer" }, controls, stage);
  let blink = 0;

  function frame({ label, path }) {
    const image = h("img", { alt: label, draggable: "false" });
    const figure = h("figure", { tabindex: 0, onwheel: wheel, onpointerdown: drag, onkeydown: key }, h("div", { class: "window" }, image), h("figcaption", {}, label));
    pictureUrl(path, { signal: abort.signal }).then((url) => {
      urls.push(url);
      image.src = url;
      // All pictures get the form of the last one, the display's, as fitted targets have.
      image.onload = () => {
        if (path === pictures.at(-1).path) stage.style.setProperty("--form", image.naturalWidth / image.naturalHeight);
        figure.querySelector("figcaption").textContent = `${label}, ${image.naturalWidth} × ${image.naturalHeight} px`;
      };
    }, (error) => {
      if (error.name !== "AbortError") figure.querySelector("figcaption").textContent = `${label}: ${error.message}`;
    });
    return figure;
  }

  function apply() {
    const isPair = mode.value !== "side by side";
    stage.classList.toggle("stacked", isPair);
    pair.hidden = !isPair;
    wipe.hidden = mode.value !== "wipe";
    clearInterval(blink);
    frames.forEach((figure, i) => {
      const image = figure.querySelector("img");
      image.style.transform = `translate(${(0.5 - view.x) * 100 * view.zoom}%, ${(0.5 - view.y) * 100 * view.zoom}%) scale(${view.zoom})`;
      figure.hidden = isPair && i !== Number(first.value) && i !== Number(second.value);
      figure.style.zIndex = isPair && i === Number(second.value) ? 1 : 0;
      const isUpper = isPair && i === Number(second.value) && first.value !== second.value;
      figure.querySelector(".window").style.clipPath = isUpper && mode.value === "wipe" ? `inset(0 0 0 ${wipe.value}%)` : "none";
      figure.style.visibility = "visible";
    });
    if (mode.value === "blink" && first.value !== second.value) {
      const upper = frames[Number(second.value)];
      blink = setInterval(() => { upper.style.visibility = upper.style.visibility === "hidden" ? "visible" : "hidden"; }, BLINK_MS);
    }
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
    addEventListener("pointerup", () => removeEventListener("pointermove", move), { once: true });
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
      abort.abort();
      clearInterval(blink);
      urls.forEach((url) => URL.revokeObjectURL(url));
    },
  };
}
