//! The calibration target: a picture whose hologram is displayed and photographed to find an alignment.

use super::Datasets;
use crate::call::Call;
use crate::error::Result;
use crate::field::Field;
use lightpath_camera::alignment::DotGrid;
use lightpath_domain::display::Display;
use lightpath_media::pictures;

/// Memory for drawing a target, for each pixel \[bytes\]: its light, its values, and the file, which is smaller.
const TARGET_BYTES_PER_PX: u64 = 4 + 1 + 1;

/// A calibration target that was drawn.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CalibrationTarget {
    /// Artifact digest of the picture.
    pub target: String,
    /// Dots in a row.
    pub columns: usize,
    /// Rows of dots.
    pub rows: usize,
}

impl Datasets {
    /// Draws the calibration target of a display.
    pub async fn calibration_target(&self, call: &Call, display: &Display) -> Result<CalibrationTarget> {
        let field = Field::new("display");
        let (height_px, width_px) = (display.height_px as usize, display.width_px as usize);
        let grid = DotGrid::of_display(height_px, width_px);
        let grid =
            grid.map_err(|error| field.invalid(format!("({}): {error}", display.id), "name a larger display"))?;
        let (columns, rows) = grid.size();
        let need_bytes = TARGET_BYTES_PER_PX * (height_px * width_px) as u64;
        let file = self.computing.run(call, need_bytes, move || pictures::grey_png_srgb(&grid.target())).await?;
        let file = file.map_err(|error| field.invalid(error, "name a smaller display"))?;
        let target = self.files.store(call, file).await?;
        Ok(CalibrationTarget { target, columns, rows })
    }
}
