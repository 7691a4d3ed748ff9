//! Jobs: submitting, listing, watching, cancelling and retrying jobs. Each kind of job has a folder.

pub(crate) mod estimate;
mod evaluate_kernel;
mod kernel_choice;
mod learn_kernel;
mod learning_rate;
mod lookup;
mod optimize_hologram;
mod prepare_dataset;
mod report_kernel;
pub(crate) mod scheduling;
mod seen_by;
mod service;
mod simulate_capture;
mod submit;
mod suggest_holograms;
pub(crate) mod to_wire;
mod verify_hologram;
mod waits_for;
mod watch_job;
