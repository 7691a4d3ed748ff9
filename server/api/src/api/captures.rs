//! Reading, checking and aligning a dataset's pairs while somebody waits for the answer.

use super::error::ApiError;
use super::field::Field;
use super::time::now_ms;
use super::{Api, caller};
use lightpath_domain::dataset::{Alignment, AlignmentMethod, Dataset, Pair, PairChecks};
use lightpath_domain::display::Display;
use lightpath_media::captures::{self, CaptureError, Captures, Reconstructor, Solved};
use lightpath_media::pictures;
use lightpath_optics::Plane;
use lightpath_optics::alignment::PointPair;
use lightpath_proto::v1;
use std::sync::{Arc, Mutex, PoisonError};

/// Pairs that an alignment is refined by, at most, and how much memory their pictures may take \[bytes\].
const ALIGNED_BY_MAX: usize = 8;
const ALIGNED_BY_BYTES_MAX: usize = 384 << 20;

/// The reconstructor that was used last: a dataset's pairs come one after the other.
pub(super) type LastReconstructor = Arc<Mutex<Option<(String, Reconstructor)>>>;

/// What was read of a pair: its checks, or what is wrong with one of its files.
type Checked = Result<PairChecks, (&'static str, CaptureError)>;

impl Api {
    /// Reads and measures a pair; refuses one whose files are not what they must be.
    pub(super) async fn checked(&self, dataset: &Dataset, pair: &Pair, field: &Field) -> Result<PairChecks, ApiError> {
        let (display, _) = self.store.display(&dataset.display).await?;
        let phase = self.picture_bytes(&field.at("phase"), &pair.phase).await?;
        let photo = self.picture_bytes(&field.at("photo"), &pair.photo).await?;
        let checked = self.check(display, dataset.clone(), pair.clone(), phase, photo).await?;
        checked.map_err(|(name, error)| {
            let digest = if name == "phase" { &pair.phase } else { &pair.photo };
            field.at(name).invalid(format!("({digest}): {error}"))
        })
    }

    /// Measures again what was measured with another alignment, or not at all, and keeps it.
    pub(super) async fn check_again(&self, dataset: &mut Dataset) -> Result<(), ApiError> {
        let homography = dataset.alignment.as_ref().map(|alignment| alignment.homography);
        let (display, _) = self.store.display(&dataset.display).await?;
        let current = |checks: &PairChecks| checks.homography == homography;
        let mut renewed = Vec::new();
        for index in 0..dataset.pairs.len() {
            let pair = dataset.pairs[index].clone();
            if pair.checks.as_ref().is_some_and(current) {
                continue;
            }
            let phase = self.artifacts.read_all(&pair.phase).await?;
            let photo = self.artifacts.read_all(&pair.photo).await?;
            let checked = self.check(display.clone(), dataset.clone(), pair.clone(), phase, photo).await?;
            let checks = checked.map_err(|(_, error)| refused(&pair.id, &error))?;
            dataset.pairs[index].checks = Some(checks.clone());
            renewed.push((pair.id, checks));
        }
        Ok(self.store.keep_checks(&dataset.id, &renewed).await?)
    }

    /// The alignment that given points make.
    pub(super) async fn align_by_points(
        &self,
        dataset: &Dataset,
        points: v1::AlignmentPoints,
    ) -> Result<Alignment, ApiError> {
        let field = Field::new("points");
        let side = 1..=pictures::SIDE_PX_MAX;
        let width_px = field.at("photo_width_px").integer(points.photo_width_px, side.clone())?;
        let height_px = field.at("photo_height_px").integer(points.photo_height_px, side)?;
        let pairs: Vec<PointPair> = points
            .points
            .iter()
            .map(|point| PointPair {
                display: [point.display_x_px, point.display_y_px],
                camera: [point.photo_x_px, point.photo_y_px],
            })
            .collect();
        let captures = self.captures(dataset).await?;
        let solved = captures::from_points(&captures, &pairs)
            .map_err(|error| field.at("points").invalid(format!("fix no alignment: {error}")))?;
        self.alignment(AlignmentMethod::Points, solved, (height_px, width_px), String::new()).await
    }

    /// The alignment that the photograph of the displayed dots shows.
    pub(super) async fn align_by_dots(&self, dataset: &Dataset, digest: &str) -> Result<Alignment, ApiError> {
        let field = Field::new("dots_photo");
        let digest = field.digest(digest)?;
        let bytes = self.picture_bytes(&field, &digest).await?;
        let captures = self.captures(dataset).await?;
        let solve = move || {
            let photo = captures.camera(&Pair::default(), &bytes)?;
            let size = (photo.height_px() as u32, photo.width_px() as u32);
            Ok::<_, CaptureError>((captures::from_dots(&captures, &photo)?, size))
        };
        let solved = self.computed(solve).await?;
        let (solved, size) = solved.map_err(|error| field.invalid(format!("({digest}): {error}")))?;
        self.alignment(AlignmentMethod::Dots, solved, size, digest).await
    }

    /// The alignment that the pairs' photographs ask for; `None` where they tell too little, or are aligned as well as that
    /// can be told.
    pub(super) async fn align_by_pairs(&self, dataset: &Dataset) -> Result<Option<Alignment>, ApiError> {
        let findings = captures::findings(dataset);
        let excluded = |pair: &&Pair| !findings.iter().any(|finding| finding.excludes && finding.pair == pair.id);
        let good: Vec<&Pair> = dataset.pairs.iter().filter(excluded).collect();
        let Some(size) = good.first().and_then(|pair| pair.checks.as_ref()).map(|checks| checks.photo_px) else {
            return Ok(None);
        };
        let captures = self.captures(dataset).await?;
        let display_px = captures.height_px() * captures.width_px();
        let pair_bytes = size_of::<f32>() * (display_px + size[0] as usize * size[1] as usize);
        let count = (ALIGNED_BY_BYTES_MAX / pair_bytes).clamp(1, ALIGNED_BY_MAX).min(good.len());
        // Evenly over all, since neighbours may be alike.
        let chosen = (0..count).map(|i| good[i * good.len() / count]);
        let mut files = Vec::with_capacity(count);
        for pair in chosen {
            let phase = self.artifacts.read_all(&pair.phase).await?;
            files.push((pair.clone(), phase, self.artifacts.read_all(&pair.photo).await?));
        }
        let last = Arc::clone(&self.reconstructor);
        let key = reconstructor_key(dataset);
        let solve = move || {
            let Some(reconstructor) = reconstructor(&last, key, &captures) else { return Ok(None) };
            let mut seen: Vec<(Plane<f32>, Plane<f32>)> = Vec::with_capacity(files.len());
            for (pair, phase, photo) in &files {
                seen.push((reconstructor.light(&captures.phase(phase)?)?, captures.camera(pair, photo)?));
            }
            captures::from_pairs(&captures, &seen)
        };
        let solved: Result<Option<Solved>, CaptureError> = self.computed(solve).await?;
        let Some(solved) = solved.map_err(|error| refused("", &error))? else { return Ok(None) };
        let alignment = self.alignment(AlignmentMethod::Pairs, solved, (size[1], size[0]), String::new()).await?;
        Ok(Some(alignment))
    }

    async fn alignment(
        &self,
        method: AlignmentMethod,
        solved: Solved,
        (photo_height_px, photo_width_px): (u32, u32),
        photo: String,
    ) -> Result<Alignment, ApiError> {
        Ok(Alignment {
            method,
            homography: solved.homography.entries(),
            photo_height_px,
            photo_width_px,
            points: solved.points as u32,
            residual_px: solved.residual_px,
            corrected_px: solved.corrected_px,
            photo,
            before: self.kept(solved.before).await?,
            after: self.kept(solved.after).await?,
        })
    }

    /// Stores bytes as an artifact and returns their digest; nothing for none.
    pub(super) async fn kept(&self, bytes: Vec<u8>) -> Result<String, ApiError> {
        if bytes.is_empty() {
            return Ok(String::new());
        }
        let size_bytes = bytes.len() as u64;
        let _publishing = self.artifacts.publishing().await;
        let digest = self.artifacts.put_bytes(bytes).await?;
        self.store.record_artifact(&digest, size_bytes, &caller::name(), now_ms()).await?;
        Ok(digest)
    }

    async fn captures(&self, dataset: &Dataset) -> Result<Captures, ApiError> {
        let (display, _) = self.store.display(&dataset.display).await?;
        Captures::of(&display, dataset).map_err(|error| refused("", &error))
    }

    async fn check(
        &self,
        display: Display,
        dataset: Dataset,
        pair: Pair,
        phase: Vec<u8>,
        photo: Vec<u8>,
    ) -> Result<Checked, ApiError> {
        let last = Arc::clone(&self.reconstructor);
        self.computed(move || {
            let captures = Captures::of(&display, &dataset).map_err(|error| ("photo", error))?;
            // Read by itself first, so that a refusal can name the field.
            captures.phase(&phase).map_err(|error| ("phase", error))?;
            let reconstructor = reconstructor(&last, reconstructor_key(&dataset), &captures);
            captures::check(&captures, reconstructor.as_ref(), &pair, &phase, &photo).map_err(|error| ("photo", error))
        })
        .await
    }

    /// What `compute` makes, on a thread that may block, few at a time.
    pub(super) async fn computed<T: Send + 'static>(
        &self,
        compute: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, ApiError> {
        let _permit = Arc::clone(&self.decoders).acquire_owned().await.map_err(|_| ApiError::Stopping)?;
        tokio::task::spawn_blocking(compute).await.map_err(ApiError::Task)
    }
}

fn refused(pair: &str, error: &CaptureError) -> ApiError {
    let message = if pair.is_empty() { error.to_string() } else { format!("pair \"{pair}\": {error}") };
    ApiError::Precondition { reason: "DATASET_UNREADABLE", message }
}

fn reconstructor_key(dataset: &Dataset) -> String {
    format!("{}/{}/{}", dataset.display, dataset.wavelength.pm, dataset.distance.nm)
}

/// The last one, or a new one; `None` where no image can be computed at the dataset's distance.
fn reconstructor(
    last: &Mutex<Option<(String, Reconstructor)>>,
    key: String,
    captures: &Captures,
) -> Option<Reconstructor> {
    // Held while a new one is made: two at once would take twice the memory.
    let mut last = last.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((of, reconstructor)) = last.as_ref()
        && *of == key
    {
        return Some(reconstructor.clone());
    }
    // The one before goes first, for the same reason.
    *last = None;
    let reconstructor = Reconstructor::of(captures).ok()?;
    *last = Some((key, reconstructor.clone()));
    Some(reconstructor)
}
