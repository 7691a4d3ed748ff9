// Pictures for a request: files of the user, which are uploaded when their digest is needed, and files of the server.

import { ApiError, request } from "../api.js";
import { bytes } from "../format.js";

const FILE_BYTES_MAX = 64e6;
/** Files that the server reads as pictures or arrays. In a folder, others are left out. */
const PICTURES = /\.(png|jpe?g|tiff?|bmp|npy)$/i;
/** Pictures that browsers draw themselves. */
const DRAWN = ["image/png", "image/jpeg", "image/bmp"];

export const ACCEPTED = ".png,.jpg,.jpeg,.tif,.tiff,.bmp,.npy";

/**
 * A picture in a file: `{name, digest(), drawn, stored}`. `drawn` is the file if a browser can draw it, and `stored` its
 * digest once the server has it.
 */
export function ownFile(file) {
  let uploaded = null;
  const picture = {
    name: file.name,
    drawn: DRAWN.includes(file.type) ? file : null,
    stored: "",
    digest() {
      uploaded ??= upload(file).then((digest) => {
        picture.stored = digest;
        return digest;
      }, (error) => {
        uploaded = null;
        throw error;
      });
      return uploaded;
    },
  };
  return picture;
}

/** A picture that the server has. */
export function storedFile(name, digest) {
  return { name, drawn: null, stored: digest, digest: async () => digest };
}

/** The files that are dropped, also those in folders. Asks for the entries at once, because the event keeps them no longer. */
export function droppedFiles(transfer) {
  const entries = [...transfer.items].filter(({ kind }) => kind === "file").map((item) => item.webkitGetAsEntry?.() ?? item.getAsFile());
  return Promise.all(entries.filter(Boolean).map(filesIn)).then((files) => files.flat());
}

/** The pictures of a chosen folder, by name. */
export function picturesAmong(files) {
  return [...files].filter(({ name }) => PICTURES.test(name)).sort((a, b) => a.name.localeCompare(b.name, "en", { numeric: true }));
}

async function filesIn(entry) {
  if (entry instanceof File) return [entry];
  if (entry.isFile) return [await new Promise((found, failed) => entry.file(found, failed))];
  const reader = entry.createReader();
  const found = [];
  for (;;) {
    // A reader tells of some entries at a time, and of none at the end.
    const some = await new Promise((read, failed) => reader.readEntries(read, failed));
    if (some.length === 0) break;
    found.push(...some);
  }
  return picturesAmong((await Promise.all(found.map(filesIn))).flat());
}

/** Names of a job's pictures: those of its label, if it has as many. */
export function namesOf(label, count) {
  const names = label ? label.split(", ") : [];
  if (names.length === count) return names;
  return count === 1 ? [label || "target"] : Array.from({ length: count }, (_, i) => `picture ${i + 1}`);
}

/** Uploads a file, and returns its digest. */
async function upload(file) {
  if (file.size > FILE_BYTES_MAX) throw new ApiError(0, `${file.name} has ${bytes(file.size)}, but a file may have ${bytes(FILE_BYTES_MAX)}.`);
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
