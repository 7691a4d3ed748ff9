//! The gRPC services and HTTP on one port, and who may call them.
//!
//! # Layout
//!
//! - The resources, each with its service, and the conversions of its messages `from_wire` and `to_wire`: `displays`,
//!   `datasets`, `jobs` (with a folder for each kind of job), `queue`, `kernels`, `artifacts`.
//! - `optics`: messages of the optics engine that several resources use, such as propagation methods and regions.
//! - `api`: what all services share. `call`: from a gRPC request with its caller to an answer.
//! - `rules`: which roles may make which call. `permissions`: which displays a caller may use.
//! - `field`, `names`, `pages`, `time`: checking fields, resource names, pages of lists, and times. `enumerations`: those of
//!   messages and those of the domain, value by value.
//! - `watch`: streams that follow something. `stream_limits`: how many streams there may be.
//! - `decoding`: work that takes a processor for long. `checked_targets`: which targets were found to have light.
//! - `error`: why a request is refused. `status`: the one map from errors to gRPC statuses.
//! - [`http`]: health, metrics, JSON, and the gate that every request passes.
//! - [`connections`]: gRPC and HTTP on one port. [`tls`]: certificates. [`audit`]: who changed what, and who was refused.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod api;
mod artifacts;
pub mod audit;
mod call;
mod checked_targets;
pub mod connections;
mod datasets;
mod decoding;
mod displays;
mod enumerations;
mod error;
mod field;
pub mod http;
mod jobs;
mod kernels;
mod names;
mod optics;
mod pages;
mod permissions;
mod queue;
mod rules;
mod status;
mod stream_limits;
mod time;
pub mod tls;
mod watch;

pub use api::Api;
pub use error::ApiError;
