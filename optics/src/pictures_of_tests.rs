//! Pictures for unit tests. In a unit test, those of the crate `lightpath-bench` have the types of another copy of this
//! crate.

use crate::numerics::Plane;

/// Samples along each side of a pixel.
const SAMPLES: usize = 4;

/// Linear light from 0 to 1, with what photographs have: smooth shades, sharp edges, fine detail and dark parts. Each
/// seed gives another picture.
pub(crate) fn picture(height_px: usize, width_px: usize, seed: u64) -> Plane<f32> {
    let half_px = height_px.min(width_px) as f32 / 2.0;
    let sample = |i: usize, side_px: usize, sample: usize| {
        (i as f32 + (sample as f32 + 0.5) / SAMPLES as f32 - side_px as f32 / 2.0) / half_px
    };
    Plane::from_fn(height_px, width_px, |y, x| {
        let tones = (0..SAMPLES * SAMPLES).map(|k| {
            let (x, y) = (sample(x, width_px, k % SAMPLES), sample(y, height_px, k / SAMPLES));
            // As the eye sees it.
            tone(x, y, seed as f32).powf(2.2)
        });
        tones.sum::<f32>() / (SAMPLES * SAMPLES) as f32
    })
}

/// A lit ball and a striped one before a chequered floor and a dim sky.
fn tone(x: f32, y: f32, seed: f32) -> f32 {
    let turn = 2.4 * seed;
    let ball = |cx: f32, cy: f32, radius: f32| {
        let (x, y) = ((x - cx) / radius, (y - cy) / radius);
        (x * x + y * y < 1.0)
            .then(|| (1.0 - x * x - y * y).sqrt() * 0.6 + 0.35 * x * turn.cos() - 0.35 * y * turn.sin())
    };
    let near = ball(0.35 * turn.cos(), 0.35 * turn.sin(), 0.5);
    let far = ball(-0.6 * turn.sin(), 0.3 * turn.cos(), 0.4);
    let is_floor = y > 0.2 * (3.0 * x + turn).sin();
    let stripe = if (25.0 * y + 8.0 * x).sin() > 0.0 { 1.0 } else { 0.3 };
    let square = if (6.0 * x + turn).sin() * (8.0 * y).sin() > 0.0 { 0.8 } else { 0.15 };
    let tone = match (near, far) {
        (Some(near), _) => 0.1 + 0.9 * near,
        (None, Some(far)) => stripe * far,
        (None, None) if is_floor => square,
        (None, None) => 0.3 - 0.25 * y,
    };
    tone.clamp(0.0, 1.0)
}
