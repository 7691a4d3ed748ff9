//! Jobs that suggest holograms to photograph, and the command `lightpath dataset suggest`.

use crate::destination::{self, Destination};
use crate::failure::Failure;
use crate::jobs::JobKind;
use crate::jobs::submission::Submission;
use crate::kernel_choice::KernelChoice;
use crate::session::Session;
use crate::table::{Facts, Table};
use clap::Args;
use lightpath::suggest_result;
use lightpath::v1::{Job, SuggestHolograms, SuggestHologramsResult, job_spec};
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
/// The printed error is the part of the error of predictions that comes from what the kernel is uncertain about. Each line
/// compares it with the error today: what remains of it after learning from this hologram and from those in the lines above.
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
    pub(crate) async fn run(self, session: &Session) -> Result<(), Failure> {
        let names: Vec<String> = (1..=self.holograms).map(|i| format!("s{i:02}")).collect();
        let files = HOLOGRAM.files(&session.stdout, &self.destination, &names)?;
        let kind = job_spec::Kind::SuggestHolograms(SuggestHolograms {
            kernel_version: self.kernel.version_name(session, self.version).await?,
            holograms: Some(self.holograms),
            seed: self.seed,
        });
        let job = self.submission.submit_and_wait(session, kind).await?;
        let found = suggest_result(&job)?;
        for (hologram, file) in found.holograms.iter().zip(&files) {
            destination::save(session, &hologram.pattern, file).await?;
        }
        session.print(found, suggestions)
    }
}

impl JobKind for SuggestHolograms {
    fn title(&self) -> (&'static str, &str) {
        ("suggest holograms", self.kernel_version.trim_start_matches("displays/"))
    }

    fn spec_facts(&self, _: &Job, facts: &mut Facts) {
        facts.add("kernel", &self.kernel_version);
    }

    fn result_facts(&self, job: &Job, _: &mut Facts) -> lightpath::Result<String> {
        Ok(format!("\n{}", suggestions(suggest_result(job)?)))
    }
}

/// A table of the holograms to photograph next.
fn suggestions(found: &SuggestHologramsResult) -> String {
    let mut table = Table::new(">hologram|picture~|>phase range??|>error|tells most about?|>error by this part???");
    for (index, hologram) in found.holograms.iter().enumerate() {
        table.row([
            (index + 1).to_string(),
            hologram.picture.clone(),
            format!("{:.2} rad", hologram.phase_range_rad),
            format!("{:+.1} dB", hologram.error_db),
            hologram.part.replace('_', " "),
            format!("{:+.1} dB", hologram.part_db),
        ]);
    }
    let count = found.holograms.len();
    format!(
        "{}These {count} tell as much as {:.0} more holograms like those of the dataset.\n",
        table.text(),
        found.worth_photographs
    )
}
