//! Holograms that are optimized through the bench itself.
//!
//! ```text
//! min over φ of  min over s of  mean over the region of ( s · r(I(φ)) − target )²
//! ```
//!
//! I is the light on the camera's pixels, without noise, and r the camera's response. A learned model can at best be
//! the bench, so the photographs of these holograms are the yardstick for those of learned models.

use super::SimulatedDisplay;
use lightpath_optics::numerics::optimizer::limited_memory::{LimitedMemory, Workspace};
use lightpath_optics::{Plane, RegionOfInterest, Result};

impl SimulatedDisplay {
    /// Optimizes the displayed phase \[rad\] by L-BFGS with `evaluations` evaluations from the phase `start`, through
    /// all that the bench does to light, and the camera's response. The gain of the photograph is free. Slow:
    /// everything is computed in f64.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](lightpath_optics::Error::SizeMismatch) or [`Error::NotFinite`](lightpath_optics::Error::NotFinite) for a start
    /// or a target that does not fit the display.
    pub fn optimize(
        &self,
        target: &Plane<f32>,
        region: RegionOfInterest,
        start: &Plane<f32>,
        evaluations: u32,
    ) -> Result<Plane<f32>> {
        let (height_px, width_px) = (start.height_px(), start.width_px());
        target.expect_size("target", height_px, width_px)?;
        target.expect_finite("target")?;
        let mut state = LimitedMemory::new(start.values().to_vec());
        let mut workspace = Workspace::default();
        for _ in 0..evaluations {
            let mut failure = None;
            state.advance(&mut workspace, |phase, gradient| {
                let evaluated = Plane::try_from_vec(height_px, width_px, phase.to_vec())
                    .and_then(|phase| self.loss_and_gradient(&phase, target, region));
                match evaluated {
                    Ok((loss, of_phase)) => {
                        gradient.iter_mut().zip(of_phase.values()).for_each(|(out, &value)| *out = value as f32);
                        loss
                    }
                    Err(error) => {
                        failure = Some(error);
                        f64::NAN
                    }
                }
            });
            if let Some(error) = failure {
                return Err(error);
            }
        }
        Plane::try_from_vec(height_px, width_px, state.point)
    }

    /// The mean squared error over the region at the best gain, and its gradient with respect to the phase.
    fn loss_and_gradient(
        &self,
        phase: &Plane<f32>,
        target: &Plane<f32>,
        region: RegionOfInterest,
    ) -> Result<(f64, Plane<f64>)> {
        let pixels = region.pixels() as f64;
        let mut loss = 0.0;
        let slope = |light: &Plane<f64>| {
            let light_slope = light.map(|light| self.camera.response(light).1);
            let light = light.map(|light| self.camera.response(light).0);
            let columns = |y: usize| region.columns(y).unwrap_or_default();
            let places = || (0..light.height_px()).flat_map(|y| columns(y).map(move |x| (y, x)));
            let sum = |of: &dyn Fn(f64, f64) -> f64| {
                places().map(|(y, x)| of(light.at(y, x), f64::from(target.at(y, x)))).sum::<f64>()
            };
            let gain = sum(&|light, target| light * target) / sum(&|light, _| light * light).max(f64::MIN_POSITIVE);
            loss = sum(&|light, target| (gain * light - target).powi(2)) / pixels;
            Plane::from_fn(light.height_px(), light.width_px(), |y, x| {
                let inside = columns(y).contains(&x);
                let error = gain * light.at(y, x) - f64::from(target.at(y, x));
                if inside { 2.0 * gain * error * light_slope.at(y, x) / pixels } else { 0.0 }
            })
        };
        let gradient = self.gradient(phase, slope)?;
        Ok((loss, gradient))
    }
}

#[cfg(test)]
mod tests {
    use crate::simulated_display::SimulatedDisplay;
    use crate::simulated_display::bench::SimulatedBench;
    use lightpath_optics::hologram::initial_phase;
    use lightpath_optics::{Grid, OpticalSetup, Orders, Plane, RegionOfInterest};

    fn all_flaws() -> SimulatedBench {
        SimulatedBench {
            seed: 3,
            misalignment_px: 0.3,
            rotation_rad: 0.3_f64.to_radians(),
            blur_px: 0.4,
            speckle_contrast: 0.05,
            crosstalk_px: 0.45,
            crosstalk_y_px: 0.3,
            flicker: 0.05,
            surface_waves: 1.5,
            response_variation: 0.12,
            dust_contrast: 0.1,
            ghost_share: 0.02,
            source_angle_rad: 0.4e-3,
            bandwidth: 0.005,
            distortion: 0.01,
            vignetting: 0.2,
            camera_nonlinearity: -0.2,
            ..SimulatedBench::FAIR
        }
    }

    #[test]
    fn gradient_of_every_flaw_matches_central_differences() {
        let grid = Grid::try_new(14, 18, 8e-6).unwrap();
        let first = OpticalSetup::try_new(grid, 515e-9, 2e-3).unwrap();
        let region = RegionOfInterest::middle(&grid);
        // Phases away from 0, where they would wrap.
        let phase = initial_phase(14, 18, 5.0, 3).unwrap().map(|phase| phase + 0.6);
        let target = Plane::from_fn(14, 18, |y, x| 0.5 + 0.4 * ((y * 2 + x * 3) as f32).sin());
        let varying = SimulatedBench { field_aberration_rad: 2.0, ..SimulatedBench::FAIR };
        let all = OpticalSetup::try_new(grid, 515e-9, 6e-3).unwrap();
        let all = all.with_orders(Orders::All { fill_factor_x: 0.9, fill_factor_y: 0.8 }).unwrap();
        // Two wavelengths and three directions say the same as one of each, and take six times as long.
        let coherent = SimulatedBench { source_angle_rad: 0.0, bandwidth: 0.0, ..all_flaws() };
        for (setup, bench) in [
            (first, SimulatedBench::FAIR),
            (first, all_flaws()),
            (first, varying),
            (all, coherent),
            (all, SimulatedBench { bandwidth: 0.02, ..SimulatedBench::FAIR }),
            (all, varying),
        ] {
            let display = SimulatedDisplay::draw(setup, None, bench).unwrap();
            let (_, gradient) = display.loss_and_gradient(&phase, &target, region).unwrap();
            let scale = gradient.values().iter().fold(0.0_f64, |largest, g| largest.max(g.abs()));
            let points: &[usize] = if setup == first { &[0, 40, 111, 126, 200, 251] } else { &[40, 126, 251] };
            for &at in points {
                let step = |h: f32| {
                    let mut moved = phase.clone();
                    moved.values_mut()[at] += h;
                    (f64::from(moved.values()[at]), display.loss_and_gradient(&moved, &target, region).unwrap().0)
                };
                let ((after, high), (before, low)) = (step(2e-3), step(-2e-3));
                let difference = (high - low) / (after - before);
                assert!((gradient.values()[at] - difference).abs() < 1e-4 * scale, "{bench:?}, {at}: {difference}");
            }
        }
    }
}
