// The choice of a kernel: that of the server, the ideal one, an alias, or a version where a hologram has one kernel.

import { get } from "../api.js";
import { h, show } from "../dom.js";
import { labelled } from "./controls.js";

const ALWAYS = [["", "active, or ideal if there is none"], ["active", "active"], ["ideal", "ideal"]];

export function kernelControl() {
  const select = h("select", { id: "kernel" });
  let kernels = [];
  let shown = "";

  /** Lists what can be chosen for these optics, and keeps the choice if it still can be. */
  async function offer(wavelengthsM, distancesM) {
    const own = wavelengthsM.length === 1 && distancesM.length === 1
      ? kernels.find((kernel) => kernel.wavelengthM === wavelengthsM[0] && kernel.place.distanceM === distancesM[0]) : undefined;
    const key = `${own?.name} ${kernels.length}`;
    if (key === shown) return;
    shown = key;
    const versions = own ? (await get(`${own.name}/versions`, { pageSize: 100 })).versions : [];
    // Other optics may have been chosen meanwhile.
    if (key !== shown) return;
    const aliases = [...new Set(kernels.flatMap((kernel) => Object.keys(kernel.aliases ?? {})))].sort();
    draw([...ALWAYS, ...aliases.map((alias) => [`alias ${alias}`, alias]),
      ...versions.map(({ name, version, active }) => [`version ${name}`, `version ${version}${active ? ", active" : ""}`])]);
  }

  function draw(choices) {
    const chosen = select.value;
    show(select, choices.map(([value, text]) => h("option", { value }, text)));
    select.value = choices.some(([value]) => value === chosen) ? chosen : "";
  }

  draw(ALWAYS);
  return {
    element: labelled("Kernel", select, { field: "kernel" }),
    offer,
    setKernels(list) {
      kernels = list;
      shown = "";
    },
    read() {
      const [kind, name] = select.value.split(" ");
      if (!kind) return undefined;
      return { [kind]: name ?? {} };
    },
    fill(choice) {
      const [kind, name] = Object.entries(choice ?? {})[0] ?? [""];
      const value = typeof name === "string" ? `${kind} ${name}` : kind;
      if (![...select.options].some((option) => option.value === value)) select.append(h("option", { value }, typeof name === "string" ? name.split("/").pop() : kind));
      select.value = value;
    },
  };
}
