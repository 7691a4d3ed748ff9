//! The transfer functions of the methods that are convolutions.

use super::ConvolutionMethod;
use super::fresnel_impulse_response::spectrum_along_axis;
use super::impulse_response::EvenSpectrum;
use crate::OpticalSetup;
use num_complex::Complex64;

/// The transfer function of a setup by the setup's method, ready to be asked at many padded bins.
///
/// Made by [`OpticalSetup::sampled`]. The same as [`OpticalSetup::transfer`], which sums impulse responses up anew at each
/// frequency.
#[derive(Clone, Debug)]
pub struct SampledTransfer {
    setup: OpticalSetup,
    tables: Tables,
}

#[derive(Clone, Debug)]
enum Tables {
    /// A formula needs none.
    Formula,
    /// Along x and y at each padded bin.
    Separable([Vec<Complex64>; 2]),
    Even(EvenSpectrum),
}

impl SampledTransfer {
    pub(crate) fn new(setup: OpticalSetup) -> Self {
        let grid = setup.grid();
        let spectrum =
            |samples| spectrum_along_axis(samples, grid.pixel_pitch_m(), setup.wavelength_m(), setup.distance_m());
        let tables = match setup.method() {
            ConvolutionMethod::FresnelImpulseResponse => {
                Tables::Separable([spectrum(grid.width_px()), spectrum(grid.height_px())])
            }
            ConvolutionMethod::RayleighSommerfeld => Tables::Even(EvenSpectrum::new(&setup)),
            _ => Tables::Formula,
        };
        Self { setup, tables }
    }

    /// H at the padded bin that is nearest to fx, fy \[1/m\].
    #[must_use]
    pub fn at(&self, fx: f64, fy: f64) -> Complex64 {
        let bin = |f: f64, side_px: usize| {
            let bins = 2 * side_px;
            (f * self.setup.grid().pixel_pitch_m() * bins as f64).round().rem_euclid(bins as f64) as usize % bins
        };
        let (u, v) = (bin(fx, self.setup.grid().width_px()), bin(fy, self.setup.grid().height_px()));
        match &self.tables {
            Tables::Formula => self.setup.transfer(fx, fy),
            Tables::Separable([along_x, along_y]) => along_x[u] * along_y[v],
            Tables::Even(spectrum) => spectrum.at_bins(u, v),
        }
    }
}
