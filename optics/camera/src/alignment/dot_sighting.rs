//! What a photograph of dots showed, in words, for a refusal that says what to change.

use super::dot_cells::SeenGrid;
use super::homography::Point;
use lightpath_optics::Plane;
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
    pub dazzling: Option<(Point, f64)>,
    /// Typical width of a dot, in displayed widths.
    pub dot_width: Option<f64>,
}

/// Level from which a pixel is saturated.
const SATURATED: f32 = 0.999;
/// Part of saturated pixels that is worth a word.
const SATURATED_MIN: f64 = 0.01;
/// Light of a spot that is worth a word, in dots. A large dot has 2.9.
const DAZZLING: f64 = 4.0;
/// Brightest pixel of a photograph that is called dark.
const DARK: f64 = 0.1;
/// Width of dots that are called blurred, in displayed widths.
const BLURRED: f64 = 1.6;
/// Width of a displayed dot, in squares.
const DISPLAYED_WIDTH: f64 = 0.1;

impl DotSighting {
    pub(super) fn of(photo: &Plane<f32>, spots: &[Point], grid: Option<&SeenGrid>) -> Self {
        let values = photo.values();
        let saturated = values.iter().filter(|&&level| level >= SATURATED).count() as f64 / values.len() as f64;
        let brightest = values.iter().copied().fold(0.0, f32::max);
        let cells = || grid.iter().flat_map(|grid| grid.cells.values()).filter(|cell| cell.light > 0.0);
        let typical = |of: fn(&super::dot_cells::Cell) -> f64| {
            let mut values: Vec<f64> = cells().map(of).collect();
            values.sort_by(f64::total_cmp);
            values.get(values.len() / 2).copied()
        };
        let dot = typical(|cell| cell.light);
        let dazzling = cells().max_by(|a, b| a.light.total_cmp(&b.light)).zip(dot);
        let dazzling =
            dazzling.map(|(cell, dot)| (cell.centre, cell.light / dot)).filter(|(_, dots)| *dots >= DAZZLING);
        let dot_width = typical(|cell| cell.width).map(|width| width / DISPLAYED_WIDTH);
        Self { spots: spots.len(), saturated, brightest: f64::from(brightest), dazzling, dot_width }
    }
}

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
