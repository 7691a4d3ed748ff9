//! Jobs that photograph patterns at the bench of a display.

use super::Kind;
use crate::call::Call;
use crate::error::{Result, ServiceError};
use crate::field::Field;
use crate::jobs::Jobs;
use crate::propagation::check_distance;
use crate::wrong_fields::collect_all;
use lightpath_domain::dataset::Dataset;
use lightpath_domain::display::Display;
use lightpath_domain::job::CapturePhotos;
use lightpath_domain::job::estimate::Need;
use lightpath_domain::job::kinds::capture_photos;
use lightpath_domain::kernel::KernelKey;
use lightpath_domain::reason::PreconditionReason;
use lightpath_media::pictures;
use lightpath_optics::Detector;

/// Pixels of the photographs that are expected, for each pixel of the display.
const CAMERA_PX_PER_PX: u64 = 4;
/// Time for a photograph besides its exposure \[s\]: showing, settling, and carrying the files.
const PHOTO_S: f64 = 0.5;
/// Exposure that is expected where it is searched \[s\].
const EXPOSURE_S: f64 = 0.05;

impl Kind for CapturePhotos {
    const ADVICE: &'static str = "photograph fewer patterns in one job";

    async fn need(&self, jobs: &Jobs, _: u64) -> Result<Need> {
        let (display, _) = jobs.store.display(&self.display).await?;
        let key = KernelKey { display: self.display.clone(), wavelength: self.wavelength, distance: self.distance };
        let engine = jobs.ideal_engine(&display, &key, Detector::Pixel, None, false)?;
        // Two bytes a pixel in the file, then its values in single precision, and a copy.
        let decoding_bytes = 10 * CAMERA_PX_PER_PX * engine.pixels();
        let photo_s = PHOTO_S + f64::from(self.exposures) * self.exposure_s.unwrap_or(EXPOSURE_S);
        Ok(capture_photos::need(engine, decoding_bytes, self.patterns.len(), photo_s))
    }
}

impl Jobs {
    /// Refuses a distance at which no method gives a correct image, a dataset of other optics or without an alignment,
    /// patterns that do not exist, and a first one whose levels or size are not those of the display.
    pub async fn require_photographable(
        &self,
        call: &Call,
        field: &Field,
        spec: &CapturePhotos,
        (display, aligned_by): (&Display, Option<&Dataset>),
    ) -> Result<()> {
        check_distance(&field.at("place").at("distance_m"), display, spec.wavelength, spec.distance)?;
        if let Some(dataset) = aligned_by {
            require_alignment(&field.at("aligned_by"), spec, dataset)?;
        }
        let of_patterns = field.at("patterns");
        let mut checks = Vec::with_capacity(spec.patterns.len());
        for (index, named) in spec.patterns.iter().enumerate() {
            let field = of_patterns.index(index).at("pattern");
            checks.push(self.files.require_picture(call, &field, &named.pattern).await);
        }
        collect_all(checks)?;
        // Hundreds of patterns take longer than a call may. The job reads all of them before it takes a photograph.
        let Some(first) = spec.patterns.first() else { return Ok(()) };
        let (height_px, width_px) = (display.height_px as usize, display.width_px as usize);
        let bit_depth = display.bit_depth;
        let decode = move |bytes: &[u8]| pictures::hologram(bytes, bit_depth, height_px, width_px).map(drop);
        let pattern = (first.pattern.as_str(), (height_px * width_px) as u64);
        self.files.decoded(call, &of_patterns.index(0).at("pattern"), pattern, decode).await.map(drop)
    }
}

fn require_alignment(field: &Field, spec: &CapturePhotos, dataset: &Dataset) -> Result<()> {
    let id = &dataset.id;
    if (&dataset.display, dataset.wavelength, dataset.distance) != (&spec.display, spec.wavelength, spec.distance) {
        let (wavelength, distance) = (dataset.wavelength, dataset.distance);
        let problem =
            format!("names datasets/{id}, which is for displays/{}, {wavelength} and {distance}", dataset.display);
        return Err(field.invalid(problem, "name one with the same display, wavelength and distance"));
    }
    if dataset.alignment.is_none() {
        let message = format!(
            "{field}: datasets/{id} has no alignment; photograph the dots first (lightpath dataset calibration --help), or \
             leave the field out"
        );
        return Err(ServiceError::Precondition { reason: PreconditionReason::DatasetNotAligned, message });
    }
    Ok(())
}
