//! Memory of computations at their peak \[bytes\] and their work, counted before they start.
//!
//! The functions mirror the buffers of the engine, the optimizations and the fits: `convolution` (half-transformed
//! fields, transfer functions, scratch), `engine`, `hologram`, `optimizer` and `learning`. The
//! test `tests/memory.rs` compares them with counted allocations, so a change of a buffer must change its function
//! here.
//!
//! ```
//! use lightpath_optics::Detector;
//! use lightpath_optics::hologram::HologramMethod;
//! use lightpath_optics::memory::{EngineSize, HologramSize};
//!
//! let engine = EngineSize::ideal(1080, 1920, Detector::Pixel, 2);
//! let hologram = HologramSize::new(engine, HologramMethod::Lbfgs, 200);
//! let mib = (hologram.problem_bytes() + hologram.state_bytes() + hologram.scratch_bytes()) >> 20;
//! assert!((250..350).contains(&mib), "{mib} MiB");
//! ```

mod engine;
mod hologram;
mod learning;
mod sampling;
mod value_bytes;

pub use engine::EngineSize;
pub use hologram::HologramSize;
pub use learning::LearningSize;
pub use sampling::{ExactSize, sampling_bytes, sampling_work};
