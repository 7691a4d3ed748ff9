//! The quality of a photographed picture: a photograph, aligned with its target, compared with it.
//!
//! | figure | measures |
//! |---|---|
//! | PSNR | the error of the light after the best gain, and after the best gain and offset |
//! | SSIM | the agreement of local brightness, contrast and structure after the best gain, 1 at best |
//! | [speckle contrast](block_speckle_contrast) | the graininess in flat bright blocks of the target, 0 at best |
//! | [`resolution`] | the finest details that photograph and target share |
//! | saturation | the share of the camera's pixels whose light is unknown, because it is above the camera's range |
//!
//! [`align`] finds the target ([`find_target`]) and resamples the photograph on the target's pixels. Its
//! [`Residual`] says how far blocks of the aligned photograph still lie from the target. Light outside of the region is
//! aligned, too, but not compared.

mod flat_blocks;
mod resolution;

pub use flat_blocks::{BLOCK_PX, BLOCKS_MIN, block_speckle_contrast};
pub use resolution::{RING_CORRELATION_MIN, Resolution, resolution};

use crate::alignment::{AlignmentError, FoundTarget, block_displacements, find_target, warp};
use lightpath_optics::metrics::{Gain, fitted_intensity_scale, psnr_db, psnr_with_offset_db, ssim};
use lightpath_optics::{Plane, RegionOfInterest};

/// A photograph on the pixels of its target.
#[derive(Clone, Debug, PartialEq)]
pub struct AlignedPhoto {
    /// Place of the target in the photograph.
    pub found: FoundTarget,
    /// The light of each channel, with the target's size. Pixels that the photograph does not show are 0.
    pub channels: Vec<Plane<f32>>,
    /// Displacements that the alignment leaves in the region. `None` if no block of the region has a clear place.
    pub residual: Option<Residual>,
}

/// Displacements of blocks of the aligned photograph from the target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual {
    /// Root mean square \[target px\].
    pub rms_px: f64,
    /// Largest displacement \[target px\].
    pub largest_px: f64,
    /// Number of blocks with a clear place. Blocks without details have none.
    pub blocks: usize,
}

/// The quality of one channel in the region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelScore {
    /// PSNR after the gain \[dB\].
    pub psnr_db: f64,
    /// PSNR after the best gain and offset \[dB\].
    pub psnr_with_offset_db: f64,
    /// Gain with the smallest error: light of the target for each light of the photograph.
    pub gain: f64,
    /// SSIM after the gain.
    pub ssim: f64,
    /// Median of standard deviation over mean in flat bright blocks; `None` if the target has too few of them.
    pub speckle_contrast: Option<f64>,
    /// The finest details that photograph and target share.
    pub resolution: Resolution,
}

/// Reasons why a photograph cannot be scored.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ScoreError {
    /// The target was not found.
    #[error(transparent)]
    Alignment(#[from] AlignmentError),
    /// The photograph shows the target, but not the whole region.
    #[error(
        "the photograph shows only {:.1} % of the region's pixels, but must show all; choose a smaller region that lies \
         inside the photograph, or photograph the whole target", 100.0 * share
    )]
    RegionOutside {
        /// Share of the region's pixels that the photograph shows.
        share: f64,
    },
    /// A figure cannot be computed.
    #[error(transparent)]
    Metric(#[from] lightpath_optics::Error),
}

/// Finds the target in the photograph and resamples the photograph on its pixels. `photo` and `target` have one or
/// three channels of linear light each. The mean of the channels decides the place.
///
/// # Errors
///
/// [`ScoreError::Alignment`] if the target is not found, [`ScoreError::RegionOutside`] if the photograph does not show
/// the whole region, [`ScoreError::Metric`] without channels or with channels of different sizes.
pub fn align(
    photo: &[Plane<f32>],
    target: &[Plane<f32>],
    region: RegionOfInterest,
) -> Result<AlignedPhoto, ScoreError> {
    let (grey, grey_target) = (mean("photo", photo)?, mean("target", target)?);
    let found = find_target(&grey, &grey_target)?;
    let (height_px, width_px) = (grey_target.height_px(), grey_target.width_px());
    let aligned = |plane: &Plane<f32>| warp(plane, &found.map, height_px, width_px, f32::INFINITY, f32::NAN);
    let grey = aligned(&grey);
    let shown = region_values(&grey, region).filter(|value| value.is_finite()).count();
    if shown < region.pixels() {
        return Err(ScoreError::RegionOutside { share: shown as f64 / region.pixels() as f64 });
    }
    let without_gaps = |plane: &Plane<f32>| plane.map(|value| if value.is_finite() { value } else { 0.0 });
    let channels = match photo {
        [_] => vec![without_gaps(&grey)],
        several => several.iter().map(|channel| without_gaps(&aligned(channel))).collect(),
    };
    Ok(AlignedPhoto { found, channels, residual: residual(&grey_target, &without_gaps(&grey), region) })
}

/// Compares one channel of an aligned photograph with the target in a region.
///
/// # Errors
///
/// [`lightpath_optics::Error::SizeMismatch`] for planes of different sizes; [`lightpath_optics::Error::OutOfRange`] for a region that leaves
/// the target or has a side below [`SSIM_SIDE_MIN`](lightpath_optics::metrics::SSIM_SIDE_MIN).
pub fn score(
    aligned: &Plane<f32>,
    target: &Plane<f32>,
    region: RegionOfInterest,
) -> lightpath_optics::Result<ChannelScore> {
    Ok(ChannelScore {
        psnr_db: psnr_db(aligned, target, region, Gain::Fitted)?,
        psnr_with_offset_db: psnr_with_offset_db(aligned, target, region)?,
        gain: fitted_intensity_scale(aligned, target, region)?,
        ssim: ssim(aligned, target, region, Gain::Fitted)?,
        speckle_contrast: block_speckle_contrast(aligned, target, region),
        resolution: resolution(aligned, target, region),
    })
}

/// The error of each pixel after a gain: gain · photograph − target.
#[must_use]
pub fn error_of(aligned: &Plane<f32>, target: &Plane<f32>, gain: f64) -> Plane<f32> {
    let difference = |y, x| (gain * f64::from(aligned.at(y, x)) - f64::from(target.at(y, x))) as f32;
    Plane::from_fn(target.height_px(), target.width_px(), difference)
}

fn mean(name: &'static str, channels: &[Plane<f32>]) -> lightpath_optics::Result<Plane<f32>> {
    let [first, others @ ..] = channels else {
        return Err(lightpath_optics::Error::Empty { name, needed: "one or three channels are needed" });
    };
    let mut sum = first.clone();
    for plane in others {
        plane.expect_size(name, first.height_px(), first.width_px())?;
        sum.values_mut().iter_mut().zip(plane.values()).for_each(|(sum, value)| *sum += value);
    }
    let count = channels.len() as f32;
    Ok(if count > 1.0 { sum.map(|value| value / count) } else { sum })
}

fn region_values(plane: &Plane<f32>, region: RegionOfInterest) -> impl Iterator<Item = f32> {
    let rows = region.y_px()..region.y_px() + region.height_px();
    rows.flat_map(move |y| plane.row(y)[region.x_px()..][..region.width_px()].iter().copied())
}

/// Displacements of the aligned photograph's blocks, found by their correlation with the target's.
fn residual(target: &Plane<f32>, aligned: &Plane<f32>, region: RegionOfInterest) -> Option<Residual> {
    let displacements = block_displacements(target, aligned, region);
    let lengths: Vec<f64> = displacements.iter().map(|block| block.shift[0].hypot(block.shift[1])).collect();
    let squares: f64 = lengths.iter().map(|length| length * length).sum();
    let blocks = lengths.len();
    let largest_px = lengths.into_iter().fold(0.0, f64::max);
    (blocks > 0).then(|| Residual { rms_px: (squares / blocks as f64).sqrt(), largest_px, blocks })
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_bench::TestCard;
    use lightpath_optics::Grid;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const HEIGHT: usize = 180;
    const WIDTH: usize = 320;

    fn target() -> Plane<f32> {
        TestCard::City.render(HEIGHT, WIDTH, 3).unwrap()
    }

    fn middle() -> RegionOfInterest {
        RegionOfInterest::middle(&Grid::try_new(HEIGHT, WIDTH, 8e-6).unwrap())
    }

    /// The picture, 40 px from the left and 25 px from the top of a dark photograph.
    fn photo_of(picture: &Plane<f32>) -> Plane<f32> {
        Plane::from_fn(240, 400, |y, x| {
            let inside = (25..25 + HEIGHT).contains(&y) && (40..40 + WIDTH).contains(&x);
            if inside { picture.at(y - 25, x - 40) } else { 0.0 }
        })
    }

    #[test]
    fn figures_match_the_known_noise_and_offset() {
        let (target, mut random) = (target(), ChaCha8Rng::seed_from_u64(1));
        // Grains of 4×4 px, which the resampling does not blur.
        let grains = Plane::from_fn(HEIGHT / 4, WIDTH / 4, |_, _| 0.1 * (random.random::<f32>() - 0.5));
        let noise = Plane::from_fn(HEIGHT, WIDTH, |y, x| grains.at(y / 4, x / 4));
        let shown = Plane::from_fn(HEIGHT, WIDTH, |y, x| 0.4 * (target.at(y, x) + noise.at(y, x)) + 0.1);
        let aligned = align(&[photo_of(&shown)], std::slice::from_ref(&target), middle()).unwrap();
        let found = score(&aligned.channels[0], &target, middle()).unwrap();
        // Uniform noise of ±0.05 has the mean square 0.1²/12.
        let expected = -10.0 * (0.01_f64 / 12.0).log10();
        assert!((found.psnr_with_offset_db - expected).abs() < 0.2, "{found:?}, expected {expected}");
        // The gain alone, from the sums of the pictures before the camera.
        let pairs = || region_values(&shown, middle()).zip(region_values(&target, middle()));
        let sum = |term: &dyn Fn(f64, f64) -> f64| pairs().map(|(p, t)| term(p.into(), t.into())).sum::<f64>();
        let gain = sum(&|p, t| p * t) / sum(&|p, _| p * p);
        let expected = -10.0 * (sum(&|p, t| (gain * p - t).powi(2)) / middle().pixels() as f64).log10();
        assert!((found.psnr_db - expected).abs() < 0.1, "{found:?}, expected {expected}");
        assert!((found.gain / gain - 1.0).abs() < 0.01);
        let residual = aligned.residual.unwrap();
        assert!(residual.rms_px < 0.1 && residual.largest_px < 0.3 && residual.blocks > 3, "{residual:?}");
    }

    #[test]
    fn region_outside_the_photograph_is_refused() {
        let photo = photo_of(&target());
        let cut = Plane::from_fn(240, 300, |y, x| photo.at(y, x));
        let refusal = align(&[cut], &[target()], middle()).unwrap_err();
        assert!(matches!(refusal, ScoreError::RegionOutside { share } if (0.85..0.95).contains(&share)), "{refusal}");
        assert!(matches!(align(&[], &[target()], middle()), Err(ScoreError::Metric(_))));
    }

    #[test]
    fn colours_share_one_place_and_have_figures_of_their_own() {
        let picture = target();
        let [red, green, blue] = [1.0, 0.5, 0.25].map(|gain| photo_of(&picture.map(|light| gain * light)));
        let aligned =
            align(&[red, green, blue], &[picture.clone(), picture.clone(), picture.clone()], middle()).unwrap();
        let gains: Vec<f64> =
            aligned.channels.iter().map(|light| score(light, &picture, middle()).unwrap().gain).collect();
        assert!(gains.iter().zip([1.0, 2.0, 4.0]).all(|(gain, truth)| (gain / truth - 1.0).abs() < 0.01), "{gains:?}");
    }

    #[test]
    fn error_is_signed() {
        let error = error_of(&Plane::filled(2, 2, 0.5), &Plane::filled(2, 2, 0.8), 2.0);
        assert!(error.values().iter().all(|value| (value - 0.2).abs() < 1e-6));
    }
}
