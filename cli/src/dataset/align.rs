//! The commands `lightpath dataset calibration` and `align`.

use super::show::facts;
use crate::destination::{self, Destination, PNG};
use crate::failure::Failure;
use crate::session::Session;
use crate::submission::Submission;
use crate::{job_text, progress};
use clap::Args;
use lightpath::v1::prepare_dataset::{Align as AlignStep, Step, align::Source};
use lightpath::v1::{self, OptimizeHologram, PrepareDataset, job_spec, optimize_hologram::ImagePlane};
use lightpath::{hologram_result, names, prepare_result};
use std::path::{Path, PathBuf};

const PHASE: Destination =
    Destination { option: "-o", suffix: "-phase.png", formats: &[("png", "grey levels for the display")] };
const BEFORE: Destination = Destination { option: "--picture-before", suffix: ".png", formats: &[PNG] };
const AFTER: Destination = Destination { option: "--picture-after", suffix: ".png", formats: &[PNG] };

/// Compute the hologram of a grid of dots, which is photographed to align the camera.
///
/// The hologram is optimized for the dataset's display, wavelength and distance with the ideal kernel. Display it and
/// photograph it with the camera in its position for the dataset. Give the photograph to lightpath dataset align
/// --dots.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Example:
  lightpath dataset calibration bench-1 -o dots.png
  lightpath dataset align bench-1 --dots photo-of-dots.png \\
      --picture-before before.png --picture-after after.png")]
pub(crate) struct Calibration {
    /// Name of the dataset
    name: String,

    /// Write the hologram to this file, a grey PNG of levels
    #[arg(short = 'o', value_name = "PHASE.png")]
    phase: PathBuf,

    /// Optimize for this many steps, 1 to 10000
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..))]
    iterations: u32,

    #[command(flatten)]
    submission: Submission,
}

/// Determine where the camera sees the display's pixels.
///
/// The positions come from the photograph of the displayed dots, from given points, or from correlating the dataset's
/// photographs with what their holograms should show. From then on photographs may have any size and are resampled to
/// the display's pixels.
///
/// Twelve points or more, such as the dots, tell the distortion of the camera's lens, too. It is corrected if it is
/// clearly there. lightpath dataset show says how far it moves the corners.
#[derive(Debug, Args)]
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
    #[arg(long, value_name = "WxH", value_parser = crate::arguments::resolution, requires = "points")]
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

impl Calibration {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let name = [format!("{}-dots", self.name)];
        let phase = PHASE.files(&session.stdout, &self.phase, &name)?.remove(0);
        let request = v1::GetDatasetRequest { name: names::dataset(&self.name) };
        let dataset = session.client.get_dataset(request).await?;
        let request = v1::CreateCalibrationTargetRequest { display: dataset.display.clone() };
        let target = session.client.create_calibration_target(request).await?;
        let kind = job_spec::Kind::OptimizeHologram(OptimizeHologram {
            display: dataset.display,
            wavelengths_m: vec![dataset.wavelength_m],
            planes: vec![ImagePlane { distance_m: dataset.distance_m, target: target.target, weight: 0.0 }],
            kernel: "ideal".to_owned(),
            iterations: self.iterations,
            seed: 1,
            ..Default::default()
        });
        let job = self.submission.submit(session, kind, "dots for the alignment", None).await?;
        let [name] = name;
        for job in progress::wait_all(session, vec![(name, job)]).await? {
            if let Ok(result) = hologram_result(&job) {
                for frame in result.wavelengths.iter().flat_map(|hologram| &hologram.frames) {
                    destination::save(session, &frame.phase, &phase).await?;
                }
            }
            session.print(&job, |_| {
                format!("hologram of {}×{} dots  {}", target.columns, target.rows, destination::shown(&phase))
            })?;
            job_text::check_success(&[job])?;
        }
        Ok(())
    }
}

impl Align {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let file = |destination: Destination, place: &Option<PathBuf>| {
            place.as_ref().map(|path| destination.file(&session.stdout, path)).transpose()
        };
        let before = file(BEFORE, &self.picture_before)?;
        let after = file(AFTER, &self.picture_after)?;
        let source = if let Some(photo) = &self.source.dots {
            Source::DotsPhoto(session.client.upload_file(photo).await?)
        } else if let (Some(path), Some(size)) = (&self.source.points, self.photo_size) {
            Source::Points(read_points(path, size)?)
        } else if self.source.pairs {
            Source::Pairs(true)
        } else {
            Source::None(true)
        };
        let dataset = names::dataset(&self.name);
        let step = Step::Align(AlignStep { source: Some(source) });
        let kind = job_spec::Kind::PrepareDataset(PrepareDataset { dataset: dataset.clone(), step: Some(step) });
        let job = self.submission.submit_and_wait(session, kind).await?;
        let alignment = prepare_result(&job)?.alignment.clone().unwrap_or_default();
        for (path, digest) in [(&before, &alignment.before), (&after, &alignment.after)] {
            if let Some(path) = path {
                destination::save(session, digest, path).await?;
            }
        }
        let dataset = session.client.get_dataset(v1::GetDatasetRequest { name: dataset }).await?;
        session.print(&dataset, |dataset| facts(&v1::Dataset { pairs: Vec::new(), ..dataset.clone() }))
    }
}

/// Reads the points of an alignment from a .csv file.
fn read_points(path: &Path, (photo_width_px, photo_height_px): (u32, u32)) -> Result<v1::AlignmentPoints, Failure> {
    let text = std::fs::read_to_string(path).map_err(|source| lightpath::Error::File {
        action: "read",
        path: path.to_owned(),
        source,
    })?;
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
