// What a running hologram's job has reached, as a small picture.

import { request } from "./api.js";
import { h } from "./dom.js";

/** Least time from one picture to the next: the server draws none sooner [ms]. */
const SPACING = 2000;

/** The picture of a job. `refresh` may be called often, for example after every event. Returns `{element, refresh, end}`. */
export function livePicture(name) {
  const image = h("img", { alt: "What the hologram shows so far" });
  const element = h("figure", { class: "live-picture", hidden: true }, image, h("figcaption", {}, "what it shows so far"));
  const ended = new AbortController();
  let lastStart = 0;
  let shown = "";

  async function refresh() {
    if (ended.signal.aborted || document.hidden || Date.now() - lastStart < SPACING) return;
    lastStart = Date.now();
    const response = await request(`/v1/${name}/picture`, { signal: ended.signal }).catch(() => null);
    // There is none before the first seconds of the job, and the page does well without one.
    if (response?.status !== 200 || response.headers.get("etag") === shown) return;
    shown = response.headers.get("etag");
    const url = URL.createObjectURL(await response.blob());
    image.onload = () => URL.revokeObjectURL(url);
    image.src = url;
    element.hidden = false;
  }

  void refresh();
  return { element, refresh: () => void refresh(), end: () => ended.abort() };
}
