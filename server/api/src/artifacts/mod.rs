//! Artifacts: upload and download.

pub(crate) mod download;
mod service;
pub(crate) mod to_wire;
mod upload;
