//! Mountains behind a lake.

use super::noise::Noise;
use super::scene::Scene;
use super::vector::{mix, step};

/// One range of mountains. Ranges are listed from the farthest to the nearest.
struct Range {
    noise: Noise,
    crest_y: f32,
    height: f32,
    fineness: f32,
    haze: f32,
}

struct View {
    sky: Noise,
    ranges: Vec<Range>,
    sun: (f32, f32),
    light_x: f32,
    shore_y: f32,
}

pub(super) fn landscape(seed: u64) -> Scene {
    let draws = Noise::new(seed, 200);
    let range = |i: i32| {
        let nearness = i as f32 / 3.0;
        Range {
            noise: Noise::new(seed, 201 + i as u64),
            crest_y: mix(-0.12, 0.32, nearness) + draws.between(10 + i, -0.05, 0.05),
            height: mix(0.85, 0.28, nearness),
            fineness: mix(0.9, 1.7, nearness),
            haze: mix(0.55, 0.0, nearness.sqrt()),
        }
    };
    let side = if draws.uniform(1, 0) < 0.5 { -1.0 } else { 1.0 };
    let view = View {
        sky: Noise::new(seed, 220),
        ranges: (0..4).map(range).collect(),
        sun: (side * draws.between(2, 0.5, 1.2), draws.between(3, -0.7, -0.5)),
        light_x: side,
        shore_y: draws.between(4, 0.5, 0.62),
    };
    let ripples = Noise::new(seed, 230);
    Box::new(move |x, y| {
        if y < view.shore_y {
            return tone(&view, x, y);
        }
        let depth = y - view.shore_y;
        let ripple = ripples.fractal(x * 3.0, depth.sqrt() * 40.0, 3);
        let mirrored = view.shore_y - depth * 1.15 + 0.05 * ripple * (0.2 + depth);
        let water = tone(&view, x + 0.02 * ripple, mirrored);
        let glint = step(0.35, 0.8, ripple) * 0.12;
        water * mix(0.82, 0.55, depth * 2.0) + glint + 0.02
    })
}

fn tone(view: &View, x: f32, y: f32) -> f32 {
    view.ranges.iter().rev().find_map(|range| slope(view, range, x, y)).unwrap_or_else(|| sky(view, x, y))
}

fn sky(view: &View, x: f32, y: f32) -> f32 {
    let to_sun = (x - view.sun.0).hypot(y - view.sun.1);
    let glow = 0.55 * (-to_sun * 2.2).exp() + if to_sun < 0.07 { 0.6 } else { 0.0 };
    let streaks = view.sky.fractal(x * 0.9, y * 3.2, 6);
    let cirrus = step(-0.05, 0.7, streaks) * step(0.3, -0.4, y);
    mix(0.4, 0.72, step(-1.1, 0.3, y)) + glow + 0.28 * cirrus
}

/// The tone of a mountain's face at (x, y). `None`: the point is above the crest.
fn slope(view: &View, range: &Range, x: f32, y: f32) -> Option<f32> {
    let crest = |x: f32| {
        let shape = range.noise.ridges(x * range.fineness, 3.7, 7);
        range.crest_y + range.height * (0.42 - 0.85 * shape)
    };
    let top = crest(x);
    if y < top {
        return None;
    }
    let below = y - top;
    // Gullies run downhill and away from the crest: the pattern is sheared along the fall line.
    let relief = |x: f32, y: f32| range.noise.ridges(x * 1.7 * range.fineness, y * 1.2 * range.fineness, 6);
    let towards = 0.015 * view.light_x;
    let (u, v) = (x + 0.25 * below * range.noise.smooth(x * 3.0, 8.0), y);
    let facing = (relief(u, v) - relief(u + towards, v - 0.01)) * 8.0 + (crest(x + towards) - top) * 7.0;
    let lit = (0.48 + 0.5 * facing).clamp(0.06, 1.0);
    let snow_line = range.height * (0.16 + 0.3 * range.noise.fractal(x * 4.0, y * 4.0, 4)) * (1.0 - range.haze * 0.2);
    let snow = step(snow_line + 0.06, snow_line - 0.04, below) * step(0.35, 0.7, range.height);
    let rock = 0.1 + 0.42 * lit + 0.08 * range.noise.fractal(x * 9.0, y * 9.0, 4);
    let face = mix(rock, 0.38 + 0.62 * lit, snow);
    let mist = (range.haze + 0.5 * step(0.1, 0.6, below) * (0.3 + range.haze)).min(0.85);
    Some(mix(face, 0.66, mist))
}
