// One kernel: its versions and their quality, promotion with the gate's verdict, and rollback.

import { guarded } from "../access.js";
import { get, post } from "../api.js";
import { chart } from "../chart.js";
import { h, show } from "../dom.js";
import { onEvent } from "../events.js";
import { age, bytes, decibels, length, number, percent, placeText, words } from "../format.js";
import { emptyNote, errorNote, refresher } from "../loading.js";
import { originTable } from "../origin.js";
import { table } from "../table.js";
import { versionReport } from "../version_report.js";

export function kernelPage(root, [display, kernelId]) {
  const name = `displays/${display}/kernels/${kernelId}`;
  const head = h("div", {});
  const notice = h("div", { role: "status" });
  const quality = h("div", {});
  const versions = h("div", {});
  const compared = h("div", {});
  const moves = h("div", {});
  const report = versionReport(display);
  const origin = h("div", {});
  show(root, head, notice, quality, versions, compared, origin, moves, report.element);
  let reported = null;
  let plot = null;
  const refresh = refresher(head, async () => {
    const [kernel, page, moved] = await Promise.all([get(name), get(`${name}/versions`, { pageSize: 100 }), get(`${name}/moves`, { pageSize: 20 })]);
    show(head, h("h1", {}, kernelId), h("p", {}, "of ", h("a", { href: `#/displays/${display}` }, display),
      `, ${length(kernel.wavelengthM)} at ${placeText(kernel.place)}. `,
      kernel.activeVersion ? `Version ${kernel.activeVersion} is active.` : "No version is active.", kernel.interpolated ? " It was interpolated." : ""));
    drawQuality(page.versions);
    show(versions, h("section", {}, h("h2", {}, "Versions"), page.versions.length ? versionTable(kernel, page.versions, moved.moves) : emptyNote("There are no versions.")),
      page.versions.length > 1 && comparison(page.versions));
    if (!reported) {
      reported = page.versions.find((version) => version.active) ?? page.versions[0] ?? null;
      report.show(reported);
    }
    show(origin, page.versions.length > 0 && h("section", {}, h("h2", {}, "Origin"), originTable("Version", page.versions.map((version) => [version.version, version]))));
    show(moves, moved.moves.length > 0 && h("section", {}, h("h2", {}, "History"), h("ol", { class: "log" }, moved.moves.map((move) =>
      h("li", {}, h("time", { datetime: move.time }, new Date(move.time).toLocaleString()),
        ` ${move.alias || "active"}: ${move.fromVersion || "none"} → ${move.toVersion || "none"}${move.caller ? ` by ${move.caller}` : ""}${move.rollback ? ", a rollback" : ""}${move.reason ? `: ${move.reason}` : ""}`)))),
    );
  });

  function drawQuality(list) {
    const measured = list.filter((version) => version.metrics?.testLoss > 0).reverse();
    plot?.end();
    plot = null;
    if (measured.length < 2) return show(quality);
    plot = chart({
      title: "Loss of held-out photographs", xLabel: "version", yLabel: "loss", isLog: true,
      xs: measured.map(({ version }) => version),
      series: [{ label: "learned kernel", values: measured.map(({ metrics }) => metrics.testLoss) },
        { label: "ideal kernel", values: measured.map(({ metrics }) => metrics.idealTestLoss), dash: [6, 4] }],
    });
    show(quality, h("section", {}, plot.element));
  }

  function versionTable(kernel, list, moved) {
    const canRollBack = moved.some((move) => move.alias === "active" && move.fromVersion);
    const row = (version) => {
      const { metrics } = version;
      const aliases = Object.entries(kernel.aliases ?? {}).filter(([, number]) => number === version.version).map(([alias]) => alias);
      const gain = metrics?.testLoss > 0 ? `${(10 * Math.log10(metrics.idealTestLoss / metrics.testLoss)).toFixed(1)} dB` : "–";
      return h("tr", { class: version.active ? "active" : "" },
        h("th", { scope: "row" }, version.version, version.active && h("span", { class: "state succeeded" }, "active"), aliases.map((alias) => h("span", { class: "state" }, alias)),
          version.deprecation && h("span", { class: "state failed", title: version.deprecation.reason }, "deprecated")),
        h("td", {}, words(version.model, "KERNEL_MODEL")),
        h("td", { class: "right" }, metrics?.testLoss > 0 ? number(metrics.testLoss) : h("span", { class: "state unmeasured" }, "not measured")),
        h("td", { class: "right" }, gain),
        h("td", { class: "right" }, metrics?.captured ? [h("strong", {}, decibels(metrics.captured.psnrDb)), h("small", {}, `ideal ${decibels(metrics.captured.idealPsnrDb)}`)] : "–"),
        h("td", { class: "right" }, metrics ? `${metrics.trainPairs} + ${metrics.validationPairs} + ${metrics.testPairs}` : "–"),
        h("td", { class: "right" }, bytes(Number(version.sizeBytes))),
        h("td", {}, version.lineage?.learned ? h("a", { href: `#/${version.lineage.learned.job}` }, "job") : version.lineage?.interpolated ? "interpolated" : "imported"),
        h("td", {}, age(version.createTime)),
        h("td", { class: "right" }, button("Report", `of version ${version.version}`, () => report.demand(version)), " ", version.active
          ? canRollBack && guarded(button("Roll back", `roll back ${version.version}`, () => rollBack(kernel)), "curate")
          : guarded(button("Promote…", `promote ${version.version}`, () => promote(kernel, version)), "curate")));
    };
    const titles = ["Version", "Model", ">Loss", ">Better than ideal", ">Photographs, PSNR", ">Pairs", ">File", "From", "Made", ">Actions"];
    return table("Versions, the newest first. Losses are mean squared errors of the test photographs; PSNR is that of photographs of new holograms, computed with the version and with the ideal kernel. Pairs are for training, validation and test.", titles, list.map(row));
  }

  function comparison(list) {
    const pick = (label, at) => h("select", { "aria-label": label, "data-key": label }, list.map(({ version }, i) => h("option", { value: version, selected: i === at }, `version ${version}`)));
    const [first, second] = [pick("First version", 1), pick("Second version", 0)];
    return h("p", { class: "controls" }, "Compare ", first, " with ", second, button("Compare", "the two versions", () => compare(first.value, second.value)));
  }

  async function compare(first, second) {
    try {
      const { transferDifference, transferPhaseRad, sourceDifference, parts, picturePng } = await get("kernels:compare", { first: `${name}/versions/${first}`, second: `${name}/versions/${second}` });
      const rows = [["transfer function, relative difference", percent(transferDifference)], ["transfer function, phase", `${number(transferPhaseRad)} rad`], ["source, relative difference", percent(sourceDifference)]];
      const differing = parts.filter((part) => part.first?.text !== part.second?.text);
      show(compared, h("section", {}, h("h2", {}, `Versions ${first} and ${second}`),
        h("dl", { class: "facts" }, rows.map(([term, value]) => [h("dt", {}, term), h("dd", {}, value)])),
        differing.length > 0 && table("Parts that differ", ["Part of the display", `Version ${first}`, `Version ${second}`], differing.map((part) =>
          h("tr", {}, h("th", { scope: "row" }, part.title), h("td", {}, part.first?.text ?? "without it"), h("td", {}, part.second?.text ?? "without it")))),
        picturePng && h("p", {}, h("img", { class: "wide-picture", src: `data:image/png;base64,${picturePng}`, alt: `Amplitude and phase of versions ${first} and ${second}` }))));
    } catch (error) {
      show(compared, errorNote(error));
    }
  }

  async function promote(kernel, { version }) {
    try {
      const verdict = await get(`${name}/versions/${version}:checkPromotion`);
      const reason = await ask(`Promote version ${version}?`, [
        h("p", {}, !verdict.passed ? "The promotion gate refuses this version."
          : verdict.checks.some(({ notMeasured }) => notMeasured) ? "The promotion gate accepts this version, though it was not measured." : "The promotion gate accepts this version."),
        h("ul", { class: "checks" }, verdict.checks.map((check) => {
          const [kind, word] = !check.passed ? ["failed", "Failed"] : check.notMeasured ? ["unmeasured", "Not measured"] : ["passed", "Passed"];
          return h("li", { class: kind }, `${word}: `, check.finding);
        })),
      ], "Promote", verdict.passed);
      if (reason === null) return;
      await post(`${name}:promote`, { version, reason, expectedActiveVersion: kernel.activeVersion ?? 0 });
      show(notice, h("p", {}, `Version ${version} is active.`));
    } catch (error) {
      show(notice, errorNote(error));
    }
    void refresh();
  }

  async function rollBack(kernel) {
    const reason = await ask("Roll back?", [h("p", {}, `The version that was active before version ${kernel.activeVersion} becomes active again.`)], "Roll back", true);
    if (reason === null) return;
    try {
      const moved = await post(`${name}:rollback`, { reason, expectedActiveVersion: kernel.activeVersion ?? 0 });
      show(notice, h("p", {}, `Version ${moved.activeVersion} is active again.`));
    } catch (error) {
      show(notice, errorNote(error));
    }
    void refresh();
  }

  const ends = onEvent((kind, data) => {
    if (kind === "job") report.onJob(data);
    if (kind === "reset" || (kind === "kernel" && data.name === name)) refresh.soon();
  });
  return () => {
    ends();
    report.end();
    plot?.end();
  };
}

function button(text, key, onclick) {
  return h("button", { type: "button", "data-key": key, "aria-label": `${text.replace("…", "")} ${key.split(" ").pop()}`, onclick }, text);
}

/** Asks for a reason; `null`: the user does not want it. */
function ask(title, content, verb, isPossible) {
  return new Promise((answer) => {
    const reason = h("input", { id: "reason", required: true, maxlength: 500, autocomplete: "off" });
    const dialog = h("dialog", { "aria-labelledby": "ask" },
      h("form", { method: "dialog", onsubmit: () => (dialog.returnValue = "yes") },
        h("h2", { id: "ask" }, title), content,
        isPossible && [h("label", { for: "reason" }, "Reason, for the history"), reason],
        h("p", { class: "actions" }, isPossible && h("button", { type: "submit", class: "main", value: "yes" }, verb),
          h("button", { type: "button", onclick: () => dialog.close("") }, "Cancel"))));
    dialog.addEventListener("close", () => {
      dialog.remove();
      answer(dialog.returnValue === "yes" ? reason.value : null);
    });
    document.body.append(dialog);
    dialog.showModal();
  });
}
