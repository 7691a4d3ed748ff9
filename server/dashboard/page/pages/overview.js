// What the server does now.

import { get, metrics } from "../api.js";
import { chart } from "../chart.js";
import { h, show } from "../dom.js";
import { onEvent } from "../events.js";
import { age, bytes, idOf, words } from "../format.js";
import { gallery } from "../gallery.js";
import { isKept, keepJobs } from "../glance.js";
import { progressOf, stateOf, updateProgress } from "../job_rows.js";
import { livePicture } from "../live_picture.js";
import { emptyNote, refresher } from "../loading.js";
import { noteNewPhotographs } from "../photographs.js";
import { simulatedMark } from "../simulated.js";

const LATEST = 12;
/** Jobs of which this many are not in memory are read together. */
const TOGETHER = 4;
/** How often that is read again of which no event tells [ms]. */
const SLOW = 60_000;
/** Least time from one reading of lists and numbers after events to the next [ms]. Events tell about each job sooner. */
const SPACING = 10_000;
/** Displays and kernels for which the overview shows details; the pages of the displays show all. */
const DISPLAYS_MAX = 6;
const KERNELS_MAX = 4;
const COUNT_MAX = 200;

export function overviewPage(root) {
  const tiles = h("dl", { class: "tiles", "aria-label": "The queue" });
  const pauses = h("div", {});
  const running = h("div", { class: "cards" });
  const latest = h("div", {});
  const displays = h("div", { class: "cards" });
  const slow = { throughput: "–", disk: null };
  show(root, h("h1", {}, "Overview"), tiles, pauses,
    h("section", {}, h("h2", {}, "Running"), running),
    h("section", {}, h("h2", {}, "Latest jobs"), latest),
    h("section", {}, h("h2", {}, "Displays"), displays));
  const shots = gallery();
  let plots = [];
  /** Pictures of running holograms by the names of their jobs. */
  const pictures = new Map();
  /** The newest jobs and the running ones, as last read or as events told since. */
  let newest = [];
  let runningNow = [];
  /** Jobs as events told them while the lists were read: the lists may be older. */
  let told = [];

  const refresh = refresher(latest, async () => {
    told = [];
    const [queue, runningJobs, failed, jobs] = await Promise.all([
      get("queue").catch((error) => (error.status === 403 ? null : Promise.reject(error))),
      get("jobs", { view: "basic", state: "running", pageSize: 20 }),
      get("jobs", { view: "basic", state: "failed", pageSize: 50 }),
      get("jobs", { view: "basic", pageSize: LATEST }),
    ]);
    const more = (page) => (page.nextPageToken ? "+" : "");
    const lastDay = failed.summaries.filter((job) => Date.now() - Date.parse(job.endTime) < 86_400_000).length;
    const tile = (label, value, href, kind = "") => h("div", { class: `tile ${kind}` }, h("dt", {}, label), h("dd", {}, h("a", { href }, value)));
    show(tiles,
      tile("running", queue?.running ?? runningJobs.summaries.length, "#/jobs?state=running"),
      tile("queued", queue?.queued ?? "–", "#/jobs?state=queued"),
      tile("failed in the last day", `${lastDay}${lastDay === failed.summaries.length ? more(failed) : ""}`, "#/jobs?state=failed", lastDay ? "bad" : ""),
      tile("succeeded in the last hour", slow.throughput, "#/jobs?state=succeeded&since=3600"),
      slow.disk !== null && h("div", { class: "tile" }, h("dt", {}, "free on the disk"), h("dd", {}, bytes(slow.disk))));
    show(pauses, (queue?.pauses ?? []).map((pause) => h("p", { class: "note" },
      `${pause.display ? idOf(pause.display) : "The whole queue"} is paused since ${age(pause.since)}: ${pause.reason}`)));
    [newest, runningNow] = [jobs.summaries, runningJobs.summaries];
    if (newest.filter((job) => !isKept(job)).length > TOGETHER) keepJobs((await get("jobs", { pageSize: LATEST })).jobs);
    told.forEach(place);
    showJobs();
  }, SPACING);

  function showJobs() {
    keepPictures(runningNow);
    show(running, runningNow.length ? runningNow.map((job) => card(job, pictures.get(job.name))) : emptyNote("No job runs now."));
    shots.show(newest);
    show(latest, newest.length
      ? shots.element
      : emptyNote("There are no jobs yet. Send a picture to a display:", "lightpath hologram optimize picture.png --display lab --distance 150mm"));
  }

  /** Shows a job as an event tells it. So a change is on the page at once, and many dashboards need not read the lists. */
  function take(job) {
    told.push(job);
    place(job);
    showJobs();
  }

  /** Puts a job into the lists instead of what they have of it. */
  function place(job) {
    const isOther = ({ name }) => name !== job.name;
    // Names are in the order of the submits.
    newest = [...newest.filter(isOther), job].sort((a, b) => (a.name < b.name ? 1 : -1)).slice(0, LATEST);
    runningNow = [...runningNow.filter(isOther), ...(job.state === "STATE_RUNNING" ? [job] : [])];
  }

  const refreshSlow = refresher(displays, async () => {
    const since = new Date(Math.floor(Date.now() / SLOW) * SLOW - 3_600_000).toISOString();
    const [done, disk, page] = await Promise.all([
      get("jobs", { view: "basic", state: "succeeded", since, pageSize: COUNT_MAX }),
      metrics().then((values) => values.lightpath_disk_free_bytes ?? null, () => null),
      get("displays", { pageSize: DISPLAYS_MAX }),
    ]);
    Object.assign(slow, { throughput: `${done.summaries.length}${done.nextPageToken ? "+" : ""}`, disk });
    void refresh();
    const found = await Promise.all(page.displays.map(displayOf));
    plots.forEach((plot) => plot.end());
    plots = [];
    show(displays, found.length ? found.map(displayCard)
      : emptyNote("No display is declared yet. Declare one:", "lightpath display create lab --resolution 1920x1080 --pixel-pitch 8um --wavelength 515nm"),
    page.nextPageToken && h("p", {}, h("a", { href: "#/displays" }, "All displays")));
  });

  /** Begins pictures for new holograms, and ends those of jobs that no longer run. */
  function keepPictures(jobs) {
    const holograms = jobs.filter(({ kind }) => kind === "KIND_OPTIMIZE_HOLOGRAM").map(({ name }) => name);
    for (const name of holograms) if (!pictures.has(name)) pictures.set(name, livePicture(name));
    for (const [name, picture] of pictures) {
      if (holograms.includes(name)) continue;
      picture.end();
      pictures.delete(name);
    }
  }

  function displayCard({ display, name, kernels, devices }) {
    const measured = kernels.flatMap(({ kernel, versions }) => versions.filter(({ metrics }) => metrics?.testLoss > 0)
      .map(({ createTime, metrics }) => ({ kernel: idOf(kernel.name), time: Date.parse(createTime) / 1000, gain: 10 * Math.log10(metrics.idealTestLoss / metrics.testLoss) })))
      .sort((a, b) => a.time - b.time);
    const labels = [...new Set(measured.map(({ kernel }) => kernel))];
    const plot = measured.length > 1 ? chart({
      title: "Versions of learned kernels: how much better than the ideal one, each when it was learned", xLabel: "", yLabel: "dB", isTime: true,
      xs: measured.map(({ time }) => time),
      series: labels.map((label) => ({ label, values: measured.map(({ kernel, gain }) => (kernel === label ? gain : null)) })),
    }) : null;
    if (plot) plots.push(plot);
    const active = kernels.map(({ kernel }) => `${idOf(kernel.name)}: ${kernel.activeVersion ? `version ${kernel.activeVersion}` : "none active"}`);
    const installed = new Map();
    for (const version of devices.flatMap((device) => device.kernels.map((kernel) => kernel.version || "none"))) installed.set(version, (installed.get(version) ?? 0) + 1);
    const versions = [...installed].map(([version, count]) => `${count} × ${version === "none" ? "none" : `version ${version}`}`).join(", ");
    return h("article", { class: "card" }, h("h3", {}, h("a", { href: `#/${name}`, "data-key": name }, idOf(name)), simulatedMark(display)),
      h("p", {}, active.length ? active.join("; ") : "no learned kernel"),
      devices.length > 0 && h("p", {}, `${devices.length} devices: ${versions}`), plot?.element);
  }

  const timer = setInterval(() => document.hidden || void refreshSlow(), SLOW);
  const ends = onEvent((kind, data) => {
    if (noteNewPhotographs(kind, data)) shots.photographed();
    if (kind === "job") pictures.get(data.name)?.refresh();
    if (kind === "job" && updateProgress(root, data)) return;
    if (kind === "job") {
      take(data);
      refresh.soon();
    }
    if (kind === "queue" || kind === "reset") void refresh();
    if (["display", "kernel", "device", "reset"].includes(kind)) refreshSlow.soon();
  });
  return () => {
    ends();
    clearInterval(timer);
    keepPictures([]);
    shots.end();
    plots.forEach((plot) => plot.end());
  };
}

/** A display with its kernels, their newest versions, and its devices. */
async function displayOf(display) {
  const { name } = display;
  const [{ kernels }, { devices }] = await Promise.all([get(`${name}/kernels`, { pageSize: KERNELS_MAX }), get(`${name}/devices`, { pageSize: 100 })]);
  const withVersions = kernels.map(async (kernel) => ({ kernel, versions: (await get(`${kernel.name}/versions`, { pageSize: 20 })).versions }));
  return { display, name, devices, kernels: await Promise.all(withVersions) };
}

function card(job, picture) {
  return h("article", { class: "card" },
    h("h3", {}, h("a", { href: `#/${job.name}`, "data-key": `card ${job.name}` }, words(job.kind, "KIND")), " ", stateOf(job)),
    h("p", {}, `on ${idOf(job.display)}`, job.owner ? ` for ${job.owner}` : ""),
    progressOf(job) ?? h("p", {}, "starts"),
    picture?.element);
}
