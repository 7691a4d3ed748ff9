//! A flower with many petals.

use super::noise::Noise;
use super::scene::Scene;
use super::vector::{mix, step};
use std::f32::consts::TAU;

/// One ring of petals. Rings are listed from the outermost inwards.
struct Ring {
    petals: f32,
    turn: f32,
    length: f32,
    brightness: f32,
    index: i32,
}

pub(super) fn flower(seed: u64) -> Scene {
    let [veins, backdrop, draws] = [1, 2, 3].map(|stream| Noise::new(seed, 600 + stream));
    let (cx, cy) = (draws.between(1, -0.35, 0.35), draws.between(2, -0.08, 0.08));
    let petals = (9 + draws.choice(3, 6)) as f32;
    let rings: Vec<Ring> = (0..7)
        .map(|i| Ring {
            petals: if i < 5 { petals } else { petals - 3.0 },
            turn: draws.between(10 + i, 0.0, TAU),
            length: 0.95 * 0.82_f32.powi(i),
            brightness: mix(0.95, 0.6, i as f32 / 6.0),
            index: i,
        })
        .collect();
    let light = draws.between(4, 0.0, TAU);
    Box::new(move |x, y| {
        let (dx, dy) = (x - cx, y - cy);
        let radius = dx.hypot(dy);
        let angle = dy.atan2(dx);
        if radius < 0.13 {
            return heart(&veins, dx, dy, radius);
        }
        let side = 0.08 * (angle - light).cos();
        let nearest_petal = rings.iter().rev().find_map(|ring| petal(&veins, ring, angle, radius));
        nearest_petal.map_or_else(|| background(&backdrop, x, y, radius), |tone| tone + side)
    })
}

/// The tone of the nearest petal of a ring. `None`: the point is between petals.
fn petal(veins: &Noise, ring: &Ring, angle: f32, radius: f32) -> Option<f32> {
    let sector = (angle + ring.turn) / TAU * ring.petals;
    let index = sector.round();
    let wobble = veins.uniform(index.rem_euclid(ring.petals) as i32, 50 + ring.index) - 0.5;
    let across = (sector - index + 0.12 * wobble) * TAU / ring.petals;
    let along = radius / (ring.length * (1.0 + 0.12 * wobble));
    if along > 1.0 {
        return None;
    }
    // Half the petal's angular width: broad in the middle, round at the tip.
    let half =
        0.36 * (along * 1.25).min(1.0).sqrt() * (1.0 - along.powi(5)).sqrt() / along.max(0.35) * 9.0 / ring.petals;
    let sideways = across / half;
    if sideways.abs() > 1.0 {
        return None;
    }
    let ridge = veins.fractal(sideways * 6.0 + index * 9.0, along * 1.5 + ring.index as f32 * 5.0, 3);
    let cupped = 1.0 - 0.32 * sideways * sideways - 0.14 * (sideways + 0.5 * wobble).powi(2);
    // The next ring inwards casts a shadow on the petal's root.
    let rooted = mix(0.32, 1.0, step(0.5, 0.95, along));
    Some(ring.brightness * (cupped * rooted + 0.1 * ridge) + 0.05 * wobble)
}

fn heart(veins: &Noise, dx: f32, dy: f32, radius: f32) -> f32 {
    // Florets lie on Vogel's spiral: the nearest floret gives the tone.
    let nearest = (0..90).map(|i| {
        let (r, a) = (0.0135 * (i as f32).sqrt(), i as f32 * 2.399_963);
        ((dx - r * a.cos()).hypot(dy - r * a.sin()), i)
    });
    let (distance, index) = nearest.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, 0));
    let dome = 1.0 - (radius / 0.15).powi(2) * 0.6;
    dome * (0.75 - 40.0 * distance + 0.2 * veins.uniform(index, 3)).clamp(0.1, 0.95)
}

fn background(noise: &Noise, x: f32, y: f32, radius: f32) -> f32 {
    let blurred = 0.26 + 0.3 * noise.fractal(x * 1.3, y * 1.3, 3);
    blurred.max(0.05) * mix(0.55, 1.0, step(0.7, 1.3, radius))
}
