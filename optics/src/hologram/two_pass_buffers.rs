//! Buffers of evaluations in two passes.

use num_complex::Complex;

/// Light and samples kept between the two passes of an evaluation; empty until an evaluation needs them.
#[derive(Debug)]
pub(super) struct Buffers<T> {
    /// Samples of each plane, mode of light and frame, if they fit into `SAMPLES_BYTES_MAX`. Those of a single field
    /// are kept in the problem's `fields` instead.
    pub(super) samples: Vec<Vec<Complex<T>>>,
    /// Light planes of each image plane.
    pub(super) lights: Vec<Vec<T>>,
    /// Slopes ∂L/∂p of one image plane.
    pub(super) slopes: Vec<T>,
    /// Light before its blur, or slopes behind it; empty without a blur.
    pub(super) spare: Vec<T>,
}

impl<T> Buffers<T> {
    pub(super) fn empty() -> Self {
        Self { samples: Vec::new(), lights: Vec::new(), slopes: Vec::new(), spare: Vec::new() }
    }
}
