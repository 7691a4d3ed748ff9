//! Artifacts: upload, download, and access for other resources.

pub(crate) mod download;
mod lookup;
mod picture;
mod service;
mod store_artifact;
mod to_wire;
mod upload;
