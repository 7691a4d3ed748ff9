//! Arguments that several commands share.

use super::words::WordParser;
use clap::Args;
use lightpath::units::{Length, ParseError};
use lightpath::v1;

/// Display, distance and wavelength that a dataset, kernel or photograph belongs to.
#[derive(Debug, Args)]
pub(crate) struct Optics {
    /// Use the display with this id, for example lab-2
    #[arg(long, value_name = "ID")]
    pub(crate) display: String,

    /// Set the distance from the SLM to the image plane, at most 10m, for example 150mm; negative for an image behind
    /// the SLM
    #[arg(long, value_name = "LENGTH", value_parser = distance, allow_hyphen_values = true)]
    pub(crate) distance: f64,

    /// Set the wavelength in vacuum, for example 515nm [default: the display's only wavelength]
    #[arg(long, value_name = "LENGTH", value_parser = wavelength, allow_hyphen_values = true)]
    pub(crate) wavelength: Option<f64>,
}

impl Optics {
    /// Wavelength \[m\] for the API. `None`: the display's only wavelength.
    pub(crate) fn wavelength_m(&self) -> Option<f64> {
        self.wavelength
    }
}

/// Length limit of a list.
#[derive(Debug, Args)]
pub(crate) struct Limit {
    /// Show at most this many entries; 0 shows all
    #[arg(long, value_name = "N", default_value_t = 50)]
    pub(crate) limit: u32,
}

/// How a version shall pass the promotion gate.
#[derive(Debug, Args)]
pub(crate) struct Passage {
    /// Record this reason in the history, at most 1024 bytes [default: none]
    #[arg(long, value_name = "TEXT", default_value = "", hide_default_value = true)]
    pub(crate) reason: String,

    /// Go on even if the version fails the gate; needs --reason, and the history keeps what failed
    #[arg(long, requires = "reason")]
    pub(crate) force: bool,

    /// Go on only if this version is active now; 0 means no active version [default: the version that is active when
    /// the gate is checked]
    #[arg(long, value_name = "N")]
    pub(crate) expected_active: Option<u32>,
}

/// Parser of propagation methods.
pub(crate) fn propagation() -> WordParser<v1::PropagationMethod> {
    WordParser::new()
        .or_unspecified_as("auto", "The planner's choice; with a learned kernel, the method it was learned with.")
}

/// Parses a distance such as `150mm` into metres.
pub(crate) fn distance(text: &str) -> Result<f64, ParseError> {
    Length::Distance.parse_m(text)
}

/// Parses a pixel pitch such as `8um` into metres.
pub(crate) fn pixel_pitch(text: &str) -> Result<f64, ParseError> {
    Length::PixelPitch.parse_m(text)
}

/// Parses a wavelength such as `515nm` into metres.
pub(crate) fn wavelength(text: &str) -> Result<f64, ParseError> {
    Length::Wavelength.parse_m(text)
}

/// Parses a number above 0.
pub(crate) fn above_zero(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number > 0.0 => Ok(number),
        Ok(_) => Err("must be above 0".to_owned()),
        Err(_) => Err("must be a number above 0".to_owned()),
    }
}

/// Parses a percentage such as `5%` into a part of one.
pub(crate) fn percent(text: &str) -> Result<f64, String> {
    let number = text.strip_suffix('%').ok_or_else(|| format!("has no unit: write {text}%, if it is in per cent"))?;
    match number.trim_end().parse::<f64>() {
        Ok(percent) if (0.0..=100.0).contains(&percent) => Ok(percent / 100.0),
        _ => Err("must be 0% to 100%".to_owned()),
    }
}

/// Parses a region `x,y,width,height` in pixels.
pub(crate) fn region(text: &str) -> Result<v1::Region, String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x_px, y_px, width_px, height_px]) => Ok(v1::Region { x_px, y_px, width_px, height_px }),
        _ => Err("must be x,y,width,height in whole pixels, such as 192,108,1536,864".to_owned()),
    }
}

/// Parses a resolution such as `1920x1080` into columns and rows.
pub(crate) fn resolution(text: &str) -> Result<(u32, u32), String> {
    let (width, height) = text.split_once(['x', '×']).unwrap_or(("", ""));
    match (width.trim().parse(), height.trim().parse()) {
        (Ok(width_px), Ok(height_px)) => Ok((width_px, height_px)),
        _ => Err("must be columns x rows in whole pixels, such as 1920x1080".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_and_resolutions_are_parsed() {
        let full = v1::Region { x_px: 1, y_px: 2, width_px: 30, height_px: 40 };
        assert_eq!(region("1,2, 30,40"), Ok(full));
        for bad in ["", "1,2,3", "1,2,3,4,5", "-1,2,3,4", "0.1,0,1,1"] {
            assert!(region(bad).unwrap_err().contains("192,108,1536,864"), "{bad}");
        }
        assert_eq!(resolution("1920x1080"), Ok((1920, 1080)));
        assert_eq!(resolution("1920×1080"), Ok((1920, 1080)));
        for bad in ["", "1920", "x", "-1x5", "1920x1080x3"] {
            assert!(resolution(bad).unwrap_err().contains("1920x1080"), "{bad}");
        }
    }
}
