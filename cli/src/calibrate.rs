//! The command `lightpath calibrate`: from a connected rig to a promoted kernel, unattended.
//!
//! Every step is a job or a call with a name of its own, derived from the dataset's. So the same command after an
//! interruption finds what was done, and goes on.

mod judge;
mod steps;

use super::arguments::{distance, wavelength};
use super::failure::Failure;
use super::jobs::capture_photos;
use super::session::{Session, print_note};
use super::{destination, show};
use clap::Args;
use lightpath::v1::capture_photos::Pattern;
use lightpath::v1::{self, job_spec, prepare_dataset};
use lightpath::{hologram_result, learn_result, names, photos_result, report_result};
use std::path::PathBuf;
use steps::Steps;

/// Steps of the holograms that are photographed.
const ITERATIONS: u32 = 60;
/// Range of the random phases of every second hologram \[rad\]: full turns light all of the optics, narrow ranges show the
/// shape of the modulator.
const WIDE_RANGE_RAD: f64 = std::f64::consts::TAU;
/// Number of steps that are counted for people.
const STEPS: usize = 12;
/// Number of the steps that fill the dataset.
const FILLING_STEPS: usize = 6;

/// Calibrate a display at its bench: one command, unattended, from nothing to a promoted kernel.
///
/// Needs lightpath-rig at the bench. Photographs a grid of dots and finds where the camera sees the display, photographs
/// holograms of test pictures, learns a kernel from them, judges it with photographs of new pictures, and promotes it if
/// it passes the display's gate. The same command again goes on after an interruption.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  lightpath calibrate --display lab-2
  lightpath calibrate --display lab-2 --dataset monday -o monday/ --photos 30

What it does step by step, and how to do each by hand: docs/learn/calibrate.md")]
pub(crate) struct Calibrate {
    /// Calibrate the display with this id, at whose bench a rig runs
    #[arg(long, value_name = "ID")]
    display: String,

    /// Calibrate for this distance [default: where the rig's camera is focused]
    #[arg(long, value_name = "LENGTH", value_parser = distance, allow_hyphen_values = true)]
    distance: Option<f64>,

    /// Calibrate for this wavelength [default: the rig's only wavelength]
    #[arg(long, value_name = "LENGTH", value_parser = wavelength)]
    wavelength: Option<f64>,

    /// Collect the photographs in this dataset; the same name again goes on with it [default: calibration-DISPLAY]
    #[arg(long, value_name = "NAME")]
    dataset: Option<String>,

    /// Photograph this many holograms to learn from, 6 to 100
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(6..=100))]
    photos: u32,

    /// Take the mean of this many exposures for each photograph, 1 to 100
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100))]
    exposures: u32,

    /// Set the highest polynomial degree of what is learned, 1 to 12 [default: the one that predicts best]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=12))]
    degree: Option<u32>,

    /// Leave the decision about the new version to a person
    #[arg(long)]
    no_promote: bool,

    /// Write the report and the photographs of the judgement to this folder; a missing folder is created
    #[arg(short = 'o', value_name = "FOLDER")]
    folder: Option<PathBuf>,
}

/// The bench that is calibrated.
struct Bench {
    display: String,
    dataset: String,
    wavelength_m: f64,
    place: v1::Place,
    exposures: u32,
}

impl Calibrate {
    pub(crate) async fn run(self, session: &Session) -> Result<(), Failure> {
        if let Some(folder) = &self.folder {
            destination::create_folder("-o", folder)?;
        }
        let bench = self.bench(session).await?;
        let steps = Steps::new(session, &bench.dataset, STEPS);
        let found = self.prepared(session, &bench, &steps).await?;
        if found.state() != v1::dataset::State::Finalized {
            self.photographed(session, &bench, &steps).await?;
        } else {
            steps.skip(FILLING_STEPS);
        }
        let learned = steps.job("learn", "learn a kernel", self.learning(&bench)).await?;
        let kernel = learn_result(&learned)?.kernels.first().cloned().unwrap_or_default();
        let version = kernel.kernel_version;
        let metrics = kernel.metrics.unwrap_or_default();
        print_note(&format!(
            "{version}: loss of held-out photographs {}, with ideal optics {}",
            show::loss(metrics.test_loss),
            show::loss(metrics.ideal_test_loss)
        ));
        let report = v1::ReportKernel { kernel_version: version.clone() };
        let report = steps.job("report", "draw the report", job_spec::Kind::ReportKernel(report)).await?;
        if let Some(folder) = &self.folder {
            let file = folder.join("report.html");
            session.client.download_to(&report_result(&report)?.html, &file).await?;
            print_note(&format!("report: {}", file.display()));
        }
        let judgement = judge::judged(session, &bench, &steps, &version, self.folder.as_deref()).await?;
        session.print_text(&judgement)?;
        self.promoted(session, &steps, &version).await
    }

    /// The rig's place and light, unless others are given.
    async fn bench(&self, session: &Session) -> Result<Bench, Failure> {
        let display = names::display(&self.display);
        session.client.get_display(v1::GetDisplayRequest { name: display.clone() }).await?;
        let rigs = session.client.list_rigs(v1::ListRigsRequest {}).await?.rigs;
        let Some(rig) = rigs.into_iter().find(|rig| rig.name.trim_end_matches("/rig") == display) else {
            return Err(Failure::Refused(format!(
                "no rig serves {display}; start lightpath-rig at its bench, then lightpath rig list shows it"
            )));
        };
        let wavelength_m = match (self.wavelength, rig.wavelengths_m.as_slice()) {
            (Some(wavelength_m), _) => wavelength_m,
            (None, [only]) => *only,
            (None, several) => {
                let list = show::lengths(several.iter().copied());
                return Err(Failure::Usage(format!(
                    "the rig has several wavelengths, {list}; choose one: --wavelength"
                )));
            }
        };
        let place = self.distance.map(v1::Place::at_m).or(rig.place).unwrap_or_default();
        let dataset = self.dataset.clone().unwrap_or_else(|| format!("calibration-{}", self.display));
        Ok(Bench { display, dataset, wavelength_m, place, exposures: self.exposures })
    }

    /// The dataset, which is created if there is none yet.
    async fn prepared(&self, session: &Session, bench: &Bench, steps: &Steps<'_>) -> Result<v1::Dataset, Failure> {
        steps.begin(&format!("collect photographs in the dataset {}", bench.dataset));
        let dataset = v1::Dataset {
            name: names::dataset(&bench.dataset),
            display: bench.display.clone(),
            wavelength_m: Some(bench.wavelength_m),
            place: Some(bench.place),
            ..Default::default()
        };
        let name = dataset.name.clone();
        match session.client.create_dataset(v1::CreateDatasetRequest { dataset: Some(dataset) }).await {
            Ok(_) => {}
            Err(error) if error.code() == Some(lightpath::Code::AlreadyExists) => {
                print_note("it exists already; what it has is kept");
            }
            Err(error) => return Err(error.into()),
        }
        Ok(session.client.get_dataset(v1::GetDatasetRequest { name }).await?)
    }

    /// Fills the dataset: dots and their alignment, holograms and their photographs.
    async fn photographed(&self, session: &Session, bench: &Bench, steps: &Steps<'_>) -> Result<(), Failure> {
        let request = v1::CreateCalibrationTargetRequest { display: bench.display.clone(), picture: None };
        let dots = session.client.create_calibration_target(request).await?.target;
        let hologram = bench.hologram(&dots, ITERATIONS, None);
        let hologram = steps.job("dots-hologram", "compute the hologram of the dots", hologram).await?;
        let patterns = vec![Pattern { id: "dots".to_owned(), pattern: pattern_of(&hologram)? }];
        let dots = steps.job("dots", "photograph the dots", bench.capture(&patterns, false)).await?;
        let photo = photos_result(&dots)?.photos.first().map(|photo| photo.photo.clone()).unwrap_or_default();
        let source = prepare_dataset::align::Source::DotsPhoto(photo);
        let align = prepare_dataset::Step::Align(prepare_dataset::Align { source: Some(source) });
        let aligned = steps.job("align", "find where the camera sees the display", bench.preparation(align)).await?;
        steps::note_alignment(&aligned)?;

        let mut kinds = Vec::new();
        for number in 0..self.photos {
            let request = v1::CreateCalibrationTargetRequest { display: bench.display.clone(), picture: Some(number) };
            let target = session.client.create_calibration_target(request).await?.target;
            let range_rad = (number % 2 == 1).then_some(WIDE_RANGE_RAD);
            kinds.push((format!("p{number:02}"), bench.hologram(&target, ITERATIONS, range_rad)));
        }
        let jobs = steps.jobs("compute holograms of test pictures", kinds).await?;
        let mut patterns = Vec::new();
        for (id, job) in jobs {
            patterns.push(Pattern { id, pattern: pattern_of(&job)? });
        }
        let taken = steps.job("photos", "photograph them", bench.capture(&patterns, true)).await?;
        let result = photos_result(&taken)?;
        for retaken in &result.retaken {
            print_note(&format!("taken again: {} {}", retaken.id, retaken.reason));
        }
        let added = capture_photos::add_to(session, &bench.dataset, &patterns, result).await?;
        for pair in &added.pairs {
            for finding in &pair.findings {
                print_note(&format!("{} {}", pair.id, finding.message));
            }
        }
        let finalize = prepare_dataset::Step::Finalize(prepare_dataset::Finalize::default());
        steps
            .job("finalize", "divide them into those to learn from and those to judge by", bench.preparation(finalize))
            .await?;
        Ok(())
    }

    fn learning(&self, bench: &Bench) -> job_spec::Kind {
        job_spec::Kind::LearnKernel(v1::LearnKernel {
            datasets: vec![names::dataset(&bench.dataset)],
            degree: self.degree,
            ..Default::default()
        })
    }

    /// Promotes the version if it passes the gate.
    async fn promoted(&self, session: &Session, steps: &Steps<'_>, version: &str) -> Result<(), Failure> {
        steps.begin("ask the display's gate");
        let verdict = session.client.check_promotion(v1::CheckPromotionRequest { name: version.to_owned() }).await?;
        for check in &verdict.checks {
            print_note(&format!("{} {}", if check.passed { "passed:" } else { "FAILED:" }, check.finding));
        }
        let (kernel, number) = (names::kernel_of(version), names::id(version).parse::<u32>().unwrap_or_default());
        if !verdict.passed {
            return Err(Failure::Refused(format!("{version} does not pass the gate, and is not active")));
        }
        if verdict.active_version == Some(number) {
            return session.print_text(&format!("{version} is active"));
        }
        if self.no_promote {
            return session
                .print_text(&format!("{version} passes the gate; promote it: lightpath kernel promote --help"));
        }
        let request = v1::PromoteKernelRequest {
            kernel: kernel.to_owned(),
            version: number,
            reason: format!("calibrated at the bench, {}", self.dataset.as_deref().unwrap_or(&self.display)),
            expected_active_version: Some(verdict.active_version.unwrap_or(0)),
            force: false,
        };
        session.client.promote_kernel(request).await?;
        session.print_text(&format!("{version} is active now"))
    }
}

impl Bench {
    /// The hologram of a target for ideal optics, with random phases of a range at the begin.
    fn hologram(&self, target: &str, iterations: u32, range_rad: Option<f64>) -> job_spec::Kind {
        use v1::optimize_hologram::{ImagePlane, InitialPhase, initial_phase};
        let random = |range_rad| InitialPhase {
            kind: Some(initial_phase::Kind::Random(initial_phase::Random { range_rad: Some(range_rad) })),
        };
        job_spec::Kind::OptimizeHologram(v1::OptimizeHologram {
            display: self.display.clone(),
            wavelengths_m: vec![self.wavelength_m],
            planes: vec![ImagePlane { place: Some(self.place), target: target.to_owned(), weight: None }],
            kernel: Some(v1::KernelChoice::ideal()),
            iterations: Some(iterations),
            initial_phase: range_rad.map(random),
            judge: v1::optimize_hologram::Judging::None.into(),
            seed: 1,
            ..Default::default()
        })
    }

    fn capture(&self, patterns: &[Pattern], is_aligned: bool) -> job_spec::Kind {
        job_spec::Kind::CapturePhotos(v1::CapturePhotos {
            display: self.display.clone(),
            wavelength_m: Some(self.wavelength_m),
            place: Some(self.place),
            patterns: patterns.to_vec(),
            aligned_by: if is_aligned { names::dataset(&self.dataset) } else { String::new() },
            exposure_s: None,
            exposure_count: Some(self.exposures),
        })
    }

    fn preparation(&self, step: prepare_dataset::Step) -> job_spec::Kind {
        job_spec::Kind::PrepareDataset(v1::PrepareDataset { dataset: names::dataset(&self.dataset), step: Some(step) })
    }
}

/// Digest of the only pattern of a job that optimized a hologram.
fn pattern_of(job: &v1::Job) -> Result<String, Failure> {
    let wavelengths = &hologram_result(job)?.wavelengths;
    let subframe = wavelengths.first().and_then(|wavelength| wavelength.subframes.first());
    Ok(subframe.map(|subframe| subframe.pattern.clone()).unwrap_or_default())
}
