//! Kernels and their versions: listing, fetching, promoting, judging, importing and interpolating.

mod fetch;
mod manifests;
mod new_versions;
mod promotion;
mod registry;
mod service;
pub(crate) mod to_wire;
mod watch_kernel;

/// Limit on the length of a reason \[bytes\]: a paragraph.
pub(crate) const REASON_BYTES_MAX: usize = 1024;
