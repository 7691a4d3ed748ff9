//! The gRPC services and HTTP on one port, with access rules.
//!
//! # Layout
//!
//! - The resources, each with its service and with the conversions of its messages (`from_wire` and `to_wire`):
//!   `displays`, `datasets`, `jobs` (with a folder for each kind of job), `queue`, `kernels`, `photos`, `artifacts`.
//! - `manifests`: signed manifests of kernels, for devices. `rollouts`, `devices`: which devices get which version, and
//!   what they report.
//! - `webhooks`: addresses that learn of events.
//! - `optics`: messages of the optics engine that several resources use, such as propagation methods and regions.
//! - `api`: state shared by all services. `call`: passing gRPC requests with their callers to methods.
//! - `rules`: which roles may make each call. `permissions`: which displays a caller may use.
//! - `field`, `names`, `pages`, `time`: checks of fields, resource names, pages of lists, and times.
//! - `wrong_fields`: checks that go on, so that a refusal names all wrong fields.
//! - `server_facts`: facts about the server and the caller's token.
//! - `events`: the stream of all changes, for dashboards.
//! - `accounts`: what each client uses: calls, memory, threads and streams. `watch`: streams that follow changes.
//! - `reconstructors`: optics for the pairs of a dataset. `checked_targets`: a memory of the targets that have light.
//! - `error`: errors of the API. `status`: conversion of errors into gRPC statuses.
//! - [`http`]: health, metrics, JSON, and the gate that every request passes.
//! - [`connections`]: gRPC and HTTP on one port. [`tls`]: certificates. [`audit`]: log of changes and refusals.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod accounts;
mod api;
mod artifacts;
pub mod audit;
mod call;
mod checked_targets;
pub mod connections;
mod datasets;
mod devices;
mod displays;
mod enumerations;
mod error;
mod events;
mod field;
pub mod http;
mod jobs;
mod kernels;
mod manifests;
mod names;
mod optics;
mod pages;
mod permissions;
mod photos;
mod queue;
mod reconstructors;
mod rollouts;
mod rules;
mod server_facts;
mod status;
mod time;
pub mod tls;
mod watch;
mod webhooks;
mod wrong_fields;

pub use api::{Api, ApiLimits};
pub use error::ApiError;
pub use jobs::estimate::JobLimits;
pub use manifests::ManifestRules;
