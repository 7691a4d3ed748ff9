//! The calibration target: a picture whose hologram is displayed and photographed to find an alignment.

use crate::api::Api;
use crate::error::ApiError;
use crate::field::Field;
use lightpath_domain::access::Caller;
use lightpath_media::pictures;
use lightpath_optics::alignment::DotGrid;
use lightpath_proto::v1;

impl Api {
    pub(crate) async fn create_calibration_target(
        &self,
        caller: &Caller,
        request: v1::CreateCalibrationTargetRequest,
    ) -> Result<v1::CalibrationTarget, ApiError> {
        let field = Field::new("display");
        let display = self.display_named(caller, &field, &request.display).await?;
        let grid = DotGrid::of_display(display.height_px as usize, display.width_px as usize);
        let grid = grid.map_err(|error| field.invalid(format!("({}): {error}", display.id)))?;
        let file = pictures::grey_png_srgb(&grid.target()).map_err(|error| field.invalid(error))?;
        let (columns, rows) = grid.size();
        let target = self.store_artifact(caller, file).await?;
        Ok(v1::CalibrationTarget { target, columns: columns as u32, rows: rows as u32 })
    }
}
