//! Jobs that judge the holograms of another job, and the command `lightpath hologram verify`.

use crate::failure::Failure;
use crate::identifiers::job_name;
use crate::jobs::JobKind;
use crate::jobs::submission::Submission;
use crate::session::{Session, print_note};
use crate::show;
use crate::table::{Facts, Table};
use clap::Args;
use lightpath::v1::{Job, VerifyHologram, VerifyResult, job_spec};
use lightpath::{names, units, verify_result};

/// Judge the holograms of a job by a slow, independent model, for all detectors.
///
/// The model computes in double precision. It shares the display's parameters with the engine that optimizes holograms,
/// but no transform, padding or transfer function, and light that leaves the image cannot come back into it. It judges
/// up to 128 rows of each picture, with the phases as the display shows them. The printed difference is its PSNR minus
/// the engine's PSNR on the same rows; above 0.5 dB the two contradict each other.
///
/// Every hologram job ends with such a judgement of 8 rows for its own detector, unless the model cannot judge the job's
/// kernel.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Example:
  lightpath hologram verify 01939a5e-7c1b-7d52-9b7e-0d6f3a1c2b4e")]
pub(crate) struct Verify {
    /// Verify the holograms of the job with this id or beginning of an id; the job must have succeeded
    job: String,

    #[command(flatten)]
    submission: Submission,
}

impl Verify {
    pub(crate) async fn run(self, session: &Session) -> Result<(), Failure> {
        let kind = job_spec::Kind::VerifyHologram(VerifyHologram { job: job_name(session, &self.job).await? });
        let job = self.submission.submit_and_wait(session, kind).await?;
        let found = verify_result(&job)?;
        session.print(found, opinions)?;
        if has_contradiction(found) {
            print_note("warning: the independent model contradicts the engine by more than 0.5 dB; trust its numbers");
        }
        Ok(())
    }
}

impl JobKind for VerifyHologram {
    fn title(&self) -> (&'static str, &str) {
        ("verify hologram", names::id(&self.job))
    }

    fn spec_facts(&self, _: &Job, facts: &mut Facts) {
        facts.add("hologram job", names::id(&self.job));
    }

    fn result_facts(&self, job: &Job, _: &mut Facts) -> lightpath::Result<String> {
        Ok(format!("\n{}", opinions(verify_result(job)?)))
    }
}

/// A table of the opinions on each picture, for each detector.
fn opinions(found: &VerifyResult) -> String {
    let mut table =
        Table::new("wavelength??|distance|detector|>engine???|>independent???|>difference|>rows????|verdict?");
    for plane in &found.planes {
        for (detector, opinion) in
            [("point", plane.point), ("pixel", plane.pixel), ("supersampled", plane.supersampled)]
        {
            let opinion = opinion.unwrap_or_default();
            table.row([
                units::show_m(plane.wavelength_m),
                units::show_m(plane.distance_m),
                detector.to_owned(),
                show::decibel(opinion.engine_psnr_db),
                show::decibel(opinion.independent_psnr_db),
                format!("{:+.3} dB", opinion.independent_psnr_db - opinion.engine_psnr_db),
                opinion.rows.to_string(),
                if opinion.contradicts { "contradicts" } else { "agrees" }.to_owned(),
            ]);
        }
    }
    table.text()
}

/// Whether the independent model contradicts the engine for any picture and detector.
fn has_contradiction(found: &VerifyResult) -> bool {
    let opinions = found.planes.iter().flat_map(|plane| [plane.point, plane.pixel, plane.supersampled]);
    opinions.flatten().any(|opinion| opinion.contradicts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath::v1::{SecondOpinion, verify_result::PlaneOpinion};

    #[test]
    fn opinions_of_every_detector_are_compared() {
        let opinion = |independent_psnr_db: f64| {
            let contradicts = (independent_psnr_db - 40.0).abs() > 0.5;
            SecondOpinion { rows: 8, engine_psnr_db: 40.0, independent_psnr_db, contradicts }
        };
        let planes = vec![PlaneOpinion {
            wavelength_m: 515e-9,
            distance_m: 0.15,
            point: Some(opinion(40.0)),
            pixel: Some(opinion(39.0)),
            supersampled: Some(opinion(40.25)),
        }];
        let found = VerifyResult { planes };
        let text = opinions(&found);
        let words = |line: &str| line.split_whitespace().collect::<Vec<_>>().join(" ");
        let lines: Vec<_> = text.lines().skip(1).map(words).collect();
        assert_eq!(lines[1], "515 nm 150 mm pixel 40.0 dB 39.0 dB -1.000 dB 8 contradicts");
        assert_eq!(lines[2], "515 nm 150 mm supersampled 40.0 dB 40.2 dB +0.250 dB 8 agrees");
        assert!(has_contradiction(&found) && !has_contradiction(&VerifyResult::default()));
    }
}
