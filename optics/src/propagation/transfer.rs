//! The transfer functions of the convolution methods.

use super::band_response::band_response;
use super::even::{EvenSpectrum, even_sum};
use super::fresnel_impulse_response::{fresnel_impulse_spectrum, spectrum_along_axis};
use super::fresnel_transfer_function::fresnel_transfer_function;
use super::impulse_response::sampled_response;
use super::limits;
use super::pixel_response::PixelResponse;
use super::planner::plan_convolution;
use super::report::ValidityReport;
use super::row_spectra::transfer_by_column;
use super::shifted::{landing_m, shifted_angular_spectrum};
use super::transfer_function::{angular_spectrum, band_limit};
use crate::display::OpticalSetup;
use crate::error::Result;
use crate::propagation_method::ConvolutionMethod;
use num_complex::{Complex32, Complex64};

/// Choice of the method, and the transfer function of the chosen method.
impl OpticalSetup {
    /// This setup with another convolution method.
    ///
    /// # Errors
    ///
    /// [`Error::Unsuitable`](crate::Error::Unsuitable), with the numbers, for a method that cannot be valid for this
    /// setup.
    pub fn with_method(self, method: ConvolutionMethod) -> Result<Self> {
        let setup = self.with_method_regardless(method);
        limits::check(&setup, setup.method().into(), &setup.window())?;
        Ok(setup)
    }

    /// This setup with the convolution method that [`plan`](super::plan) chooses, and the report about that method.
    ///
    /// # Errors
    ///
    /// [`Error::Unsuitable`](crate::Error::Unsuitable), with the numbers, where no method can be valid.
    pub fn planned(self) -> Result<(Self, ValidityReport)> {
        let (method, report) = plan_convolution(&self)?;
        Ok((self.with_method(method)?, report))
    }

    /// The transfer function at fx, fy \[1/m\], without the piston. [`propagation`](super) has the formulas.
    ///
    /// Methods with an impulse response sum over the whole frame in each call; behind a filter each call samples all
    /// bins and returns the nearest one. Use [`Self::sampled`] to sample many bins.
    #[must_use]
    pub fn transfer(&self, fx: f64, fy: f64) -> Complex64 {
        let (wavelength_m, distance_m, grid) = (self.wavelength_m(), self.distance_m(), self.grid());
        match self.method() {
            ConvolutionMethod::BandLimited if self.keeps(fx, fy) => angular_spectrum(fx, fy, wavelength_m, distance_m),
            ConvolutionMethod::Shifted if self.keeps(fx, fy) => {
                let window = self.window();
                shifted_angular_spectrum(fx, fy, wavelength_m, distance_m, window.centre_x_m(), window.centre_y_m())
            }
            ConvolutionMethod::BandLimited | ConvolutionMethod::Shifted => Complex64::ZERO,
            ConvolutionMethod::FresnelTransferFunction => fresnel_transfer_function(fx, fy, wavelength_m, distance_m),
            ConvolutionMethod::FresnelImpulseResponse => {
                let along =
                    |f, samples| fresnel_impulse_spectrum(f, samples, grid.pixel_pitch_m(), wavelength_m, distance_m);
                along(fx, grid.width_px()) * along(fy, grid.height_px())
            }
            ConvolutionMethod::BandResponse if self.orders().filter().is_some() => self.sampled().at(fx, fy),
            ConvolutionMethod::BandResponse => {
                let (response, row) = (band_response(self), grid.width_px() + 1);
                self.spectrum_of(fx, fy, |y, x| response[y * row + x])
            }
            ConvolutionMethod::AllOrders => self.spectrum_of(fx, fy, pixels_response(self)),
            ConvolutionMethod::RayleighSommerfeld => self.spectrum_of(fx, fy, sampled_response(self)),
            ConvolutionMethod::AngularSpectrum => angular_spectrum(fx, fy, wavelength_m, distance_m),
        }
    }

    /// Transfer function of an even impulse response at a frequency \[1/m\], computed in O(pixels).
    fn spectrum_of(&self, fx: f64, fy: f64, response: impl Fn(usize, usize) -> Complex64) -> Complex64 {
        let (grid, pitch_m) = (self.grid(), self.grid().pixel_pitch_m());
        even_sum(grid.height_px(), grid.width_px(), fx * pitch_m, fy * pitch_m, response)
    }

    /// The transfer function with its tables computed once, for sampling many bins.
    #[must_use]
    pub fn sampled(&self) -> SampledTransfer {
        SampledTransfer::new(*self)
    }

    /// The transfer function of an engine's kernel without errors, with tables: that of the setup, or 1 where each
    /// sub-sample has a [transfer function of its own](super::row_spectra).
    pub(crate) fn sampled_kernel(&self) -> SampledTransfer {
        match self.method() {
            ConvolutionMethod::AllOrders => SampledTransfer { setup: *self, tables: Tables::One },
            _ => self.sampled(),
        }
    }

    /// Whether the light of frequency fx, fy \[1/m\] lands within the padded frame. Samples at such frequencies are
    /// free of aliasing. This is the [band limit](band_limit), or its one-sided form for the shifted method.
    #[must_use]
    pub fn keeps(&self, fx: f64, fy: f64) -> bool {
        let pitch_m = self.grid().pixel_pitch_m();
        let (extent_x_m, extent_y_m) =
            (self.padded_width_px() as f64 * pitch_m, self.padded_height_px() as f64 * pitch_m);
        if self.method() != ConvolutionMethod::Shifted {
            return band_limit(fx, fy, self.wavelength_m(), self.distance_m(), extent_x_m, extent_y_m);
        }
        let window = self.window();
        landing_m(fx, fy, self.wavelength_m(), self.distance_m()).is_some_and(|(x_m, y_m)| {
            (x_m - window.centre_x_m()).abs() <= extent_x_m / 2.0
                && (y_m - window.centre_y_m()).abs() <= extent_y_m / 2.0
        })
    }
}

/// The response of square pixels at their centres: at the lags between two pixels of the frame, and 0 at the lag of a
/// whole side.
fn pixels_response(setup: &OpticalSetup) -> impl Fn(usize, usize) -> Complex64 + Sync {
    let (height_px, width_px, pitch_m) =
        (setup.grid().height_px(), setup.grid().width_px(), setup.grid().pixel_pitch_m());
    let response = PixelResponse::new(setup);
    move |y, x| {
        if y >= height_px || x >= width_px {
            return Complex64::ZERO;
        }
        response.at(x as f64 * pitch_m, y as f64 * pitch_m)
    }
}

/// The transfer function of a setup, with tables for fast sampling at many padded bins.
///
/// [`OpticalSetup::sampled`] makes it. Its values equal those of [`OpticalSetup::transfer`], which sums the impulse
/// response again at each frequency.
#[derive(Clone, Debug)]
pub struct SampledTransfer {
    setup: OpticalSetup,
    tables: Tables,
}

#[derive(Clone, Debug)]
enum Tables {
    /// A formula gives the transfer function; there is no table.
    Formula,
    /// The factors along x and along y at each padded bin.
    Separable([Vec<Complex64>; 2]),
    Even(EvenSpectrum),
    /// The value at each padded bin, for each column all rows.
    ByColumn(Vec<Complex32>),
    /// 1 at all bins.
    One,
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
            ConvolutionMethod::BandResponse if setup.orders().filter().is_some() => {
                Tables::ByColumn(transfer_by_column(&setup))
            }
            ConvolutionMethod::BandResponse => {
                let (response, row) = (band_response(&setup), grid.width_px() + 1);
                // Moved, so that the lags are dropped when they are transformed.
                let h = move |y: usize, x: usize| response[y * row + x];
                Tables::Even(EvenSpectrum::new(grid.height_px(), grid.width_px(), h))
            }
            ConvolutionMethod::AllOrders => {
                Tables::Even(EvenSpectrum::new(grid.height_px(), grid.width_px(), pixels_response(&setup)))
            }
            ConvolutionMethod::RayleighSommerfeld => {
                Tables::Even(EvenSpectrum::new(grid.height_px(), grid.width_px(), sampled_response(&setup)))
            }
            _ => Tables::Formula,
        };
        Self { setup, tables }
    }

    /// H at the padded bin that is nearest to fx, fy \[1/m\].
    #[must_use]
    pub fn at(&self, fx: f64, fy: f64) -> Complex64 {
        let bin = |f: f64, side_px: usize| {
            let bins = 2 * side_px;
            let position = f * self.setup.grid().pixel_pitch_m() * bins as f64;
            // A cast rounds down from positive numbers, much faster than `round` does.
            match (position + bins as f64 + 0.5) as usize {
                bin if position >= -0.5 && bin < 2 * bins => bin - bins,
                bin if position > -(bins as f64) && bin < bins => bin,
                _ => position.round().rem_euclid(bins as f64) as usize % bins,
            }
        };
        let (u, v) = (bin(fx, self.setup.grid().width_px()), bin(fy, self.setup.grid().height_px()));
        match &self.tables {
            Tables::Formula => self.setup.transfer(fx, fy),
            Tables::Separable([along_x, along_y]) => along_x[u] * along_y[v],
            Tables::Even(spectrum) => spectrum.at_bins(u, v),
            Tables::ByColumn(values) => {
                let value = values.get(u * 2 * self.setup.grid().height_px() + v).copied().unwrap_or_default();
                Complex64::new(value.re.into(), value.im.into())
            }
            Tables::One => Complex64::ONE,
        }
    }
}
