//! Jobs that judge the holograms of another job, and the command `lightpath hologram verify`.

use crate::failure::Failure;
use crate::identifiers::job_name;
use crate::jobs::JobKind;
use crate::jobs::submission::Submission;
use crate::session::{Session, print_note};
use crate::show;
use crate::table::{Facts, Table};
use clap::Args;
use lightpath::v1::{Job, VerifyHologram, VerifyHologramResult, job_spec};
use lightpath::{Words as _, judgements, names, units, verify_result};

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
fn opinions(found: &VerifyHologramResult) -> String {
    let mut table =
        Table::new("wavelength??|distance|detector|>engine???|>independent???|>difference|>rows????|verdict?");
    for plane in &found.planes {
        for (engine, independent) in judgements::opinions(&plane.judgements) {
            table.row([
                units::show_m(plane.wavelength_m),
                show::place(plane.place.as_ref()),
                independent.detector().word().to_owned(),
                show::decibel(engine.psnr()),
                show::decibel(independent.psnr()),
                format!("{:+.3} dB", independent.psnr() - engine.psnr()),
                independent.rows().to_string(),
                if independent.contradicts { "contradicts" } else { "agrees" }.to_owned(),
            ]);
        }
    }
    table.text()
}

/// Whether the independent model contradicts the engine for any picture and detector.
fn has_contradiction(found: &VerifyHologramResult) -> bool {
    found.planes.iter().flat_map(|plane| &plane.judgements).any(|judged| judged.contradicts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath::v1::{Detector, Judgement, Measure, Place, judgement, verify_hologram_result::PlaneOpinion};

    #[test]
    fn opinions_of_every_detector_are_compared() {
        let opinion = |detector: Detector, psnr_db: f64| {
            let measure = |value| Some(Measure { value, ..Measure::default() });
            let engine = Judgement {
                model: judgement::Model::Engine.into(),
                detector: detector.into(),
                rows: Some(8),
                psnr_db: measure(40.0),
                ..Judgement::default()
            };
            let contradicts = (psnr_db - 40.0).abs() > 0.5;
            let model = judgement::Model::Independent.into();
            [engine.clone(), Judgement { model, psnr_db: measure(psnr_db), contradicts, ..engine }]
        };
        let judged = [(Detector::Point, 40.0), (Detector::Pixel, 39.0), (Detector::Supersampled, 40.25)];
        let found = VerifyHologramResult {
            planes: vec![PlaneOpinion {
                wavelength_m: 515e-9,
                place: Some(Place::at_m(0.15)),
                judgements: judged.into_iter().flat_map(|(detector, db)| opinion(detector, db)).collect(),
            }],
        };
        let text = opinions(&found);
        let words = |line: &str| line.split_whitespace().collect::<Vec<_>>().join(" ");
        let lines: Vec<_> = text.lines().skip(1).map(words).collect();
        assert_eq!(lines[1], "515 nm 150 mm pixel 40.0 dB 39.0 dB -1.000 dB 8 contradicts");
        assert_eq!(lines[2], "515 nm 150 mm supersampled 40.0 dB 40.2 dB +0.250 dB 8 agrees");
        assert!(has_contradiction(&found) && !has_contradiction(&VerifyHologramResult::default()));
    }
}
