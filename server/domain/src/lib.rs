//! What Lightpath is about, as plain validated Rust: it knows no database, no wire type, no file and no clock.
//!
//! # Layout
//!
//! - [`units`]: exact wavelengths and distances. [`display`], [`dataset`], [`kernel`], [`job`]: the things of the service.
//! - [`planning`], [`slm`]: a display as the optics engine sees it. Words of optics, such as detectors, methods and qualities,
//!   are the engine's own types.
//! - [`access`]: roles and tokens. [`causes`]: errors in one line.
//! - [`reason`]: why something failed or was refused, for programs.
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod access;
pub mod causes;
pub mod dataset;
pub mod display;
pub mod job;
pub mod kernel;
pub mod planning;
pub mod reason;
pub mod slm;
pub mod units;
