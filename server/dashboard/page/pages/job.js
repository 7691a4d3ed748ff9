// One job: its progress, loss, pictures, quality, origin, log, and how to make it again.

import { guarded } from "../access.js";
import { get, post } from "../api.js";
import { chart } from "../chart.js";
import { h, show } from "../dom.js";
import { downloads, filesOfHologram } from "../downloads.js";
import { areaOf, regionOf } from "../hologram_region.js";
import { makeAgain } from "../make_again.js";
import { onEvent } from "../events.js";
import { age, between, bytes, decibels, duration, idOf, length, measuredDecibels, number, percent, placeText } from "../format.js";
import { progressOf, stateOf, updateProgress, waitOf } from "../job_rows.js";
import { colourPictures, headlineOf, hologramPictures, judgementOf, phasePicture, photographPicture, photographsOf } from "../hologram_pictures.js";
import { livePicture } from "../live_picture.js";
import { errorNote, refresher } from "../loading.js";
import { noteLoss } from "../loss_history.js";
import { originTable, versionsOfHologram } from "../origin.js";
import { pictureViewer } from "../pictures.js";
import { propagationSection } from "../propagation.js";
import { reportFigures } from "../report_figures.js";
import { table } from "../table.js";

const DETECTORS = ["point", "pixel", "supersampled"];
const STAGES = [["as optimized", "OPTIMIZED"], ["displayed", "DISPLAYED"]];

export function jobPage(root, [id]) {
  const name = `jobs/${id}`;
  const head = h("div", {});
  const notice = h("div", { role: "status" });
  const live = h("div", {});
  const loss = h("div", {});
  const results = h("div", {});
  const facts = h("div", {});
  const log = h("div", {});
  show(root, head, notice, live, loss, results, facts, log);
  let plot = null;
  let picture = null;
  let viewers = [];
  let shownRevision = "";
  let hasEnded = false;

  const refresh = refresher(head, async () => {
    const job = await get(name);
    if (job.revision === shownRevision) return;
    shownRevision = job.revision;
    hasEnded = ["STATE_SUCCEEDED", "STATE_FAILED", "STATE_CANCELLED"].includes(job.state);
    showHead(job);
    showLive(job);
    note(job.progress);
    await showFacts(job);
    if (job.state === "STATE_SUCCEEDED") await showResults(job);
    const events = await get(`${name}/events`, { pageSize: 200 });
    show(log, h("section", {}, h("h2", {}, "Log"), h("ol", { class: "log" }, events.events.map((event) =>
      h("li", {}, h("time", { datetime: event.time }, new Date(event.time).toLocaleString()), ` ${event.message}`)))));
  });

  function showHead(job) {
    const isJudged = job.spec.optimizeHologram?.iterations === 0;
    const kind = isJudged ? "evaluate hologram" : Object.keys(job.spec)[0].replace(/[A-Z]/g, (letter) => ` ${letter.toLowerCase()}`);
    const act = (verb, text) => guarded(h("button", { type: "button", "data-key": verb, onclick: async () => {
      try {
        await post(`${name}:${verb}`);
        show(notice);
      } catch (error) {
        show(notice, errorNote(error));
      }
      void refresh();
    } }, text), "submit");
    const took = between(job.startTime, job.endTime);
    show(head, h("h1", {}, kind, " ", stateOf(job)),
      h("p", {}, `${job.label ? `${job.label}, ` : ""}${id}, submitted ${age(job.createTime)}${job.owner ? ` by ${job.owner}` : ""}${took === null ? "" : `, took ${duration(took)}`}`),
      job.error && h("p", { class: "note bad" }, job.error.message),
      job.waitsFor && h("p", { class: "note" }, `The job waits: ${waitOf(job)}.`),
      progressOf(job),
      h("p", { class: "actions" }, !hasEnded && !job.cancelRequested && act("cancel", "Cancel"),
        ["STATE_FAILED", "STATE_CANCELLED"].includes(job.state) && act("retry", "Retry")));
  }

  /** Shows the picture of a running hologram, until its result is there. */
  function showLive(job) {
    if (job.state === "STATE_RUNNING" && job.spec.optimizeHologram) {
      picture ??= livePicture(name);
      show(live, picture.element);
    } else {
      picture?.end();
      picture = null;
      show(live);
    }
  }

  /** Draws the losses of the steps so far, with that of the latest one. */
  function note(progress) {
    const { stage, steps, losses } = noteLoss(name, hasEnded ? null : progress);
    if (steps.length > 0) drawLoss(`Loss: ${stage}${steps[0] > 1 ? `, from step ${steps[0]} on` : ""}`, "step", steps, losses);
  }

  function drawLoss(title, xLabel, steps, losses) {
    if (plot?.title === title) return plot.update(steps, [losses]);
    plot?.end();
    plot = { title, ...chart({ title, xLabel, yLabel: "loss", xs: steps, series: [{ label: "loss", values: losses }], isLog: true }) };
    show(loss, h("section", {}, plot.element));
  }

  async function showFacts(job) {
    const spec = Object.values(job.spec)[0];
    const display = spec.display ?? spec.kernelVersion?.split("/kernels/")[0];
    const link = (target) => h("a", { href: `#/${target.split("/versions/")[0]}` }, target);
    const rows = [
      ["Display", display && link(display)],
      ["Batch", job.batch && h("a", { href: `#/jobs?batch=${encodeURIComponent(job.batch)}` }, job.batch)],
      ["Attempt", `${job.attempt} of ${job.attemptsMax}`],
      ["Needs", job.needs.join(", ")],
      ["Waits for", job.after.map((after) => h("a", { href: `#/${after}` }, idOf(after), " "))],
      ["Computed by", job.computer || null],
      ["Estimate", job.estimatedTimeS ? `${duration(job.estimatedTimeS)}, ${bytes(Number(job.estimatedMemoryBytes))} of memory` : null],
      ["Kernels", [...new Set(job.kernels.map(({ kernelVersion }) => kernelVersion || "ideal"))].join(", ")],
    ];
    // Without its display the command line of a hologram is not known, but the call over HTTP is.
    const declared = job.spec.optimizeHologram ? await get(spec.display).catch(() => null) : null;
    show(facts, h("section", {}, h("h2", {}, "Request"),
      h("dl", { class: "facts" }, rows.filter(([, value]) => value && value.length !== 0).map(([term, value]) => [h("dt", {}, term), h("dd", {}, value)])),
      h("details", {}, h("summary", {}, "The whole request"), h("pre", { tabindex: 0 }, h("code", {}, JSON.stringify(job.spec, null, 2))))),
    makeAgain(job, declared));
  }

  async function showResults(job) {
    const { optimizeHologram: hologram, learnKernel: learn, simulateCapture: capture, reportKernel: report, ...others } = job.result;
    const display = job.spec.optimizeHologram && await get(job.spec.optimizeHologram.display);
    viewers.forEach((viewer) => viewer.end());
    viewers = [];
    const sections = [];
    if (hologram) sections.push(await hologramSections(job, hologram, display));
    if (learn) sections.push(await learnSections(learn));
    if (capture) {
      sections.push(pictures("Photograph", [phasePicture("pattern", job.spec.simulateCapture.pattern), photographPicture("photograph", capture.photo)]),
        propagationSection([[placeText(job.spec.simulateCapture.place), capture.propagation]]));
    }
    if (report) sections.push(figures(report));
    const other = Object.values(others)[0];
    if (other) sections.push(h("section", {}, h("h2", {}, "Result"), h("pre", { tabindex: 0 }, h("code", {}, JSON.stringify(other, null, 2)))));
    show(results, sections);
  }

  function pictures(title, list, region = null) {
    const viewer = pictureViewer(list, region);
    viewers.push(viewer);
    return h("section", {}, h("h2", {}, title), viewer.element);
  }

  function figures(report) {
    const shown = reportFigures(report.figures);
    viewers.push(shown);
    return h("section", {}, h("h2", {}, "Report"), shown.element);
  }

  async function learnSections({ lossHistory, kernels }) {
    drawLoss("Training loss", "epoch, then refinement step", lossHistory.map((_, i) => i + 1), lossHistory);
    const versions = await Promise.all(kernels.map(({ kernelVersion }) => get(kernelVersion)));
    return [
      h("section", {}, h("h2", {}, "Learned kernels"), originTable("Dataset", versions.map((version, i) => [idOf(kernels[i].dataset), version]))),
      propagationSection(kernels.map(({ dataset, propagation }) => [idOf(dataset), propagation])),
    ];
  }

  async function hologramSections(job, result, display) {
    const spec = job.spec.optimizeHologram;
    const [photographs, versions] = await Promise.all([
      photographsOf(display, result.wavelengths.flatMap(({ subframes }) => subframes.map(({ pattern }) => pattern))),
      versionsOfHologram(job),
    ]);
    const planes = result.wavelengths.flatMap((wavelength) => wavelength.planes.map((plane) => [`${length(wavelength.wavelengthM)}, ${placeText(plane.place)}`, plane]));
    const qualities = planes.flatMap(([at, plane]) => STAGES.flatMap(([phases, stage]) => DETECTORS.map((detector) => [at, phases, detector, judgementOf(plane, stage, detector)])))
      .filter(([, , , judged]) => judged);
    const showsRegion = h("input", { type: "checkbox", checked: !results.classList.contains("regionless"), onchange: () => results.classList.toggle("regionless", !showsRegion.checked) });
    return [
      h("p", {}, h("label", {}, showsRegion, " In pictures of light, show the region in which they count. The darkened rest is light that the picture does not need.")),
      result.colourReconstructions.length > 0 && pictures("Pictures in colour", colourPictures(spec, result, areaOf(spec, display)), regionOf(spec, display)),
      result.wavelengths.map((wavelength) => {
        const own = photographs.filter((photograph) => wavelength.subframes.some(({ pattern }) => pattern === photograph.pattern));
        return pictures(result.wavelengths.length > 1 ? `Pictures at ${length(wavelength.wavelengthM)}` : "Pictures", hologramPictures(spec, result, wavelength, display.modulator.bitDepth, own, areaOf(spec, display)), regionOf(spec, display));
      }),
      downloads(filesOfHologram(job, display, photographs)),
      h("section", {}, h("h2", {}, "Quality"), LEFT_OUT[result.judged] && h("p", { class: "note" }, LEFT_OUT[result.judged]),
        qualities.length > 0 && [expectations(planes, versions), qualityTable(qualities)]),
      propagationSection(planes.map(([at, plane]) => [at, plane.propagation])),
      h("section", {}, h("h2", {}, "Origin"), originTable("Plane", versions)),
    ];
  }

  const ends = onEvent((kind, data) => {
    if (kind === "reset") {
      shownRevision = "";
      refresh.soon();
    }
    if (kind !== "job" || data.name !== name) return;
    picture?.refresh();
    if (updateProgress(head, data)) note(data.progress);
    else refresh.soon();
  });
  return () => {
    ends();
    plot?.end();
    picture?.end();
    viewers.forEach((viewer) => viewer.end());
  };
}

/** What a job with less judging than in full left out. */
const LEFT_OUT = {
  JUDGING_NONE: "Not judged (judge none).",
  JUDGING_QUICK: "Judged by the engine alone (judge quick): not judged on displays with other orders, nor by the independent model.",
};

/** What a photograph of each plane is expected to show, and by which model. `versions` are the kernels of the hologram. */
function expectations(planes, versions) {
  return planes.map(([at, plane], i) => {
    const { psnrDb, stage, kernelVersion } = headlineOf(plane);
    if (!kernelVersion && !versions[i][1]) return h("p", {}, h("strong", {}, `${decibels(psnrDb.value)} if the optics are ideal`), ` at ${at}. No kernel of the display is active to say what a photograph shows.`);
    const by = kernelVersion ? h("a", { href: `#/${kernelVersion.split("/versions/")[0]}` }, `version ${idOf(kernelVersion)} of the display's kernel`) : "the kernel of the hologram";
    const expected = stage === "STAGE_PHOTOGRAPHED" ? `${measuredDecibels(psnrDb)} expected in a photograph` : `${decibels(psnrDb.value)} at most in a photograph`;
    return h("p", {}, h("strong", {}, expected), ` at ${at}, by `, by, stage !== "STAGE_PHOTOGRAPHED" && ", whose own error no test photograph has shown",
      kernelVersion && ", which was active when the job was submitted. The table is by the kernel of the hologram.");
  });
}

function qualityTable(qualities) {
  const titles = ["Plane", "Phases", "Detector", ">PSNR", ">SSIM", ">MS-SSIM", ">Diffraction efficiency", ">Speckle contrast"];
  const row = ([plane, phases, detector, quality]) => h("tr", {}, h("th", { scope: "row" }, plane), h("td", {}, phases), h("td", {}, detector),
    [decibels(quality.psnrDb.value), number(quality.ssim), number(quality.msSsim), percent(quality.diffractionEfficiency), number(quality.speckleContrast)]
      .map((text) => h("td", { class: "right" }, text)));
  return table("Quality of the reconstruction, as each detector sees it", titles, qualities.map(row));
}
