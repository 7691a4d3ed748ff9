//! What a display is: its pixels and the light on them, the orders that it shows, and the [model] of its errors, which
//! has a file for each of its [parts].

pub mod carrier;
pub mod detector;
pub(crate) mod image_window;
pub mod model;
mod order_filter;
mod orders;
pub mod parts;
pub mod phase_response;
pub mod setup;

pub use carrier::Carrier;
pub use detector::Detector;
pub use image_window::ImageWindow;
pub use model::{DisplayModel, KernelShape};
pub use order_filter::{FilterShape, OrderFilter};
pub use orders::Orders;
pub use parts::crosstalk::Crosstalk;
pub use parts::dust::Dust;
pub use parts::ghost::Ghost;
pub use parts::light_blur::LightBlur;
pub use parts::partial_coherence::{FurtherMode, PartialCoherence};
pub use parts::response_variation::ResponseVariation;
pub use parts::spatial_variation::SpatialVariation;
pub use setup::OpticalSetup;
