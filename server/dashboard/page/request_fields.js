// The fields of requests, and those in which requests differ.

/** The fields of a message with their paths, such as `optimizeHologram.planes.0.place.distanceM`. A message without fields is `set`. */
export function fieldsOf(value, path = "") {
  if (value === null || typeof value !== "object") return { [path]: String(value) };
  const inner = Object.entries(value);
  if (inner.length === 0) return { [path]: "set" };
  return Object.assign({}, ...inner.map(([name, field]) => fieldsOf(field, path ? `${path}.${name}` : name)));
}

/** The paths of the fields that are not the same in all of these requests, given as `fieldsOf` has them. */
export function differing(requests) {
  const paths = [...new Set(requests.flatMap((request) => Object.keys(request)))];
  return paths.filter((path) => requests.some((request) => request[path] !== requests[0][path]));
}

/** A path in words, such as `distance [m]`. Numbers of lists stay if the list has several entries in which requests differ. */
export function wordsOf(path, paths) {
  const plain = (name) => name.replace(/^\w+\./, "").replace(/\.\d+(?=\.|$)/g, "");
  const isOne = paths.filter((other) => plain(other) === plain(path)).length === 1;
  const parts = (isOne ? plain(path) : path.replace(/^\w+\./, "")).replace(/^planes\./, "").replace(/^place\./, "").replace("place.", "").split(".");
  const unit = parts.at(-1).match(/(?<=[a-z])(M|S|Px|Rad)$/)?.[0];
  if (unit) parts[parts.length - 1] = parts.at(-1).slice(0, -unit.length);
  const text = parts.map((part) => part.replace(/[A-Z]/g, (letter) => ` ${letter.toLowerCase()}`)).join(" ");
  return unit ? `${text} [${{ M: "m", S: "s", Px: "px", Rad: "rad" }[unit]}]` : text;
}
