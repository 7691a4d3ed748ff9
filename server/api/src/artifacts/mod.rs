//! Artifacts: upload, download, and access for other resources.

pub(crate) mod download;
mod keep;
mod lookup;
mod picture;
mod service;
mod to_wire;
mod upload;
