// A batch: how far it is, and of a sweep the parameters that differ, as a table, a plot and pictures.

import { get } from "../api.js";
import { chart } from "../chart.js";
import { h, show } from "../dom.js";
import { patternsButton } from "../downloads.js";
import { onEvent } from "../events.js";
import { decibels, idOf, number, words } from "../format.js";
import { gallery } from "../gallery.js";
import { isNotJudged, keepJobs, NOT_JUDGED, photographOf, scoreOf, worstExpected } from "../glance.js";
import { progressOf, stateOf, updateProgress } from "../job_rows.js";
import { emptyNote, refresher } from "../loading.js";
import { noteNewPhotographs, photographsOf } from "../photographs.js";
import { differing, fieldsOf, wordsOf } from "../request_fields.js";
import { table } from "../table.js";

/** Jobs of a batch that are compared. */
const JOBS_MAX = 200;
/** Lines of a plot: more cannot be told apart. */
const LINES_MAX = 4;
/** Values so many times apart are shown on a logarithmic axis. */
const LOG_FROM = 50;

export function batchPage(root, [batch], query) {
  const head = h("div", {});
  const sweep = h("div", {});
  const files = h("div", {});
  let offered = 0;
  const shots = gallery();
  show(root, h("h1", { class: "name" }, batch), head, files, sweep, h("section", {}, h("h2", {}, "Pictures"), shots.element));
  let plot = null;
  let chosen = query.get("over") ?? "";
  let read = { jobs: [], scores: new Map() };

  const refresh = refresher(head, async () => {
    const [numbers, page] = await Promise.all([get(`batches/${encodeURIComponent(batch)}`), get("jobs", { batch, pageSize: JOBS_MAX, order: "oldest_first" })]);
    const { jobs } = page;
    keepJobs(jobs);
    const counted = ["succeeded", "running", "queued", "failed", "cancelled"].filter((state) => Number(numbers[state]) > 0).map((state) => `${numbers[state]} ${state}`);
    show(head, h("p", {}, `${counted.join(", ")}. `, h("a", { href: `#/jobs?batch=${encodeURIComponent(batch)}` }, "In the list of jobs")),
      numbers.done < 1 && h("progress", { max: 1, value: numbers.done, "aria-label": `Progress of ${batch}` }),
      page.nextPageToken && h("p", { class: "note" }, `The first ${JOBS_MAX} jobs are compared.`));
    const made = jobs.filter((job) => job.result?.optimizeHologram);
    if (made.length > 1 && made.length !== offered) show(files, patternsButton(made));
    offered = made.length;
    shots.show(jobs.map(summaryOf));
    read = { jobs, scores: read.scores };
    draw();
    await readScores(jobs);
  });

  /** Reads what photographs of the holograms really show. */
  async function readScores(jobs) {
    const missing = jobs.filter((job) => job.result?.optimizeHologram && !read.scores.has(job.name));
    const displays = [...new Set(missing.map((job) => job.spec.optimizeHologram.display))];
    const photographs = (await Promise.all(displays.map(photographsOf))).flat();
    await Promise.all(missing.map(async (job) => {
      const photograph = photographOf(job, photographs);
      const score = photograph ? await scoreOf(job, photograph) : null;
      if (score !== null) read.scores.set(job.name, score);
    }));
    if (read.scores.size > 0 && root.isConnected) draw();
  }

  function draw() {
    const holograms = read.jobs.filter((job) => job.spec.optimizeHologram);
    const requests = holograms.map((job) => ({ ...fieldsOf(job.spec), job }));
    const paths = differing(requests.map(({ job, ...fields }) => fields));
    if (holograms.length < 2 || paths.length === 0) {
      plot?.end();
      plot = null;
      return show(sweep, emptyNote(holograms.length < 2 ? "There are no holograms to compare in this batch yet." : "All holograms of this batch have the same request."));
    }
    if (!paths.includes(chosen)) chosen = bestPath(requests, paths);
    show(sweep, h("section", {}, h("h2", {}, "Sweep"), plotOver(requests, paths)), tableOf(requests, paths));
  }

  function plotOver(requests, paths) {
    const choice = h("select", { "data-key": "over", onchange: (event) => {
      chosen = event.target.value;
      history.replaceState(null, "", `#/batch/${encodeURIComponent(batch)}?over=${encodeURIComponent(chosen)}`);
      draw();
    } }, paths.map((path) => h("option", { value: path, selected: path === chosen }, wordsOf(path, paths))));
    const points = requests.map((request) => ({ x: textOf(request, chosen), group: groupOf(request, paths, chosen, requests), y: worstExpected(request.job)?.value, score: read.scores.get(request.job.name) }))
      .filter(({ y }) => y !== undefined);
    plot?.end();
    plot = points.length > 0 ? sweepChart(points, wordsOf(chosen, paths)) : null;
    return [h("p", { class: "controls" }, h("label", {}, "PSNR in a photograph over ", choice)), plot?.element ?? h("p", {}, "No job of the batch has a result yet.")];
  }

  function tableOf(requests, paths) {
    const isRight = (path) => (requests.every((request) => textOf(request, path) === undefined || isNumber(textOf(request, path))) ? ">" : "");
    const sorted = [...requests].sort((a, b) => compareTexts(textOf(a, chosen), textOf(b, chosen)));
    const row = (request) => {
      const expected = worstExpected(request.job);
      return h("tr", {}, h("th", { scope: "row" }, h("a", { href: `#/${request.job.name}`, "data-key": request.job.name }, request.job.label || idOf(request.job.name).slice(-6))),
        paths.map((path) => h("td", { class: isRight(path) && "right" }, shortened(textOf(request, path)))),
        h("td", { class: "right" }, expected ? h("strong", {}, expected.text) : isNotJudged(request.job) ? NOT_JUDGED : stateOf(request.job), expected && !expected.isExpected && h("small", {}, expected.note), progressOf(request.job)),
        h("td", { class: "right" }, decibels(read.scores.get(request.job.name) ?? NaN)));
    };
    return table("What differs, and the PSNR that a photograph is expected to have and has", ["Job", ...paths.map((path) => isRight(path) + wordsOf(path, paths)), ">Expected", ">Photographed"], sorted.map(row));
  }

  const ends = onEvent((kind, data) => {
    if (noteNewPhotographs(kind, data)) shots.photographed();
    if (kind === "reset" || (kind === "job" && (data.batch === batch || data.kind === "KIND_SIMULATE_CAPTURE") && !updateProgress(root, data))) refresh.soon();
  });
  return () => {
    ends();
    shots.end();
    plot?.end();
  };
}

/** The fields that a list shows of a whole job. */
function summaryOf(job) {
  const [kind, spec] = Object.entries(job.spec)[0];
  return { ...job, kind: `KIND_${kind.replace(/[A-Z]/g, (letter) => `_${letter}`).toUpperCase()}`, display: spec.display ?? "" };
}

const isNumber = (text) => text !== undefined && text !== "" && Number.isFinite(Number(text));
/** A field as a person reads it: of a target its name, if the job has one. */
const textOf = (request, path) => (path.endsWith(".target") && request.job.label) || request[path];
const compareTexts = (a, b) => (isNumber(a) && isNumber(b) ? a - b : String(a ?? "").localeCompare(String(b ?? ""), undefined, { numeric: true }));
const distinct = (requests, path) => new Set(requests.map((request) => request[path])).size;

function shortened(text) {
  if (text === undefined) return "–";
  if (isNumber(text)) return number(Number(text), 6);
  if (/^[A-Z_]+$/.test(text)) return words(text, "[A-Z_]*?(METHOD|FIT|ENCODING|DETECTOR|QUANTITY|AREA)");
  return text.startsWith("sha256-") ? text.slice(7, 15) : text.split("/").slice(-2).join(" ");
}

/** The parameter to plot over: of those with numbers the one with the most values, else any. */
function bestPath(requests, paths) {
  const rank = (path) => (requests.every((request) => isNumber(request[path])) ? 1000 : 0) + distinct(requests, path);
  return [...paths].sort((a, b) => rank(b) - rank(a))[0];
}

/** The line of a job: by the parameter, besides the plotted one, that has few enough values; else all jobs are one line. */
function groupOf(request, paths, over, requests) {
  const path = paths.filter((path) => path !== over && distinct(requests, path) <= LINES_MAX).sort((a, b) => distinct(requests, b) - distinct(requests, a))[0];
  return path ? `${wordsOf(path, paths)} ${shortened(request[path])}` : "expected";
}

/** The mean of each line at each value, and that of the photographs. */
function sweepChart(points, label) {
  const values = [...new Set(points.map(({ x }) => x))].sort(compareTexts);
  const isReal = values.every(isNumber);
  const xs = isReal ? values.map(Number) : values.map((_, i) => i);
  const mean = (list) => (list.length ? list.reduce((sum, value) => sum + value, 0) / list.length : null);
  const line = (name, of, dash) => ({ label: name, dash, values: values.map((x) => mean(points.filter((point) => point.x === x).map(of).filter((value) => value !== undefined))) });
  const groups = [...new Set(points.map(({ group }) => group))];
  const series = groups.map((group) => line(group, (point) => (point.group === group ? point.y : undefined)));
  if (groups.length < LINES_MAX && points.some(({ score }) => score !== undefined)) series.push(line("photographed", ({ score }) => score, [6, 4]));
  const isLogX = isReal && xs[0] > 0 && xs.at(-1) / xs[0] >= LOG_FROM;
  return chart({ title: "PSNR that a photograph is expected to have; the mean where several jobs have the same value", xLabel: label, yLabel: "PSNR [dB]", xs, series, isReal, isLogX, names: isReal ? null : values.map(shortened) });
}
