// A new hologram: a picture is dropped or chosen, uploaded, and submitted as a job.

import { ApiError, get, post, request } from "../api.js";
import { h, show } from "../dom.js";
import { bytes, idOf, length, placeText } from "../format.js";
import { emptyNote, errorNote } from "../loading.js";

const FILE_BYTES_MAX = 64e6;
let dropped = null;

/** Takes pictures that are dropped anywhere on the page to the page for a new hologram. */
export function acceptDrops(open) {
  document.addEventListener("dragover", (event) => event.dataTransfer.types.includes("Files") && event.preventDefault());
  document.addEventListener("drop", (event) => {
    const [file] = event.dataTransfer.files;
    if (!file) return;
    event.preventDefault();
    dropped = file;
    open();
  });
}

export function newPage(root) {
  const notice = h("div", { role: "status" });
  const preview = h("img", { class: "preview", alt: "The chosen picture", hidden: true });
  const file = h("input", { id: "picture", type: "file", accept: "image/png,image/jpeg,image/tiff,image/bmp,.npy", required: true, onchange: () => choose(file.files[0]) });
  const display = h("select", { id: "display", required: true, onchange: fillDistances });
  const distances = h("datalist", { id: "distances" });
  const distance = h("input", { id: "distance", type: "number", min: 0.001, step: "any", required: true, list: "distances", value: 150 });
  const kernel = h("select", { id: "kernel" }, [["", "active, or ideal if there is none"], ["ideal", "ideal"]].map(([value, text]) => h("option", { value }, text)));
  const iterations = h("input", { id: "iterations", type: "number", min: 1, max: 10_000, value: 200, required: true });
  const submit = h("button", { type: "submit", class: "main" }, "Make the hologram");
  const field = (label, input, unit) => h("label", { for: input.id }, label, h("span", { class: "field" }, input, unit && h("span", {}, unit)));
  const form = h("form", { class: "new", onsubmit: send },
    field("Picture (PNG, JPEG, TIFF, BMP or .npy), or drop one anywhere on this page", file), preview,
    field("Display", display), field("Distance from the display to the picture", distance, "mm"), distances,
    field("Kernel", kernel), field("Iterations", iterations), h("p", { class: "actions" }, submit), notice);
  const body = h("div", {});
  show(root, h("h1", {}, "New hologram"), body);
  let picture = null;
  let previewUrl = "";

  function choose(chosen) {
    if (!chosen) return;
    picture = chosen;
    file.required = false;
    URL.revokeObjectURL(previewUrl);
    previewUrl = URL.createObjectURL(chosen);
    preview.src = previewUrl;
    preview.hidden = false;
    show(notice, h("p", {}, `${chosen.name}, ${bytes(chosen.size)}`));
  }

  async function fillDistances() {
    const { kernels } = await get(`displays/${display.value}/kernels`, { pageSize: 100 });
    show(distances, kernels.map((kernel) => h("option", { value: kernel.place.distanceM * 1000 }, placeText(kernel.place))));
    const active = kernels.find((kernel) => kernel.activeVersion);
    if (active) distance.value = Number((active.place.distanceM * 1000).toPrecision(6));
  }

  async function send(event) {
    event.preventDefault();
    submit.disabled = true;
    try {
      if (picture.size > FILE_BYTES_MAX) throw new ApiError(0, `The picture has ${bytes(picture.size)}, but may have ${bytes(FILE_BYTES_MAX)}.`);
      show(notice, h("p", {}, "The picture is uploaded…"));
      const target = await upload(picture);
      const planes = [{ place: { distanceM: Number(distance.value) / 1000 }, target }];
      const optimizeHologram = { display: `displays/${display.value}`, planes, ...(kernel.value && { kernel: { [kernel.value]: {} } }), iterations: Number(iterations.value) };
      const job = await post("jobs", { spec: { optimizeHologram }, label: labelOf(picture.name) });
      location.hash = `#/${job.name}`;
    } catch (error) {
      show(notice, errorNote(error));
      submit.disabled = false;
    }
  }

  function take() {
    if (!dropped) return;
    choose(dropped);
    dropped = null;
  }

  get("displays", { pageSize: 200 }).then(async ({ displays }) => {
    if (displays.length === 0) {
      show(body, emptyNote("A hologram needs a display. Declare one:", "lightpath display create lab --resolution 1920x1080 --pixel-pitch 8um --wavelength 515nm"));
      return;
    }
    show(display, displays.map(({ name }) => h("option", { value: idOf(name) }, idOf(name))));
    show(body, form);
    take();
    await fillDistances();
  }).catch((error) => show(body, errorNote(error)));
  addEventListener("picturedrop", take);
  return () => {
    removeEventListener("picturedrop", take);
    URL.revokeObjectURL(previewUrl);
  };
}

/** A file name as the label of a job: at most 128 bytes, without a part of a character at the end. */
function labelOf(name) {
  const bytes = new TextEncoder().encode(name.replace(/\p{Cc}/gu, " "));
  return new TextDecoder().decode(bytes.slice(0, 128)).replace(/\ufffd+$/, "");
}

/** Uploads a file, and returns its digest. */
async function upload(file) {
  const headers = { "content-type": "application/octet-stream" };
  if (!crypto.subtle) {
    // Browsers compute digests only on pages from https or localhost.
    const stored = await request("/v1/artifacts", { method: "POST", body: file, headers });
    return (await stored.json()).digest;
  }
  const content = await file.arrayBuffer();
  const hash = new Uint8Array(await crypto.subtle.digest("SHA-256", content));
  const digest = `sha256-${[...hash].map((byte) => byte.toString(16).padStart(2, "0")).join("")}`;
  await request(`/v1/artifacts/${digest}/upload`, { method: "PUT", body: content, headers });
  return digest;
}
