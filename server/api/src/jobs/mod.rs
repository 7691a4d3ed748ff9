//! Jobs: submitting, listing, watching, cancelling and retrying jobs. `kinds` has a file for each kind of job.

mod kinds;
mod scheduling;
mod service;
mod submit;
pub(crate) mod to_wire;
mod watch_job;
