//! Jobs that photograph patterns at the bench of a display, and the command `lightpath capture`.

use crate::arguments::Optics;
use crate::destination::{self, Destination};
use crate::failure::Failure;
use crate::jobs::JobKind;
use crate::jobs::submission::Submission;
use crate::session::{Session, print_note};
use crate::table::{Facts, Table};
use crate::{inputs, show, times};
use clap::Args;
use lightpath::v1::capture_photos::Pattern;
use lightpath::v1::{self, CapturePhotos, CapturePhotosResult, Job, Place, job_spec};
use lightpath::{names, photos_result};
use std::path::{Path, PathBuf};

const PHOTO: Destination = Destination {
    option: "-o",
    suffix: ".png",
    formats: &[("png", "grey levels of 8 or 16 bits, linear light, white is full scale")],
};
/// Patterns that are read: the server takes PNG, BMP and .npy.
const PATTERNS: &[&str] = &["png", "bmp", "npy"];

/// Photograph holograms at the bench of a display.
///
/// Needs lightpath-rig, which runs at the computer with SLM and camera and is connected to the server. Each photograph is
/// checked: one that is black, saturated, displaced, or of another hologram is taken again, and never kept. The job goes
/// on where it was when the server, the rig or the network fails.
#[derive(Debug, Args)]
#[command(
    override_usage = "lightpath capture [OPTIONS] --display <ID> --distance <LENGTH>\n           --pattern <FILE>... <-o <PHOTO.png>|--dataset <NAME>>"
)]
#[command(after_long_help = "\
Examples:
  lightpath capture --display lab-2 --distance 150mm --pattern p01.png \\
      -o c01.png

  All holograms of a folder, as pairs of a dataset, and as files
    lightpath capture --display lab-2 --distance 150mm --pattern holograms/ \\
        --dataset bench-1 -o photos/

If the dataset has an alignment (lightpath dataset align), each photograph is compared with what its hologram should
show.")]
pub(crate) struct Capture {
    #[command(flatten)]
    optics: Optics,

    /// Photograph these patterns, which have the display's size: grey PNGs or BMPs of levels, or .npy files of the phase
    /// in radians (floats); a folder stands for all such files in it
    #[arg(long = "pattern", value_name = "FILE", required = true, num_args = 1..)]
    patterns: Vec<PathBuf>,

    /// Write the photographs here: a file, a folder, or a pattern with {name}; grey PNGs, linear light
    #[arg(short = 'o', value_name = "PHOTO.png", required_unless_present = "dataset")]
    photos: Option<PathBuf>,

    /// Add the patterns and their photographs to this open dataset, with exposure and black level
    #[arg(long, value_name = "NAME")]
    dataset: Option<String>,

    /// Expose each photograph for this time, such as 20ms [default: found with the first pattern, so that its brightest
    /// parts have three quarters of full scale]
    #[arg(long, value_name = "TIME", value_parser = times::exposure_s)]
    exposure: Option<f64>,

    /// Take the mean of this many exposures for each photograph, 1 to 100
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100))]
    exposures: u32,

    #[command(flatten)]
    submission: Submission,
}

impl Capture {
    pub(crate) async fn run(self, session: &Session) -> Result<(), Failure> {
        let files = inputs::expanded(&self.patterns, PATTERNS)?;
        inputs::require_pictures(&files)?;
        let ids: Vec<String> = files.iter().map(|pattern| destination::name_of(pattern)).collect();
        let photos = match &self.photos {
            Some(photos) => PHOTO.files(&session.stdout, photos, &ids)?,
            None => Vec::new(),
        };
        destination::check_distinct(files.iter().map(PathBuf::as_path), photos.iter().map(PathBuf::as_path))?;
        let aligned_by = match &self.dataset {
            Some(dataset) => aligned(session, dataset).await?,
            None => String::new(),
        };
        let mut patterns = Vec::with_capacity(files.len());
        for (file, id) in files.iter().zip(ids) {
            patterns.push(Pattern { id, pattern: session.upload(file).await? });
        }
        let kind = job_spec::Kind::CapturePhotos(CapturePhotos {
            display: names::display(&self.optics.display),
            wavelength_m: self.optics.wavelength_m(),
            place: Some(Place::at_m(self.optics.distance)),
            patterns: patterns.clone(),
            aligned_by,
            exposure_s: self.exposure,
            exposure_count: Some(self.exposures),
        });
        let job = self.submission.submit_and_wait(session, kind).await?;
        let result = photos_result(&job)?;
        save(session, result, &photos).await?;
        if let Some(dataset) = &self.dataset {
            add_to(session, dataset, &patterns, result).await?;
        }
        session.print(&job, |_| table(result))
    }
}

/// The dataset's name if it has an alignment, with which photographs can be compared; else nothing.
async fn aligned(session: &Session, dataset: &str) -> Result<String, Failure> {
    let name = names::dataset(dataset);
    let found = session.client.get_dataset(v1::GetDatasetRequest { name: name.clone() }).await?;
    if found.alignment.is_some() {
        return Ok(name);
    }
    print_note(&format!(
        "{dataset} has no alignment, so the photographs are compared with each other only; photograph the dots first: \
         lightpath dataset calibration --help"
    ));
    Ok(String::new())
}

async fn save(session: &Session, result: &CapturePhotosResult, files: &[PathBuf]) -> Result<(), Failure> {
    for (photo, file) in result.photos.iter().zip(files) {
        destination::save(session, &photo.photo, file as &Path).await?;
    }
    Ok(())
}

/// Adds the photographs with their patterns to a dataset. Pairs that it has already stay as they are.
pub(crate) async fn add_to(
    session: &Session,
    dataset: &str,
    patterns: &[Pattern],
    result: &CapturePhotosResult,
) -> Result<v1::AddPairsResponse, Failure> {
    let pairs = patterns.iter().zip(&result.photos).map(|(pattern, photo)| v1::Pair {
        id: pattern.id.clone(),
        pattern: pattern.pattern.clone(),
        photo: photo.photo.clone(),
        black_level: result.black_level.unwrap_or(0.0),
        exposure_s: Some(photo.exposure_s),
        ..Default::default()
    });
    let request = v1::AddPairsRequest { dataset: names::dataset(dataset), pairs: pairs.collect() };
    Ok(session.client.add_pairs(request).await?)
}

impl JobKind for CapturePhotos {
    fn title(&self) -> (&'static str, &str) {
        ("photograph", names::id(&self.display))
    }

    fn spec_facts(&self, _: &Job, facts: &mut Facts) {
        facts.add("display", names::id(&self.display));
        facts.add("optics", show::optics(self.wavelength_m(), self.place.as_ref()));
        facts.add("patterns", self.patterns.len().to_string());
        if !self.aligned_by.is_empty() {
            facts.add("aligned by", names::id(&self.aligned_by));
        }
    }

    fn result_facts(&self, job: &Job, facts: &mut Facts) -> lightpath::Result<String> {
        let result = photos_result(job)?;
        facts.add("rig", show::plain(&result.rig));
        Ok(format!("\n{}", table(result)))
    }
}

/// A table of the photographs, and what was taken again.
pub(crate) fn table(result: &CapturePhotosResult) -> String {
    let mut table = Table::new("photograph|>exposure|>match?|>next best??|taken?|>temperature???");
    for photo in &result.photos {
        let number = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |value| format!("{value:.2}"));
        table.row([
            show::plain(&photo.id),
            exposure(photo.exposure_s),
            number(photo.correlation),
            number(photo.other_correlation),
            show::clock_or_dash(photo.exposure_time.as_ref()),
            photo.temperature_c.map_or_else(|| "–".to_owned(), |celsius| format!("{celsius:.1} °C")),
        ]);
    }
    let mut text = table.text();
    if let Some(black_level) = result.black_level {
        text += &format!("black level {:.2} % of full scale\n", 100.0 * black_level);
    }
    for retaken in &result.retaken {
        text += &format!("taken again: {} {}\n", show::plain(&retaken.id), show::plain(&retaken.reason));
    }
    text
}

/// An exposure as text, such as `12.5 ms`.
pub(crate) fn exposure(exposure_s: f64) -> String {
    match exposure_s {
        ..1e-3 => format!("{:.3} ms", 1e3 * exposure_s),
        1e-3..1.0 => format!("{:.1} ms", 1e3 * exposure_s),
        _ => format!("{exposure_s:.2} s"),
    }
}
