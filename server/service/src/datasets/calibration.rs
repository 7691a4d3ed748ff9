//! Calibration targets: the picture whose hologram is displayed and photographed to find an alignment, and test pictures,
//! from photographs of whose holograms a kernel is learned.

use super::Datasets;
use crate::call::Call;
use crate::error::Result;
use crate::field::Field;
use lightpath_bench::TestCard;
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
    /// Dots in a row, and rows of dots; `None`: it is a test picture.
    pub dots: Option<(usize, usize)>,
}

impl Datasets {
    /// Draws the calibration target of a display.
    pub async fn calibration_target(&self, call: &Call, display: &Display) -> Result<CalibrationTarget> {
        let field = Field::new("display");
        let (height_px, width_px) = (display.height_px as usize, display.width_px as usize);
        let grid = DotGrid::of_display(height_px, width_px);
        let grid =
            grid.map_err(|error| field.invalid(format!("({}): {error}", display.id), "name a larger display"))?;
        let dots = Some(grid.size());
        let need_bytes = TARGET_BYTES_PER_PX * (height_px * width_px) as u64;
        let file = self.computing.run(call, need_bytes, move || pictures::grey_png_srgb(&grid.target())).await?;
        let file = file.map_err(|error| field.invalid(error, "name a smaller display"))?;
        let target = self.files.store(call, file).await?;
        Ok(CalibrationTarget { target, dots })
    }

    /// Draws a test picture of a display's size: all kinds of scenes and charts in turn, each time from another seed.
    pub async fn test_picture(&self, call: &Call, display: &Display, number: u32) -> Result<CalibrationTarget> {
        let field = Field::new("display");
        let (height_px, width_px) = (display.height_px as usize, display.width_px as usize);
        let kinds = TestCard::ALL.len();
        let (card, seed) = (TestCard::ALL[number as usize % kinds], u64::from(number) / kinds as u64);
        let need_bytes = TARGET_BYTES_PER_PX * (height_px * width_px) as u64;
        let draw = move || Ok(pictures::grey_png_srgb(&card.render(height_px, width_px, seed)?));
        let file = self.computing.run(call, need_bytes, draw).await?;
        let file = file.map_err(|error: lightpath_optics::Error| field.invalid(error, "name another display"))?;
        let file = file.map_err(|error| field.invalid(error, "name a smaller display"))?;
        Ok(CalibrationTarget { target: self.files.store(call, file).await?, dots: None })
    }
}
