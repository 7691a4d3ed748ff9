//! The camera: from light to grey levels.
//!
//! ```text
//! level = round(w · clamp(b + r(I) + √(σ² + s I r′(I)²) · n, 0, 1)),   r(I) = I + c I (1 − I)
//! ```
//!
//! w is the value of white (255 in a photograph of 8 bits), I the exposed light (1 is full scale), b the black level, n
//! normal noise, σ the read noise as a part of full scale. s is the variance of the shot noise at full scale: 1/electrons
//! of a full pixel, or σ² when that number is not given. c is the nonlinearity of the response r.
//!
//! The order is that of a sensor: photons become electrons, whose number has shot noise; the amplifier of the pixel
//! turns electrons into a voltage, which is not quite linear; read noise and black level are added; the converter clips
//! and rounds. So the response acts on the shot noise, too, by its slope, and not on the read noise. Sources: J. R.
//! Janesick, *Photon Transfer* (2007); EMVA Standard 1288, Release 4.0 (2021).

use super::bench::SimulatedBench;
use super::draws::{Draws, Stream};
use lightpath_optics::{Plane, interrupt};
use rayon::prelude::*;

/// The camera of one bench, with drawn properties.
#[derive(Clone, Debug)]
pub(super) struct Camera {
    pub(super) black_level: f64,
    noise: f64,
    shot_variance: f64,
    nonlinearity: f64,
}

impl Camera {
    pub(super) fn draw(draws: &mut Draws, bench: &SimulatedBench) -> Self {
        let SimulatedBench { camera_noise: noise, full_well_electrons, camera_nonlinearity: nonlinearity, .. } = *bench;
        let shot_variance = if full_well_electrons > 0.0 { 1.0 / full_well_electrons } else { noise * noise };
        Self { black_level: draws.within_a_fifth_of(0.01), noise, shot_variance, nonlinearity }
    }

    /// The signal r(I) of some light, both in full scales, and its slope r′(I). Beyond full scale, where every
    /// photograph is clipped, the response is that of a linear camera, so that it keeps growing.
    pub(super) fn response(&self, light: f64) -> (f64, f64) {
        let inside = light.clamp(0.0, 1.0);
        let slope = if inside == light { 1.0 + self.nonlinearity * (1.0 - 2.0 * inside) } else { 1.0 };
        (light + self.nonlinearity * inside * (1.0 - inside), slope)
    }

    /// Takes a photograph of exposed light, of which white has the value `white`. `rounded` makes a value of a whole number.
    pub(super) fn photograph<T: Copy + Default + Send>(
        &self,
        light: &Plane<f32>,
        white: u16,
        noise_seed: u64,
        rounded: impl Fn(f64) -> T + Sync,
    ) -> Plane<T> {
        let (width_px, white) = (light.width_px(), f64::from(white));
        let mut photograph = Plane::filled(light.height_px(), width_px, T::default());
        photograph.values_mut().par_chunks_mut(width_px).enumerate().for_each(|(y, row)| {
            interrupt::check();
            let mut draws = Draws::of_row(noise_seed, Stream::Noise, y);
            for (level, &light) in row.iter_mut().zip(light.row(y)) {
                let light = f64::from(light);
                let (signal, slope) = self.response(light);
                let shot_variance = self.shot_variance * light.max(0.0) * slope * slope;
                let noise = (self.noise * self.noise + shot_variance).sqrt() * draws.normal();
                *level = rounded((white * (self.black_level + signal + noise).clamp(0.0, 1.0)).round());
            }
        });
        photograph
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(camera_noise: f64, camera_nonlinearity: f64) -> Camera {
        let bench =
            SimulatedBench { camera_noise, camera_nonlinearity, full_well_electrons: 400.0, ..SimulatedBench::FAIR };
        Camera { black_level: 0.0, ..Camera::draw(&mut Draws::new(1, Stream::Camera), &bench) }
    }

    #[test]
    fn response_grows_to_full_scale_and_has_its_slope() {
        for nonlinearity in [-0.3, -0.1, 0.0, 0.02, 0.3] {
            let camera = camera(0.0, nonlinearity);
            assert_eq!((camera.response(0.0).0, camera.response(1.0).0), (0.0, 1.0));
            assert!((camera.response(0.5).0 - 0.5 - nonlinearity / 4.0).abs() < 1e-15);
            for step in 1..150 {
                let light = f64::from(step) / 100.0;
                assert!(camera.response(light).0 > camera.response(light - 0.01).0);
                let slope = (camera.response(light + 1e-6).0 - camera.response(light - 1e-6).0) / 2e-6;
                // At full scale the slope jumps.
                assert!(step == 100 || (slope - camera.response(light).1).abs() < 1e-8, "{nonlinearity} {light}");
            }
        }
    }

    #[test]
    fn response_acts_on_shot_noise_and_not_on_read_noise() {
        // Mean and standard deviation of 100,000 pixels [levels].
        let measured = |camera: &Camera| {
            let levels = camera.photograph(&Plane::filled(100, 1000, 0.2), 255, 7, |level| level);
            let mean = levels.values().iter().sum::<f64>() / 1e5;
            (mean, (levels.values().iter().map(|level| (level - mean).powi(2)).sum::<f64>() / 1e5).sqrt())
        };
        for nonlinearity in [-0.3, 0.0, 0.3] {
            let camera = camera(0.02, nonlinearity);
            let (mean, spread) = measured(&camera);
            let slope = 1.0 + nonlinearity * (1.0 - 2.0 * 0.2);
            // Read noise, shot noise of 80 of 400 electrons, and rounding to levels.
            let expected = (0.02_f64.powi(2) + 0.2 / 400.0 * slope * slope + 1.0 / 12.0 / 255.0_f64.powi(2)).sqrt();
            // Five standard errors: 255·σ/√10⁵ of the mean, and σ/√(2·10⁵) of the deviation.
            assert!((mean - 255.0 * (0.2 + nonlinearity * 0.16)).abs() < 5.0 * 255.0 * expected / 316.0, "{mean}");
            assert!((spread - 255.0 * expected).abs() < 5.0 * 255.0 * expected / 447.0, "{spread}, {expected}");
        }
    }
}
