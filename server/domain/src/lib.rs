//! The domain of Lightpath as plain validated Rust types, independent of database, wire format, files and clock.
//!
//! # Layout
//!
//! - [`units`]: exact wavelengths and distances. [`display`], [`dataset`], [`kernel`], [`job`]: the resources of the
//!   service. [`kernel_format`]: the file forms of kernels. [`lineage`]: where versions come from.
//! - [`promotion`]: what a version must show before it becomes active. [`rollout`], [`device`]: versions on their way
//!   to the displays in the field.
//! - [`webhook`]: addresses that learn of events. [`origin`]: lists of allowed origins.
//! - [`expected_psnr`]: what a photograph of a hologram is expected to show.
//! - [`planning`], [`slm`]: conversion from displays to the types of the optics engine.
//! - [`ability`]: labels and memory of processes, and what jobs need of them. [`access`]: roles and tokens. [`causes`]: error messages in one line.
//! - [`digests`]: digests of contents.
//! - [`reason`]: codes for errors and refusals, for programs.
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod ability;
pub mod access;
pub mod causes;
pub mod dataset;
pub mod device;
pub mod digests;
pub mod display;
pub mod expected_psnr;
pub mod job;
pub mod kernel;
pub mod kernel_format;
pub mod lineage;
pub mod origin;
pub mod planning;
pub mod promotion;
pub mod reason;
pub mod rollout;
pub mod slm;
pub mod units;
pub mod webhook;
