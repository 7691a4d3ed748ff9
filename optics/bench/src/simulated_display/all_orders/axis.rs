//! Size and tables of the computation along one axis of a display that shows all orders.

use crate::simulated_display::bench::SimulatedBench;
use crate::simulated_display::{modes, phasor};
use lightpath_fft::{Fft, FftPlanner};
use lightpath_optics::OpticalSetup;
use lightpath_optics::numerics::quadrature::gauss_legendre;
use num_complex::Complex64;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// Largest displacement by aberrations and by a ghost that is provided for \[px\].
const DISPLACED_PX: f64 = 32.0;
/// Smallest cosine of the angle between light and axis for which the frame is padded. Light nearer to the plane is
/// spread thinly.
const COSINE_MIN: f64 = 0.2;

/// Size of the computation along one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::simulated_display) struct AxisSize {
    pub(super) side_px: usize,
    pub(in crate::simulated_display) padded_px: usize,
    /// Orders to each side of the first one.
    orders_beside: usize,
    /// Number of places in a camera pixel.
    pub(in crate::simulated_display) places: usize,
    /// Frequencies at which the orders begin and end to fade out \[cycles per pixel\].
    fade: [f64; 2],
}

impl AxisSize {
    /// Number of orders.
    pub(in crate::simulated_display) fn orders(&self) -> usize {
        2 * self.orders_beside + 1
    }
}

/// Sizes along x and y for each mode of a bench's light.
pub(in crate::simulated_display) fn sizes(setup: &OpticalSetup, bench: &SimulatedBench) -> Vec<[AxisSize; 2]> {
    let shift_px = bench.misalignment_px + along_rail_px(setup, bench).abs();
    let modes = modes::draw(bench.seed, bench.source_angle_rad, bench.bandwidth, bench.ghost_share);
    modes.iter().map(|mode| axis_sizes(setup, mode.wavelength * setup.wavelength_m(), shift_px)).collect()
}

/// How far a tilted rail moves the image \[px\].
pub(in crate::simulated_display) fn along_rail_px(setup: &OpticalSetup, bench: &SimulatedBench) -> f64 {
    setup.distance_m() * bench.rail_tilt_rad.tan() / setup.grid().pixel_pitch_m()
}

/// `shift_px` is the largest shift of the image along an axis.
fn axis_sizes(setup: &OpticalSetup, wavelength_m: f64, shift_px: f64) -> [AxisSize; 2] {
    let (pitch_m, z_m) = (setup.grid().pixel_pitch_m(), setup.distance_m().abs());
    let sides_px = [setup.grid().width_px(), setup.grid().height_px()];
    let limit = pitch_m / wavelength_m;
    // Width of a Fresnel zone in the spectrum: over several of them the fading is smooth.
    let zone = pitch_m / (wavelength_m * z_m).sqrt();
    // Frequency of the light that moves by `way_px`.
    let reaching = |way_px: f64| limit * way_px * pitch_m / (way_px * pitch_m).hypot(z_m);
    let fades = sides_px.map(|side_px| {
        let begin = reaching(side_px as f64 + shift_px + DISPLACED_PX) + 2.0 * zone;
        // Waves do not travel beyond 1/λ.
        if begin + 4.0 * zone < limit { [begin, begin + 4.0 * zone] } else { [begin.min(0.9 * limit), limit] }
    });
    let sines = fades.map(|[_, end]| end / limit);
    let cosine = (1.0 - sines[0] * sines[0] - sines[1] * sines[1]).max(COSINE_MIN * COSINE_MIN).sqrt();
    [0, 1].map(|axis| {
        let (side_px, [_, end]) = (sides_px[axis], fades[axis]);
        let moved_px = z_m / pitch_m * sines[axis] / cosine + shift_px + DISPLACED_PX;
        // Detail of the light on a point, which comes from all pixels [cycles per pixel].
        let detail = (2.0 * reaching(side_px as f64 / 2.0) + 2.0 * zone + 0.5).min(2.0 * end);
        AxisSize {
            side_px,
            padded_px: transformed_fast(side_px + moved_px.ceil() as usize),
            orders_beside: (end - 0.5).ceil().max(0.0) as usize,
            places: (1.5 * detail).ceil() as usize + 3,
            fade: fades[axis],
        }
    })
}

/// The next even number without prime factors above 5.
fn transformed_fast(least: usize) -> usize {
    let is_fast = |n: &usize| {
        let mut rest = *n;
        for factor in [2, 3, 5] {
            while rest.is_multiple_of(factor) {
                rest /= factor;
            }
        }
        n.is_multiple_of(2) && rest == 1
    };
    (least.max(2)..).find(is_fast).unwrap_or(least)
}

/// Tables of one axis.
#[derive(Clone)]
pub(super) struct Axis {
    pub(super) size: AxisSize,
    /// √a sinc(aν), the fading and the shift, over the number of samples: for each order all bins.
    pub(super) factors: Vec<Complex64>,
    /// e^{i2πνd} for each place d, and the weight of the place.
    pub(super) places: Vec<(Vec<Complex64>, f64)>,
    pub(super) forward: Arc<dyn Fft<f64>>,
    pub(super) inverse: Arc<dyn Fft<f64>>,
}

impl Axis {
    /// `camera_part`: the part of a camera pixel's side that sees light.
    pub(super) fn new(size: AxisSize, fill_factor: f64, camera_part: f64, shift_px: f64) -> Self {
        let frequencies: Vec<f64> = (0..size.orders() * size.padded_px).map(|fine| frequency(&size, fine)).collect();
        let [begin, end] = size.fade;
        let factor = |&frequency: &f64| {
            let faded = ((frequency.abs() - begin) / (end - begin)).clamp(0.0, 1.0);
            let share = if faded < 1.0 { 0.5 + 0.5 * (PI * faded).cos() } else { 0.0 };
            let angle = PI * fill_factor * frequency;
            let sinc = if angle == 0.0 { 1.0 } else { angle.sin() / angle };
            phasor(frequency * shift_px) * share * fill_factor.sqrt() * sinc / size.padded_px as f64
        };
        let nodes = gauss_legendre(size.places);
        let turns = |place_px: f64| frequencies.iter().map(|f| Complex64::cis(TAU * f * place_px)).collect();
        Self {
            size,
            factors: frequencies.iter().map(factor).collect(),
            places: nodes.iter().map(|(at, weight)| (turns(0.5 * camera_part * at), 0.5 * weight)).collect(),
            forward: FftPlanner::new().plan_fft_forward(size.padded_px),
            inverse: FftPlanner::new().plan_fft_inverse(size.padded_px),
        }
    }

    /// Σ over the orders of values times turns: for each bin of the padded frame.
    pub(super) fn folded(&self, values: &[Complex64], turns: &[Complex64], folded: &mut [Complex64]) {
        folded.fill(Complex64::ZERO);
        let bins = self.size.padded_px;
        for (values, turns) in values.chunks_exact(bins).zip(turns.chunks_exact(bins)) {
            folded.iter_mut().zip(values).zip(turns).for_each(|((sum, value), turn)| *sum += value * turn);
        }
    }

    /// The adjoint of [`Self::folded`], which adds to `values`.
    pub(super) fn unfold(&self, folded: &[Complex64], turns: &[Complex64], values: &mut [Complex64]) {
        let bins = self.size.padded_px;
        for (values, turns) in values.chunks_exact_mut(bins).zip(turns.chunks_exact(bins)) {
            values.iter_mut().zip(folded).zip(turns).for_each(|((sum, value), turn)| *sum += value * turn.conj());
        }
    }
}

/// Frequency of a bin of the orders [cycles per pixel].
pub(super) fn frequency(size: &AxisSize, fine: usize) -> f64 {
    let (order, bin) = ((fine / size.padded_px) as f64, fine % size.padded_px);
    let bin = if 2 * bin < size.padded_px { bin as f64 } else { bin as f64 - size.padded_px as f64 };
    order - size.orders_beside as f64 + bin / size.padded_px as f64
}

/// Index of the nearest frequency of the band in a table from −½ to ½ cycle per pixel.
pub(super) fn band_index(size: &AxisSize, frequency: f64) -> usize {
    ((frequency.clamp(-0.5, 0.5) + 0.5) * size.padded_px as f64).round() as usize
}
