//! Chapter about a kernel that varies over the modulator, at several positions.

use super::chapter::{Chapter, ReportError};
use super::optics::{ratio, spot_picture};
use crate::figures::Canvas;
use lightpath_optics::DisplayModel;
use lightpath_optics::diagnostics::point_spread;
use lightpath_optics::display::parts::spatial_variation::local_kernels::{change, per_side};
use std::fmt::Write as _;

/// Positions along x, from edge (−1) to edge (1).
const COLUMNS: [(&str, f64); 3] = [("left", -1.0), ("middle", 0.0), ("right", 1.0)];
/// Positions along y, from edge (−1) to edge (1).
const ROWS: [(&str, f64); 3] = [("top", -1.0), ("middle", 0.0), ("bottom", 1.0)];
/// Number of samples along each side of the band for the comparison of a position with the axis.
const SAMPLES: usize = 48;

/// The chapter. `None`: the kernel does not vary over the modulator.
pub(super) fn chapter(model: &DisplayModel) -> Result<Option<Chapter>, ReportError> {
    if model.variation.is_none() {
        return Ok(None);
    }
    let (pitch_m, on_axis) = (model.setup.grid().pixel_pitch_m(), ratio(model));
    let nyquist = 0.5 / pitch_m;
    let side = per_side(&model.variation);
    let mut body = format!(
        "<p>The transfer function depends on the position on the modulator. Between the axis and the corner with the \
         largest change, the logarithm of the transfer function (amplitude and phase) changes by <b>{:.2} rad</b>, as \
         root mean square over the band. Holograms are computed with {side}×{side} blended kernels. The table lists \
         for each position the phase difference from the axis, as root mean square over the band without piston and \
         tilts, and the Strehl ratio.</p><table><tr><th></th>",
        change(&model.variation)
    );
    body.extend(COLUMNS.map(|(name, _)| format!("<th class=n>{name}</th>")));
    body.push_str("</tr>");
    let (mut sheet, mut strehls, mut changes) = (Vec::new(), Vec::new(), Vec::new());
    for (row_name, y) in ROWS {
        body.extend(["<tr><td>", row_name, "</td>"]);
        let mut row = Vec::new();
        for (column_name, x) in COLUMNS {
            let local = |fx: f64, fy: f64| model.variation.exponent(x, y, fx, fy);
            let found = point_spread(|fx, fy| on_axis(nyquist * fx, nyquist * fy) * local(fx, fy).exp());
            let phase_change_rad = rms_rad(|fx, fy| local(fx, fy).im);
            // Writing to a string cannot fail.
            let _ = write!(body, "<td class=n>{phase_change_rad:.2} rad, {:.3}</td>", found.strehl);
            row.push(spot_picture(&format!("{row_name}, {column_name}"), &found, 1e6 * pitch_m));
            strehls.push(found.strehl);
            changes.push(phase_change_rad);
        }
        body.push_str("</tr>");
        sheet.push(row);
    }
    body.push_str("</table>");
    let mut chapter = Chapter { title: "Over the modulator", body, ..Chapter::default() };
    chapter.png(
        "over-modulator",
        "Point spread functions at nine positions on the modulator",
        &Canvas::grid(&sheet),
    )?;
    chapter.array("strehl_over_modulator", &[ROWS.len(), COLUMNS.len()], strehls);
    chapter.array("phase_change_over_modulator_rad", &[ROWS.len(), COLUMNS.len()], changes);
    Ok(Some(chapter))
}

/// Root mean square \[rad\] of a phase over the band, without its mean and its tilts.
fn rms_rad(phase: impl Fn(f64, f64) -> f64) -> f64 {
    let at = |i: usize| (2 * i + 1) as f64 / SAMPLES as f64 - 1.0;
    let count = (SAMPLES * SAMPLES) as f64;
    let mean = |of: &dyn Fn(f64, f64) -> f64| {
        (0..SAMPLES * SAMPLES).map(|k| of(at(k % SAMPLES), at(k / SAMPLES))).sum::<f64>() / count
    };
    let squares = mean(&|x, _| x * x);
    let [piston, tilt_x, tilt_y] =
        [mean(&|x, y| phase(x, y)), mean(&|x, y| x * phase(x, y)) / squares, mean(&|x, y| y * phase(x, y)) / squares];
    mean(&|x, y| (phase(x, y) - piston - tilt_x * x - tilt_y * y).powi(2)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_optics::{Grid, KernelShape, OpticalSetup, SmoothField, SpatialVariation};

    #[test]
    fn varying_kernel_is_described_at_each_position() {
        let setup = OpticalSetup::try_new(Grid::try_new(48, 64, 8e-6).unwrap(), 515e-9, 5e-3).unwrap();
        let mut model =
            DisplayModel { kernel: KernelShape::Smooth(SmoothField::flat(2)), ..DisplayModel::ideal(setup) };
        assert!(chapter(&model).unwrap().is_none());
        // A defocus that grows along x only: x · 0.8 (T_2(fx) + T_2(fy)).
        let mut fields = [(); SpatialVariation::POWERS].map(|()| SmoothField::flat(2));
        for (degrees, c) in fields[0].basis().degrees().zip(&mut fields[0].phase) {
            *c = if matches!(degrees, (0, 2) | (2, 0)) { 0.8 } else { 0.0 };
        }
        model.variation = SpatialVariation::new(fields);
        let chapter = chapter(&model).unwrap().unwrap();
        // The rms is 0.8 times the root of twice T_2's variance, 7/15 − (1/3)², at the edges, and 0 in the middle.
        let expected = 0.8 * (2.0 * (7.0 / 15.0 - 1.0 / 9.0_f64)).sqrt();
        assert!(chapter.body.matches(&format!("{expected:.2} rad, ")).count() == 6, "{}", chapter.body);
        assert!(chapter.body.matches("0.00 rad, 1.000").count() == 3, "{}", chapter.body);
    }
}
