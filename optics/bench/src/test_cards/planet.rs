//! A ringed planet among stars.

use super::noise::Noise;
use super::scene::Scene;
use super::vector::{add_scaled, dot, mix, step, turned, unit};

pub(super) fn planet(seed: u64) -> Scene {
    let [bands, belts, stars, draws] = [1, 2, 3, 4].map(|stream| Noise::new(seed, 100 + stream));
    let radius = draws.between(1, 0.52, 0.66);
    let (cx, cy) = (draws.between(2, -0.3, 0.3), draws.between(3, -0.1, 0.1));
    let tilt = draws.between(4, -0.5, 0.5);
    let flatness = draws.between(5, 0.18, 0.32);
    let light = unit([draws.between(6, -0.9, 0.9), -0.35, draws.between(7, 0.35, 0.7)]);
    let moon = (draws.between(8, -1.3, 1.3), draws.between(9, 0.62, 0.8), draws.between(10, 0.05, 0.1));
    Box::new(move |x, y| {
        let (u, v) = turned((x - cx) / radius, (y - cy) / radius, -tilt);
        let around = starry(&stars, x, y).max(ball(x - moon.0, y + moon.1, moon.2, light));
        let squared = u * u + v * v;
        let lit_ring = ring(&belts, u, v, flatness, light);
        if squared >= 1.0 {
            // A thin atmosphere glows on the lit side.
            let glow = (-(squared.sqrt() - 1.0) * 30.0).exp() * (0.25 + 0.3 * (u * light[0] + v * light[1]).max(0.0));
            return lit_ring.map_or(around + glow, |(tone, cover)| mix(around + glow, tone, cover));
        }
        let normal = [u, v, (1.0 - squared).sqrt()];
        let latitude = v / (1.0 + 0.2 * normal[2]);
        let warp = bands.fractal(u * 1.5 + 3.0, latitude * 5.0, 5);
        let swirl = bands.fractal(u * 3.0 + warp * 1.2, latitude * 9.0 + warp * 1.5, 5);
        let belt = belts.fractal(0.3, latitude * 4.5 + 0.35 * warp, 4);
        let albedo = (0.68 + 0.38 * belt + 0.16 * swirl).clamp(0.12, 1.0);
        let lambert = dot(normal, light);
        let shadow = 1.0 - 0.65 * ring_shadow(&belts, normal, light, flatness);
        let tone = albedo * (0.03 + 1.05 * step(-0.12, 1.0, lambert) * shadow);
        match lit_ring {
            // The near half of the ring passes in front.
            Some((ring_tone, cover)) if v > 0.0 => mix(tone, ring_tone, cover),
            _ => tone,
        }
    })
}

/// The ring's tone, and how much of its background it covers, 0 to 1. `None`: the point is beside the ring.
fn ring(belts: &Noise, u: f32, v: f32, flatness: f32, light: [f32; 3]) -> Option<(f32, f32)> {
    let distance = u.hypot(v / flatness);
    let density = density(belts, distance)?;
    // The planet's shadow falls on the ring behind it, as seen from the light.
    let point = [u, v, v / flatness];
    let towards = dot(point, light);
    let beside = add_scaled(point, light, -towards);
    let shadow = if towards < 0.0 { step(1.06, 0.94, dot(beside, beside).sqrt()) } else { 0.0 };
    let tone = (0.45 + 0.5 * density) * mix(1.0, 0.18, shadow);
    Some((tone, 0.15 + 0.8 * density))
}

fn density(belts: &Noise, distance: f32) -> Option<f32> {
    if !(1.25..2.15).contains(&distance) {
        return None;
    }
    let gap = 1.0 - 0.9 * step(0.035, 0.012, (distance - 1.83).abs());
    let ends = step(1.25, 1.32, distance) * step(2.15, 2.1, distance);
    let grain = 0.62 + 0.55 * belts.fractal(distance * 9.0, 40.0, 4);
    Some((grain * ends * gap).clamp(0.0, 1.0))
}

fn ring_shadow(belts: &Noise, normal: [f32; 3], light: [f32; 3], flatness: f32) -> f32 {
    // Distance towards the light to the ring's plane, v = flatness · z.
    let along = (normal[1] - flatness * normal[2]) / (light[1] - flatness * light[2]);
    if along > 0.0 {
        return 0.0;
    }
    let hit = normal[0] - along * light[0];
    let depth = normal[2] - along * light[2];
    density(belts, hit.hypot(depth)).unwrap_or(0.0)
}

fn ball(x: f32, y: f32, radius: f32, light: [f32; 3]) -> f32 {
    let (u, v) = (x / radius, y / radius);
    let squared = u * u + v * v;
    if squared >= 1.0 {
        return 0.0;
    }
    0.06 + 0.85 * step(-0.05, 1.0, dot([u, v, (1.0 - squared).sqrt()], light))
}

fn starry(stars: &Noise, x: f32, y: f32) -> f32 {
    let cloud = (0.28 + 0.42 * stars.fractal(x * 1.1 + 5.0, y * 1.1 + 2.0, 6)).max(0.03);
    let (cell_x, cell_y) = ((x * 9.0).floor(), (y * 9.0).floor());
    let (ix, iy) = (cell_x as i32, cell_y as i32);
    let (dx, dy) = (
        x * 9.0 - cell_x - 0.2 - 0.6 * stars.uniform(ix, iy),
        y * 9.0 - cell_y - 0.2 - 0.6 * stars.uniform(ix + 1000, iy),
    );
    let brightness = stars.uniform(ix, iy + 1000).powi(3);
    let spot = brightness * (-(dx * dx + dy * dy) / (0.003 + 0.012 * brightness)).exp();
    cloud + 1.2 * spot
}
