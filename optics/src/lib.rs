//! Fourier optics for phase-only holographic displays: propagation, hologram optimization, and learning a
//! display's own light transport from photographs.
//!
//! # Conventions
//!
//! - Planes are row-major, `[y][x]`; sizes are `height_px` and `width_px`; public names carry SI units.
//! - Time convention e^{−iωt}: a wave travelling towards +z gains e^{+ikz}.
//! - Forward Fourier transform with e^{−i2π(fx·x + fy·y)}, unscaled; the inverse is scaled by 1/(number of samples).
//!   Zero frequency is at `[0][0]`.
//! - Frequencies are the exact bins n/(N·Δ) for n = 0 … N/2−1, −N/2 … −1.
//! - Phases of transfer functions are computed in f64 without their piston and reduced modulo 2π before they are
//!   narrowed to f32.
//! - Fields are zero-padded twofold along each axis, so that the convolution is linear, and cropped afterwards.
//!
//! # Layout
//!
//! - [`grid`], [`plane`], [`region`]: sizes, arrays, and the part of an image that counts.
//! - [`setup`], [`transfer_function`]: what light goes through, and what that does to it.
//! - [`propagation`]: the methods by which it is computed, and a planner that chooses one and says how good it is.
//! - [`phase_response`], [`carrier`]: from phases to what a modulator shows.
//! - [`metrics`]: how close an image comes to its target, and how much of the light arrives.
//! - [`reference`](mod@reference): slow and plain f64 twins of what is fast elsewhere.
//! - [`display_model`], [`chebyshev`]: a display as it is learned: kernel, source, response, zero order.
//! - [`spatial_variation`]: a kernel that changes over the modulator, and the grid of kernels that stands for it.
//! - [`engine`], [`detector`], [`photometry`]: that display made ready to run, fused and parallel; what a camera or an eye
//!   sees of its light; how that compares with a picture.
//! - [`hologram`], [`learning`], [`optimizer`]: finding phases, and finding displays.
//! - [`passes`]: an evaluation taken apart, to see where its time goes.
//! - [`alignment`]: from a camera's pixels to the display's.
//! - [`diagnostics`]: what a learned transfer function does: aberrations, point spread, what was never lit.
//! - [`simulated_display`]: an imperfect bench to photograph holograms on.
//! - [`test_cards`]: target pictures to try all of it on.
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod alignment;
mod batch_fft;
pub mod carrier;
pub mod chebyshev;
mod convolution;
pub mod detector;
pub mod diagnostics;
pub mod display_model;
pub mod engine;
mod engine_cache;
mod error;
pub mod grid;
pub mod hologram;
pub mod learning;
mod least_squares;
mod light;
pub mod metrics;
pub mod optimizer;
pub mod passes;
pub mod phase_response;
pub mod photometry;
pub mod plane;
pub mod propagation;
mod real;
pub mod reference;
pub mod region;
pub mod setup;
pub mod simulated_display;
mod slm;
mod slm_inverse;
pub mod spatial_variation;
pub mod test_cards;
pub mod transfer_function;

pub use carrier::Carrier;
pub use detector::Detector;
pub use display_model::{DisplayModel, KernelShape, SmoothField};
pub use engine::Engine;
pub use engine_cache::EngineCache;
pub use error::{Error, Result};
pub use grid::Grid;
pub use hologram::{Adam, AdamState, Evaluation, HologramMethod, HologramProblem, InitialPhase, Optimization};
pub use learning::KernelModel;
pub use plane::Plane;
pub use propagation::{ConvolutionMethod, PropagationMethod, Propagator, ValidityReport, plan, plan_onto};
pub use real::Real;
pub use region::RegionOfInterest;
pub use setup::OpticalSetup;
pub use simulated_display::SimulatedBench;
pub use spatial_variation::SpatialVariation;
