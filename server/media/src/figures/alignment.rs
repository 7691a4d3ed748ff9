//! Pictures that show whether photographs are aligned with the display.

use super::canvas::{Canvas, scaled_height_px};
use crate::pictures::linear_to_srgb;
use lightpath_optics::Plane;

const MARK: [u8; 3] = [0xff, 0x8c, 0x1a];

/// A photograph with an open cross at each of the given points. The picture is at most `width_px_max` wide.
#[must_use]
pub fn marked(light: &Plane<f32>, points: &[[f64; 2]], width_px_max: u32) -> Canvas {
    let width_px = (light.width_px() as u32).clamp(1, width_px_max);
    let mut canvas = Canvas::new(width_px, scaled_height_px(light, width_px));
    canvas.light(0, 0, width_px, &stretched(light));
    let scale = width_px as f32 / light.width_px() as f32;
    for &[x, y] in points {
        let at = |value: f64| (value as f32 + 0.5) * scale - 0.5;
        let (x, y) = (at(x), at(y));
        for (dx, dy) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
            canvas.stroke((x + 4.0 * dx, y + 4.0 * dy), (x + 9.0 * dx, y + 9.0 * dy), 1.2, MARK);
        }
    }
    canvas
}

/// An overlay of the expected light in cyan and the photograph in red. Where they agree the sum is grey. A displaced
/// photograph has red and cyan rims.
#[must_use]
pub fn overlay(expected: &Plane<f32>, photo: &Plane<f32>, width_px_max: u32) -> Canvas {
    let (expected, photo) = (stretched(expected), stretched(photo));
    let width_px = (expected.width_px() as u32).clamp(1, width_px_max);
    let height_px = scaled_height_px(&expected, width_px);
    let mut canvas = Canvas::new(width_px, height_px);
    let scale = expected.width_px() as f32 / width_px as f32;
    let grey = |plane: &Plane<f32>, x: u32, y: u32| {
        let at = |i: u32, side: usize| (((i as f32 + 0.5) * scale) as usize).min(side - 1);
        let value = plane.at(at(y, plane.height_px()), at(x, plane.width_px()));
        (linear_to_srgb(value.clamp(0.0, 1.0)) * 255.0).round() as u8
    };
    canvas.paint(0, 0, width_px, height_px, |x, y| {
        let (red, cyan) = (grey(&photo, x, y), grey(&expected, x, y));
        [red, cyan, cyan]
    });
    canvas
}

/// The light, scaled such that all but one pixel in two hundred lies between black and white.
fn stretched(light: &Plane<f32>) -> Plane<f32> {
    let mut values: Vec<f32> = light.values().iter().copied().filter(|value| value.is_finite()).collect();
    if values.is_empty() {
        return light.clone();
    }
    let at = values.len() - 1 - values.len() / 200;
    let (_, &mut white, _) = values.select_nth_unstable_by(at, f32::total_cmp);
    light.map(|value| if value.is_finite() && white > 0.0 { value / white } else { 0.0 })
}
