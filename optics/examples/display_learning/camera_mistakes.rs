//! Mistakes in taking a photograph: a rotated, moved or overexposed camera.

use lightpath_optics::{Plane, RegionOfInterest};

/// The light as seen by a camera that is rotated about the middle and shifted.
pub(crate) fn rotated_and_shifted(light: &Plane<f32>, rotation_rad: f64, dx_px: f64, dy_px: f64) -> Plane<f32> {
    let (height_px, width_px) = (light.height_px(), light.width_px());
    let (middle_y, middle_x) = ((height_px - 1) as f64 / 2.0, (width_px - 1) as f64 / 2.0);
    let (sine, cosine) = rotation_rad.sin_cos();
    Plane::from_fn(height_px, width_px, |y, x| {
        let (v, u) = (y as f64 - middle_y, x as f64 - middle_x);
        cubic(light, middle_y + sine * u + cosine * v + dy_px, middle_x + cosine * u - sine * v + dx_px)
    })
}

/// Catmull-Rom interpolation. Outside the plane the nearest edge pixel counts.
fn cubic(light: &Plane<f32>, y: f64, x: f64) -> f32 {
    let weights = |t: f64| {
        let (t2, t3) = (t * t, t * t * t);
        [-0.5 * t3 + t2 - 0.5 * t, 1.5 * t3 - 2.5 * t2 + 1.0, -1.5 * t3 + 2.0 * t2 + 0.5 * t, 0.5 * t3 - 0.5 * t2]
    };
    let inside = |i: f64, side: usize| i.clamp(0.0, (side - 1) as f64) as usize;
    let mut sum = 0.0;
    for (i, wy) in weights(y - y.floor()).into_iter().enumerate() {
        let row = light.row(inside(y.floor() + i as f64 - 1.0, light.height_px()));
        for (j, wx) in weights(x - x.floor()).into_iter().enumerate() {
            sum += wy * wx * f64::from(row[inside(x.floor() + j as f64 - 1.0, light.width_px())]);
        }
    }
    sum.max(0.0) as f32
}

/// The light after an exposure that puts a `share` of the region's pixels beyond full scale.
pub(crate) fn overexposed(light: &Plane<f32>, region: RegionOfInterest, share: f64) -> Plane<f32> {
    let rows = (0..light.height_px()).filter_map(|y| region.columns(y).map(|columns| &light.row(y)[columns]));
    let mut values: Vec<f32> = rows.flatten().copied().collect();
    values.sort_by(f32::total_cmp);
    let scale = 1.0 / values[((values.len() - 1) as f64 * (1.0 - share)) as usize];
    light.map(|value| value * scale)
}
