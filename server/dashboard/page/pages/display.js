// One display: its properties, its kernels, its devices.

import { get } from "../api.js";
import { h, show } from "../dom.js";
import { onEvent } from "../events.js";
import { age, idOf, length, placeText, words } from "../format.js";
import { emptyNote, refresher } from "../loading.js";
import { simulatedMark } from "../simulated.js";
import { table } from "../table.js";

export function displayPage(root, [id]) {
  const name = `displays/${id}`;
  const head = h("div", {});
  const kernels = h("section", {});
  const devices = h("section", {});
  show(root, head, kernels, devices);
  const refresh = refresher(head, async () => {
    const [display, kernelPage, devicePage] = await Promise.all([get(name), get(`${name}/kernels`, { pageSize: 100 }), get(`${name}/devices`, { pageSize: 100 })]);
    const facts = [
      ["Size", `${display.modulator.widthPx} × ${display.modulator.heightPx} px`],
      ["Pixel pitch", length(display.modulator.pixelPitchXM)],
      ["Depth", `${display.modulator.bitDepth} bit`],
      ["Wavelengths", display.wavelengthsM.map(length).join(", ")],
      ["Carrier", display.carrier === "CARRIER_UNSPECIFIED" ? "none" : words(display.carrier, "CARRIER")],
      ["Phase response", responseText(display.modulator.phase?.responseRad ?? [])],
      ["Diffraction orders", ordersText(display)],
      ["Camera's fill factor", display.cameraFillFactor],
      ["Simulated", display.simulatedBench && `seed ${display.simulatedBench.seed ?? 0}`],
      ["Notes", display.notes],
      ["Declared", age(display.createTime)],
    ];
    show(head, h("h1", { class: "name" }, id, simulatedMark(display)),
      h("dl", { class: "facts" }, facts.filter(([, value]) => value).map(([term, value]) => [h("dt", {}, term), h("dd", {}, value)])),
      h("p", {}, h("a", { href: `#/jobs?display=${encodeURIComponent(id)}` }, "Jobs of this display")));
    show(kernels, h("h2", {}, "Kernels"), kernelPage.kernels.length ? kernelTable(kernelPage.kernels)
      : emptyNote("No kernel is learned yet. Learn one from photographs:", `lightpath kernel learn --dataset bench-1`));
    show(devices, h("h2", {}, "Devices"), devicePage.devices.length ? deviceTable(devicePage.devices)
      : emptyNote("No device has reported yet. The agent on a device fetches kernels and reports. From a checkout:", "cargo install --locked --path agent"));
  });
  const own = (data) => data.name === name || data.name?.startsWith(`${name}/`);
  return onEvent((kind, data) => (kind === "reset" || (["display", "kernel", "device"].includes(kind) && own(data))) && refresh.soon());
}

/** A measured response with the range of its phases, in which a wrong unit shows. */
function responseText(responseRad) {
  const inPi = (phaseRad) => `${(phaseRad / Math.PI).toFixed(2)}π`;
  return responseRad.length ? `measured, ${inPi(Math.min(...responseRad))} to ${inPi(Math.max(...responseRad))}` : "linear, 0 to 2π";
}

function ordersText({ allOrders, orderFilter }) {
  if (allOrders) return `all, fill factor ${allOrders.fillFactorX ?? 1} × ${allOrders.fillFactorY ?? 1}`;
  if (!orderFilter) return "first";
  const { width, height, centreX, centreY, shape } = orderFilter;
  return `first, through a filter of ${width ?? 1} × ${height ?? 1} orders around ${centreX ?? 0}, ${centreY ?? 0} (${shape === "SHAPE_ELLIPSE" ? "ellipse" : "rectangle"})`;
}

function kernelTable(kernels) {
  return table("Learned kernels", ["Kernel", "Wavelength", "Distance", "Active version", "Newest version"], kernels.map((kernel) =>
    h("tr", {}, h("th", { scope: "row" }, h("a", { href: `#/${kernel.name}`, "data-key": kernel.name }, idOf(kernel.name))),
      h("td", {}, length(kernel.wavelengthM)), h("td", {}, placeText(kernel.place)),
      h("td", {}, kernel.activeVersion || "none", kernel.interpolated ? " (interpolated)" : "", kernel.rollout ? ` (rollout ${idOf(kernel.rollout)} runs)` : ""),
      h("td", {}, kernel.latestVersion))));
}

function deviceTable(devices) {
  const installed = (kernel) => `${idOf(kernel.kernel)} ${kernel.version ? `version ${kernel.version}` : "none"}${kernel.message ? `: ${kernel.message}` : ""}`;
  return table("Devices and what they last reported", ["Device", "Group", "Agent", "Installed", "Last report"], devices.map((device) =>
    h("tr", {}, h("th", { scope: "row" }, idOf(device.name)), h("td", {}, device.group), h("td", {}, device.agent),
      h("td", { class: "wide" }, device.kernels.map((kernel) => h("div", {}, installed(kernel)))),
      h("td", {}, device.reportTime ? age(device.reportTime) : "never"))));
}
