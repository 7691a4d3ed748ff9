// Charts of numbers over steps or time, drawn by uPlot.

import uPlot from "./vendor/uplot/uPlot.esm.js";
import { number } from "./format.js";
import { h } from "./dom.js";

const HEIGHT_PX = 220;
/** Steps and versions are whole numbers, and so are the distances between their ticks. */
const WHOLE = [1, 2, 5].flatMap((first) => [0, 1, 2, 3, 4, 5].map((power) => first * 10 ** power)).sort((a, b) => a - b);

function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

/**
 * A chart of series over one axis.
 *
 * `series` has `{label, values, dash}`; the values belong to `xs`. `isTime`: the axis is time [s since 1970]. `isReal`: ticks may lie
 * between whole numbers. `isLogX`: the axis is logarithmic. `names`: texts for the whole numbers from 0 on.
 * Returns `{element, update(xs, lists), end}`.
 */
export function chart({ title, xLabel, yLabel, xs, series, isLog = false, isTime = false, isReal = false, isLogX = false, names = null }) {
  const area = h("div", { class: "plot", role: "img", "aria-label": title });
  const element = h("figure", { class: "chart" }, h("figcaption", {}, title), area);
  let data = [xs, ...series.map(({ values }) => values)];
  let plot = null;
  const axis = (label) => ({
    label,
    stroke: colour("--text-quiet"),
    grid: { stroke: colour("--line"), width: 1 },
    ticks: { stroke: colour("--line"), width: 1 },
    font: "12px system-ui",
    labelFont: "12px system-ui",
  });
  const draw = () => {
    plot?.destroy();
    const lines = series.map(({ label, dash }, i) => ({
      label,
      dash,
      spanGaps: true,
      stroke: colour(`--series-${i + 1}`),
      width: 2,
      points: { show: data[0].length < 40, size: 6 },
      value: (_, value) => (value === null ? "–" : number(value, 4)),
    }));
    const x = isTime ? {} : { label: xLabel, value: (_, value) => (value === null ? "–" : names?.[value] ?? number(value, 4)) };
    const marks = names ? { incrs: [1], values: (_, ticks) => ticks.map((tick) => names[tick] ?? "") } : isReal ? {} : { incrs: WHOLE };
    const ends = names ? { range: [-0.5, names.length - 0.5] } : isLogX ? { distr: 3 } : {};
    plot = new uPlot({
      width: Math.max(240, area.clientWidth || 600),
      height: HEIGHT_PX,
      scales: { x: { time: isTime, ...ends }, y: isLog ? { distr: 3 } : {} },
      axes: [isTime ? axis(xLabel) : { ...axis(xLabel), ...marks }, { ...axis(yLabel), size: 64, values: (_, ticks) => ticks.map((tick) => (tick === null ? "" : number(tick, 2))) }],
      series: [x, ...lines],
      legend: { live: true },
    }, data, area);
  };
  const observer = new ResizeObserver(() => {
    if (!plot) draw();
    else plot.setSize({ width: Math.max(240, area.clientWidth), height: HEIGHT_PX });
  });
  observer.observe(area);
  addEventListener("themechange", draw);
  return {
    element,
    update(newXs, lists) {
      data = [newXs, ...lists];
      plot?.setData(data);
    },
    end() {
      observer.disconnect();
      removeEventListener("themechange", draw);
      plot?.destroy();
    },
  };
}
