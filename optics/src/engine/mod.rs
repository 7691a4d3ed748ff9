//! A [`DisplayModel`] made ready to run: its transfer function sampled, its SLM tabulated, its transforms planned.
//!
//! [`Engine`] runs in f32. `core` is what computes, in f32 or f64: the f64 one is a
//! [reference](crate::reference::EngineCore).

mod cache;
mod core;
mod light;

pub use cache::EngineCache;
pub use core::EngineCore;
pub(crate) use core::{Fields, kernel_grid, tabulate_source};

use crate::carrier::Carrier;
use crate::{Detector, DisplayModel, Plane, Result};
use num_complex::Complex32;

/// A display model made ready to run, for one detector. A clone shares all that is large.
#[derive(Clone, Debug)]
pub struct Engine {
    pub(crate) core: EngineCore<f32>,
}

impl Engine {
    /// A display, seen by a detector, with a grating on its modulator.
    ///
    /// # Errors
    ///
    /// What [`DisplayModel::validate`] finds.
    pub fn new(model: &DisplayModel, detector: Detector, carrier: Option<Carrier>) -> Result<Self> {
        Ok(Self { core: EngineCore::new(model, detector, carrier)? })
    }

    /// The same display seen by another detector; the transfer functions are shared.
    #[must_use]
    pub fn with_detector(&self, detector: Detector) -> Self {
        Self { core: self.core.with_detector(detector) }
    }

    /// What counts as the light of a pixel.
    #[must_use]
    pub fn detector(&self) -> Detector {
        self.core.detector()
    }

    /// Rows \[px\].
    #[must_use]
    pub fn height_px(&self) -> usize {
        self.core.height_px()
    }

    /// Columns \[px\].
    #[must_use]
    pub fn width_px(&self) -> usize {
        self.core.width_px()
    }

    /// The complex field in the image plane at the pixels' centres, for a `phase` \[rad\] on the SLM.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a phase of another size.
    pub fn field(&self, phase: &Plane<f32>) -> Result<Plane<Complex32>> {
        self.core.field(phase)
    }

    /// The complex field in the image plane that a given `field` at the SLM becomes; the SLM's model is not used.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a field of another size.
    pub fn propagate(&self, field: &Plane<Complex32>) -> Result<Plane<Complex32>> {
        self.core.propagate(field)
    }

    /// The light that the detector sees at each pixel (of the supersampled detector, the mean over the sub-samples).
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a phase of another size.
    pub fn light(&self, phase: &Plane<f32>) -> Result<Plane<f32>> {
        self.core.light(phase)
    }

    /// |u|² at every sub-sample of the detector, where it is in the image: k·`height_px` × k·`width_px` values, k = 1 for
    /// [`Detector::Point`] and 2 for the others, whose mean over k×k samples is [`Self::light`] where the detector is
    /// [`Detector::Pixel`].
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a phase of another size.
    pub fn samples(&self, phase: &Plane<f32>) -> Result<Plane<f32>> {
        self.core.samples(phase)
    }

    /// Σ |c|² over the pixels, c the field that leaves the modulator: with an ideal one, the number of pixels.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a phase of another size.
    pub fn light_sent(&self, phase: &Plane<f32>) -> Result<f64> {
        self.core.light_sent(phase)
    }
}
