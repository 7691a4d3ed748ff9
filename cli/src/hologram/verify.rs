//! The command `lightpath hologram verify`.

use crate::failure::Failure;
use crate::identifiers::job_name;
use crate::quality_text;
use crate::session::{Session, print_note};
use crate::submission::Submission;
use clap::Args;
use lightpath::v1::{self, job_spec};
use lightpath::verify_result;

/// Judge the holograms of a job by a slow, independent model, for all detectors.
///
/// The model computes in double precision. It shares the display's parameters with the engine that optimizes holograms,
/// but no transform, padding or transfer function, and light that leaves the image cannot come back into it. It judges
/// up to 128 rows of each picture, with the phases as the display shows them. The printed difference is its PSNR minus
/// that of the engine on the same rows; above 0.5 dB the two contradict each other.
///
/// Every hologram job has such an opinion on 8 rows for its own detector already, where the model can judge its kernel.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Example:
  lightpath hologram verify 01939a5e-7c1b-7d52-9b7e-0d6f3a1c2b4e")]
pub(crate) struct Verify {
    /// Verify the holograms of the job with this id, or the beginning of one; it must have succeeded
    job: String,

    #[command(flatten)]
    submission: Submission,
}

impl Verify {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let kind = job_spec::Kind::VerifyHologram(v1::VerifyHologram { job: job_name(session, &self.job).await? });
        let job = self.submission.submit_and_wait(session, kind).await?;
        let found = verify_result(&job)?;
        session.print(found, quality_text::opinions)?;
        if quality_text::has_contradiction(found) {
            print_note("warning: the independent model contradicts the engine by more than 0.5 dB; trust its numbers");
        }
        Ok(())
    }
}
