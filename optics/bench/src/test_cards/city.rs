//! A skyline at night, mirrored in a river.

use super::noise::Noise;
use super::scene::Scene;
use super::vector::{mix, step};

struct Row {
    noise: Noise,
    house_width: f32,
    tallest: f32,
    haze: f32,
}

pub(super) fn city(seed: u64) -> Scene {
    let [sky, ripples, draws] = [1, 2, 3].map(|stream| Noise::new(seed, 800 + stream));
    let bank_y = draws.between(1, 0.4, 0.55);
    let moon = (draws.between(2, -1.0, 1.0), draws.between(3, -0.75, -0.5), draws.between(4, 0.1, 0.16));
    let rows = [(0.17, 1.15, 0.55), (0.24, 0.9, 0.25), (0.31, 0.55, 0.0)];
    let rows: Vec<Row> = (0..)
        .zip(rows)
        .map(|(i, (house_width, tallest, haze))| Row { noise: Noise::new(seed, 810 + i), house_width, tallest, haze })
        .collect();
    let tone = move |x: f32, y: f32| {
        let house = rows.iter().rev().find_map(|row| facade(row, x, y, bank_y));
        house.unwrap_or_else(|| night(&sky, moon, x, y, bank_y))
    };
    Box::new(move |x, y| {
        if y < bank_y {
            return tone(x, y);
        }
        let depth = y - bank_y;
        let wave = ripples.fractal(x * 5.0, depth * 34.0 / (0.3 + depth), 3);
        // Ripples blur the mirrored lights up and down.
        let blurred = [-1.0, -0.35, 0.35, 1.0]
            .map(|k| tone(x + 0.03 * wave, bank_y - depth + (0.05 * k + 0.08 * wave) * (0.3 + depth)));
        0.03 + 0.75 * blurred.iter().sum::<f32>() / 4.0 + 0.05 * wave
    })
}

fn night(sky: &Noise, moon: (f32, f32, f32), x: f32, y: f32, bank_y: f32) -> f32 {
    let (dx, dy) = ((x - moon.0) / moon.2, (y - moon.1) / moon.2);
    let from_moon = dx.hypot(dy);
    let maria = 0.9 + 0.25 * sky.fractal(dx * 1.4, dy * 1.4, 5);
    let clouds = 0.3 * step(-0.1, 0.7, sky.fractal(x * 0.9, y * 2.5, 6));
    let glow = mix(0.16, 0.52, step(-1.2, bank_y, y));
    let around = glow + clouds + 0.35 * (-(from_moon - 1.0).max(0.0) * 0.7).exp();
    mix(around, maria, step(1.02, 0.98, from_moon))
}

/// The tone of the house at (x, y) in a row of houses. `None`: the point is above the roof.
fn facade(row: &Row, x: f32, y: f32, bank_y: f32) -> Option<f32> {
    let cell = (x / row.house_width + row.noise.between(1, 0.0, 1.0)).floor();
    let house = cell as i32;
    let inside = x / row.house_width + row.noise.between(1, 0.0, 1.0) - cell;
    let height = row.tallest * (0.3 + 0.7 * row.noise.uniform(house, 5));
    let above = bank_y - y;
    let spire = row.noise.uniform(house, 6) < 0.25 && (inside - 0.5).abs() < 0.03 * (1.0 - (above - height) / 0.3);
    let stepped = row.noise.uniform(house, 7) < 0.4 && (inside - 0.5).abs() > 0.32;
    let roof = height * if stepped { 0.88 } else { 1.0 } + if spire { 0.22 } else { 0.0 };
    if above > roof {
        return None;
    }
    let wall = mix(0.05 + 0.12 * row.noise.uniform(house, 8) + 0.1 * inside, 0.42, row.haze);
    let (columns, floors) = (4.0 + (row.noise.uniform(house, 9) * 4.0).floor(), 16.0);
    let (u, v) = (inside * columns, above * floors);
    let pane = (0.22..0.78).contains(&u.fract()) && (0.25..0.75).contains(&v.fract()) && above < height * 0.96 - 0.02;
    let key = house * 64 + u.floor() as i32;
    let lit = row.noise.uniform(key, 100 + v.floor() as i32);
    if !pane || lit < 0.45 {
        return Some(wall * if pane { 0.7 } else { 1.0 });
    }
    Some(mix(0.45 + 0.55 * (lit - 0.45) / 0.55, wall, row.haze * 0.6))
}
