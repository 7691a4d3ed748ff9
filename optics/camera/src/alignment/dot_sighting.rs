//! What a photograph of dots showed, in words, for a refusal that says what to change.

use std::fmt;

/// What was seen in a photograph in which the grid of dots was not recognized.
#[derive(Clone, Debug, PartialEq)]
pub struct DotSighting {
    /// Number of bright spots.
    pub spots: usize,
    /// Part of the pixels that are saturated.
    pub saturated: f64,
    /// Brightest pixel, from 0 to 1.
    pub brightest: f64,
    /// A spot far brighter than dots: its place \[camera px\], and its light in dots.
    pub dazzling: Option<([f64; 2], f64)>,
    /// Typical width of a dot, in displayed widths.
    pub dot_width: Option<f64>,
}

/// Part of saturated pixels that is worth a word.
const SATURATED_MIN: f64 = 0.01;
/// Light of a spot that is worth a word, in dots. A large dot has 2.9.
pub(super) const DAZZLING: f64 = 4.0;
/// Brightest pixel of a photograph that is called dark.
const DARK: f64 = 0.1;
/// Width of dots that are called blurred, in displayed widths.
const BLURRED: f64 = 1.6;

impl fmt::Display for DotSighting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} bright spots", self.spots)?;
        if let Some(([x, y], dots)) = self.dazzling {
            write!(f, "; a spot as bright as {dots:.0} dots at ({x:.0}, {y:.0}) px (block undiffracted light)")?;
        }
        match self.saturated {
            part if part >= SATURATED_MIN => {
                write!(f, "; {:.1} % of the pixels saturated (expose shorter)", 100.0 * part)?;
            }
            _ if self.brightest < DARK => {
                write!(f, "; no pixel above {:.1} % of full scale (expose longer)", 100.0 * self.brightest)?;
            }
            part => write!(f, "; {:.1} % of the pixels saturated", 100.0 * part)?,
        }
        match self.dot_width {
            Some(width) if width >= BLURRED => {
                write!(f, "; spots {width:.1} times as wide as displayed dots (focus the camera)")
            }
            _ => Ok(()),
        }
    }
}
