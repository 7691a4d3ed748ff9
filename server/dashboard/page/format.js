// Values as people read them, with units.

/** The last part of a resource name. */
export function idOf(name) {
  return name.split("/").pop();
}

/** `KIND_LEARN_KERNEL` as `learn kernel`: the words of an enumeration's value without their prefix. */
export function words(value, prefix) {
  return value.replace(new RegExp(`^${prefix}_`), "").toLowerCase().replaceAll("_", " ");
}

export function number(value, digits = 3) {
  if (!Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  return size >= 1e-3 && size < 1e5 ? String(Number(value.toPrecision(digits))) : value.toExponential(digits - 1);
}

export function decibels(value) {
  return Number.isFinite(value) ? `${value.toFixed(1)} dB` : "–";
}

/** A ratio in decibels with one standard deviation, if it is known and not too small to show. */
export function measuredDecibels({ value, std }) {
  return std >= 0.05 ? `${value.toFixed(1)} ± ${std.toFixed(1)} dB` : decibels(value);
}

export function percent(part) {
  return Number.isFinite(part) ? `${number(100 * part)} %` : "–";
}

export function duration(seconds) {
  if (!Number.isFinite(seconds)) return "–";
  if (seconds < 1) return `${Math.max(1, Math.round(seconds * 1000))} ms`;
  if (seconds < 60) return `${seconds < 10 ? seconds.toFixed(1) : Math.round(seconds)} s`;
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min ${Math.round(seconds % 60)} s`;
  if (seconds < 86_400) return `${Math.floor(seconds / 3600)} h ${Math.round((seconds % 3600) / 60)} min`;
  return `${Math.round(seconds / 86_400)} d`;
}

/** How long ago a time was, as coarse as people say it. */
export function age(time) {
  const seconds = (Date.now() - Date.parse(time)) / 1000;
  const units = [[86_400, "d"], [3600, "h"], [60, "min"], [1, "s"]];
  const [unit, name] = units.find(([unit]) => seconds >= unit) ?? [1, "s"];
  return seconds < 5 ? "now" : `${Math.floor(seconds / unit)} ${name} ago`;
}

/** A place, such as `150 mm`. */
export function placeText(place) {
  return length(place.distanceM);
}

export function length(metres) {
  if (!Number.isFinite(metres)) return "–";
  const [unit, name] = metres >= 1 ? [1, "m"] : metres >= 1e-3 ? [1e-3, "mm"] : metres >= 1e-6 ? [1e-6, "µm"] : [1e-9, "nm"];
  return `${Number((metres / unit).toPrecision(6))} ${name}`;
}

export function bytes(count) {
  const [unit, name] = count >= 1e9 ? [1e9, "GB"] : count >= 1e6 ? [1e6, "MB"] : count >= 1e3 ? [1e3, "kB"] : [1, "bytes"];
  return `${Number((count / unit).toPrecision(3))} ${name}`;
}

/** Time between two times of the API [s]; `null` if one is missing. */
export function between(from, to) {
  return from && to ? (Date.parse(to) - Date.parse(from)) / 1000 : null;
}
