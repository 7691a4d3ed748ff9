//! Optical diagnostics of a learned transfer function, in terms of classical optics.
//!
//! - [`zernike`]: the phase as classical aberrations.
//! - [`mod@point_spread`]: the image of a point, and the contrast that remains for fine patterns.
//! - [`lit_band`]: the frequencies that a set of holograms sent light to. Photographs carry information on these only.
pub mod lit_band;
pub mod point_spread;
pub mod zernike;

pub use lit_band::LitBand;
pub use point_spread::{PointSpread, point_spread};
pub use zernike::{Aberration, ZernikeFit};
