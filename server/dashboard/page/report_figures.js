// The figures of a report: pictures that can be enlarged, and drawings.

import { request } from "./api.js";
import { h } from "./dom.js";
import { pictureViewer } from "./pictures.js";

/** The figures `{name, title, artifact}`, in their order. Returns `{element, end}`. */
export function reportFigures(figures) {
  const viewers = [];
  const ended = new AbortController();
  const shown = figures.map(({ name, title, artifact }) => {
    if (name.endsWith(".svg")) return drawing(title, artifact, ended.signal);
    const viewer = pictureViewer([{ label: title, digest: artifact, kind: "figure" }]);
    viewers.push(viewer);
    return viewer.element;
  });
  return {
    element: h("div", { class: "figures" }, shown),
    end() {
      ended.abort();
      viewers.forEach((viewer) => viewer.end());
    },
  };
}

/** A drawing as an image, in which no script of it can run. */
function drawing(title, artifact, signal) {
  const image = h("img", { alt: title });
  const load = async () => {
    const response = await request(`/v1/artifacts/${artifact}/content`, { signal, cache: "default" });
    const url = URL.createObjectURL(new Blob([await response.arrayBuffer()], { type: "image/svg+xml" }));
    image.onload = () => URL.revokeObjectURL(url);
    image.src = url;
  };
  load().catch((error) => error.name !== "AbortError" && image.replaceWith(h("p", { class: "note bad" }, `${title}: ${error.message}`)));
  return h("figure", { class: "drawing" }, image, h("figcaption", {}, title));
}
