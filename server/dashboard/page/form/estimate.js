// What a hologram will need, and what is wrong with its request, while its form is filled in.

import { post } from "../api.js";
import { h, show } from "../dom.js";
import { bytes, duration, idOf } from "../format.js";
import { errorNote } from "../loading.js";
import { showProblems } from "./controls.js";

/** Rest after a change before the server is asked [ms]. */
const REST_MS = 400;

/**
 * An estimate for what a form asks for. `jobs`, `missing` and `requestOf` are those of `hologramForm`; problems are shown in `form`.
 * Returns `{element, soon, end}`.
 */
export function estimateOf(form, { jobs, missing, requestOf }) {
  const element = h("div", { class: "estimate", role: "status", "aria-live": "polite" });
  let timer = 0;
  let latest = 0;

  function soon() {
    clearTimeout(timer);
    latest += 1;
    timer = setTimeout(() => void ask(latest), REST_MS);
  }

  async function ask(turn) {
    const wanted = jobs();
    if (missing().length > 0) {
      showProblems(form, []);
      show(element, h("p", { class: "hint" }, "Time and memory are shown here once all pictures are chosen."));
      return;
    }
    let estimate = null;
    let error = null;
    try {
      const { spec } = await requestOf(wanted[0]);
      if (turn !== latest) return;
      estimate = await post("jobs:estimate", { spec });
    } catch (caught) {
      error = caught;
    }
    // A newer change has another answer.
    if (turn !== latest) return;
    const others = showProblems(form, error?.fields ?? []);
    if (error?.fields?.length) show(element, others.map((problem) => h("p", { class: "problem" }, `${problem.field}: ${problem.problem}; ${problem.fix}`)));
    else show(element, error ? errorNote(error) : textOf(estimate, wanted.length));
  }

  return {
    element,
    soon,
    end() {
      clearTimeout(timer);
      latest += 1;
    },
  };
}

function textOf({ timeS, memoryBytes, kernels }, count) {
  const used = [...new Set(kernels.map(({ kernelVersion }) => (kernelVersion ? `version ${idOf(kernelVersion)}` : "the ideal kernel")))].join(", ");
  const needs = timeS === undefined ? "The server cannot estimate it" : `About ${duration(timeS)}${count > 1 ? ` for each of ${count} holograms` : ""} and ${bytes(Number(memoryBytes))} of memory`;
  return h("p", {}, h("strong", {}, needs), ` when nothing else runs; by ${used}.`);
}
