//! Fits of light with several modes that do not interfere, or with a blur.
//!
//! The light of all modes is added up and blurred first. Then each mode is propagated again, multiplied by the slope of
//! the loss and propagated back, and what arrives at the SLM is added up.

use super::fit::Fit;
use super::mode_buffers::ModeBuffers;
use super::pair::Example;
use crate::display::parts::light_blur::Blur;
use crate::engine::Real;
use crate::engine::photometry::{Comparison, Sums};
use crate::engine::{EngineCore, Fields};
use rayon::prelude::*;

impl<T: Real> Fit<T> {
    /// Calls `use_mode(fit, m)` for each mode of the light, while the fit's engine is that of the mode.
    pub(super) fn for_each_mode(&mut self, mut use_mode: impl FnMut(&mut Self, usize)) {
        for m in 0..=self.engine.further.len() {
            self.exchange_mode(m);
            use_mode(self, m);
            self.exchange_mode(m);
        }
    }

    /// Exchanges the first mode and mode `m`.
    fn exchange_mode(&mut self, m: usize) {
        let EngineCore { kernels, share, further, .. } = &mut self.engine;
        if let Some(mode) = m.checked_sub(1).and_then(|i| further.get_mut(i)) {
            std::mem::swap(kernels, &mut mode.kernels);
            std::mem::swap(share, &mut mode.share);
        }
    }

    /// Propagates a hologram in all modes, and returns the sums of their light at gain 1 and offset 0. The hologram's
    /// spectrum stays in `out`, and so does the field of the last mode.
    pub(super) fn measure_modes(&mut self, example: &Example<T>) -> Sums {
        self.for_each_mode(|fit, m| {
            match m {
                0 => fit.engine.send(example.phase.values(), &mut fit.out),
                _ => fit.propagate_spectrum(),
            }
            let Self { engine, out, modes, .. } = fit;
            engine.convolver.add_light(&out.tiles, engine.share, m == 0, None, &mut modes.lights);
        });
        let Self { engine, modes: ModeBuffers { lights, sharp, .. }, .. } = self;
        engine.blur_lights(lights, sharp);
        let comparison = example.comparison(&self.engine, 1.0, 0.0);
        self.engine.convolver.measure_lights(&comparison, &self.modes.lights)
    }

    /// Compares the light of all modes with a photograph, for [`Self::weigh_mode`].
    pub(super) fn compare_modes(&mut self, comparison: &Comparison<'_, T>) -> Sums {
        let Self { engine, modes: ModeBuffers { lights, sharp, slopes, by_blur, .. }, .. } = self;
        let sums = engine.convolver.slopes(comparison, lights, slopes);
        if let Some(blur) = &engine.blur {
            *by_blur = Blur::slopes(blur.ratios()).map(|slope| {
                engine.apply_to_lights(&slope, sharp, lights);
                product(lights, slopes) / engine.detector.light_planes() as f64
            });
            engine.spread_slopes(slopes, lights);
        }
        sums
    }

    /// Writes the half-transformed gradient of the mode whose engine the fit has now to `back`.
    pub(super) fn weigh_mode(&mut self) {
        if !self.engine.is_coherent() {
            self.propagate_spectrum();
        }
        let Self { engine, out, back, modes, .. } = self;
        let factor = engine.share / engine.samples_per_pixel() as f64;
        engine.convolver.weigh_sampled_tiles(&out.tiles, &modes.slopes, factor, back);
    }

    /// Propagates the spectrum in `out` to the image.
    fn propagate_spectrum(&mut self) {
        let Self { engine, out: Fields { spectrum, tiles }, .. } = self;
        let (convolver, kernels) = (&engine.convolver, &engine.kernels);
        let image = &mut tiles[..engine.image_len()];
        convolver.propagate(&spectrum[..kernels.half_spectrum_len(convolver)], kernels, image);
    }

    /// Adds what has arrived at the SLM in mode `m`, the first values of the tiles, to that of the modes before it.
    /// Writes the sum to the tiles.
    pub(super) fn add_returned(&mut self, m: usize) {
        let Self { out, modes: ModeBuffers { returned, .. }, .. } = self;
        let tiles = &mut out.tiles[..returned.len()];
        if m > 0 {
            tiles.par_iter_mut().zip(&*returned).for_each(|(sum, &before)| *sum = *sum + before);
        }
        returned.copy_from_slice(tiles);
    }
}

/// Σ a b, added up in a fixed order.
fn product<T: Real>(a: &[T], b: &[T]) -> f64 {
    /// Values that are added up one after the other.
    const PART: usize = 4096;
    let part = |(a, b): (&[T], &[T])| a.iter().zip(b).map(|(&a, &b)| (a * b).wide()).sum::<f64>();
    let parts: Vec<f64> = a.par_chunks(PART).zip(b.par_chunks(PART)).map(part).collect();
    parts.iter().sum()
}
