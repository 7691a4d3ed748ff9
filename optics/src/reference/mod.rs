//! Slow and plain: what the fast engine is tested against.
//!
//! Everything here is in f64 and written to be checked by eye, with no regard for speed. Use it to judge a result, not
//! to make one.
//!
//! - [`fft2`], [`dft2`]: the two-dimensional Fourier transform, fast and by its definition.
//! - [`propagate`]: convolution with a transfer function, zero-padded twofold.
//! - [`rayleigh_sommerfeld`], [`rayleigh_sommerfeld_onto`]: diffraction as a direct sum, knowing no Fourier transform.
//! - [`gaussian_beam`], [`square_aperture`]: fields that are known in closed form.
//!
//! Beside them stand [`EngineCore`] and [`PropagatorCore`], the fast engine and propagator themselves in either precision: in f64
//! they tell what of an error is rounding.

mod closed_forms;
mod fourier;
mod propagation;
mod rayleigh_sommerfeld;

pub use crate::convolution::Real;
pub use crate::engine::EngineCore;
pub use crate::propagator::PropagatorCore;
pub use closed_forms::{fresnel_integral, gaussian_beam, square_aperture};
pub use fourier::{Direction, dft2, fft2};
pub use propagation::{filter, offset, propagate, propagate_uncropped};
pub use rayleigh_sommerfeld::{rayleigh_sommerfeld, rayleigh_sommerfeld_onto};
