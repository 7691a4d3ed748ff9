// The options of a hologram that have one value each: their controls, defaults, and names on the command line and in Python.

/**
 * Each option has the `path` of its field in the request, a `label`, a `fallback` that the server takes for a missing
 * value, the `flag` of the command line and the keyword in `python`. `choices` are `[value, text]`; `prefix` is that of
 * their values in the API, whose rest is the word on the command line. Numbers have `min`, `max`, `step` and a `unit`.
 * `chosen` is what the server puts in the place of an unspecified value.
 */
export const OPTIONS = [
  { path: "iterations", label: "Iterations; 0 judges given phases", fallback: 200, min: 0, max: 10_000, flag: "--iterations", python: "iterations" },
  { path: "method", label: "Method", prefix: "HOLOGRAM_METHOD", fallback: "LBFGS", flag: "--method", python: "method", choices: [
    ["LBFGS", "L-BFGS: the best picture"], ["ADAM", "Adam"], ["GERCHBERG_SAXTON", "Gerchberg–Saxton: a draft"],
    ["WEIGHTED_GERCHBERG_SAXTON", "weighted Gerchberg–Saxton"], ["DOUBLE_PHASE", "double phase: one pass"]] },
  { path: "learningRate", label: "Learning rate of Adam", fallback: 0.1, min: 0, max: 10, step: "any", unit: "rad", flag: "--learning-rate", python: "learning_rate", onlyIf: ({ method }) => method === "HOLOGRAM_METHOD_ADAM" },
  { path: "subframes", label: "Subframes, whose mean the eye sees", fallback: 1, min: 1, max: 24, flag: "--subframes", python: "subframes" },
  { path: "detector", label: "Detector: the light that counts", prefix: "DETECTOR", fallback: "PIXEL", flag: "--detector", python: "detector", choices: [
    ["PIXEL", "pixel, as a camera sees it"], ["POINT", "point"], ["SUPERSAMPLED", "supersampled, as an eye sees it"]] },
  { path: "targetFit", label: "Pictures of other sizes", prefix: "FIT", fallback: "CONTAIN", flag: "--fit", python: "fit", isAdvanced: true, choices: [
    ["CONTAIN", "fit inside, black borders"], ["COVER", "fill, cut what hangs over"], ["STRETCH", "stretch"], ["EXACT", "refuse"]] },
  { path: "targetArea", label: "Area that a picture fills", prefix: "AREA", fallback: "UNSPECIFIED", flag: "--area", python: "area", isAdvanced: true, chosen: ({ targetFit }) => (targetFit === "FIT_EXACT" ? "AREA_DISPLAY" : "AREA_REGION"), choices: [
    ["UNSPECIFIED", "the default"], ["REGION", "the region, where it counts"], ["DISPLAY", "the whole display"]] },
  { path: "targetEncoding", label: "Values of a picture", prefix: "ENCODING", fallback: "SRGB", flag: "--target-encoding", python: "target_encoding", isAdvanced: true, choices: [
    ["SRGB", "sRGB, as most pictures"], ["LINEAR", "linear light"]] },
  { path: "propagation", label: "Propagation of light", prefix: "PROPAGATION_METHOD", fallback: "UNSPECIFIED", flag: "--propagation", python: "propagation", isAdvanced: true, choices: [
    ["UNSPECIFIED", "the planner chooses"], ["BAND_RESPONSE", "band response"], ["ANGULAR_SPECTRUM", "angular spectrum"], ["BAND_LIMITED", "band limited"],
    ["RAYLEIGH_SOMMERFELD", "Rayleigh–Sommerfeld"], ["FRESNEL_TRANSFER_FUNCTION", "Fresnel transfer function"], ["FRESNEL_IMPULSE_RESPONSE", "Fresnel impulse response"]] },
  { path: "loss.quantity", label: "Loss: what is compared", prefix: "QUANTITY", fallback: "INTENSITY", flag: "--loss", python: "loss", isAdvanced: true, choices: [
    ["INTENSITY", "intensity"], ["AMPLITUDE", "amplitude: dark parts count more"]] },
  { path: "loss.totalVariation", label: "Smoothness: total variation", fallback: 0, min: 0, max: 1000, step: "any", flag: "--total-variation", python: "total_variation", isAdvanced: true },
  { path: "loss.speckle", label: "Less speckle: local contrast", fallback: 0, min: 0, max: 1000, step: "any", flag: "--speckle", python: "speckle", isAdvanced: true },
  { path: "loss.speckleBlockPx", label: "Side of the blocks for speckle", fallback: 8, min: 2, max: 256, unit: "px", flag: "--speckle-block", isAdvanced: true },
  { path: "seed", label: "Seed of random phases", fallback: "0", isText: true, flag: "--seed", python: "seed", isAdvanced: true },
  { path: "quantizationAware", label: "Quantization aware: through the display's grey levels", fallback: false, flag: "--quantization-aware", python: "quantization_aware", isAdvanced: true },
  { path: "judge", label: "Judging", prefix: "JUDGING", fallback: "FULL", flag: "--judge", python: "judge", isAdvanced: true, choices: [
    ["FULL", "in full"], ["QUICK", "quick: by the engine alone"], ["NONE", "none: no figures"]] },
];

/** The value that the server takes if a request has none. */
export function defaultOf({ prefix, fallback }) {
  return prefix ? `${prefix}_${fallback}` : fallback;
}

export function at(message, path) {
  return path.split(".").reduce((part, name) => part?.[name], message);
}

export function put(message, path, value) {
  const names = path.split(".");
  const last = names.pop();
  names.reduce((part, name) => (part[name] ??= {}), message)[last] = value;
}

/** The value of an option in a job's request, where an unset number or an unspecified word means the default. */
export function valueOf(option, spec) {
  const value = at(spec, option.path);
  const isUnset = value === undefined || value === null || (option.prefix && value === `${option.prefix}_UNSPECIFIED`);
  if (isUnset || value === option.chosen?.(spec)) return defaultOf(option);
  return option.isText ? String(value) : value;
}

/** The initial phase that the server chooses for a request without one. */
export function defaultPhase({ method, detector, subframes }) {
  if (method === "HOLOGRAM_METHOD_DOUBLE_PHASE") return { constant: { phaseRad: 0 } };
  const followsGradient = ["HOLOGRAM_METHOD_LBFGS", "HOLOGRAM_METHOD_ADAM"].includes(method);
  if (!followsGradient || subframes > 1) return { random: { rangeRad: 1 } };
  return { backPropagated: { rangeRad: detector === "DETECTOR_SUPERSAMPLED" ? 0 : 1 } };
}

/** The region in which a picture counts if a request has none: the middle 80 % of each axis, rounded as the server does. */
export function middleOf({ widthPx, heightPx }) {
  const span = (side) => {
    const start = Math.round(side * 0.1);
    return [start, Math.max(1, side - 2 * start)];
  };
  const [[x, width], [y, height]] = [span(widthPx), span(heightPx)];
  return { xPx: x, yPx: y, widthPx: width, heightPx: height };
}

/** Whether two values of a message are equal. */
export function isSame(a, b) {
  if (typeof a !== "object" || typeof b !== "object" || !a || !b) return a === b;
  return [...new Set([...Object.keys(a), ...Object.keys(b)])].every((key) => isSame(a[key], b[key]));
}
