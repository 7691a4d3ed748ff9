//! Jobs that align and finalize datasets, and the commands `lightpath dataset align` and `finalize`.

use crate::arguments::resolution;
use crate::dataset_text::{add_alignment, facts, findings};
use crate::destination::{self, Destination, PNG};
use crate::failure::Failure;
use crate::inputs;
use crate::jobs::JobKind;
use crate::jobs::submission::Submission;
use crate::session::Session;
use crate::table::Facts;
use crate::whole_dataset::print_whole_dataset;
use clap::Args;
use lightpath::v1::SplitCounts;
use lightpath::v1::prepare_dataset::{
    self, Step,
    align::{self, Source},
};
use lightpath::v1::{self, Job, PrepareDataset, job_spec};
use lightpath::{names, prepare_result};
use std::path::{Path, PathBuf};

const BEFORE: Destination = Destination { option: "--picture-before", suffix: ".png", formats: &[PNG] };
const AFTER: Destination = Destination { option: "--picture-after", suffix: ".png", formats: &[PNG] };

/// Determine where the camera sees the display's pixels.
///
/// The positions come from the photograph of the displayed dots, from given points, or from correlating the dataset's
/// photographs with what their holograms should show. From then on photographs may have any size and are resampled to
/// the display's pixels.
///
/// Twelve points or more, such as the dots, tell the distortion of the camera's lens, too. A distortion that they show
/// clearly is corrected. lightpath dataset show says how far it moves the corners.
#[derive(Debug, Args)]
#[command(
    override_usage = "lightpath dataset align [OPTIONS]\n           <--dots <PHOTO>|--points <FILE.csv>|--pairs|--none> <NAME>"
)]
#[command(after_long_help = "\
Examples:
  lightpath dataset align bench-1 --dots photo.png --picture-after after.png
  lightpath dataset align bench-1 --points points.csv --photo-size 4096x3000
  lightpath dataset align bench-1 --pairs

  points.csv has a line for each point, at least 4 points; pixel centres are
  at whole numbers, x grows to the right and y downwards
    display_x,display_y,photo_x,photo_y
    0,0,412.3,288.9")]
pub(crate) struct Align {
    /// Name of the dataset
    name: String,

    #[command(flatten)]
    source: AlignmentSource,

    /// Set the size of the photographs for --points: columns x rows in pixels, for example 4096x3000
    #[arg(long, value_name = "WxH", value_parser = resolution, requires = "points")]
    photo_size: Option<(u32, u32)>,

    /// Write a picture of a photograph before the alignment to this file, PNG
    #[arg(long, value_name = "FILE.png", conflicts_with_all = ["points", "none"])]
    picture_before: Option<PathBuf>,

    /// Write a picture of a photograph after the alignment, on the display's pixels, to this file, PNG
    #[arg(long, value_name = "FILE.png", conflicts_with_all = ["points", "none"])]
    picture_after: Option<PathBuf>,

    #[command(flatten)]
    submission: Submission,
}

/// The data that an alignment is computed from.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct AlignmentSource {
    /// Align with this photograph of the displayed dots
    #[arg(long, value_name = "PHOTO")]
    dots: Option<PathBuf>,

    /// Align with the points in this .csv file; needs --photo-size
    #[arg(long, value_name = "FILE.csv", requires = "photo_size")]
    points: Option<PathBuf>,

    /// Refine the existing alignment with the dataset's own pairs; keeps the distortion of the lens, and takes scale and
    /// shear for the camera's, even where an uneven modulator makes them
    #[arg(long)]
    pairs: bool,

    /// Remove the alignment: one camera pixel is one pixel of the display
    #[arg(long)]
    none: bool,
}

/// Draw the split and close a dataset permanently; kernels are learned only from finalized datasets.
///
/// The job first aligns photographs that are turned against what their holograms should show, or shifted so far that
/// learning may not find it. Scale and shear up to 2 px stay for learning, because an uneven modulator makes them, too.
/// The job leaves out pairs that cannot be learned from: black photographs, copies, and photographs of another
/// hologram. The printed findings say why.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  lightpath dataset finalize bench-1
  lightpath dataset finalize bench-1 --test-fraction 0.3 --seed 4")]
pub(crate) struct Finalize {
    /// Name of the dataset
    name: String,

    /// Draw this fraction of the pairs without a split for validation, 0 to 0.8; validation pairs choose the degree of a
    /// kernel and the parts of a display model [default: 0.2]
    #[arg(long, value_name = "X")]
    validation_fraction: Option<f64>,

    /// Draw this fraction of the pairs without a split for the test, 0 to 0.8; at least one pair is drawn if no
    /// test pair was given
    #[arg(long, value_name = "X", default_value_t = 0.2)]
    test_fraction: f64,

    /// Set the seed of the draw
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,

    /// Keep the alignment unchanged even if the photographs are turned or shifted
    #[arg(long)]
    keep_alignment: bool,

    #[command(flatten)]
    submission: Submission,
}

impl Align {
    pub(crate) async fn run(self, session: &Session) -> Result<(), Failure> {
        let file = |destination: Destination, place: &Option<PathBuf>| {
            place.as_ref().map(|path| destination.file(&session.stdout, path)).transpose()
        };
        let before = file(BEFORE, &self.picture_before)?;
        let after = file(AFTER, &self.picture_after)?;
        let source = if let Some(photo) = &self.source.dots {
            Source::DotsPhoto(session.upload(photo).await?)
        } else if let (Some(path), Some(size)) = (&self.source.points, self.photo_size) {
            Source::Points(read_points(path, size)?)
        } else if self.source.pairs {
            Source::Pairs(align::ByPairs {})
        } else {
            Source::None(align::NoAlignment {})
        };
        let dataset = names::dataset(&self.name);
        let step = Step::Align(prepare_dataset::Align { source: Some(source) });
        let kind = job_spec::Kind::PrepareDataset(PrepareDataset { dataset: dataset.clone(), step: Some(step) });
        let job = self.submission.submit_and_wait(session, kind).await?;
        let alignment = prepare_result(&job)?.alignment.clone().unwrap_or_default();
        for (path, digest) in [(&before, &alignment.before), (&after, &alignment.after)] {
            if let Some(path) = path {
                destination::save(session, digest, path).await?;
            }
        }
        let dataset = session.client.get_dataset(v1::GetDatasetRequest { name: dataset }).await?;
        session.print(&dataset, facts)
    }
}

impl Finalize {
    pub(crate) async fn run(self, session: &Session) -> Result<(), Failure> {
        let dataset = names::dataset(&self.name);
        let step = Step::Finalize(prepare_dataset::Finalize {
            validation_fraction: self.validation_fraction,
            test_fraction: Some(self.test_fraction),
            seed: self.seed,
            keep_alignment: self.keep_alignment,
        });
        let kind = job_spec::Kind::PrepareDataset(PrepareDataset { dataset: dataset.clone(), step: Some(step) });
        self.submission.submit_and_wait(session, kind).await?;
        print_whole_dataset(session, &dataset).await
    }
}

impl JobKind for PrepareDataset {
    fn title(&self) -> (&'static str, &str) {
        let name = match self.step {
            Some(Step::Finalize(_)) => "finalize dataset",
            Some(Step::Align(_)) | None => "align dataset",
        };
        (name, names::id(&self.dataset))
    }

    fn spec_facts(&self, _: &Job, facts: &mut Facts) {
        facts.add("dataset", names::id(&self.dataset));
        facts.add("work", preparation(self));
    }

    fn result_facts(&self, job: &Job, facts: &mut Facts) -> lightpath::Result<String> {
        let result = prepare_result(job)?;
        if let Some(alignment) = &result.alignment {
            add_alignment(alignment, facts);
            for (name, picture) in [("before", &alignment.before), ("after", &alignment.after)] {
                if !picture.is_empty() {
                    facts.add(name, picture);
                }
            }
        }
        if let Some(SplitCounts { train, validation, test, excluded }) = result.split_counts {
            facts.add("digest", &result.digest);
            let counts = format!("{train} train, {validation} validation, {test} test");
            let left_out = if excluded > 0 { format!(", {excluded} left out") } else { String::new() };
            facts.add("pairs", counts + &left_out);
        }
        Ok(findings(&result.findings))
    }
}

fn preparation(spec: &PrepareDataset) -> String {
    match &spec.step {
        Some(Step::Align(align)) => match &align.source {
            Some(Source::Points(points)) => format!("align with {} points", points.points.len()),
            Some(Source::DotsPhoto(photo)) => format!("align with the photograph of the dots {photo}"),
            Some(Source::Pairs(_)) => "align with the pairs".to_owned(),
            Some(Source::None(_)) | None => "remove the alignment".to_owned(),
        },
        Some(Step::Finalize(finalize)) => {
            let prepare_dataset::Finalize { seed, keep_alignment, .. } = finalize;
            let (validation_fraction, test_fraction) = (finalize.validation_fraction(), finalize.test_fraction());
            let kept = if *keep_alignment { ", alignment kept" } else { "" };
            format!("finalize: {validation_fraction} for validation, {test_fraction} for the test, seed {seed}{kept}")
        }
        None => String::new(),
    }
}

/// Reads the points of an alignment from a .csv file.
fn read_points(path: &Path, (photo_width_px, photo_height_px): (u32, u32)) -> Result<v1::AlignmentPoints, Failure> {
    let text = inputs::text(path)?;
    let usage_error = |number: usize, problem: &str| {
        Failure::Usage(format!("--points {}: line {}: {problem}", path.display(), number + 1))
    };
    let mut points = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let fields: Vec<&str> = line.split(',').map(str::trim).collect();
        // The first line may be a line of names.
        if line.trim().is_empty() || (number == 0 && fields.iter().all(|field| field.parse::<f64>().is_err())) {
            continue;
        }
        let numbers: Option<Vec<f64>> = fields.iter().map(|field| field.parse().ok()).collect();
        let Some([display_x_px, display_y_px, photo_x_px, photo_y_px]) = numbers.as_deref() else {
            return Err(usage_error(number, "must have four numbers: display_x,display_y,photo_x,photo_y"));
        };
        points.push(v1::AlignmentPoint {
            display_x_px: *display_x_px,
            display_y_px: *display_y_px,
            photo_x_px: *photo_x_px,
            photo_y_px: *photo_y_px,
        });
    }
    Ok(v1::AlignmentPoints { photo_width_px, photo_height_px, points })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_parsed_with_and_without_line_of_names() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "display_x,display_y,photo_x,photo_y\n0, 1,2.5,3\n\n4,5,6,7\n").unwrap();
        let points = read_points(file.path(), (40, 30)).unwrap();
        assert_eq!((points.points.len(), points.points[0].photo_x_px, points.photo_width_px), (2, 2.5, 40));
        std::fs::write(file.path(), "0,1,2,3\n4,5,6\n").unwrap();
        assert!(matches!(read_points(file.path(), (40, 30)), Err(Failure::Usage(text)) if text.contains("line 2")));
    }
}
