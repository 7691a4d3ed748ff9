//! A second opinion on a hologram's picture: the PSNR that a slow, independent model finds on some rows of the image,
//! beside the engine's on the same rows.
//!
//! The independent model computes in f64. It shares the display's parameters with the engine, but no transform,
//! padding, transfer function or place between the pixels.

mod free_space;
mod frequencies;
mod kernels;
mod model;
mod modulator;
mod vectors;

use crate::display::{Carrier, Detector, DisplayModel, KernelShape, OpticalSetup, Orders};
use crate::error::Result;
use crate::hologram::{ShownLight, Wanted};
use crate::numerics::Plane;
use crate::numerics::quadrature::gauss_legendre;
use frequencies::{Frequencies, PANELS};
use model::Places;
use serde::{Deserialize, Serialize};

/// Memory of a complex number in f64.
const COMPLEX_BYTES: u64 = 16;

/// PSNR of a hologram's picture by two models, on the same rows of the image.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SecondOpinion {
    /// Number of rows of pixels that were compared, evenly distributed over the region of interest.
    pub rows: u32,
    /// PSNR of the engine's light \[dB\].
    pub engine_psnr_db: f64,
    /// PSNR of the independent model's light \[dB\].
    pub independent_psnr_db: f64,
}

/// Effort of a second opinion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Effort {
    /// Most rows of the image that are compared.
    pub rows_max: usize,
    /// Largest number of values of the transfer function that may be computed, for all modes of the light together. A
    /// kernel that varies over the SLM has many transfer functions. They count as one here, so such a kernel takes many
    /// times as long; its optimization does, too.
    pub values_max: u64,
}

impl Effort {
    /// Takes about as long as some steps of the optimization.
    pub const CHEAP: Self = Self { rows_max: 8, values_max: 1 << 28 };
    /// Takes minutes for a large display.
    pub const THOROUGH: Self = Self { rows_max: 128, values_max: 1 << 33 };
}

impl SecondOpinion {
    /// Difference of the two models above which they contradict each other \[dB\].
    pub const CONTRADICTION_DB: f64 = 0.5;

    /// PSNR of the independent model minus that of the engine \[dB\].
    #[must_use]
    pub fn difference_db(&self) -> f64 {
        self.independent_psnr_db - self.engine_psnr_db
    }

    /// Whether the two models differ by more than [`Self::CONTRADICTION_DB`].
    #[must_use]
    pub fn is_contradiction(&self) -> bool {
        self.difference_db().abs() > Self::CONTRADICTION_DB
    }

    /// Compares the light that the engine computed for `phases`, shown one after the other, with the independent
    /// model's, for one detector. The phases are those before the carrier is added. `None` where the model would take
    /// more than `effort` allows, and where no pixel of the compared rows counts.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for phases or a target of another size than the display.
    pub fn of(
        (model, carrier): (&DisplayModel, Option<Carrier>),
        phases: &[Plane<f32>],
        shown: &ShownLight,
        detector: Detector,
        wanted: Wanted<'_>,
        effort: Effort,
    ) -> Result<Option<Self>> {
        let Wanted { target, region, .. } = wanted;
        let grid = model.setup.grid();
        for plane in phases.iter().chain([target]) {
            plane.expect_size("phase or target", grid.height_px(), grid.width_px())?;
        }
        let has_bins = matches!(model.kernel, KernelShape::Bins(_));
        let modes = model.coherence.shares().len();
        let Some(frequencies) = affordable(&model.setup, has_bins, modes, effort) else { return Ok(None) };
        let rows = model::rows(&wanted, effort.rows_max);
        let (places, weights) = places(model, detector);
        let lights = model::light((model, carrier), phases, &places, &rows, &frequencies);
        let mut independent = Comparison::default();
        let mut engine = Comparison::default();
        let seen = shown.seen_by(detector);
        let columns = region.x_px()..region.x_px() + region.width_px();
        for (row, &y) in rows.iter().enumerate() {
            for x in columns.clone().filter(|&x| wanted.counts(y, x)) {
                let wanted = f64::from(target.at(y, x));
                if detector == Detector::Supersampled {
                    // The places are in the order of the samples: by y, then by x.
                    for (place, light) in lights.iter().enumerate() {
                        independent.add(light.at(row, x), wanted);
                        engine.add(f64::from(seen.at(2 * y + place / 2, 2 * x + place % 2)), wanted);
                    }
                } else {
                    independent.add(lights.iter().zip(&weights).map(|(light, w)| w * light.at(row, x)).sum(), wanted);
                    engine.add(f64::from(seen.at(y, x)), wanted);
                }
            }
        }
        let psnr = (engine.count > 0.0).then(|| (engine.psnr_db(), independent.psnr_db()));
        let rows = rows.len() as u32;
        Ok(psnr.map(|(engine_psnr_db, independent_psnr_db)| Self { rows, engine_psnr_db, independent_psnr_db }))
    }
}

/// Size of a second opinion on a hologram in one plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpinionSize {
    /// Values of spectra that are computed.
    pub values: u64,
    /// Frequencies along an axis.
    pub along_axis: u64,
    /// Memory for the kernel \[bytes\].
    kernel_bytes: u64,
    /// Rows whose light blurs into that of one row.
    pub rows_for_each: u64,
}

impl OpinionSize {
    /// Size for a kernel that is approximated by `kernels_per_side`² others, or has a value for each frequency
    /// (`has_bins`), and for a number of modes of light; `None` where it would take more than [`Effort::CHEAP`].
    pub(crate) fn of(setup: &OpticalSetup, has_bins: bool, kernels_per_side: usize, modes: usize) -> Option<Self> {
        let (frequencies, grid) = (affordable(setup, has_bins, modes, Effort::CHEAP)?, setup.grid());
        let (height, width) = (grid.height_px() as u64, grid.width_px() as u64);
        let windows = kernels::windows_per_side(kernels_per_side) as u64;
        let (spectra, kernel_bytes) = match has_bins {
            true => (kernels::SPECTRA_OF_BINS, 8 * COMPLEX_BYTES * height * width),
            false => (windows * windows, (windows - 1) * COMPLEX_BYTES * PANELS as u64 * height),
        };
        let values = frequencies.values();
        Some(Self {
            values: values * modes as u64 * spectra,
            along_axis: values.isqrt(),
            kernel_bytes,
            rows_for_each: 1,
        })
    }

    /// The same size for a display whose light blurs as that of `model`.
    pub(crate) fn blurred_as(self, model: &DisplayModel) -> Self {
        Self { rows_for_each: model::rows_for_each(model) as u64, ..self }
    }

    /// Memory of a second opinion with [`Effort::CHEAP`] on a display of this many rows and columns \[bytes\].
    pub(crate) fn bytes(&self, [height_px, width_px]: [usize; 2]) -> u64 {
        let (height, width) = (height_px as u64, width_px as u64);
        let rows = height.min(Effort::CHEAP.rows_max as u64 * self.rows_for_each);
        // The tables along y; the field, spectra of rows by rows and by panels, and the lines of the image.
        let places = 4;
        let along_y = self.along_axis * (rows * places + 2 * places * places);
        let fields = height * width + 2 * PANELS as u64 * height + rows * places * places * width;
        COMPLEX_BYTES * (along_y + fields) + self.kernel_bytes
    }
}

fn affordable(setup: &OpticalSetup, has_bins: bool, modes: usize, effort: Effort) -> Option<Frequencies> {
    let frequencies = Frequencies::of(setup, has_bins);
    (frequencies.values() * modes as u64 <= effort.values_max).then_some(frequencies)
}

/// Places in a pixel at which a detector measures, with the weights of their light.
fn places(model: &DisplayModel, detector: Detector) -> (Places, Vec<f64>) {
    let part = model.setup.camera_fill_factor();
    let [along_x, along_y] = match detector {
        Detector::Point => [vec![(0.0, 1.0)], vec![(0.0, 1.0)]],
        Detector::Supersampled => [vec![(-0.25, 0.5), (0.25, 0.5)], vec![(-0.25, 0.5), (0.25, 0.5)]],
        // The light has details of up to one cycle per pixel in the first order, and z_c/2z cycles in all orders.
        Detector::Pixel => {
            [model.setup.critical_distance_x_m(), model.setup.critical_distance_y_m()].map(|critical_m| {
                let nodes = match model.setup.orders() {
                    Orders::First | Orders::Filtered(_) => 4,
                    Orders::All { .. } => {
                        (critical_m / model.setup.distance_m().abs()).ceil().clamp(1.0, 8.0) as usize + 3
                    }
                };
                gauss_legendre(nodes).into_iter().map(|(node, weight)| (0.5 * part * node, 0.5 * weight)).collect()
            })
        }
    };
    let only = |nodes: &[(f64, f64)]| nodes.iter().map(|(node, _)| *node).collect();
    let places = Places { along_x: only(&along_x), along_y: only(&along_y) };
    let weights = along_y.iter().flat_map(|(_, y)| along_x.iter().map(move |(_, x)| x * y)).collect();
    (places, weights)
}

/// Sums from which the PSNR with the best gain follows.
#[derive(Clone, Copy, Debug, Default)]
struct Comparison {
    count: f64,
    light_squared: f64,
    light_times_wanted: f64,
    wanted_squared: f64,
}

impl Comparison {
    fn add(&mut self, light: f64, wanted: f64) {
        self.count += 1.0;
        self.light_squared += light * light;
        self.light_times_wanted += light * wanted;
        self.wanted_squared += wanted * wanted;
    }

    fn psnr_db(&self) -> f64 {
        let explained = match self.light_squared {
            0.0 => 0.0,
            squared => self.light_times_wanted * self.light_times_wanted / squared,
        };
        // Rounding of the difference ends at the square root of the precision, far below every hologram's error.
        let error = ((self.wanted_squared - explained) / self.count).max(1e-16);
        -10.0 * error.log10()
    }
}

#[cfg(test)]
mod tests;
