//! A typed client of a Lightpath server. The command line `lightpath` is built on it.
//!
//! ```no_run
//! use lightpath::v1::{OptimizeHologram, Place, SubmitJobRequest, job_spec, optimize_hologram::ImagePlane};
//! use lightpath::{Client, job_spec};
//!
//! # async fn run() -> lightpath::Result<()> {
//! let client = Client::connect("http://127.0.0.1:7070")?;
//! let target = client.upload_file("indian_head.png".as_ref()).await?;
//! let spec = job_spec(job_spec::Kind::OptimizeHologram(OptimizeHologram {
//!     display: "displays/lab-2".into(),
//!     planes: vec![ImagePlane { place: Some(Place::at_m(0.15)), target, ..Default::default() }],
//!     ..Default::default()
//! }));
//! let job = client.submit(SubmitJobRequest { spec: Some(spec), ..Default::default() }).await?;
//! let job = client.wait(&job.name, |_| ()).await?;
//! let hologram = lightpath::hologram_result(&job)?;
//! let pattern = &hologram.wavelengths[0].subframes[0].pattern;
//! client.download_to(pattern, "pattern.png".as_ref()).await?;
//! # Ok(())
//! # }
//! ```
//!
//! # Layout
//!
//! - [`Client`]: a connection to a server, with a method for each call of the API (`calls.rs`). Requests and answers are
//!   the generated messages of [`v1`].
//! - Transfers: [`Client::upload_bytes`] and [`Client::upload_file`] (`upload.rs`), [`Client::download`] and
//!   [`Client::download_to`] (`download.rs`), [`Client::fetch_kernel`] (`kernel.rs`, with
//!   [`Client::follow_kernel`]). Each is checked against its
//!   SHA-256 digest and repeated or continued after a lost connection.
//! - Jobs: [`Client::submit`], [`Client::wait`], and functions that return the result of a job (`job.rs`).
//! - Rigs: [`Client::serve_rig`], the stream of a program at a bench (`rig.rs`).
//! - [`names`]: resource names. [`units`]: lengths as text, such as `150mm` or `515nm`. [`Words`]: enumerations as words.
//! - [`Error`]: why a call failed, with its gRPC [`Code`]; a refusal lists the wrong fields.
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
mod rig;
mod upload;

pub use client::{Client, Credentials};
pub use digest::digest_of;
pub use download::replace_file;
pub use error::{Error, FieldViolation, Refusal, Result};
pub use job::{
    JobChange, capture_result, evaluate_result, has_ended, hologram_result, job_spec, learn_result, photos_result,
    prepare_result, report_result, suggest_result, verify_result,
};
pub use kernel::KernelChange;
pub use lightpath_proto::{Word, Words, judgements, v1};
pub use lightpath_units as units;
pub use rig::RigStream;
pub use tonic::Code;
