//! The Lightpath server: a durable job queue, workers on the optics engine, and a registry of learned kernels,
//! behind one gRPC and HTTP port.
//!
//! # Layout
//!
//! - [`units`], [`display`], [`dataset`], [`kernel`], [`job`]: the domain, plain validated Rust that knows no
//!   database, no wire type and no clock.
//! - [`pictures`]: decoding of targets, photographs and holograms, and encoding of results.
//! - [`kernel_file`]: learned displays as safetensors.
//! - [`artifacts`]: content-addressed files and resumable uploads.
//! - [`store`]: the durable queue and registry; the only place that knows the database.
//! - [`worker`]: claims jobs and runs them.
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod artifacts;
pub mod dataset;
pub mod display;
pub mod job;
pub mod kernel;
pub mod kernel_file;
pub mod pictures;
pub mod store;
pub mod units;
pub mod worker;
