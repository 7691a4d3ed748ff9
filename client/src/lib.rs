//! A typed client of a Lightpath server, and the command line `lightpath` on top of it.
//!
//! ```no_run
//! use lightpath::v1::{OptimizeHologram, SubmitJobRequest, job_spec, optimize_hologram::ImagePlane};
//! use lightpath::{Client, job_spec};
//!
//! # async fn run() -> lightpath::Result<()> {
//! let client = Client::connect("http://127.0.0.1:7070")?;
//! let target = client.upload_file("indian_head.png".as_ref()).await?;
//! let spec = job_spec(job_spec::Kind::OptimizeHologram(OptimizeHologram {
//!     display: "displays/lab-2".into(),
//!     planes: vec![ImagePlane { distance_m: 0.15, target, ..Default::default() }],
//!     ..Default::default()
//! }));
//! let job = client.submit(SubmitJobRequest { spec: Some(spec), ..Default::default() }).await?;
//! let job = client.wait(&job.name, |_| ()).await?;
//! let hologram = lightpath::hologram_result(&job)?;
//! let phase = &hologram.wavelengths[0].frames[0].phase;
//! client.download_to(phase, "phase.png".as_ref()).await?;
//! # Ok(())
//! # }
//! ```
//!
//! # Layout
//!
//! - [`Client`]: one channel to a server, and a method for every call of the API (`calls.rs`), in the generated
//!   messages of [`v1`].
//! - Transfers: [`Client::upload_bytes`] and [`Client::upload_file`] (`upload.rs`), [`Client::download`] and
//!   [`Client::download_to`] (`download.rs`), [`Client::fetch_kernel`] (`kernel.rs`). All are checked against
//!   their SHA-256 and go on after a break.
//! - Jobs: [`Client::submit`], [`Client::wait`] and what a job gave (`job.rs`).
//! - [`names`]: resource names; [`units`]: `150mm`, `8um`, `515nm` and back; [`Words`]: enumerations as words.
//! - [`Error`]: what the server refused and why, field by field.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod calls;
mod client;
mod digest;
mod download;
mod error;
mod job;
mod kernel;
pub mod names;
mod retry;
pub mod units;
mod upload;

pub use client::{Client, Credentials};
pub use digest::digest_of;
pub use error::{Error, FieldViolation, Refusal, Result};
pub use job::{
    JobChange, capture_result, evaluate_result, has_ended, hologram_result, job_spec, learn_result, prepare_result,
    report_result,
};
pub use lightpath_proto::{Word, Words, v1};
