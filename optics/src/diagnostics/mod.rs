//! What a learned transfer function does to light, in the words of people who build optics.
//!
//! - [`zernike`]: its phase as classical aberrations.
//! - [`mod@point_spread`]: the spot that it makes of a point, and the contrast that it leaves to fine patterns.
//! - [`lit_band`]: which frequencies a set of holograms ever sent light to, and so can tell anything about.
pub mod lit_band;
pub mod point_spread;
pub mod zernike;

pub use lit_band::LitBand;
pub use point_spread::{PointSpread, point_spread};
pub use zernike::{Aberration, ZernikeFit};
