//! The command `lightpath dataset suggest`.

use crate::destination::{self, Destination};
use crate::failure::Failure;
use crate::kernel_choice::KernelChoice;
use crate::quality_text;
use crate::session::Session;
use crate::submission::Submission;
use clap::Args;
use lightpath::v1::{self, job_spec};
use lightpath::{names, suggest_result};
use std::path::PathBuf;

const HOLOGRAM: Destination =
    Destination { option: "-o", suffix: ".png", formats: &[("png", "grey levels for the display")] };

/// Make the holograms whose photographs would tell most about a display.
///
/// A learned kernel is certain about what its photographs showed, and uncertain about the rest: frequencies that no
/// hologram lit, phases that none contained. The job makes holograms of test pictures through the kernel, from several
/// ranges of random phases, computes what a photograph of each would add, and writes the best. Photograph them, add
/// them to a new dataset together with the old pairs, and learn again.
///
/// The printed error is what predictions of such holograms are wrong by because the kernel is uncertain, after the
/// photographs of this hologram and of those before it, relative to now.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Example:
  lightpath dataset suggest --display lab-2 --distance 150mm --version 3 \\
      --holograms 4 -o next/")]
pub(crate) struct Suggest {
    #[command(flatten)]
    kernel: KernelChoice,

    /// Improve on this version [default: the newest version]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    version: Option<u32>,

    /// Suggest this many holograms, 1 to 16
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=16))]
    holograms: u32,

    /// Set the seed of the pictures and of the random phases
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,

    /// Write the holograms to this folder or to files of a pattern with {name}, grey PNGs of levels; a missing folder
    /// is created if the name ends with /
    #[arg(short = 'o', value_name = "FOLDER/")]
    destination: PathBuf,

    #[command(flatten)]
    submission: Submission,
}

impl Suggest {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let names: Vec<String> = (1..=self.holograms).map(|i| format!("s{i:02}")).collect();
        let files = HOLOGRAM.files(&session.stdout, &self.destination, &names)?;
        let kernel = self.kernel.name(session).await?;
        let version = match self.version {
            Some(version) => version,
            None => session.client.get_kernel(v1::GetKernelRequest { name: kernel.clone() }).await?.latest_version,
        };
        let kind = job_spec::Kind::SuggestHolograms(v1::SuggestHolograms {
            kernel_version: names::kernel_version(&kernel, version),
            holograms: self.holograms,
            seed: self.seed,
        });
        let job = self.submission.submit_and_wait(session, kind).await?;
        let found = suggest_result(&job)?;
        for (hologram, file) in found.holograms.iter().zip(&files) {
            destination::save(session, &hologram.phase, file).await?;
        }
        session.print(found, quality_text::suggestions)
    }
}
