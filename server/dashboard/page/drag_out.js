// Pictures that can be dragged out of the page as files.

import { hasToken } from "./api.js";

const TYPES = { png: "image/png", jpg: "image/jpeg", jpeg: "image/jpeg", tif: "image/tiff", tiff: "image/tiff", bmp: "image/bmp", npy: "application/octet-stream" };

/**
 * Lets a user drag an artifact from an element out of the browser: Chromium makes a file of it, other browsers a link. With a
 * token it is not possible, because the browser itself fetches the file and has no token.
 */
export function dragOut(element, digest, fileName) {
  if (hasToken()) {
    element.draggable = false;
    return;
  }
  element.draggable = true;
  element.addEventListener("dragstart", (event) => {
    const url = new URL(`/v1/artifacts/${digest}/content`, location.href).href;
    const type = TYPES[fileName.split(".").pop().toLowerCase()] ?? "application/octet-stream";
    event.dataTransfer.clearData();
    event.dataTransfer.setData("DownloadURL", `${type}:${fileName}:${url}`);
    event.dataTransfer.setData("text/uri-list", url);
    event.dataTransfer.setData("text/plain", url);
    event.dataTransfer.effectAllowed = "copy";
  });
}

/** A name for the file of a job's picture. A label that is a file name names the target. */
export function fileNameOf(job, title) {
  // The colon separates the parts of what Chromium reads.
  const label = (job.label || job.name.split("/").pop().slice(0, 13)).replace(/[^\p{L}\p{N}._-]+/gu, "-");
  const isFile = /\.(png|jpe?g|tiff?|bmp|npy)$/i.test(label);
  if (title === "target") return isFile ? label : `${label}-target.png`;
  return `${label.replace(/\.\w+$/, "")}-${title}.png`;
}
