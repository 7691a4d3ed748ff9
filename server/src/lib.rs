//! The Lightpath server: a durable job queue, workers on the optics engine, and a registry of learned kernels,
//! behind one gRPC and HTTP port.
//!
//! # Layout
//!
//! - [`units`], [`display`], [`dataset`], [`kernel`], [`job`], [`propagation`]: the domain, plain validated Rust that knows no
//!   database, no wire type and no clock.
//! - [`pictures`]: decoding of targets, photographs and holograms, and encoding of results.
//! - `npy`: the limits of NumPy's files, for [`pictures`] and [`kernel_formats`].
//! - [`captures`]: photographs of holograms, brought to the display's grid and checked.
//! - [`kernel_file`]: learned displays as safetensors; [`kernel_formats`]: in other forms. `planning`, `slm`: from displays to optical setups and modulators.
//! - [`figures`]: contact sheets, heat maps and curves for people.
//! - [`report`]: what a learned kernel is like, as HTML, pictures and arrays.
//! - [`demo`]: the whole loop on a simulated display, for people to see.
//! - [`access`]: roles and tokens. `audit`: what was done and refused. [`tls`]: certificates.
//! - [`artifacts`]: content-addressed files and resumable uploads.
//! - [`store`]: the durable queue and registry; the only place that knows the database.
//! - [`fuzzing`]: an entry to every decoder. `fail`: places where tests make the process die or a call fail.
//! - [`upkeep`]: what operators do to a data folder: check, back up, restore.
//! - [`worker`]: claims jobs and runs them.
//! - `api`: the gRPC services. `http`: health, metrics and JSON. `connections`: both on one port.
//! - [`config`], [`server`], [`metrics`]: settings, assembly, and what Prometheus is told. `causes`: errors in one line.
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod access;
mod api;
pub mod artifacts;
mod audit;
pub mod captures;
mod causes;
pub mod config;
mod connections;
pub mod dataset;
pub mod demo;
pub mod display;
mod fail;
pub mod figures;
#[cfg(test)]
mod fixtures;
pub mod fuzzing;
mod http;
pub mod job;
pub mod kernel;
pub mod kernel_file;
pub mod kernel_formats;
pub mod metrics;
mod npy;
pub mod pictures;
mod planning;
pub mod propagation;
pub mod report;
pub mod server;
mod slm;
pub mod store;
pub mod tls;
pub mod units;
pub mod upkeep;
pub mod worker;
