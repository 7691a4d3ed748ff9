//! The slow twin of the processor's [`FieldAdjoint`]: light and gradient from their definitions in f64.
//!
//! Numbers of the modulator, the ghost and the blur are moved, and what they move is compared. It shares the parts of a
//! display with the fit, and nothing of how that computes. It knows displays that show the first order of their pixels.

use super::adjoint::{Adjoint, FieldAdjoint, ModeAdjoint, ModulatorAdjoint, SeriesGradient};
use super::fit::variation_degrees;
use super::layout::Layout;
use super::pair::Example;
use crate::display::parts::{Block, light_blur};
use crate::display::{Carrier, Detector, DisplayModel};
use crate::engine::photometry::Sums;
use crate::numerics::Plane;
use crate::numerics::chebyshev::{ChebyshevBasis, polynomials};
use crate::numerics::fourier::{Direction, fft2};
use crate::numerics::grid::frequency;
use crate::reference::display_light::{Optics, behind_modulator, image, spread};
use num_complex::Complex64;

/// By how much a number is moved up and down.
const STEP: f64 = 1e-5;

#[derive(Debug)]
pub(super) struct PlainAdjoint {
    pub(super) model: DisplayModel,
    pub(super) layout: Layout,
    pub(super) detector: Detector,
    pub(super) carrier: Option<Carrier>,
}

struct Light {
    /// Blurred light of each light plane of the detector.
    blurred: Vec<Plane<f64>>,
    /// For each mode the field at each place in a pixel.
    images: Vec<Vec<Place>>,
}

struct Place {
    /// Light plane to which the field adds `factor` times its light.
    light_plane: usize,
    factor: f64,
    /// Transfer function of each window to this place.
    transfers: Vec<Plane<Complex64>>,
    /// Padded field.
    field: Plane<Complex64>,
}

impl PlainAdjoint {
    fn light(&self, phase: &Plane<f64>) -> (Optics, Vec<Plane<Complex64>>, Light) {
        let (optics, places) = (Optics::new(&self.model, self.detector), self.detector.places_px().len());
        let spectra = optics.spectra(&behind_modulator(&self.model, self.carrier, phase.values()));
        let planes = if self.detector == Detector::Supersampled { places } else { 1 };
        let mut sharp = vec![Plane::filled(phase.height_px(), phase.width_px(), 0.0); planes];
        let mut images = Vec::new();
        for (share, to_places) in &optics.modes {
            let of_place = |(at, transfers): (usize, &Vec<Plane<Complex64>>)| {
                let (light_plane, factor) = (at % planes, share * planes as f64 / places as f64);
                let field = image(&spectra, transfers);
                for (i, light) in sharp[light_plane].values_mut().iter_mut().enumerate() {
                    *light += factor * field.at(i / phase.width_px(), i % phase.width_px()).norm_sqr();
                }
                Place { light_plane, factor, transfers: transfers.clone(), field }
            };
            images.push(to_places.iter().enumerate().map(of_place).collect());
        }
        let blurred = sharp.iter().map(|light| light_blur::blurred_light(light, &self.model.light_blur)).collect();
        (optics, spectra, Light { blurred, images })
    }

    /// Place, weight and photograph of each pixel of the region.
    fn pixels<'a>(example: &'a Example<f64>) -> impl Iterator<Item = ([usize; 2], f64, f64)> + 'a {
        let rows = example.region.y_px()..example.region.y_px() + example.region.height_px();
        let columns = example.region.x_px()..example.region.x_px() + example.region.width_px();
        let at = rows.flat_map(move |y| columns.clone().map(move |x| (y, x)));
        at.map(|(y, x)| ([y, x], example.weight.at(y, x), example.photo.at(y, x)))
    }

    fn sums(lights: &[Plane<f64>], example: &Example<f64>, (gain, offset): (f64, f64)) -> Sums {
        let mut sums = Sums::default();
        for (light, ([y, x], w, t)) in lights.iter().flat_map(|light| Self::pixels(example).map(move |at| (light, at)))
        {
            let p = light.at(y, x);
            let e = gain * p + offset - t;
            sums.add(&Sums {
                w,
                p: w * p,
                pp: w * p * p,
                t: w * t,
                tp: w * t * p,
                tt: w * t * t,
                ee: w * e * e,
                e: w * e,
                ep: w * e * p,
            });
        }
        sums
    }

    /// ∂L/∂n of each number of the model that `numbers` gives, from the losses to both sides.
    fn by_moved_loss<const N: usize>(
        &self,
        example: &Example<f64>,
        exposure: (f64, f64),
        number: impl Fn(&mut DisplayModel, usize) -> &mut f64,
    ) -> [f64; N] {
        std::array::from_fn(|i| {
            let [above, below] = [STEP, -STEP].map(|step| {
                let mut model = self.model.clone();
                *number(&mut model, i) += step;
                let (_, _, light) = Self { model, ..*self }.light(&example.phase);
                Self::sums(&light.blurred, example, exposure).loss()
            });
            (above - below) / (2.0 * STEP)
        })
    }

    /// ∂L/∂n = 2 Re Σ b* ∂c/∂n of some numbers of the modulator.
    fn by_moved_field(
        &self,
        example: &Example<f64>,
        b: &[Complex64],
        count: usize,
        number: impl Fn(&mut DisplayModel, usize) -> &mut f64,
    ) -> Vec<f64> {
        let of_number = |i: usize| {
            let [above, below] = [STEP, -STEP].map(|step| {
                let mut model = self.model.clone();
                *number(&mut model, i) += step;
                behind_modulator(&model, self.carrier, example.phase.values())
            });
            let moved = above.values().iter().zip(below.values()).map(|(above, below)| (above - below) / (2.0 * STEP));
            b.iter().zip(moved).map(|(b, c)| 2.0 * (b.conj() * c).re).sum()
        };
        (0..count).map(of_number).collect()
    }

    fn modulator(&self, example: &Example<f64>, b: &[Complex64]) -> ModulatorAdjoint {
        let wanted = |block, count| if self.layout.blocks.contains(block) { count } else { 0 };
        let by = |count: usize, number: fn(&mut DisplayModel, usize) -> &mut f64| {
            self.by_moved_field(example, b, count, number)
        };
        let terms = self.layout.source.terms();
        let zero_order = by(2, |model, i| if i == 0 { &mut model.zero_order.re } else { &mut model.zero_order.im });
        let mut crosstalk = by(wanted(Block::Crosstalk, 2), |model, i| match i {
            0 => &mut model.crosstalk.ratio_x,
            _ => &mut model.crosstalk.ratio_y,
        });
        crosstalk.resize(2, 0.0);
        let coefficients = variation_degrees().count();
        let mut variation =
            by(wanted(Block::UnevenResponse, coefficients), |model, i| &mut model.response_variation.coefficients[i]);
        variation.resize(coefficients, 0.0);
        let response = by(2 * self.model.response.len(), |model, i| &mut model.response[i / 2][i % 2]);
        ModulatorAdjoint {
            source: (
                by(terms, |model, i| &mut model.source.log_amplitude[i]),
                by(terms, |model, i| &mut model.source.phase[i]),
            ),
            response: response.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect(),
            zero_order: [zero_order[0], zero_order[1]],
            crosstalk: [crosstalk[0], crosstalk[1]],
            variation,
        }
    }
}

/// 2 Re Σ_f H u g* T and −2 Im Σ_f H u g* T for each term T of a series.
fn by_series(basis: ChebyshevBasis, products: &Plane<Complex64>) -> SeriesGradient {
    let (rows, columns) = (products.height_px(), products.width_px());
    let at = |bin, bins| polynomials(basis.order(), 2.0 * frequency(bin, bins, 1.0));
    let [along_x, along_y] = [columns, rows].map(|bins| (0..bins).map(|bin| at(bin, bins)).collect::<Vec<_>>());
    let sum = |(i, j): (usize, usize)| -> Complex64 {
        let bins = (0..rows).flat_map(|v| (0..columns).map(move |u| (v, u)));
        bins.map(|(v, u)| products.at(v, u) * along_x[u][i] * along_y[v][j]).sum()
    };
    basis.degrees().map(|degrees| (2.0 * sum(degrees).re, -2.0 * sum(degrees).im)).unzip()
}

impl FieldAdjoint<f64> for PlainAdjoint {
    fn set(&mut self, _plane: usize, layout: &Layout, model: &DisplayModel) {
        (self.layout, self.model) = (*layout, model.clone());
    }

    fn measure(&mut self, example: &Example<f64>) -> Sums {
        let (_, _, light) = self.light(&example.phase);
        Self::sums(&light.blurred, example, (1.0, 0.0))
    }

    fn adjoint(&mut self, example: &Example<f64>) -> (Sums, Adjoint) {
        let (optics, spectra, Light { blurred, images }) = self.light(&example.phase);
        let exposure = Self::sums(&blurred, example, (1.0, 0.0)).best_gain_and_offset();
        let ((gain, offset), sums) = (exposure, Self::sums(&blurred, example, exposure));
        // ∂L/∂p before the blur.
        let slopes = |light: &Plane<f64>| {
            let mut slopes = Plane::filled(light.height_px(), light.width_px(), 0.0);
            for ([y, x], w, t) in Self::pixels(example) {
                let slope = 2.0 * gain * w / sums.w * (gain * light.at(y, x) + offset - t);
                slopes.values_mut()[y * light.width_px() + x] = slope;
            }
            spread(&self.model, &slopes)
        };
        let slopes: Vec<_> = blurred.iter().map(slopes).collect();
        let (height_px, width_px) = (example.phase.height_px(), example.phase.width_px());
        let mut b = vec![Complex64::ZERO; height_px * width_px];
        let mut of_mode = |places: &Vec<Place>| {
            let mut mode = ModeAdjoint::default();
            let mut products = vec![Plane::filled(2 * height_px, 2 * width_px, Complex64::ZERO); spectra.len()];
            for Place { light_plane, factor, transfers, field } in places {
                let g = Plane::from_fn(height_px, width_px, |y, x| {
                    field.at(y, x) * (factor * slopes[*light_plane].at(y, x))
                });
                let lights = (0..height_px).flat_map(|y| (0..width_px).map(move |x| (y, x)));
                mode.light += lights.map(|(y, x)| (g.at(y, x).conj() * field.at(y, x)).re).sum::<f64>();
                optics.add_returned(&g, transfers, &mut b);
                let padded = Plane::from_fn(2 * height_px, 2 * width_px, |y, x| {
                    if y < height_px && x < width_px { g.at(y, x) } else { Complex64::ZERO }
                });
                let bins = (4 * height_px * width_px) as f64;
                let back = fft2(&padded, Direction::Forward);
                for ((products, transfer), u) in products.iter_mut().zip(transfers).zip(&spectra) {
                    let product = |v, h| transfer.at(v, h) * u.at(v, h) * back.at(v, h).conj() / bins;
                    *products = Plane::from_fn(2 * height_px, 2 * width_px, |v, h| products.at(v, h) + product(v, h));
                }
            }
            mode.kernels = products.iter().map(|products| by_series(self.layout.kernel, products)).collect();
            mode
        };
        let modes = images.iter().map(&mut of_mode).collect();
        let blocks = self.layout.blocks;
        let adjoint = Adjoint {
            modes,
            orders: None,
            ghost: blocks.contains(Block::Ghost).then(|| {
                self.by_moved_loss(example, exposure, |model, i| match i {
                    0 => &mut model.ghost.amplitude.re,
                    1 => &mut model.ghost.amplitude.im,
                    4 => &mut model.ghost.defocus_rad,
                    _ => &mut model.ghost.shift_px[i - 2],
                })
            }),
            blur: blocks.contains(Block::LightBlur).then(|| {
                self.by_moved_loss(example, exposure, |model, i| match i {
                    0 => &mut model.light_blur.ratio_x,
                    _ => &mut model.light_blur.ratio_y,
                })
            }),
            modulator: self.layout.has_slm().then(|| self.modulator(example, &b)),
        };
        (sums, adjoint)
    }
}
