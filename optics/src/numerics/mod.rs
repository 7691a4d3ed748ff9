//! Numerics that know no optics: planes and grids of samples, Fourier transforms, bases, least squares, and optimization
//! methods.

pub(crate) mod batch_fft;
pub(crate) mod buffers;
pub mod chebyshev;
pub(crate) mod cholesky;
pub(crate) mod fourier;
pub(crate) mod gaussian_blur;
pub mod grid;
pub mod least_squares;
pub mod optimizer;
pub mod plane;
pub mod quadrature;
pub(crate) mod real;
pub mod region;
pub(crate) mod smooth_field;
pub mod tiles;
pub(crate) mod vectorized;

pub use grid::Grid;
pub use plane::Plane;
pub use region::RegionOfInterest;
pub use smooth_field::SmoothField;
