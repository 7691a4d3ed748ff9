//! A veined leaf in front of lights that are out of focus.

use super::noise::Noise;
use super::scene::Scene;
use super::vector::{mix, step, turned};

pub(super) fn leaf(seed: u64) -> Scene {
    let [tissue, edge, lights, draws] = [1, 2, 3, 4].map(|stream| Noise::new(seed, 700 + stream));
    let tilt = draws.between(1, -0.7, 0.7);
    let (cx, cy) = (draws.between(2, -0.2, 0.2), draws.between(3, -0.06, 0.06));
    let bend = draws.between(4, -0.25, 0.25);
    let veins = draws.between(5, 7.0, 11.0);
    let breadth = draws.between(6, 0.42, 0.58);
    let glow = (draws.between(7, -0.5, 0.5), draws.between(8, -0.3, 0.3));
    Box::new(move |x, y| {
        let (u, v) = turned(x - cx, y - cy, -tilt);
        let v = v + bend * (u * u - 0.35);
        let along = (u + 1.0) / 2.05;
        let behind = bokeh(&lights, x, y);
        let stalk = (-1.35..-0.98).contains(&u) && v.abs() < 0.018;
        if stalk {
            return 0.3 + 8.0 * v;
        }
        if !(0.0..1.0).contains(&along) {
            return behind;
        }
        let teeth = 1.0 + 0.05 * ((along * 60.0 + 1.0 * edge.smooth(along * 8.0, v.signum())).fract() - 0.5);
        let half = breadth * teeth * (along.powf(0.62) * (1.0 - along).powf(0.75) * 1.9);
        let across = v / half;
        if across.abs() > 1.0 {
            return behind * mix(0.75, 1.0, step(1.0, 1.25, across.abs()));
        }
        // Side veins branch off the midrib forwards and curve towards the tip.
        let reach = v.abs() / breadth;
        let side = if v < 0.0 { 0.0 } else { 0.5 };
        let phase = (along - 0.42 * reach + 0.16 * reach * reach) * veins + side;
        let to_vein = (phase - phase.round()).abs() / veins;
        let width = mix(0.011, 0.003, reach.min(1.0));
        let vein = step(width * 1.6, width * 0.5, to_vein).max(step(0.022, 0.008, v.abs() * (0.6 + along)));
        let fine = tissue.ridges(u * 14.0, v * 14.0, 3);
        let bulge = 0.16 * (std::f32::consts::TAU * phase).sin() * v.signum();
        let lit = 0.62 - 0.22 * ((u - glow.0).hypot(v - glow.1)) + bulge * (1.0 - 0.4 * reach);
        let blade = lit + 0.12 * (fine - 0.5) + 0.1 * tissue.fractal(u * 2.0, v * 2.0, 4) - 0.12 * across.powi(6);
        let shaded = blade * if v < 0.0 { 1.0 } else { 0.72 };
        mix(shaded, 0.93, vein * 0.75)
    })
}

/// Round, soft lights of different sizes.
fn bokeh(lights: &Noise, x: f32, y: f32) -> f32 {
    let base = (0.2 + 0.25 * lights.fractal(x * 0.9, y * 0.9, 3)).max(0.04);
    let discs = (0..22).map(|i| {
        let (cx, cy) = (lights.between(3 * i, -2.0, 2.0), lights.between(3 * i + 1, -1.1, 1.1));
        let radius = lights.between(3 * i + 2, 0.08, 0.24);
        let from_disc = (x - cx).hypot(y - cy) / radius;
        let rim = 0.75 + 0.25 * step(0.6, 0.95, from_disc);
        lights.between(200 + i, 0.05, 0.3) * step(1.0, 0.93, from_disc) * rim
    });
    base + discs.sum::<f32>()
}
