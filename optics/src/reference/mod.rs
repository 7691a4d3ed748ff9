//! Slow, simple reference implementations that tests compare the fast engine with.
//!
//! They compute in f64 and are written for checking by eye, with no regard for speed. Use them to judge results, not to
//! produce them.
//!
//! - [`fft2`], [`dft2`]: the two-dimensional Fourier transform, by fast transforms and by its definition.
//! - [`propagate`]: convolution with a transfer function, zero-padded twofold.
//! - [`rayleigh_sommerfeld()`], [`rayleigh_sommerfeld_onto`]: diffraction as a direct sum, without Fourier transforms.
//! - [`first_order_onto`]: diffraction of a display that shows the first order of its pixels, as a direct integral.
//! - [`gaussian_beam`], [`square_aperture`]: fields with a closed form.
//!
//! [`EngineCore`](crate::engine::EngineCore) and [`PropagatorCore`](crate::engine::PropagatorCore) are the fast engine and
//! propagator in either precision. In f64 they show which part of an error is rounding.

mod closed_forms;
pub(crate) mod display_light;
mod first_order;
mod propagation;
mod rayleigh_sommerfeld;

pub use crate::numerics::fourier::{Direction, dft2, fft2};
pub use closed_forms::{fresnel_integral, gaussian_beam, square_aperture};
pub use first_order::first_order_onto;
pub use propagation::{filter, offset, propagate, propagate_uncropped};
pub use rayleigh_sommerfeld::{rayleigh_sommerfeld, rayleigh_sommerfeld_onto};
