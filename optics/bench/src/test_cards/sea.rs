//! Waves under a low sun.

use super::noise::Noise;
use super::scene::Scene;
use super::vector::{dot, mirrored, mix, step, unit};

pub(super) fn sea(seed: u64) -> Scene {
    let [swell, ripples, haze, draws] = [1, 2, 3, 4].map(|stream| Noise::new(seed, 400 + stream));
    let horizon = draws.between(1, -0.4, -0.15);
    let sun = (draws.between(2, -0.8, 0.8), horizon - draws.between(3, 0.15, 0.4));
    let heading = draws.between(4, -0.6, 0.6);
    let sky = move |x: f32, y: f32| {
        let to_sun = (x - sun.0).hypot(y - sun.1);
        let disc = if to_sun < 0.1 { 0.5 } else { 0.0 };
        let bank = 0.3 * haze.fractal(x * 0.8, y * 4.0, 6) * step(horizon, horizon - 0.5, y);
        mix(0.75, 0.28, step(horizon, horizon - 1.1, y)) + 0.35 * (-to_sun * 2.0).exp() + disc + bank
    };
    let height = move |x: f32, z: f32| {
        let along = x * heading.sin() + z * heading.cos();
        0.1 * (along * 2.1 + 2.0 * swell.smooth(x * 0.3, z * 0.3)).sin()
            + 0.16 * swell.fractal(x * 0.8, z * 0.8, 3)
            + 0.05 * ripples.fractal(x * 3.0, z * 3.0, 3)
    };
    Box::new(move |x, y| {
        if y < horizon {
            return sky(x, y);
        }
        let distance = 1.0 / (y - horizon + 0.012);
        let (wx, wz) = (x * distance * 0.8, distance * 1.6);
        let reach = 0.01 * distance.max(1.0);
        let slope_x = (height(wx + reach, wz) - height(wx, wz)) / reach;
        let slope_z = (height(wx, wz + reach) - height(wx, wz)) / reach;
        // Distant waves are too small to be seen one by one: they fade with the distance.
        let calm = 1.0 / (1.0 + 0.05 * distance);
        let normal = unit([-slope_x * calm, -1.0, slope_z * calm]);
        let view = unit([x * 0.8, (y - horizon) * 0.8 + 0.02, -1.0]);
        let leaving = mirrored(view, normal);
        let grazing = (1.0 + dot(view, normal)).clamp(0.0, 1.0).powi(3);
        let to_sun = unit([sun.0 * 0.8, sun.1 - horizon, -1.0]);
        let glitter = dot(leaving, to_sun).max(0.0).powi(60);
        let body = 0.1 + 0.12 * height(wx, wz) * 5.0;
        let reflected = mix(0.72, 0.3, (-leaving[1] * 1.2).clamp(0.0, 1.0));
        let tone = mix(body, reflected, 0.15 + 0.85 * grazing) + 0.9 * glitter;
        mix(tone, 0.62, step(0.06, 0.0, y - horizon) * 0.7)
    })
}
