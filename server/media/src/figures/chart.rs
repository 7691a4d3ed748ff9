//! Line charts over a linear axis, as SVG: small files that are sharp at any size.

use super::ticks;
use std::fmt::Write;

/// A line chart.
#[derive(Clone, Debug)]
pub struct Chart<'a> {
    /// Title above the chart.
    pub title: &'a str,
    /// Label below the x axis.
    pub x_label: &'a str,
    /// Label beside the y axis.
    pub y_label: &'a str,
    /// Whether the y axis is logarithmic, with powers of ten.
    pub logarithmic: bool,
    /// Lines of the chart; each has a colour of its own.
    pub lines: Vec<Line>,
    /// Uncertainty of the first line: x, and the range of y. Empty: unknown.
    pub band: Vec<(f64, [f64; 2])>,
}

/// A line of a chart.
#[derive(Clone, Debug)]
pub struct Line {
    /// Name of the line in the legend.
    pub label: String,
    /// Points (x, y) of the line, ascending in x.
    pub points: Vec<(f64, f64)>,
    /// Whether the line is dashed. Dashed lines are references for comparison.
    pub dashed: bool,
}

const COLOURS: [&str; 6] = ["#1f5fa8", "#d46a0c", "#2b8a5e", "#a82e5b", "#6b55b0", "#555555"];
const WIDTH: f64 = 680.0;
const HEIGHT: f64 = 340.0;
const LEFT: f64 = 76.0;
const TOP: f64 = 36.0;
const PLOT_WIDTH: f64 = 400.0;
const PLOT_HEIGHT: f64 = 248.0;
const BOTTOM: f64 = TOP + PLOT_HEIGHT;

/// Ranges of the axes, which place values in the picture.
struct Axes {
    x: (f64, f64),
    y: (f64, f64),
    logarithmic: bool,
}

impl Axes {
    fn x(&self, x: f64) -> f64 {
        LEFT + PLOT_WIDTH * (x - self.x.0) / (self.x.1 - self.x.0)
    }

    fn y(&self, y: f64) -> f64 {
        let (low, high) = self.y;
        let part = if self.logarithmic { (y / low).ln() / (high / low).ln() } else { (y - low) / (high - low) };
        TOP + PLOT_HEIGHT * (1.0 - part)
    }

    /// The points in the form of the `points` attribute of an SVG line or polygon.
    fn path(&self, points: impl Iterator<Item = (f64, f64)>) -> String {
        points.map(|(x, y)| format!("{:.1},{:.1}", self.x(x), self.y(y))).collect::<Vec<_>>().join(" ")
    }

    fn draw_y_ticks(&self, svg: &mut String) {
        let (low, high) = self.y;
        let y_ticks = if self.logarithmic { ticks::logarithmic(low, high) } else { ticks::linear(low, high, 6) };
        for (value, label) in y_ticks {
            let y = self.y(value);
            let (right, text) = (LEFT + PLOT_WIDTH, LEFT - 8.0);
            write(
                svg,
                format_args!("<line x1=\"{LEFT}\" x2=\"{right}\" y1=\"{y:.1}\" y2=\"{y:.1}\" stroke=\"#e4e4e4\"/>"),
            );
            write(svg, format_args!("<text x=\"{text}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>", y + 4.0));
        }
    }

    fn draw_x_ticks(&self, svg: &mut String) {
        for (value, label) in ticks::linear(self.x.0, self.x.1, 8) {
            let x = self.x(value);
            let end = BOTTOM + 4.0;
            write(
                svg,
                format_args!("<line x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{BOTTOM}\" y2=\"{end}\" stroke=\"#6b6b6b\"/>"),
            );
            write(
                svg,
                format_args!("<text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{label}</text>", BOTTOM + 19.0),
            );
        }
    }
}

impl Chart<'_> {
    /// Draws the chart as SVG.
    #[must_use]
    pub fn svg(&self) -> String {
        let axes = self.axes();
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" \
             font-family=\"DejaVu Sans, Verdana, sans-serif\" font-size=\"12\" fill=\"#1a1a1a\">\
             <rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"#fff\"/>"
        );
        axes.draw_y_ticks(&mut svg);
        axes.draw_x_ticks(&mut svg);
        write(
            &mut svg,
            format_args!(
                "<rect x=\"{LEFT}\" y=\"{TOP}\" width=\"{PLOT_WIDTH}\" height=\"{PLOT_HEIGHT}\" fill=\"none\" stroke=\"#c8c8c8\"/>"
            ),
        );
        self.draw_band(&mut svg, &axes);
        for (i, line) in self.lines.iter().enumerate() {
            self.draw_line(&mut svg, &axes, i, line);
        }
        self.draw_titles(&mut svg);
        svg.push_str("</svg>");
        svg
    }

    fn usable(&self, (x, y): (f64, f64)) -> bool {
        x.is_finite() && y.is_finite() && (!self.logarithmic || y > 0.0)
    }

    /// The points of one edge of the band. `side` 0 is the lower edge, 1 the upper one.
    fn edge(&self, side: usize) -> impl DoubleEndedIterator<Item = (f64, f64)> {
        self.band.iter().map(move |&(x, edges)| (x, edges[side])).filter(|&point| self.usable(point))
    }

    fn axes(&self) -> Axes {
        let lines = self.lines.iter().flat_map(|line| line.points.iter().copied());
        let points: Vec<(f64, f64)> =
            lines.filter(|&point| self.usable(point)).chain(self.edge(0)).chain(self.edge(1)).collect();
        let range = |of: fn(&(f64, f64)) -> f64| {
            let empty = (f64::INFINITY, f64::NEG_INFINITY);
            points.iter().map(of).fold(empty, |(low, high), v| (low.min(v), high.max(v)))
        };
        let (low, high) = range(|point| point.1);
        let y = match self.logarithmic {
            true if low <= high => (low / 1.3, high * 1.3),
            true => (0.1, 1.0),
            false => widened((low, high), 0.05),
        };
        Axes { x: widened(range(|point| point.0), 0.0), y, logarithmic: self.logarithmic }
    }

    fn draw_band(&self, svg: &mut String, axes: &Axes) {
        let points = axes.path(self.edge(0).chain(self.edge(1).rev()));
        if !points.is_empty() {
            let colour = COLOURS[0];
            write(svg, format_args!("<polygon points=\"{points}\" fill=\"{colour}\" fill-opacity=\"0.2\"/>"));
        }
    }

    /// Draws line number `i` and its entry in the legend.
    fn draw_line(&self, svg: &mut String, axes: &Axes, i: usize, line: &Line) {
        let colour = COLOURS[i % COLOURS.len()];
        let dash = if line.dashed { " stroke-dasharray=\"6 5\"" } else { "" };
        let path = axes.path(line.points.iter().copied().filter(|&point| self.usable(point)));
        write(
            svg,
            format_args!("<polyline points=\"{path}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"{dash}/>"),
        );
        let (y, x) = (TOP + 12.0 + 20.0 * i as f64, LEFT + PLOT_WIDTH + 14.0);
        write(
            svg,
            format_args!(
                "<line x1=\"{x}\" x2=\"{}\" y1=\"{y}\" y2=\"{y}\" stroke=\"{colour}\" stroke-width=\"2\"{dash}/>",
                x + 22.0
            ),
        );
        write(svg, format_args!("<text x=\"{}\" y=\"{}\">{}</text>", x + 28.0, y + 4.0, escaped(&line.label)));
    }

    fn draw_titles(&self, svg: &mut String) {
        let middle = LEFT + PLOT_WIDTH / 2.0;
        let (title, x_label, y_label) = (escaped(self.title), escaped(self.x_label), escaped(self.y_label));
        write(
            svg,
            format_args!("<text x=\"{middle}\" y=\"22\" text-anchor=\"middle\" font-size=\"15\">{title}</text>"),
        );
        let y = BOTTOM + 42.0;
        write(svg, format_args!("<text x=\"{middle}\" y=\"{y}\" text-anchor=\"middle\">{x_label}</text>"));
        let y = TOP + PLOT_HEIGHT / 2.0;
        write(
            svg,
            format_args!(
                "<text x=\"18\" y=\"{y}\" text-anchor=\"middle\" transform=\"rotate(-90 18 {y})\">{y_label}</text>"
            ),
        );
    }
}

/// Text with the special characters of markup escaped.
#[must_use]
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Appends `part` to `svg`. Writing to a string cannot fail.
fn write(svg: &mut String, part: std::fmt::Arguments<'_>) {
    let _ = svg.write_fmt(part);
}

/// The range with a margin at both ends. An empty range gets a length.
fn widened((low, high): (f64, f64), margin: f64) -> (f64, f64) {
    if low > high || !low.is_finite() || !high.is_finite() {
        return (0.0, 1.0);
    }
    let length = if high - low > 1e-12 * high.abs().max(1e-12) { high - low } else { low.abs().max(1.0) };
    (low - margin * length, low.max(high).max(low + length) + margin * length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_without_values_are_drawn_and_text_is_escaped() {
        for points in [vec![], vec![(0.0, f64::NAN)], vec![(1.0, 2.0)], vec![(0.0, -1.0), (1.0, 3.0)]] {
            for logarithmic in [false, true] {
                let lines = vec![Line { label: "a < b".to_owned(), points: points.clone(), dashed: true }];
                let band = vec![(0.0, [0.1, f64::NAN]), (1.0, [1.0, 2.0])];
                let svg = Chart { title: "t & u", x_label: "x", y_label: "y", logarithmic, lines, band }.svg();
                assert!(svg.ends_with("</svg>") && svg.contains("a &lt; b") && svg.contains("t &amp; u"));
                assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
            }
        }
    }
}
