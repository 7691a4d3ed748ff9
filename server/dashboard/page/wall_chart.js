// Points over time, drawn so large that they can be read from afar.

const SVG = "http://www.w3.org/2000/svg";

/**
 * A chart of `points`, `{time, value, series}`: time [ms], value [dB], and the number of the series from 1. It grows with its
 * element, and its texts with the size of the font. Returns `{element, update(points), end}`.
 */
export function pointsOverTime(label) {
  const element = document.createElement("div");
  element.className = "points";
  element.setAttribute("role", "img");
  let points = [];
  const make = (tag, attributes, text = "") => {
    const node = document.createElementNS(SVG, tag);
    for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
    node.textContent = text;
    return node;
  };

  function draw() {
    const [width, height] = [element.clientWidth, element.clientHeight];
    if (width < 1 || height < 1 || points.length === 0) return element.replaceChildren();
    const em = parseFloat(getComputedStyle(element).fontSize);
    const area = { left: 3.4 * em, right: width - 1.2 * em, top: 0.7 * em, bottom: height - 1.9 * em };
    const values = points.map(({ value }) => value);
    const ticks = ticksOf(Math.min(...values), Math.max(...values));
    const times = points.map(({ time }) => time);
    const [from, to] = [Math.min(...times), Math.max(...times)];
    const x = (time) => (to > from ? area.left + em + ((time - from) / (to - from)) * (area.right - area.left - 2 * em) : (area.left + area.right) / 2);
    const y = (value) => area.bottom - ((value - ticks[0]) / (ticks.at(-1) - ticks[0])) * (area.bottom - area.top);
    const svg = make("svg", { width, height });
    for (const tick of ticks) {
      svg.append(make("line", { class: "grid", x1: area.left, x2: area.right, y1: y(tick), y2: y(tick) }),
        make("text", { x: area.left - 0.5 * em, y: y(tick) + 0.35 * em, "text-anchor": "end" }, String(tick)));
    }
    const ends = [...new Set([from, to].map((time) => timeText(time, to - from)))];
    ends.forEach((text, i) => svg.append(make("text", { x: ends.length === 1 ? (area.left + area.right) / 2 : i ? area.right : area.left, y: height - 0.4 * em, "text-anchor": ends.length === 1 ? "middle" : i ? "end" : "start" }, text)));
    for (const { time, value, series } of points) svg.append(make("circle", { class: `series-${series}`, cx: x(time), cy: y(value), r: 0.28 * em }));
    element.replaceChildren(svg);
  }

  const observer = new ResizeObserver(draw);
  observer.observe(element);
  return {
    element,
    update(shown) {
      points = shown;
      const values = points.map(({ value }) => value);
      element.setAttribute("aria-label", points.length ? `${label}: ${points.length} photographs, ${Math.min(...values).toFixed(1)} to ${Math.max(...values).toFixed(1)} dB` : label);
      draw();
    },
    end: () => observer.disconnect(),
  };
}

/** Two to five round values that enclose a range. */
function ticksOf(least, most) {
  const step = [1, 2, 5, 10, 20, 50].find((step) => Math.ceil(most / step) - Math.floor(least / step) <= 4) ?? 100;
  const [first, last] = [Math.floor(least / step), Math.max(Math.ceil(most / step), Math.floor(least / step) + 1)];
  return Array.from({ length: last - first + 1 }, (_, i) => (first + i) * step);
}

/** A time as far as it tells the points apart: of one day the clock, else the date. */
function timeText(time, span) {
  const date = new Date(time);
  if (span > 86_400_000) return date.toLocaleDateString([], { day: "numeric", month: "short" });
  return date.toLocaleTimeString([], { hour: "2-digit", minute: "2-digit" });
}
