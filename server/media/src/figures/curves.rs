//! Curves over the number of steps, with a logarithmic y axis.

use super::canvas::{Anchor, BLACK, Canvas, Colour, GREY, PALE};
use super::ticks;

/// A picture of curves.
#[derive(Clone, Debug)]
pub struct Curves<'a> {
    /// Title above the picture.
    pub title: &'a str,
    /// Label below the x axis.
    pub x_label: &'a str,
    /// Label beside the y axis.
    pub y_label: &'a str,
    /// The curves; each has a colour of its own.
    pub curves: Vec<Curve>,
}

/// A curve, or a horizontal level if it has a single value.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Name of the curve in the legend.
    pub label: String,
    /// Values at x = 1, 2, …. Values of 0 and below are left out. A single value becomes a dashed line across the
    /// picture.
    pub values: Vec<f64>,
}

/// Colours of the curves, which most colour-blind people can tell apart.
const COLOURS: [Colour; 6] = [
    [0x1f, 0x5f, 0xa8],
    [0xd4, 0x6a, 0x0c],
    [0x2b, 0x8a, 0x5e],
    [0xa8, 0x2e, 0x5b],
    [0x6b, 0x55, 0xb0],
    [0x55, 0x55, 0x55],
];
const SIZE_PX: (u32, u32) = (860, 460);
const LEFT_PX: f32 = 92.0;
const TOP_PX: f32 = 48.0;
const PLOT_PX: (f32, f32) = (530.0, 344.0);

impl Curves<'_> {
    /// Draws the curves.
    #[must_use]
    pub fn draw(&self) -> Canvas {
        let mut canvas = Canvas::new(SIZE_PX.0, SIZE_PX.1);
        let values =
            || self.curves.iter().flat_map(|curve| &curve.values).copied().filter(|v| *v > 0.0 && v.is_finite());
        let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(0.0, f64::max));
        let (low, high) = if low <= high { (low / 1.25, high * 1.25) } else { (0.1, 1.0) };
        let steps = self.curves.iter().map(|curve| curve.values.len()).max().unwrap_or(1).max(2) as f64;
        let at_x = |x: f64| LEFT_PX + PLOT_PX.0 * ((x - 1.0) / (steps - 1.0)) as f32;
        let at_y = |y: f64| TOP_PX + PLOT_PX.1 * ((high / y).ln() / (high / low).ln()) as f32;
        let (right, bottom) = (LEFT_PX + PLOT_PX.0, TOP_PX + PLOT_PX.1);

        for (value, label) in ticks::logarithmic(low, high) {
            let y = at_y(value);
            canvas.stroke((LEFT_PX, y), (right, y), 1.0, [0xe4; 3]);
            canvas.text([LEFT_PX as i32 - 8, y.round() as i32 + 4], &label, 12.0, BLACK, Anchor::End);
        }
        for (value, label) in ticks::linear(1.0, steps, 8).into_iter().filter(|(value, _)| value.fract() == 0.0) {
            let x = at_x(value);
            canvas.stroke((x, bottom), (x, bottom + 4.0), 1.0, GREY);
            canvas.text([x.round() as i32, bottom as i32 + 19], &label, 12.0, BLACK, Anchor::Middle);
        }
        canvas.frame(LEFT_PX as i32, TOP_PX as i32, PLOT_PX.0 as u32, PLOT_PX.1 as u32, PALE);
        for (i, curve) in self.curves.iter().enumerate() {
            let colour = COLOURS[i % COLOURS.len()];
            self.draw_curve(&mut canvas, curve, colour, at_x, at_y);
            let y = TOP_PX + 12.0 + 22.0 * i as f32;
            let (start, end) = (right + 16.0, right + 38.0);
            match curve.values[..] {
                [_] => draw_level(&mut canvas, start, end, y, colour),
                _ => canvas.stroke((start, y), (end, y), 2.0, colour),
            }
            canvas.text([right as i32 + 46, y as i32 + 4], &curve.label, 12.0, BLACK, Anchor::Start);
        }
        let middle = (LEFT_PX + PLOT_PX.0 / 2.0) as i32;
        canvas.text([middle, 28], self.title, 15.0, BLACK, Anchor::Middle);
        canvas.text([middle, bottom as i32 + 42], self.x_label, 12.0, BLACK, Anchor::Middle);
        canvas.text_upwards(22, (TOP_PX + PLOT_PX.1 / 2.0) as i32, self.y_label, 12.0, BLACK);
        canvas
    }

    fn draw_curve(
        &self,
        canvas: &mut Canvas,
        curve: &Curve,
        colour: Colour,
        at_x: impl Fn(f64) -> f32,
        at_y: impl Fn(f64) -> f32,
    ) {
        if let [level] = curve.values[..] {
            return draw_level(canvas, LEFT_PX, LEFT_PX + PLOT_PX.0, at_y(level), colour);
        }
        let points: Vec<_> = (1..)
            .zip(&curve.values)
            .filter(|(_, value)| **value > 0.0 && value.is_finite())
            .map(|(step, &value)| (at_x(f64::from(step)), at_y(value)))
            .collect();
        for pair in points.windows(2) {
            canvas.stroke(pair[0], pair[1], 2.0, colour);
        }
    }
}

/// Draws a dashed horizontal line.
fn draw_level(canvas: &mut Canvas, start: f32, end: f32, y: f32, colour: Colour) {
    const DASH_PX: f32 = 6.0;
    let dashes = ((end - start + DASH_PX) / (2.0 * DASH_PX)) as u32;
    for x in (0..dashes).map(|i| start + 2.0 * DASH_PX * i as f32) {
        canvas.stroke((x, y), (x + DASH_PX, y), 1.6, colour);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_without_values_are_drawn() {
        for values in [vec![], vec![f64::NAN, 0.0], vec![1e-3], vec![0.1, 0.01, 0.005]] {
            let curves = vec![Curve { label: "a".to_owned(), values }];
            assert_eq!(Curves { title: "t", x_label: "x", y_label: "y", curves }.draw().width_px(), SIZE_PX.0);
        }
    }
}
