//! Cumulus clouds.

use super::noise::Noise;
use super::scene::Scene;
use super::vector::{mix, step};

pub(super) fn clouds(seed: u64) -> Scene {
    let [shape, curl, draws] = [1, 2, 3].map(|stream| Noise::new(seed, 300 + stream));
    let light_x = draws.between(1, -1.0, 1.0);
    let scale = draws.between(2, 0.75, 1.15);
    let cover = draws.between(3, -0.06, 0.1);
    let density = move |x: f32, y: f32| {
        let (x, y) = (x * scale, y * scale * 1.5);
        let (wx, wy) = (curl.fractal(x * 1.4, y * 1.4, 4), curl.fractal(x * 1.4 + 40.0, y * 1.4, 4));
        let billows = shape.ridges(x * 2.2 + 0.5 * wx, y * 2.2 + 0.5 * wy, 6);
        shape.fractal(x + 0.3 * wx, y + 0.3 * wy, 6) + 0.3 * (0.45 - billows) + cover + 0.12 * y
    };
    Box::new(move |x, y| {
        let here = density(x, y);
        let opacity = step(0.0, 0.16, here);
        let sky = mix(0.26, 0.6, step(-1.2, 1.2, y)) + 0.05 * light_x * x;
        if opacity == 0.0 {
            return sky;
        }
        // The cloud absorbs light: a point with less cloud towards the light is brighter.
        let shade = |reach: f32| density(x + reach * light_x, y - reach).max(0.0);
        let lost = 1.1 * shade(0.03) + 1.0 * shade(0.09) + 0.8 * shade(0.2);
        let lit = 0.3 + 0.72 * (-1.5 * (lost - 0.6 * here)).exp();
        mix(sky, lit.min(1.0), opacity)
    })
}
