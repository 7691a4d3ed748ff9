//! Optimization of holograms: finds phases with which a display shows target pictures.

mod adam;
mod backend;
#[cfg(any(test, feature = "conformance"))]
pub mod conformance;
mod double_phase;
mod evaluate;
mod gerchberg_saxton;
mod initial;
mod loss;
mod optimization;
mod optimize;
mod options;
mod other_orders;
mod plain;
mod plain_project;
mod preview;
mod problem;
mod processor;
mod processor_project;
mod quality;
mod roughness;
mod rounded;
mod shown_light;
mod state;
mod stopwatch;
mod two_pass_buffers;
mod two_passes;
mod wanted;

pub use backend::{Backend, Picture};
pub use evaluate::{Evaluate, Evaluation, ProblemSize, Project};
pub use initial::{InitialPhase, RANDOM_RANGE_RAD, default_focal_length_m, initial_phase};
pub use loss::{ImagePlane, Loss};
pub use optimization::{Optimization, Step};
pub use optimize::{Hologram, optimize};
pub use options::{HologramMethod, HologramOptions};
pub(crate) use other_orders::OTHER_ORDERS_PIXELS_MAX;
pub use other_orders::{pixel_psnr_db, with_other_orders};
pub use plain::{Plain, PlainProblem};
pub use problem::HologramProblem;
pub use quality::{DetectorQuality, Quality, quality};
pub use rounded::Levels;
pub use shown_light::{ShownLight, light_of_frames};
pub use state::OptimizationState;
pub use stopwatch::Clock;
pub(crate) use two_passes::SAMPLES_BYTES_MAX;
pub use wanted::Wanted;
