//! The calibration target: a picture whose hologram is displayed and photographed to find an alignment.

use crate::api::Api;
use crate::call::Call;
use crate::error::ApiError;
use crate::field::Field;
use lightpath_camera::alignment::DotGrid;
use lightpath_media::pictures;
use lightpath_proto::v1;

/// Memory for drawing a target, for each pixel \[bytes\]: its light, its values, and the file, which is smaller.
const TARGET_BYTES_PER_PX: u64 = 4 + 1 + 1;

impl Api {
    pub(crate) async fn create_calibration_target(
        &self,
        call: &Call,
        request: v1::CreateCalibrationTargetRequest,
    ) -> Result<v1::CalibrationTarget, ApiError> {
        let field = Field::new("display");
        let display = self.display_named(call, &field, &request.display).await?;
        let (height_px, width_px) = (display.height_px as usize, display.width_px as usize);
        let grid = DotGrid::of_display(height_px, width_px);
        let grid = grid.map_err(|error| field.invalid(format!("({}): {error}", display.id)))?;
        let (columns, rows) = grid.size();
        let need_bytes = TARGET_BYTES_PER_PX * (height_px * width_px) as u64;
        let file = self.accounts.compute(call, need_bytes, move || pictures::grey_png_srgb(&grid.target())).await?;
        let file = file.map_err(|error| field.invalid(error))?;
        let target = self.store_artifact(call, file).await?;
        Ok(v1::CalibrationTarget { target, columns: columns as u32, rows: rows as u32 })
    }
}
