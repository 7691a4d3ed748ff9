// Losses of running jobs over their steps, as events tell them. They are kept from the first event of a job on, whatever page is
// open, so that a job's own page has the whole curve when it is opened later.

import { onEvent } from "./events.js";

/** Jobs whose losses are kept, and points of each: more cannot be told apart on a screen. */
const JOBS_MAX = 50;
const POINTS_MAX = 1000;

const histories = new Map();

/** Adds what a job has reached, and returns its losses in the present stage: `{stage, steps, losses}`. */
export function noteLoss(name, progress) {
  const known = histories.get(name);
  if (!Number.isFinite(progress?.loss)) return known ?? { stage: "", steps: [], losses: [] };
  const isSame = known?.stage === progress.stage && progress.step >= (known.steps.at(-1) ?? 0);
  const history = isSame ? known : { stage: progress.stage, steps: [], losses: [] };
  if (progress.step !== history.steps.at(-1)) {
    history.steps.push(progress.step);
    history.losses.push(progress.loss);
  }
  if (history.steps.length > POINTS_MAX) for (const list of ["steps", "losses"]) history[list] = history[list].filter((_, i) => i % 2 === 0);
  histories.delete(name);
  histories.set(name, history);
  if (histories.size > JOBS_MAX) histories.delete(histories.keys().next().value);
  return history;
}

onEvent((kind, data) => {
  if (kind === "job") noteLoss(data.name, data.progress);
});
