//! The gRPC services and HTTP on one port, with access rules. It translates: what happens is in `lightpath_service`.
//!
//! # Layout
//!
//! - The resources, each with its service and with the conversions of its messages (`from_wire` and `to_wire`):
//!   `displays`, `datasets`, `jobs` (with a file for each kind of job), `queue`, `kernels`, `rollouts`, `devices`, `rigs`,
//!   `photos`,
//!   `webhooks`, `artifacts`.
//! - `optics`: messages of the optics engine that several resources use, such as propagation methods and regions.
//! - `api`: state shared by all services. `call`: passing gRPC requests with their callers to methods. `routes`: the routes
//!   of all services.
//! - `rules`: which roles may make each call.
//! - `enumerations`, `names`, `pages`, `time`: numbers of values, resource names, pages of lists, and times. `mask`: which
//!   fields an update changes. `once`: by what repeated requests are known.
//! - `server_facts`: facts about the server and the caller's token.
//! - `event_log`: the latest changes. `events`: the stream of all changes, for dashboards.
//! - `accounts`: what each client uses: calls, memory for messages, streams. `watch`: streams that follow changes.
//! - `status`: conversion of errors into gRPC statuses. `fixes`: what to do about them. `status_size`: statuses that fit
//!   into what clients accept.
//! - [`http`]: health, metrics, JSON, and the admission of every request.
//! - [`connections`]: gRPC and HTTP on one port. [`tls`]: certificates. [`audit`]: log of changes and refusals.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod accounts;
mod api;
mod artifacts;
pub mod audit;
mod call;
pub mod connections;
mod datasets;
mod devices;
mod displays;
mod enumerations;
mod event_log;
mod events;
mod fixes;
pub mod http;
mod jobs;
mod kernels;
mod mask;
mod names;
mod once;
mod optics;
mod pages;
mod photos;
mod queue;
mod rigs;
mod rollouts;
mod routes;
mod rules;
mod server_facts;
mod status;
mod status_size;
mod time;
pub mod tls;
mod watch;
mod webhooks;

pub use api::Api;
