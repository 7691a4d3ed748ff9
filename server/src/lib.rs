//! The Lightpath server: a durable job queue, workers on the optics engine, and a registry of learned kernels,
//! behind one gRPC and HTTP port.
//!
//! # Layout
//!
//! - [`units`], [`display`], [`dataset`], [`kernel`], [`job`]: the domain, plain validated Rust that knows no
//!   database, no wire type and no clock.
pub mod dataset;
pub mod display;
pub mod job;
pub mod kernel;
pub mod units;
