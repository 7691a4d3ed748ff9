//! The quality of a photograph of a target: reading both files, comparing them, and drawing the aligned photograph and
//! its error.

use crate::figures::{Axis, Canvas, ColourMap, Heatmap};
use crate::pictures::{self, PictureError, SATURATION, srgb_to_linear};
use lightpath_camera::alignment::TARGET_SIDE_MIN;
use lightpath_camera::photo_score::{self, AlignedPhoto, ChannelScore, ScoreError};
use lightpath_domain::dataset::Encoding;
use lightpath_optics::{Plane, RegionOfInterest};

/// Longer side of the picture of the error \[px\], and of each of three pictures.
const ERROR_PX: f64 = 960.0;
const ERROR_OF_COLOUR_PX: f64 = 640.0;
/// Ends of the error's scale. The smallest of them is used that holds all but the largest errors.
const ERROR_SCALES: [f32; 6] = [0.02, 0.05, 0.1, 0.2, 0.5, 1.0];
/// Part of the errors that may lie beyond the scale.
const BEYOND_SCALE: f64 = 0.02;
const COLOURS: [&str; 3] = ["red", "green", "blue"];

/// A picture and the encoding of its values.
#[derive(Clone, Debug, PartialEq)]
pub struct EncodedPicture {
    channels: Vec<Plane<f32>>,
    encoding: Encoding,
}

impl EncodedPicture {
    /// Reads a picture file.
    ///
    /// # Errors
    ///
    /// [`PictureError`] for a file that is no readable picture, and a picture beyond the limits or with a side below
    /// [`TARGET_SIDE_MIN`].
    pub fn read(bytes: &[u8], encoding: Encoding) -> Result<Self, PictureError> {
        Ok(Self { channels: pictures::colour_planes(bytes, encoding, TARGET_SIDE_MIN as u32)?, encoding })
    }

    /// Number of rows and of columns \[px\].
    #[must_use]
    pub fn size_px(&self) -> (usize, usize) {
        self.channels.first().map_or((0, 0), |channel| (channel.height_px(), channel.width_px()))
    }

    /// The light of a channel: its colour, or the grey value, or, for a grey photograph, the mean of the colours.
    fn seen_by(&self, channels: usize) -> Vec<Plane<f32>> {
        match &self.channels[..] {
            [grey] => vec![grey.clone(); channels],
            [red, green, blue] if channels == 1 => {
                let mean = |y, x| (red.at(y, x) + green.at(y, x) + blue.at(y, x)) / 3.0;
                vec![Plane::from_fn(red.height_px(), red.width_px(), mean)]
            }
            colours => colours.to_vec(),
        }
    }

    /// Share of the pixels of which a channel is at full scale.
    fn saturated(&self) -> f64 {
        let least = match self.encoding {
            Encoding::Linear => SATURATION,
            Encoding::Srgb => srgb_to_linear(SATURATION),
        };
        let pixels = self.channels.first().map_or(0, |channel| channel.values().len());
        let is_saturated = |i: &usize| self.channels.iter().any(|channel| channel.values()[*i] >= least);
        (0..pixels).filter(is_saturated).count() as f64 / pixels.max(1) as f64
    }
}

/// The quality of a photograph, with its pictures.
#[derive(Clone, Debug)]
pub struct ScoredPhoto {
    /// The aligned photograph.
    pub aligned: AlignedPhoto,
    /// The score of each channel.
    pub channels: Vec<ChannelScore>,
    /// Share of the photograph's pixels of which a channel is at full scale.
    pub saturated: f64,
    /// The aligned photograph after the gains, in the target's encoding, as PNG.
    pub aligned_png: Vec<u8>,
    /// The error in colours with a scale, as PNG.
    pub error_png: Vec<u8>,
}

/// Reasons why a photograph cannot be scored or its pictures cannot be drawn.
#[derive(Debug, thiserror::Error)]
pub enum PhotoScoreError {
    /// The photograph does not match the target, or not in the region.
    #[error(transparent)]
    Score(#[from] ScoreError),
    /// A picture could not be written.
    #[error(transparent)]
    Picture(#[from] PictureError),
}

/// Finds the target in the photograph and compares the two in a region of the target.
///
/// # Errors
///
/// [`PhotoScoreError::Score`] if the target is not found or the photograph does not show the region;
/// [`PhotoScoreError::Picture`] if a picture cannot be encoded.
pub fn score(
    photo: &EncodedPicture,
    target: &EncodedPicture,
    region: RegionOfInterest,
) -> Result<ScoredPhoto, PhotoScoreError> {
    let seen = target.seen_by(photo.channels.len());
    let aligned = photo_score::align(&photo.channels, &seen, region)?;
    let scores = aligned.channels.iter().zip(&seen).map(|(light, target)| photo_score::score(light, target, region));
    let channels = scores.collect::<Result<Vec<_>, _>>().map_err(ScoreError::Metric)?;
    let aligned_png = aligned_png(&aligned, &channels, target.encoding)?;
    let error_png = error_picture(&aligned, &channels, &seen, region).png();
    let error_png = error_png.map_err(|error| PictureError::Encode(error.to_string()))?;
    Ok(ScoredPhoto { aligned, channels, saturated: photo.saturated(), aligned_png, error_png })
}

fn aligned_png(aligned: &AlignedPhoto, scores: &[ChannelScore], encoding: Encoding) -> Result<Vec<u8>, PictureError> {
    let encoded = |(light, score): (&Plane<f32>, &ChannelScore)| {
        let light = light.map(|value| value * score.gain as f32);
        match encoding {
            Encoding::Linear => pictures::grey_png_linear(&light),
            Encoding::Srgb => pictures::grey_png_srgb(&light),
        }
    };
    let files = aligned.channels.iter().zip(scores).map(encoded).collect::<Result<Vec<_>, _>>()?;
    match &files[..] {
        [red, green, blue] => pictures::colour_png([red, green, blue]),
        _ => Ok(files.concat()),
    }
}

/// Heat maps of the error, one below the other, with the same scale.
fn error_picture(
    aligned: &AlignedPhoto,
    scores: &[ChannelScore],
    targets: &[Plane<f32>],
    region: RegionOfInterest,
) -> Canvas {
    let channels = aligned.channels.iter().zip(targets).zip(scores);
    let errors: Vec<Plane<f32>> =
        channels.map(|((light, target), score)| photo_score::error_of(light, target, score.gain)).collect();
    let scale = scale_of(&errors, region);
    let drawn = errors.iter().enumerate().map(|(i, values)| {
        let axis = |label, side: usize| Axis { label, start: 0.0, end: side as f64 };
        let title = match errors.len() {
            1 => "gain · photograph − target, in parts of the peak".to_owned(),
            _ => format!("gain · photograph − target, in parts of the peak: {}", COLOURS[i % COLOURS.len()]),
        };
        let map = Heatmap {
            title: &title,
            values,
            colours: ColourMap::Diverging,
            range: (-scale, scale),
            unit: "",
            x: axis("x [target px]", values.width_px()),
            y: axis("y [target px]", values.height_px()),
        };
        vec![map.draw_sized(if errors.len() == 1 { ERROR_PX } else { ERROR_OF_COLOUR_PX })]
    });
    Canvas::grid(&drawn.collect::<Vec<_>>())
}

/// The smallest scale beyond which only a few errors of the region lie.
fn scale_of(errors: &[Plane<f32>], region: RegionOfInterest) -> f32 {
    let rows = region.y_px()..region.y_px() + region.height_px();
    let beyond = |scale: f32| {
        let values = |plane: &Plane<f32>| {
            let row = |y: usize| plane.row(y)[region.x_px()..][..region.width_px()].iter();
            rows.clone().flat_map(row).filter(|error| error.abs() > scale).count()
        };
        errors.iter().map(values).sum::<usize>() as f64
    };
    let allowed = BEYOND_SCALE * (region.pixels() * errors.len()) as f64;
    let [.., widest] = ERROR_SCALES;
    ERROR_SCALES.into_iter().find(|&scale| beyond(scale) <= allowed).unwrap_or(widest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pictures::{colour_png, grey_png_linear, grey_png_srgb};
    use lightpath_bench::TestCard;
    use lightpath_optics::Grid;

    fn card() -> Plane<f32> {
        TestCard::Portrait.render(90, 160, 1).unwrap()
    }

    fn middle() -> RegionOfInterest {
        RegionOfInterest::middle(&Grid::try_new(90, 160, 8e-6).unwrap())
    }

    fn read(file: &[u8], encoding: Encoding) -> EncodedPicture {
        EncodedPicture::read(file, encoding).unwrap()
    }

    #[test]
    fn encodings_are_decoded_and_colours_are_compared_one_by_one() {
        let target = read(&grey_png_srgb(&card()).unwrap(), Encoding::Srgb);
        let grey = read(&grey_png_linear(&card().map(|light| 0.5 * light)).unwrap(), Encoding::Linear);
        let found = score(&grey, &target, middle()).unwrap();
        assert!(found.channels.len() == 1 && (found.channels[0].gain - 2.0).abs() < 0.02, "{:?}", found.channels);
        assert!(found.channels[0].psnr_db > 35.0, "8-bit values: {:?}", found.channels);
        let channel = |gain: f32| grey_png_linear(&card().map(|light| gain * light)).unwrap();
        let (red, green, blue) = (channel(0.25), channel(0.5), channel(1.0));
        let colours = read(&colour_png([&red, &green, &blue]).unwrap(), Encoding::Linear);
        let found = score(&colours, &target, middle()).unwrap();
        let gains: Vec<f64> = found.channels.iter().map(|score| score.gain).collect();
        assert!(gains.iter().zip([4.0, 2.0, 1.0]).all(|(gain, truth)| (gain / truth - 1.0).abs() < 0.03), "{gains:?}");
        assert_eq!(pictures::picture_size(&found.aligned_png).unwrap(), (160, 90));
    }

    #[test]
    fn saturated_pixels_are_counted_before_decoding() {
        let photo = Plane::from_fn(40, 40, |y, _| if y < 10 { 1.0 } else { 0.5 });
        for encoding in [Encoding::Linear, Encoding::Srgb] {
            assert_eq!(read(&grey_png_linear(&photo).unwrap(), encoding).saturated(), 0.25);
        }
    }

    #[test]
    fn the_scale_holds_nearly_all_errors() {
        let error = Plane::from_fn(90, 160, |y, x| if (y, x) == (45, 80) { 0.9 } else { 0.07 });
        assert_eq!(scale_of(&[error], middle()), 0.1);
        assert_eq!(scale_of(&[Plane::filled(90, 160, 3.0)], middle()), 1.0);
    }
}
