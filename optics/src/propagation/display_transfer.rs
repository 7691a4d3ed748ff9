//! The transfer function of a display, with the errors of its model.

use crate::display::{DisplayModel, KernelShape};
use num_complex::{Complex32, Complex64};

/// Transfer function of the display.
impl DisplayModel {
    /// Transfer function H of the first mode at the frequency fx, fy \[1/m\], on the axis. If the setup's method is an
    /// impulse response, each call computes a sum over the frame.
    #[must_use]
    pub fn transfer(&self, fx: f64, fy: f64) -> Complex64 {
        self.beside_ideal(fx, fy, |fx, fy| self.setup.transfer(fx, fy))
    }

    /// Returns a function that computes [`Self::transfer`] at padded bins from tables, for many bins. A kernel with a value
    /// for each bin needs no tables.
    pub fn sampled(&self) -> impl Fn(f64, f64) -> Complex64 + Sync + '_ {
        let ideal = (!matches!(self.kernel, KernelShape::Bins(_))).then(|| self.setup.sampled());
        let ideal_at = move |fx, fy| ideal.as_ref().map_or(Complex64::ONE, |ideal| ideal.at(fx, fy));
        move |fx, fy| self.beside_ideal(fx, fy, &ideal_at)
    }

    fn beside_ideal(&self, fx: f64, fy: f64, ideal: impl Fn(f64, f64) -> Complex64) -> Complex64 {
        let pitch_m = self.setup.grid().pixel_pitch_m();
        match &self.kernel {
            KernelShape::Ideal => ideal(fx, fy),
            KernelShape::Smooth(errors) => {
                let (x, y) = (2.0 * pitch_m * fx, 2.0 * pitch_m * fy);
                ideal(fx, fy) * errors.value(x, y) * self.ghost.factor(x, y)
            }
            KernelShape::Bins(bins) => {
                let index = |f: f64, padded: usize, side: usize| {
                    let i = (f * pitch_m * padded as f64).round() + (side / 2) as f64;
                    (0.0..side as f64).contains(&i).then_some(i as usize)
                };
                let y = index(fy, self.setup.padded_height_px(), bins.height_px());
                let x = index(fx, self.setup.padded_width_px(), bins.width_px());
                let value = y.zip(x).map_or(Complex32::ZERO, |(y, x)| bins.at(y, x));
                Complex64::new(value.re.into(), value.im.into())
            }
        }
    }
}
