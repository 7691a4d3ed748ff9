//! Evaluations in two passes: the first computes all of the light, the second its gradient. They serve the gain that
//! fits best, several frames, several modes of light, blurred light, roughness, and the projections of
//! Gerchberg–Saxton.

use super::evaluate::Evaluation;
use super::loss::{TargetPlane, weighted_sums};
use super::processor::{ProcessorProblem, Sink, compare_with, send_back};
use super::roughness::{LightPlane, total_variation};
use super::two_pass_buffers::Buffers;
use crate::display::Detector;
use crate::engine::photometry::{Comparison, Quantity, Sums};
use crate::engine::{Fields, Real};
use crate::interrupt;
use crate::metrics::Gain;
use crate::numerics::Plane;
use crate::numerics::buffers::zeros;
use crate::numerics::real::unit;
use num_complex::Complex;
use rayon::prelude::*;

/// Largest size of the kept samples of several fields \[bytes\]. Above this size the samples are computed
/// again in the second pass. Three planes of 1080×1920 px with a pixel detector fit.
pub(crate) const SAMPLES_BYTES_MAX: usize = 256 << 20;

impl<T: Real> ProcessorProblem<T> {
    /// Evaluates the loss and its gradient in two passes: computes all of the light, then the slopes at the given or
    /// fitted gain, and propagates them back.
    pub(super) fn evaluate_in_two(&mut self, phase: &[T], gain: Gain, gradient: &mut [T]) -> Evaluation {
        self.compute_light(phase);
        let gain = match gain {
            Gain::Given(gain) => gain,
            Gain::Fitted => self.fitted_gain(),
        };
        let mut roughness = 0.0;
        let sums = weighted_sums(self.planes.len(), |p| {
            let plane = &self.planes[p];
            let (comparison, share) = (compare_with(plane, self.loss.quantity, self.region, gain), plane.share);
            let Buffers { lights, slopes, .. } = &mut self.buffers;
            let sums = plane.engine.convolver.slopes(&comparison, &lights[p], slopes);
            roughness += self.roughness(p);
            self.spread_slopes(p);
            self.weigh_and_send_back(p, phase, Sink::Gradient(&mut *gradient));
            (sums, share)
        });
        Evaluation::new(&sums, roughness)
    }

    /// Computes the correction of Gerchberg–Saxton: writes to `field` the excess of the field on the SLM, the mean over
    /// the planes of
    ///
    /// ```text
    /// Aᴴ[ Bᵀ( w · ( 1 − W√t / (s√p) ) ) · u ]
    /// ```
    ///
    /// Without a blur B of the light this is the change when each image amplitude is replaced by its target amplitude.
    /// `wanted` holds W√t of each plane. If `weighted` is true, W is updated first.
    pub(super) fn excess(
        &mut self,
        phase: &[T],
        wanted: &mut [Plane<T>],
        weighted: bool,
        field: &mut [Complex<T>],
    ) -> Evaluation {
        self.compute_light(phase);
        let evaluation = Evaluation::new(&weighted_sums(self.planes.len(), |p| self.measure_plane(p, 1.0)), 0.0);
        if weighted {
            let gain = self.fitted_amplitude_gain(&self.target_amplitudes());
            for ((plane, lights), wanted) in self.planes.iter().zip(&self.buffers.lights).zip(&mut *wanted) {
                update_weighted_amplitudes(plane, lights, gain, wanted);
            }
        }
        let gain = self.fitted_amplitude_gain(wanted);
        for (p, wanted) in wanted.iter().enumerate() {
            let plane = &self.planes[p];
            let comparison = Comparison {
                picture: wanted,
                // slope = w e / (s √p), the relative excess of the amplitude in every frame
                weight_sum: gain * gain / (plane.share * self.frames as f64),
                ..compare_with(plane, Quantity::Amplitude, self.region, gain)
            };
            plane.engine.convolver.slopes(&comparison, &self.buffers.lights[p], &mut self.buffers.slopes);
            self.spread_slopes(p);
            self.weigh_and_send_back(p, phase, Sink::Field(&mut *field));
        }
        evaluation
    }

    fn fitted_amplitude_gain(&self, wanted: &[Plane<T>]) -> f64 {
        let sums = weighted_sums(self.planes.len(), |p| {
            let plane = &self.planes[p];
            let comparison =
                Comparison { picture: &wanted[p], ..compare_with(plane, Quantity::Amplitude, self.region, 1.0) };
            (plane.engine.convolver.measure_lights(&comparison, &self.buffers.lights[p]), plane.share)
        });
        sums.best_gain()
    }

    /// Target amplitudes √t of each plane.
    pub(super) fn target_amplitudes(&self) -> Vec<Plane<T>> {
        let amplitude = |plane: &TargetPlane<T>| match self.loss.quantity {
            Quantity::Intensity => plane.picture.map(T::sqrt),
            Quantity::Amplitude => plane.picture.clone(),
        };
        self.planes.iter().map(amplitude).collect()
    }

    /// Field on the SLM that results from propagating the targets' amplitudes backwards, with the phase `image_phase`
    /// in all planes.
    pub(super) fn back_propagated(&self, image_phase: &[T]) -> Vec<Complex<T>> {
        let width_px = self.engine().width_px();
        let mut field: Vec<Complex<T>> = zeros(self.frame_len());
        for (plane, amplitude) in self.planes.iter().zip(self.target_amplitudes()) {
            let point = plane.engine.with_detector(Detector::Point);
            let mut fields = Fields::new(&point);
            let share = T::of(plane.share);
            let spectrum = &mut fields.spectrum[..point.image_len()];
            point.convolver.forward_rows(spectrum, &[None], |y, row| {
                for (x, (u, &a)) in row.iter_mut().zip(amplitude.row(y)).enumerate() {
                    let counts = plane.weight.as_ref().map_or(T::one(), |weight| weight.at(y, x));
                    *u = unit(image_phase[y * width_px + x]).scale(a * counts * share);
                }
            });
            send_back(&point, &mut fields, &[], &mut Sink::Field(&mut field), true);
        }
        field
    }

    /// Computes the light of all planes: the sum over the modes, and the mean over the frames, with its blur.
    pub(super) fn compute_light(&mut self, phase: &[T]) {
        self.allocate_buffers();
        let (frame_len, frames) = (self.frame_len(), self.frames);
        let (single_field, mut field) = (self.fields_before(self.planes.len()) == 1, 0);
        for (p, plane) in self.planes.iter().enumerate() {
            let sent =
                plane.modes.iter().flat_map(|mode| phase.chunks_exact(frame_len).map(move |phase| (mode, phase)));
            for (i, (mode, phase)) in sent.enumerate() {
                mode.send(phase, &mut self.fields);
                let stored = match self.buffers.samples.get_mut(field) {
                    Some(stored) => Some(stored.as_mut_slice()),
                    None if single_field => Some(self.fields.spectrum.as_mut_slice()),
                    None => None,
                };
                let (share, lights) = (mode.share / frames as f64, &mut self.buffers.lights[p]);
                mode.convolver.add_light(&self.fields.tiles, share, i == 0, stored, lights);
                field += 1;
            }
            plane.engine.blur_lights(&mut self.buffers.lights[p], &mut self.buffers.spare);
        }
    }

    /// Makes the slopes by a plane's light slopes by the light before its blur.
    fn spread_slopes(&mut self, p: usize) {
        let Buffers { slopes, spare, .. } = &mut self.buffers;
        self.planes[p].engine.spread_slopes(slopes, spare);
    }

    /// Light planes of the first image plane at the latest evaluation; `None` if no evaluation kept any.
    pub(super) fn kept_light(&self) -> Option<&[T]> {
        self.buffers.lights.first().map(Vec::as_slice)
    }

    /// Computes the light planes of the first image plane. Keeps light only if evaluations keep it, too.
    pub(super) fn light_of_first_plane(&mut self, phase: &[T]) -> Vec<T> {
        let keeps_light = self.kept_light().is_some();
        self.compute_light(phase);
        if keeps_light {
            return self.buffers.lights[0].clone();
        }
        std::mem::replace(&mut self.buffers, Buffers::empty()).lights.swap_remove(0)
    }

    /// Number of fields of the planes before plane `p`: one for each mode and frame.
    fn fields_before(&self, p: usize) -> usize {
        self.frames * self.planes[..p].iter().map(|plane| plane.modes.len()).sum::<usize>()
    }

    fn allocate_buffers(&mut self) {
        if !self.buffers.lights.is_empty() {
            return;
        }
        let light_len = self.engine().detector().light_planes() * self.frame_len();
        let (fields, len) = (self.fields_before(self.planes.len()), self.fields.spectrum.len());
        self.buffers.lights = (0..self.planes.len()).map(|_| zeros(light_len)).collect();
        self.buffers.slopes = zeros(light_len);
        if fields > 1 && fields * len * size_of::<Complex<T>>() <= SAMPLES_BYTES_MAX {
            self.buffers.samples = (0..fields).map(|_| zeros(len)).collect();
        }
    }

    pub(super) fn measure_plane(&self, p: usize, gain: f64) -> (Sums, f64) {
        let plane = &self.planes[p];
        let comparison = compare_with(plane, self.loss.quantity, self.region, gain);
        (plane.engine.convolver.measure_lights(&comparison, &self.buffers.lights[p]), plane.share)
    }

    fn fitted_gain(&self) -> f64 {
        weighted_sums(self.planes.len(), |p| self.measure_plane(p, 1.0)).best_gain()
    }

    /// Returns the weighted roughness of a plane's light and adds its derivative to the slopes.
    pub(super) fn roughness(&mut self, p: usize) -> f64 {
        let (plane, Buffers { lights, slopes, .. }) = (&self.planes[p], &mut self.buffers);
        let (extent, count) = (plane.extent(self.region), plane.engine.detector().light_planes());
        let mut sum = 0.0;
        for index in 0..count {
            let light_plane = LightPlane { index, count, width_px: plane.engine.width_px() };
            if self.loss.total_variation > 0.0 {
                let factor = self.loss.total_variation * plane.share;
                sum += factor * total_variation(&extent, light_plane, &lights[p], factor, slopes);
            }
            if let Some(blocks) = &plane.blocks {
                let factor = self.loss.speckle * plane.share;
                sum += factor * blocks.evaluate(&extent, light_plane, &lights[p], factor, slopes);
            }
        }
        sum / count as f64
    }

    /// Multiplies a plane's samples by the slopes and propagates them back to the SLM, mode by mode and frame by frame.
    fn weigh_and_send_back(&mut self, p: usize, phase: &[T], mut sink: Sink<'_, T>) {
        let (first_field, frame_len) = (self.fields_before(p), self.frame_len());
        let single_field = self.fields_before(self.planes.len()) == 1;
        for (m, mode) in self.planes[p].modes.iter().enumerate() {
            let factor = mode.share / (mode.samples_per_pixel() * self.frames) as f64;
            for (f, phase) in phase.chunks_exact(frame_len).enumerate() {
                let Buffers { samples, slopes, .. } = &mut self.buffers;
                if let Some(stored) = samples.get_mut(first_field + m * self.frames + f) {
                    mode.convolver.weigh_stored_samples(stored, slopes, factor);
                    std::mem::swap(stored, &mut self.fields.spectrum);
                } else if single_field {
                    mode.convolver.weigh_stored_samples(&mut self.fields.spectrum, slopes, factor);
                } else {
                    mode.send(phase, &mut self.fields);
                    let Fields { spectrum, tiles } = &mut self.fields;
                    mode.convolver.weigh_sampled_tiles(tiles, slopes, factor, spectrum);
                }
                send_back(mode, &mut self.fields, phase, &mut sink.frame(f, frame_len), p + m > 0);
            }
        }
    }
}

/// Updates W ← W · √t / (s√p), with W limited so that a dark spot does not draw all of the light.
fn update_weighted_amplitudes<T: Real>(plane: &TargetPlane<T>, lights: &[T], gain: f64, wanted: &mut Plane<T>) {
    /// Largest W; the smallest is its inverse.
    const WEIGHT_MAX: f64 = 3.0;
    let (width_px, planes) = (plane.picture.width_px(), plane.engine.detector().light_planes());
    let is_amplitude = plane.compares_amplitudes;
    let share = T::of(1.0 / planes as f64);
    wanted.values_mut().par_chunks_mut(width_px).enumerate().for_each(|(y, wanted)| {
        interrupt::check();
        let lights = &lights[y * planes * width_px..][..planes * width_px];
        for (x, wanted) in wanted.iter_mut().enumerate() {
            let light = (0..planes).fold(T::zero(), |sum, l| sum + lights[l * width_px + x]) * share;
            let target = plane.picture.at(y, x);
            let target = if is_amplitude { target } else { target.sqrt() };
            let shown = T::of(gain) * light.sqrt();
            if target > T::zero() {
                let least = target * T::of(1.0 / WEIGHT_MAX);
                let raised = *wanted * target / shown.max(least);
                *wanted = raised.max(least).min(target * T::of(WEIGHT_MAX));
            }
        }
    });
}
