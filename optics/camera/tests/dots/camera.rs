//! Cameras that were drawn at random, and their photographs.

use crate::display::{FINE, Geometry, Light};
use lightpath_optics::Plane;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A camera, and where it sees the display.
#[derive(Clone, Debug)]
pub(crate) struct Camera {
    pub(crate) height_px: usize,
    pub(crate) width_px: usize,
    /// Homography from the display's pixels to the camera's, row by row.
    pub(crate) map: [f64; 9],
    blur_px: f64,
    /// Light at the darker side, relative to the brighter one; direction to the darker side \[rad\].
    fall_off: [f64; 2],
    /// Exposure: level of the light that a thousandth exceeds.
    exposure: f64,
    black: f64,
    read_noise: f64,
    /// Electrons of a full pixel.
    full_well: f64,
    hot: usize,
    seed: u64,
}

impl Camera {
    /// Draws a camera. `orientation` 0 to 7: quarter turns, and mirrored from 4 on.
    pub(crate) fn draw(geometry: Geometry, orientation: u8, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0x5eed_0fca_3e7a);
        let mut within = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
        let (w, h) = (geometry.width_px as f64, geometry.height_px as f64);
        let scale = 2.0_f64.powf(within(-0.3, 1.1));
        let angle = within(-8.0, 8.0) + 90.0 * f64::from(orientation % 4);
        let (sine, cosine) = angle.to_radians().sin_cos();
        let flip = if orientation >= 4 { -1.0 } else { 1.0 };
        let side = |a: f64, b: f64| (scale * (a * cosine.abs() + b * sine.abs())).round();
        let (width, height) = (side(w, h) * within(0.88, 1.25), side(h, w) * within(0.88, 1.25));
        let (width, height) = (width.round(), height.round());
        let shift = [within(-0.05, 0.05) * width, within(-0.05, 0.05) * height];
        let tilt = [within(-0.05, 0.05) / w, within(-0.05, 0.05) / h];
        // Middle of the display to the origin, turn, and to the middle of the photograph; then the tilt.
        let linear = [scale * cosine * flip, -scale * sine, scale * sine * flip, scale * cosine];
        let [mx, my] = [(w - 1.0) / 2.0, (h - 1.0) / 2.0];
        let [cx, cy] = [(width - 1.0) / 2.0 + shift[0], (height - 1.0) / 2.0 + shift[1]];
        let last = [tilt[0], tilt[1], 1.0 - tilt[0] * mx - tilt[1] * my];
        let rows = [[linear[0], linear[1]], [linear[2], linear[3]]];
        let mut map = [0.0; 9];
        for (row, middle) in [cx, cy].into_iter().enumerate() {
            let [a, b] = rows[row];
            let entries = [a, b, -a * mx - b * my];
            (0..3).for_each(|k| map[row * 3 + k] = entries[k] + middle * last[k]);
        }
        map[6..].copy_from_slice(&last);
        Self {
            height_px: height as usize,
            width_px: width as usize,
            map,
            blur_px: within(0.0, 1.2) * scale.max(0.8),
            fall_off: [within(0.25, 1.0), within(0.0, std::f64::consts::TAU)],
            exposure: within(0.35, 1.2),
            black: within(0.0, 0.04),
            read_noise: within(0.001, 0.01),
            full_well: within(3000.0, 30000.0),
            hot: within(0.0, 80.0) as usize,
            seed,
        }
    }

    /// Photographs the light of a display, from 0 to 1 in 8 bits.
    pub(crate) fn photograph(&self, light: &Light) -> Plane<f32> {
        let (height, width) = (self.height_px, self.width_px);
        let back = inverse(&self.map);
        let mut image = vec![0.0; height * width];
        for (i, value) in image.iter_mut().enumerate() {
            for (dy, dx) in (0..9).map(|k| (f64::from(k / 3 - 1) / 3.0, f64::from(k % 3 - 1) / 3.0)) {
                *value += light.at(apply(&back, [(i % width) as f64 + dx, (i / width) as f64 + dy])) / 9.0;
            }
        }
        let image = blurred(&image, height, width, self.blur_px);
        self.recorded(&image)
    }

    fn recorded(&self, image: &[f64]) -> Plane<f32> {
        let (height, width) = (self.height_px, self.width_px);
        let mut random = ChaCha8Rng::seed_from_u64(self.seed ^ 0x0a_5e);
        let mut sorted = image.to_vec();
        let rank = sorted.len() * 995 / 1000;
        let (_, &mut bright, _) = sorted.select_nth_unstable_by(rank, f64::total_cmp);
        let [least, towards] = self.fall_off;
        let mut levels: Vec<f32> = Vec::with_capacity(image.len());
        for (i, light) in image.iter().enumerate() {
            let (u, v) = ((i % width) as f64 / width as f64 - 0.5, (i / width) as f64 / height as f64 - 0.5);
            let along = 0.5 + (u * towards.cos() + v * towards.sin()) / std::f64::consts::SQRT_2;
            let value = light / bright * self.exposure * (1.0 - (1.0 - least) * along);
            let normal = (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
            let noise = normal * (value.max(0.0) / self.full_well + self.read_noise.powi(2)).sqrt();
            levels.push(((self.black + value + noise).clamp(0.0, 1.0) * 255.0).round() as f32 / 255.0);
        }
        for _ in 0..self.hot {
            let place = (random.random::<f64>() * levels.len() as f64) as usize;
            levels[place] = (0.5 + random.random::<f32>()).min(1.0);
        }
        Plane::try_from_vec(height, width, levels).unwrap()
    }
}

impl Light {
    /// Light at a place in pixels of the display, between the samples' middles. Dark outside.
    fn at(&self, [x, y]: [f64; 2]) -> f64 {
        let fine = FINE as f64;
        let x = (x + 0.5) * fine - 0.5 + (self.width / 4) as f64;
        let y = (y + 0.5) * fine - 0.5 + (self.height / 4) as f64;
        if !(x >= 0.0 && y >= 0.0 && x < (self.width - 1) as f64 && y < (self.height - 1) as f64) {
            return 0.0;
        }
        let (i, j, a, b) = (x as usize, y as usize, x.fract(), y.fract());
        let value = |j: usize, i: usize| self.values[j * self.width + i];
        (1.0 - b) * ((1.0 - a) * value(j, i) + a * value(j, i + 1))
            + b * ((1.0 - a) * value(j + 1, i) + a * value(j + 1, i + 1))
    }
}

pub(crate) fn apply(map: &[f64; 9], [x, y]: [f64; 2]) -> [f64; 2] {
    let w = map[6] * x + map[7] * y + map[8];
    [(map[0] * x + map[1] * y + map[2]) / w, (map[3] * x + map[4] * y + map[5]) / w]
}

/// The inverse up to a factor, by cofactors.
pub(crate) fn inverse(m: &[f64; 9]) -> [f64; 9] {
    let minor = |a: usize, b: usize, c: usize, d: usize| m[a] * m[d] - m[b] * m[c];
    [
        minor(4, 5, 7, 8),
        minor(2, 1, 8, 7),
        minor(1, 2, 4, 5),
        minor(5, 3, 8, 6),
        minor(0, 2, 6, 8),
        minor(2, 0, 5, 3),
        minor(3, 4, 6, 7),
        minor(1, 0, 7, 6),
        minor(0, 1, 3, 4),
    ]
}

/// Convolution with a Gaussian.
fn blurred(image: &[f64], height: usize, width: usize, sigma: f64) -> Vec<f64> {
    let reach = (4.0 * sigma).ceil() as i64;
    let weight = |k: i64| (-0.5 * (k as f64 / sigma.max(1e-9)).powi(2)).exp();
    let sum: f64 = (-reach..=reach).map(weight).sum();
    let pass = |from: &[f64], step: (i64, i64)| -> Vec<f64> {
        let at = |y: i64, x: i64| {
            from[y.clamp(0, height as i64 - 1) as usize * width + x.clamp(0, width as i64 - 1) as usize]
        };
        let one = |i: usize| {
            let (y, x) = ((i / width) as i64, (i % width) as i64);
            (-reach..=reach).map(|k| weight(k) * at(y + k * step.0, x + k * step.1)).sum::<f64>() / sum
        };
        (0..from.len()).map(one).collect()
    };
    pass(&pass(image, (0, 1)), (1, 0))
}
