//! Kernels and their versions: listing, fetching, promoting, judging, importing and interpolating.

mod bundle;
mod compare;
pub(crate) mod conversions;
pub(crate) mod fetch;
pub(crate) mod import;
mod interpolate;
mod model_file;
pub(crate) mod promotion;
mod registry;
mod service;
pub(crate) mod to_wire;
mod watch_kernel;
