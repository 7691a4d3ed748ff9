//! Pictures as people look at them: a part, smaller, in colours, on a logarithmic scale, or less another picture.

use super::ColourMap;
use crate::pictures::{self, Channel, PictureError, Placement, Rectangle};
use lightpath_domain::dataset::Encoding;
use lightpath_domain::job::Fit;
use lightpath_optics::Plane;

/// Colours of a view.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ViewColours {
    /// Those of the picture.
    #[default]
    Own,
    /// From black to white, in the encoding of the picture.
    Grey,
    /// Those of a map, from 0 or the negative end of the range to its end.
    Map(ColourMap),
}

/// How to show a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// The encoding of the picture.
    pub encoding: Encoding,
    /// The part to show; `None`: all of it.
    pub region: Option<Rectangle>,
    /// Number of columns of the result; `None`: those of the part. Pictures never grow.
    pub width_px: Option<usize>,
    /// Colours.
    pub colours: ViewColours,
    /// Decades of light below the end of the range on a logarithmic scale; `None`: a linear scale.
    pub decades: Option<f32>,
    /// Light at the end of the scale, above 0.
    pub range: f32,
}

impl Default for View {
    fn default() -> Self {
        Self {
            encoding: Encoding::Srgb,
            region: None,
            width_px: None,
            colours: ViewColours::Own,
            decades: None,
            range: 1.0,
        }
    }
}

/// A picture whose light is taken from another.
#[derive(Clone, Copy, Debug)]
pub struct Subtracted<'a> {
    /// The file.
    pub bytes: &'a [u8],
    /// Its encoding.
    pub encoding: Encoding,
    /// How it is fitted to the area.
    pub fit: Fit,
    /// The part of the other that it fills; `None`: all of it.
    pub area: Option<Rectangle>,
    /// The colour that gives its light.
    pub channel: Channel,
}

/// A drawn view.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// The view as a PNG.
    pub png: Vec<u8>,
    /// Number of columns of the whole picture, of which the view may show a part.
    pub width_px: usize,
    /// Number of rows of the whole picture.
    pub height_px: usize,
    /// How close the shown part comes to the subtracted picture; `None`: none was subtracted.
    pub closeness: Option<Closeness>,
}

/// PSNR of a picture against another, at most 200 dB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closeness {
    /// With the gain that has the smallest error \[dB\].
    pub psnr_db: f64,
    /// With the gain and the offset that have the smallest error, as without a camera's black level \[dB\].
    pub psnr_with_offset_db: f64,
}

/// Largest PSNR, that of equal pictures \[dB\].
const PSNR_MAX_DB: f64 = 200.0;

/// Draws a view of a picture, less another one if wanted, as a PNG. Differences of light reach from −range to range,
/// light from 0 to range.
///
/// # Errors
///
/// [`PictureError`] for files that are no readable pictures, a subtracted picture that does not fit, and a region
/// outside the picture.
pub fn view(bytes: &[u8], subtracted: Option<Subtracted<'_>>, view: &View) -> Result<Drawn, PictureError> {
    let is_own = view.colours == ViewColours::Own && subtracted.is_none() && view.decades.is_none();
    let mut planes = match is_own {
        true => pictures::colour_planes(bytes, view.encoding, 1)?,
        false => vec![pictures::photograph(bytes, view.encoding)?],
    };
    let (height_px, width_px) = (planes[0].height_px(), planes[0].width_px());
    let mut closeness = None;
    if let Some(subtracted) = subtracted {
        let other = pictures::photograph_channel(subtracted.bytes, subtracted.encoding, subtracted.channel)?;
        let placement = Placement { fit: subtracted.fit, area: subtracted.area, height_px, width_px };
        let other = pictures::fit(other, &placement)?;
        closeness = Some(compared(&planes[0], &other, view.region)?);
        planes[0].values_mut().iter_mut().zip(other.values()).for_each(|(light, other)| *light -= other);
    }
    let is_cyclic = view.colours == ViewColours::Map(ColourMap::Cyclic);
    let resized = |plane: Plane<f32>| -> Result<Plane<f32>, PictureError> {
        let part = match view.region {
            None => plane,
            Some(region) => part(&plane, region)?,
        };
        Ok(shrunk(part, view.width_px, subtracted.is_some(), is_cyclic))
    };
    let planes = planes.into_iter().map(resized).collect::<Result<Vec<_>, _>>()?;
    let png = encoded(&planes, subtracted.is_some(), view)?;
    Ok(Drawn { png, width_px, height_px, closeness })
}

/// Compares a part of a picture with another picture of the same size, as [`lightpath_optics::metrics`] does, but for pictures of
/// any size.
fn compared(picture: &Plane<f32>, target: &Plane<f32>, region: Option<Rectangle>) -> Result<Closeness, PictureError> {
    let whole = Rectangle { x_px: 0, y_px: 0, width_px: picture.width_px(), height_px: picture.height_px() };
    let region = region.unwrap_or(whole);
    let (picture, target) = (part(picture, region)?, part(target, region)?);
    let count = picture.values().len() as f64;
    let mean = |plane: &Plane<f32>| plane.values().iter().map(|&light| f64::from(light)).sum::<f64>() / count;
    let psnr_db = |p_mean: f64, t_mean: f64| {
        let pairs = || {
            let pairs = picture.values().iter().zip(target.values());
            pairs.map(|(&p, &t)| (f64::from(p) - p_mean, f64::from(t) - t_mean))
        };
        let (pp, pt) = pairs().fold((0.0, 0.0), |(pp, pt), (p, t)| (pp + p * p, pt + p * t));
        let gain = if pp > 0.0 { pt / pp } else { 0.0 };
        let mse = pairs().map(|(p, t)| (gain * p - t).powi(2)).sum::<f64>() / count;
        (-10.0 * mse.log10()).min(PSNR_MAX_DB)
    };
    Ok(Closeness { psnr_db: psnr_db(0.0, 0.0), psnr_with_offset_db: psnr_db(mean(&picture), mean(&target)) })
}

/// The planes of a view in their colours, as a PNG.
fn encoded(planes: &[Plane<f32>], is_difference: bool, view: &View) -> Result<Vec<u8>, PictureError> {
    let scale = |value: f32| scaled(value / view.range, is_difference, view.decades);
    match view.colours {
        ViewColours::Map(map) => pictures::rgb_png(&planes[0].map(|value| map.colour(scale(value)))),
        ViewColours::Own if is_difference => {
            pictures::rgb_png(&planes[0].map(|value| ColourMap::Diverging.colour(scale(value))))
        }
        ViewColours::Own | ViewColours::Grey => {
            // A logarithmic scale and a difference are no light: they are shown as they are.
            let is_light = view.decades.is_none() && !is_difference && view.encoding == Encoding::Srgb;
            let grey = |value: f32| {
                let t = scale(value).clamp(0.0, 1.0);
                ((if is_light { pictures::linear_to_srgb(t) } else { t }) * 255.0).round() as u8
            };
            match planes {
                [red, green, blue] => {
                    let rgb = Plane::from_fn(red.height_px(), red.width_px(), |y, x| {
                        [red, green, blue].map(|plane| grey(plane.at(y, x)))
                    });
                    pictures::rgb_png(&rgb)
                }
                planes => pictures::levels_png(&planes[0].map(|value| u16::from(grey(value))), 8),
            }
        }
    }
}

/// The place of a value on the scale, from 0 to 1. `value` is relative to the end of the range.
fn scaled(value: f32, is_difference: bool, decades: Option<f32>) -> f32 {
    let logarithmic = |light: f32, decades: f32| (1.0 + light.log10() / decades).max(0.0);
    match (is_difference, decades) {
        (false, None) => value,
        (false, Some(decades)) => logarithmic(value, decades),
        (true, None) => 0.5 + 0.5 * value,
        (true, Some(decades)) => 0.5 + 0.5 * value.signum() * logarithmic(value.abs(), decades),
    }
}

fn part(plane: &Plane<f32>, region: Rectangle) -> Result<Plane<f32>, PictureError> {
    region.require_inside(plane.height_px(), plane.width_px())?;
    let Rectangle { x_px, y_px, width_px, height_px } = region;
    Ok(Plane::from_fn(height_px, width_px, |y, x| plane.at(y_px + y, x_px + x)))
}

/// The plane with at most `width_px` columns. Light is averaged, differences too; of phases, whose mean means nothing,
/// every so many pixels one is shown.
fn shrunk(plane: Plane<f32>, width_px: Option<usize>, is_difference: bool, is_cyclic: bool) -> Plane<f32> {
    let (rows, columns) = (plane.height_px(), plane.width_px());
    let Some(width_px) = width_px.map(|width_px| width_px.max(1)).filter(|width_px| *width_px < columns) else {
        return plane;
    };
    let height_px = (rows * width_px + columns / 2).div_euclid(columns).max(1);
    if is_cyclic {
        let nearest = |i: usize, shown: usize, stored: usize| (2 * i + 1) * stored / (2 * shown);
        return Plane::from_fn(height_px, width_px, |y, x| {
            plane.at(nearest(y, height_px, rows), nearest(x, width_px, columns))
        });
    }
    // The resampling clips to [0, 1], the range of light.
    if is_difference {
        let light = plane.map(|difference| 0.5 + 0.5 * difference);
        return pictures::resized(&light, height_px, width_px).map(|light| 2.0 * light - 1.0);
    }
    pictures::resized(&plane, height_px, width_px)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns, rows and pixels of a PNG.
    fn decoded(png: &[u8]) -> (usize, usize, Vec<[u8; 3]>) {
        let picture = image::load_from_memory(png).unwrap().to_rgb8();
        (picture.width() as usize, picture.height() as usize, picture.pixels().map(|pixel| pixel.0).collect())
    }

    fn grey(levels: &Plane<u16>) -> Vec<u8> {
        pictures::levels_png(levels, 8).unwrap()
    }

    #[test]
    fn a_view_without_wishes_shows_every_picture_as_it_is() {
        let levels = Plane::from_fn(16, 16, |y, x| (16 * y + x) as u16);
        for encoding in [Encoding::Srgb, Encoding::Linear] {
            let (_, _, shown) =
                decoded(&view(&grey(&levels), None, &View { encoding, ..View::default() }).unwrap().png);
            assert!(shown.iter().zip(0..=255).all(|(&pixel, level)| pixel == [level; 3]), "{encoding:?}");
        }
        let colours = Plane::from_fn(3, 4, |y, x| [60 * y as u8, 60 * x as u8, 200]);
        let (width, height, shown) =
            decoded(&view(&pictures::rgb_png(&colours).unwrap(), None, &View::default()).unwrap().png);
        assert_eq!((width, height, shown.as_slice()), (4, 3, colours.values()));
    }

    #[test]
    fn a_part_is_shown_smaller_with_its_mean_light_and_of_phases_single_pixels() {
        // Columns of 0 and 255 by turns: the mean of linear levels is 127.5.
        let levels = Plane::from_fn(40, 80, |_, x| if x % 2 == 0 { 0 } else { 255 });
        let region = Some(Rectangle { x_px: 10, y_px: 5, width_px: 60, height_px: 20 });
        let small = View { encoding: Encoding::Linear, region, width_px: Some(15), ..View::default() };
        let drawn = view(&grey(&levels), None, &small).unwrap();
        let (width, height, shown) = decoded(&drawn.png);
        assert_eq!((width, height), (15, 5));
        assert_eq!((drawn.width_px, drawn.height_px), (80, 40), "the size of the whole picture");
        let middle = shown[2 * 15 + 7];
        assert!((126..=129).contains(&middle[0]), "{middle:?}");
        let phase = View { colours: ViewColours::Map(ColourMap::Cyclic), ..small };
        let (_, _, shown) = decoded(&view(&grey(&levels), None, &phase).unwrap().png);
        let ends = [0.0, 1.0].map(|t| ColourMap::Cyclic.colour(t));
        assert!(shown.iter().all(|pixel| ends.contains(pixel)), "{shown:?}");
        let (width, ..) = decoded(&view(&grey(&levels), None, &View { width_px: Some(500), ..small }).unwrap().png);
        assert_eq!(width, 60, "pictures do not grow");
    }

    #[test]
    fn colours_follow_light_linearly_or_by_decades() {
        let levels = Plane::from_fn(1, 3, |_, x| [255, 26, 0][x]);
        let at = |decades, range| {
            let colours = ViewColours::Map(ColourMap::Sequential);
            let wish = View { encoding: Encoding::Linear, colours, decades, range, ..View::default() };
            decoded(&view(&grey(&levels), None, &wish).unwrap().png).2
        };
        let colour = |t| ColourMap::Sequential.colour(t);
        let tenth = 26.0 / 255.0;
        assert_eq!(at(None, 1.0), [colour(1.0), colour(tenth), colour(0.0)]);
        assert_eq!(at(None, tenth), [colour(1.0), colour(1.0), colour(0.0)]);
        assert_eq!(at(Some(2.0), 1.0), [colour(1.0), colour(1.0 + tenth.log10() / 2.0), colour(0.0)]);
    }

    #[test]
    fn differences_are_centred_and_the_other_picture_is_fitted() {
        let (bright, dark) = (Plane::filled(8, 16, 204_u16), Plane::filled(4, 8, 102_u16));
        let subtracted = |bytes, fit| {
            Some(Subtracted { bytes, encoding: Encoding::Linear, fit, area: None, channel: Channel::Mean })
        };
        let wish = View { encoding: Encoding::Linear, range: 0.8, ..View::default() };
        let dark = grey(&dark);
        let (width, height, shown) = decoded(&view(&grey(&bright), subtracted(&dark, Fit::Cover), &wish).unwrap().png);
        // (204 − 102)/255 = 0.4, half of the range.
        assert_eq!((width, height, shown[0]), (16, 8, ColourMap::Diverging.colour(0.75)));
        let wrong = view(&grey(&bright), subtracted(&dark, Fit::Exact), &wish).unwrap_err();
        assert!(matches!(wrong, PictureError::WrongSize { width_px: 16, .. }), "{wrong}");
    }

    #[test]
    fn one_colour_of_the_other_picture_can_be_subtracted() {
        let white = grey(&Plane::filled(8, 16, 255));
        let green = pictures::rgb_png(&Plane::filled(8, 16, [0, 255, 0])).unwrap();
        let less = |channel| {
            let other = Subtracted { bytes: &green, encoding: Encoding::Srgb, fit: Fit::Exact, area: None, channel };
            decoded(&view(&white, Some(other), &View::default()).unwrap().png).2[0]
        };
        assert_eq!(less(Channel::Colour(0)), ColourMap::Diverging.colour(1.0));
        assert_eq!(less(Channel::Colour(1)), ColourMap::Diverging.colour(0.5));
    }

    #[test]
    fn a_region_outside_the_picture_is_refused() {
        let picture = grey(&Plane::filled(8, 16, 3));
        for (x_px, y_px, width_px, height_px) in [(10, 0, 7, 1), (0, 8, 1, 1), (0, 0, 0, 1), (usize::MAX, 0, 1, 1)] {
            let region = Some(Rectangle { x_px, y_px, width_px, height_px });
            let refused = view(&picture, None, &View { region, ..View::default() }).unwrap_err();
            assert!(refused.to_string().contains("16×8 px"), "{refused}");
        }
    }
}
