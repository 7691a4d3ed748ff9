//! Heat maps: a plane of numbers as colours, with axes and a colour bar.

use super::canvas::{Anchor, BLACK, Canvas, GREY};
use super::colours::ColourMap;
use super::ticks;
use lightpath_optics::Plane;

/// A plane of numbers, with the texts and colours that present it.
#[derive(Clone, Copy, Debug)]
pub struct Heatmap<'a> {
    /// Title above the picture.
    pub title: &'a str,
    /// The numbers, \[y\]\[x\], drawn with y downwards.
    pub values: &'a Plane<f32>,
    /// Colour map. Cyclic colours are for phases in radians.
    pub colours: ColourMap,
    /// The numbers at the ends of the colour bar. Cyclic colours always have −π and π.
    pub range: (f32, f32),
    /// Unit below the colour bar; may be empty.
    pub unit: &'a str,
    /// Horizontal axis, along the columns.
    pub x: Axis<'a>,
    /// Vertical axis, along the rows.
    pub y: Axis<'a>,
}

/// An axis of a heat map.
#[derive(Clone, Copy, Debug)]
pub struct Axis<'a> {
    /// Label of the axis, with its unit.
    pub label: &'a str,
    /// Value of the axis at the left or upper edge.
    pub start: f64,
    /// Value of the axis at the right or lower edge.
    pub end: f64,
}

const LONG_SIDE_PX: f64 = 320.0;
const LEFT_PX: i32 = 66;
const TOP_PX: i32 = 40;
const RIGHT_PX: u32 = 92;
const BOTTOM_PX: u32 = 56;
const BAR_GAP_PX: i32 = 14;
const BAR_WIDTH_PX: u32 = 14;

impl Heatmap<'_> {
    /// Draws the heat map. Both axes have the same scale.
    #[must_use]
    pub fn draw(&self) -> Canvas {
        self.draw_sized(LONG_SIDE_PX)
    }

    /// Draws the heat map with a longer side of the given length \[px\], without the axes.
    #[must_use]
    pub fn draw_sized(&self, long_side_px: f64) -> Canvas {
        let (width_px, height_px) = self.size_px(long_side_px);
        let mut canvas = Canvas::new(LEFT_PX as u32 + width_px + RIGHT_PX, TOP_PX as u32 + height_px + BOTTOM_PX);
        let (rows, columns) = (self.values.height_px(), self.values.width_px());
        let nearest = |i: u32, drawn: u32, stored: usize| (2 * i as usize + 1) * stored / (2 * drawn as usize);
        canvas.paint(LEFT_PX, TOP_PX, width_px, height_px, |x, y| {
            self.colour(self.values.at(nearest(y, height_px, rows), nearest(x, width_px, columns)))
        });
        canvas.frame(LEFT_PX, TOP_PX, width_px, height_px, GREY);
        let middle = LEFT_PX + width_px as i32 / 2;
        canvas.text([middle, TOP_PX - 14], self.title, 15.0, BLACK, Anchor::Middle);
        self.draw_axes(&mut canvas, width_px, height_px);
        self.draw_bar(&mut canvas, width_px, height_px);
        canvas
    }

    fn size_px(&self, long_side_px: f64) -> (u32, u32) {
        let (across, down) = ((self.x.end - self.x.start).abs(), (self.y.end - self.y.start).abs());
        let scale = long_side_px / across.max(down);
        ((across * scale).round().max(1.0) as u32, (down * scale).round().max(1.0) as u32)
    }

    fn ends(&self) -> (f32, f32) {
        match self.colours {
            ColourMap::Sequential | ColourMap::Diverging => self.range,
            ColourMap::Cyclic => (-std::f32::consts::PI, std::f32::consts::PI),
        }
    }

    fn colour(&self, value: f32) -> [u8; 3] {
        let (low, high) = self.ends();
        let t = (value - low) / (high - low);
        self.colours.colour(if self.colours == ColourMap::Cyclic { t.rem_euclid(1.0) } else { t })
    }

    fn draw_axes(&self, canvas: &mut Canvas, width_px: u32, height_px: u32) {
        let bottom = TOP_PX + height_px as i32;
        for (value, label) in ticks::linear(self.x.start, self.x.end, 5) {
            let x = LEFT_PX as f32 + position(&self.x, value) * width_px as f32;
            canvas.stroke((x, bottom as f32), (x, bottom as f32 + 4.0), 1.0, GREY);
            canvas.text([x.round() as i32, bottom + 18], &label, 12.0, BLACK, Anchor::Middle);
        }
        for (value, label) in ticks::linear(self.y.start, self.y.end, 5) {
            let y = TOP_PX as f32 + position(&self.y, value) * height_px as f32;
            canvas.stroke((LEFT_PX as f32 - 5.0, y), (LEFT_PX as f32 - 1.0, y), 1.0, GREY);
            canvas.text([LEFT_PX - 9, y.round() as i32 + 4], &label, 12.0, BLACK, Anchor::End);
        }
        canvas.text([LEFT_PX + width_px as i32 / 2, bottom + 38], self.x.label, 12.0, BLACK, Anchor::Middle);
        canvas.text_upwards(18, TOP_PX + height_px as i32 / 2, self.y.label, 12.0, BLACK);
    }

    fn draw_bar(&self, canvas: &mut Canvas, width_px: u32, height_px: u32) {
        let left = LEFT_PX + width_px as i32 + BAR_GAP_PX;
        let (low, high) = self.ends();
        canvas.paint(left, TOP_PX, BAR_WIDTH_PX, height_px, |_, y| {
            self.colours.colour(1.0 - (y as f32 + 0.5) / height_px as f32)
        });
        canvas.frame(left, TOP_PX, BAR_WIDTH_PX, height_px, GREY);
        let right = left + BAR_WIDTH_PX as i32;
        let ticks = match self.colours {
            ColourMap::Sequential | ColourMap::Diverging => ticks::linear(low.into(), high.into(), 5),
            ColourMap::Cyclic => ticks::phase(),
        };
        for (value, label) in ticks {
            let y = TOP_PX as f32 + height_px as f32 * (high - value as f32) / (high - low).max(f32::MIN_POSITIVE);
            canvas.stroke((right as f32 + 1.0, y), (right as f32 + 4.0, y), 1.0, GREY);
            canvas.text([right + 8, y.round() as i32 + 4], &label, 12.0, BLACK, Anchor::Start);
        }
        let below = TOP_PX + height_px as i32 + 18;
        canvas.text([left + BAR_WIDTH_PX as i32 / 2, below], self.unit, 12.0, BLACK, Anchor::Middle);
    }
}

/// Position of `value` on the axis, from 0 to 1.
fn position(axis: &Axis<'_>, value: f64) -> f32 {
    ((value - axis.start) / (axis.end - axis.start)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_axes_have_the_same_scale() {
        let values = Plane::from_fn(8, 8, |y, x| (y + x) as f32);
        let axis = |end| Axis { label: "x [px]", start: 0.0, end };
        let map = Heatmap {
            title: "t",
            values: &values,
            colours: ColourMap::Sequential,
            range: (0.0, 14.0),
            unit: "",
            x: axis(16.0),
            y: axis(8.0),
        };
        assert_eq!(map.size_px(LONG_SIDE_PX), (320, 160));
        let canvas = map.draw();
        assert_eq!(canvas.width_px(), LEFT_PX as u32 + 320 + RIGHT_PX);
        assert!(!canvas.png().unwrap().is_empty());
    }
}
