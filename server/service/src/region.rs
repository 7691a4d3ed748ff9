//! Regions of interest.

use crate::error::Result;
use crate::field::Field;
use lightpath_domain::display::Display;
use lightpath_optics::{Grid, RegionOfInterest};

/// A rectangle inside the display: first column and row, width and height \[px\]. If it is not given, the middle 80 % of
/// each axis.
pub fn region_of(field: &Field, region_px: Option<[u32; 4]>, display: &Display) -> Result<RegionOfInterest> {
    let grid = Grid::try_new(display.height_px as usize, display.width_px as usize, display.pixel_pitch_m);
    let grid = grid.map_err(|error| field.invalid(error, "name a larger display"))?;
    region_inside(field, region_px, &grid, &format!("displays/{}", display.id))
}

/// A rectangle inside a grid, which `name` calls in messages. If it is not given, the middle 80 % of each axis.
pub(crate) fn region_inside(
    field: &Field,
    region_px: Option<[u32; 4]>,
    grid: &Grid,
    name: &str,
) -> Result<RegionOfInterest> {
    let Some([x_px, y_px, width_px, height_px]) = region_px else { return Ok(RegionOfInterest::middle(grid)) };
    let [x, y, width, height] = [x_px, y_px, width_px, height_px].map(|px| px as usize);
    RegionOfInterest::try_new(grid, x, y, width, height).map_err(|_| {
        let given = format!("is {width_px}×{height_px} px at ({x_px}, {y_px})");
        let (columns, rows) = (grid.width_px(), grid.height_px());
        field.but(given, format!("must be at least 1×1 px and inside {name}, {columns}×{rows} px"))
    })
}
