//! Cards that show the resolution and the grey levels of a display.

use super::noise::Noise;
use super::scene::{Frame, Scene};
use super::vector::{mix, step, turned};
use std::f32::consts::{PI, TAU};

/// A card with grey steps, ramps and discs.
pub(super) fn wedges(frame: Frame, seed: u64) -> Scene {
    let noise = Noise::new(seed, 1);
    let steps = 7 + noise.choice(1, 6);
    let swirl = noise.between(2, -0.5, 0.5);
    let discs: Vec<f32> = (0..5).map(|i| noise.between(10 + i, 0.05, 0.95)).collect();
    Box::new(move |x, y| {
        let across = (x / frame.half_width + 1.0) / 2.0;
        let down = y / frame.half_height;
        if down < -0.45 {
            let level = (across * steps as f32).floor() / (steps - 1) as f32;
            return level.clamp(0.0, 1.0);
        }
        if down > 0.62 {
            let level = 1.0 - (across * (2 * steps) as f32).floor() / (2 * steps - 1) as f32;
            return if down > 0.81 { level } else { 1.0 - across };
        }
        let ramp = 0.5 + 0.45 * (across * 2.0 - 1.0 + swirl * down).clamp(-1.0, 1.0);
        let cell = (across * 5.0).floor().clamp(0.0, 4.0);
        let radius_max = 0.42 * (frame.half_width * 2.0 / 5.0).min(frame.half_height * 1.07);
        let (cx, cy) = ((cell + 0.5) / 5.0 * 2.0 - 1.0, 0.085);
        let radius = (x - cx * frame.half_width).hypot(y - cy * frame.half_height) / radius_max;
        let shade = discs[cell as usize];
        let ball = mix(shade, 1.0 - shade, radius * radius);
        if radius < 1.0 { ball } else { 1.0 - ramp }
    })
}

/// A card with groups of vertical and horizontal bars that get finer.
pub(super) fn resolution_bars(frame: Frame, seed: u64) -> Scene {
    const COLUMNS: f32 = 4.0;
    const ROWS: f32 = 3.0;
    /// Stripes in a group: five bright bars and the four gaps between them.
    const STRIPES: f32 = 9.0;
    let noise = Noise::new(seed, 2);
    let dark_on_bright = noise.uniform(1, 1) < 0.5;
    let tilt = noise.between(2, -0.04, 0.04);
    Box::new(move |x, y| {
        let (x, y) = turned(x, y, tilt);
        let across = (x / frame.half_width + 1.0) / 2.0 * COLUMNS;
        let down = (y / frame.half_height + 1.0) / 2.0 * ROWS;
        let (column, row) = (across.floor().clamp(0.0, COLUMNS - 1.0), down.floor().clamp(0.0, ROWS - 1.0));
        let index = row * COLUMNS + column;
        let cell_width = frame.half_width * 2.0 / COLUMNS;
        let cell_height = frame.half_height * 2.0 / ROWS;
        let (local_x, local_y) = ((across - column - 0.5) * cell_width, (down - row - 0.5) * cell_height);
        let size = 0.86 * cell_height.min(cell_width / 2.0) * 0.86_f32.powf(index);
        let upright = local_x < 0.0;
        let centre = if upright { -cell_width / 4.0 } else { cell_width / 4.0 };
        let (u, v) = ((local_x - centre) / size + 0.5, local_y / size + 0.5);
        let inside = (0.0..1.0).contains(&u) && (0.0..1.0).contains(&v);
        let stripe = ((if upright { u } else { v }) * STRIPES).floor();
        let bar = inside && stripe % 2.0 == 0.0;
        let contrast = mix(1.0, 0.55, row / (ROWS - 1.0));
        let paper = mix(0.02, 0.2, (x / frame.half_width + 1.0) / 2.0);
        let tone = if bar { paper + (0.97 - paper) * contrast } else { paper };
        if dark_on_bright { 0.9 - 0.85 * tone } else { tone }
    })
}

/// A card with spokes that meet in the middle, inside grey rings.
pub(super) fn siemens_star(frame: Frame, seed: u64) -> Scene {
    let noise = Noise::new(seed, 3);
    let spokes = (12 + 4 * noise.choice(1, 6)) as f32;
    let turn = noise.between(2, 0.0, TAU);
    let (cx, cy) = (noise.between(3, -0.3, 0.3) * (frame.half_width - 0.8), noise.between(4, -0.08, 0.08));
    Box::new(move |x, y| {
        let (x, y) = (x - cx, y - cy);
        let (radius, angle) = (x.hypot(y), y.atan2(x));
        if radius < 0.05 {
            return 0.95;
        }
        if radius < 0.86 {
            return if ((angle + turn) * spokes).sin() > 0.0 { 0.95 } else { 0.04 };
        }
        if radius < 0.93 {
            return ((angle / PI + 1.0) * 6.0).floor() / 11.0;
        }
        let fade = (0.5 + 0.5 * x / (frame.half_width + cx.abs())).clamp(0.0, 1.0);
        mix(0.15, 0.8, fade) + 0.1 * y
    })
}

/// A card with rings that get finer towards the edge and fade out softly.
pub(super) fn rings(seed: u64) -> Scene {
    let noise = Noise::new(seed, 4);
    let (cx, cy) = (noise.between(1, -0.5, 0.5), noise.between(2, -0.25, 0.25));
    let fineness = noise.between(3, 11.0, 17.0);
    let start = noise.between(4, 0.0, TAU);
    Box::new(move |x, y| {
        let squared = (x - cx).powi(2) + (y - cy).powi(2);
        let contrast = 0.06 + 0.94 * (-squared / 1.1).exp();
        let centre = mix(0.72, 0.36, step(0.0, 2.5, squared));
        centre + 0.5 * contrast * centre.min(1.0 - centre) * 2.0 * (PI * fineness * squared + start).cos()
    })
}
