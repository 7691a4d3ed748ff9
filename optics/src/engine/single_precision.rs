//! The engine in f32, which production uses.

use super::core::EngineCore;
use crate::display::{Carrier, Detector, DisplayModel};
use crate::error::Result;
use crate::numerics::Plane;
use num_complex::Complex32;

/// A [`DisplayModel`] prepared for computation with one detector. Clones share all large data.
#[derive(Clone, Debug)]
pub struct Engine {
    pub(crate) core: EngineCore<f32>,
}

impl Engine {
    /// Creates the engine of a display, seen by a detector, with an optional carrier grating on its modulator.
    ///
    /// # Errors
    ///
    /// The errors of [`DisplayModel::validate`].
    pub fn new(model: &DisplayModel, detector: Detector, carrier: Option<Carrier>) -> Result<Self> {
        Ok(Self { core: EngineCore::new(model, detector, carrier)? })
    }

    /// Engine of the same display with another detector. Both engines share the transfer functions.
    #[must_use]
    pub fn with_detector(&self, detector: Detector) -> Self {
        Self { core: self.core.with_detector(detector) }
    }

    /// Detector that measures the light of a pixel.
    #[must_use]
    pub fn detector(&self) -> Detector {
        self.core.detector()
    }

    /// Number of rows \[px\].
    #[must_use]
    pub fn height_px(&self) -> usize {
        self.core.height_px()
    }

    /// Number of columns \[px\].
    #[must_use]
    pub fn width_px(&self) -> usize {
        self.core.width_px()
    }

    /// Complex field of the first mode in the image plane at the pixels' centres, for a `phase` \[rad\] on the SLM.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a phase of another size.
    pub fn field(&self, phase: &Plane<f32>) -> Result<Plane<Complex32>> {
        self.core.field(phase)
    }

    /// Propagates a complex `field` at the SLM to the image plane. The model of the SLM is not used.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a field of another size.
    pub fn propagate(&self, field: &Plane<Complex32>) -> Result<Plane<Complex32>> {
        self.core.propagate(field)
    }

    /// Light that the detector measures at each pixel. With the supersampled detector this is the mean over the
    /// sub-samples.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a phase of another size.
    pub fn light(&self, phase: &Plane<f32>) -> Result<Plane<f32>> {
        self.core.light(phase)
    }

    /// Intensities |u|² at every sub-sample of [`Detector::Point`] or [`Detector::Supersampled`], at its place in the
    /// image: k·`height_px` × k·`width_px` values with k = 1 or k = 2. With [`Detector::Pixel`] those of
    /// [`Detector::Supersampled`].
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a phase of another size.
    pub fn samples(&self, phase: &Plane<f32>) -> Result<Plane<f32>> {
        self.core.samples(phase)
    }

    /// All light that passes the optics, wherever it falls, in the unit of [`Self::light`]:
    ///
    /// ```text
    /// ∫ |E U₀|² df
    /// ```
    ///
    /// U₀ is the spectrum of the field on the modulator and E the optics' transmission, 1 for free space. For an ideal
    /// display this is the number of pixels. For a kernel that varies over the SLM, E is that on the axis. The light of
    /// all modes is added up.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a phase of another size.
    pub fn light_passed(&self, phase: &Plane<f32>) -> Result<f64> {
        self.core.light_passed(phase)
    }
}
