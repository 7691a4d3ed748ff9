//! The stream of all events, for dashboards.
//!
//! One task turns the announcements of the store into events, and keeps the latest ones. Any number of streams send
//! them, so that a change is read from the database once, not once for each dashboard.
//!
//! # Layout
//!
//! - `publisher`: the task that fills the log of events. `service`: the streams that read it.

mod publisher;
mod service;
