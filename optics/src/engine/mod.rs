//! Engines: display models prepared for computation, with sampled transfer functions, tables of the SLM, and FFT plans.
//!
//! [`Engine`] computes in f32. [`EngineCore`] contains the computations for f32 and f64; the engine in f64 shows which
//! part of an error is rounding. A [`Propagator`] runs every propagation method, without a display model.

mod blur;
mod cache;
pub(crate) mod convolution;
mod core;
mod exact_light;
mod kept_transfers;
mod light;
mod order_products;
#[doc(hidden)]
pub mod passes;
pub mod photometry;
pub mod prepared;
mod propagator;
mod sample_transfers;
mod single_precision;
pub(crate) mod slm;
mod slm_inverse;
mod sub_samples;

pub use cache::EngineCache;
pub use convolution::Real;
pub use core::EngineCore;
pub(crate) use core::{Fields, Mode, kernels, tabulate_gain, tabulate_source};
pub(crate) use order_products::{OrderProducts, OrderWeights, order_products, turns};
pub use prepared::Prepared;
pub use propagator::{Propagated, Propagator, PropagatorCore, propagate};
pub(crate) use sample_transfers::sample_transfers;
pub use single_precision::Engine;
pub use slm::Slm;
pub(crate) use sub_samples::{reported_nodes, sub_samples};
