// Jobs as pictures: target, reconstruction and photograph, with what a photograph is expected to show.

import { dragOut, fileNameOf } from "./drag_out.js";
import { h, show } from "./dom.js";
import { age, decibels, idOf, words } from "./format.js";
import { framesOf } from "./frames.js";
import { hologramOf, isKept, isNotJudged, NOT_JUDGED, photographOf, picturesOf, readHolograms, scoreOf, wholeJob, worstExpected } from "./glance.js";
import { progressOf, stateOf, waitOf } from "./job_rows.js";
import { PHOTOGRAPHS_SPACING, photographsOf } from "./photographs.js";
import { columnsFor } from "./picture_source.js";

/** Jobs this far below the shown part of the page are read, and their pictures fetched [CSS px]. */
const AHEAD = "400px";
/** Kinds of jobs that have something to show. */
const WITH_PICTURES = ["KIND_OPTIMIZE_HOLOGRAM", "KIND_SIMULATE_CAPTURE", "KIND_LEARN_KERNEL"];

/**
 * A gallery of jobs. `choice(job)` and `actions(job)` make what a user can do with one. Its method `show(jobs)` takes
 * summaries, and keeps the pictures of those that it had. Returns `{element, show, photographed, end}`.
 */
export function gallery({ choice = null, actions = null } = {}) {
  const element = h("ul", { class: "gallery", "aria-label": "Jobs" });
  const ended = new AbortController();
  let shots = new Map();
  let later = 0;
  const near = new IntersectionObserver((entries) => {
    for (const { isIntersecting, target } of entries) if (isIntersecting) shots.get(target.dataset.job)?.load();
  }, { rootMargin: AHEAD });

  function shot(first) {
    let job = first;
    let loaded = "";
    let isPhotographed = false;
    const pictures = h("div", { class: "shots" });
    const link = h("a", { href: `#/${job.name}`, "data-key": job.name }, pictures);
    const figure = h("p", { class: "figure" });
    const text = h("div", {});
    const card = h("li", { class: "shot", "data-job": job.name }, link, figure, text);
    near.observe(card);

    async function load() {
      const key = `${job.state}`;
      if (loaded === key || !WITH_PICTURES.includes(job.kind)) return;
      loaded = key;
      try {
        const whole = await wholeJob(job);
        const photographs = await photographsOf(job.display);
        if (whole.spec.simulateCapture && !hologramOf(whole)) await readHolograms(job.display);
        if (ended.signal.aborted) return;
        show(figure, figures(whole, null));
        const shown = await thumbnails(whole, photographs);
        if (shown.length > 0) pictures.replaceChildren(...(hologramOf(whole) ? [...shown, ...missing(shown.length, "none yet")] : [...missing(0, "unknown").slice(0, 2), ...shown]));
        const photograph = photographOf(whole, photographs);
        isPhotographed = Boolean(photograph);
        const score = photograph && await scoreOf(hologramOf(whole), photograph, ended.signal);
        if (Number.isFinite(score)) show(figure, figures(whole, score));
      } catch (error) {
        // The server may be away for a moment: the next reading of the list tries again.
        loaded = "";
        if (error.name !== "AbortError" && error.status !== 0) show(figure, h("small", {}, error.message));
      }
    }

    async function thumbnails(whole, photographs) {
      const { frames, form } = await framesOf(whole, picturesOf(whole, photographs), columnsFor(pictures.clientWidth / 3), (title) => `${title} of ${titleOf(job)}`, ended.signal);
      if (form) pictures.style.setProperty("--form", form);
      return frames.map(({ title, digest, image, window }) => {
        dragOut(image, digest, fileNameOf(whole, title));
        return h("figure", {}, window, h("figcaption", {}, title));
      });
    }

    function take(fresh) {
      job = fresh;
      if (!loaded) show(pictures, h("span", { class: "kind" }, words(job.kind, "KIND")));
      show(text, h("p", { class: "title" }, h("a", { href: `#/${job.name}`, tabindex: -1 }, titleOf(job)), job.state !== "STATE_SUCCEEDED" && stateOf(job)),
        progressOf(job) ?? (job.error && job.state !== "STATE_SUCCEEDED" ? h("p", { class: "reason" }, job.error.message) : job.state === "STATE_QUEUED" && h("p", { class: "meta" }, waitOf(job))),
        h("p", { class: "meta" }, [job.label && words(job.kind, "KIND"), idOf(job.display), job.owner].filter(Boolean).join(" · "),
          job.batch && [" · ", h("a", { href: `#/batch/${encodeURIComponent(job.batch)}` }, job.batch)], " · ",
          h("time", { datetime: job.createTime, title: job.createTime }, age(job.createTime))),
        (choice || actions) && h("p", { class: "acts" }, choice && job.kind === "KIND_OPTIMIZE_HOLOGRAM" && h("label", {}, choice(job), " compare"), actions?.(job)));
      // What was seen before is seen at once; the rest waits until it comes into sight.
      if (loaded || isKept(job)) void load();
    }

    function again() {
      if (!loaded || isPhotographed || job.kind !== "KIND_OPTIMIZE_HOLOGRAM") return;
      loaded = "";
      void load();
    }

    take(first);
    return { card, take, load, again };
  }

  return {
    element,
    show(jobs) {
      const before = shots;
      shots = new Map(jobs.map((job) => [job.name, before.get(job.name) ?? shot(job)]));
      for (const job of jobs) if (before.has(job.name)) shots.get(job.name).take(job);
      for (const [name, { card }] of before) if (!shots.has(name)) near.unobserve(card);
      // A card that stays where it is keeps the focus.
      [...shots.values()].forEach(({ card }, i) => element.children[i] !== card && element.insertBefore(card, element.children[i] ?? null));
      while (element.children.length > jobs.length) element.lastChild.remove();
    },
    /** Shows photographs that were taken meanwhile, as soon as they are read again. */
    photographed() {
      later ||= setTimeout(() => {
        later = 0;
        for (const { again } of shots.values()) again();
      }, PHOTOGRAPHS_SPACING);
    },
    end() {
      clearTimeout(later);
      ended.abort();
      near.disconnect();
    },
  };
}

/** Places of the pictures from `first` on that are not there, so that all cards have the same form. */
function missing(first, text) {
  return ["target", "reconstruction", "photograph"].slice(first).map((title) => h("figure", {}, h("div", { class: "window missing" }, text), h("figcaption", {}, title)));
}

/** What a person calls a job: its label, or the beginning of its id. */
function titleOf(job) {
  return job.label || `${words(job.kind, "KIND")} ${idOf(job.name).slice(-6)}`;
}

/** The figure to believe, and the photograph's own where there is one. */
function figures(job, score) {
  if (job.result?.learnKernel) {
    const { metrics } = job.result.learnKernel.kernels[0];
    const captured = metrics?.captured;
    if (captured) return [h("strong", {}, decibels(captured.psnrDb)), " in photographs ", h("small", {}, `${decibels(captured.idealPsnrDb)} with the ideal kernel`)];
    const gain = metrics?.testLoss > 0 ? 10 * Math.log10(metrics.idealTestLoss / metrics.testLoss) : null;
    return gain === null ? null : [h("strong", {}, decibels(gain)), " better than ideal ", h("small", {}, "loss of test photographs")];
  }
  const photographed = Number.isFinite(score) && [h("strong", {}, decibels(score)), " photographed"];
  const expected = worstExpected(job);
  if (!expected) return photographed || (isNotJudged(job) ? NOT_JUDGED : null);
  const all = expected.pictures > 1 ? ` (lowest of ${expected.pictures})` : "";
  return [h("strong", {}, expected.text), ` ${expected.note}${all} `, photographed && h("small", {}, photographed)];
}
