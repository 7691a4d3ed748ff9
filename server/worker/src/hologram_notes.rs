//! Notes about a hologram: why its figures may say less than they seem to.

use crate::hologram_setup::HologramSetup;
use lightpath_domain::job::{OptimizeHologram, pixels_of_planes};
use lightpath_optics::hologram::HologramMethod;
use lightpath_optics::{Orders, Plane, RegionOfInterest};

/// Brightest light of a target, as a part of full scale, below which the PSNR says little: it counts from full scale.
const DARK: f32 = 0.3;

/// Notes about the hologram of one wavelength, as sentences.
pub(super) fn notes(spec: &OptimizeHologram, setup: &HologramSetup) -> Vec<String> {
    let mut notes = Vec::new();
    for plane in &setup.planes {
        let note = dark_target(&plane.target, setup.region);
        notes.extend(note.filter(|note| !notes.contains(note)));
    }
    notes.extend(grey_of_colours(spec));
    notes.extend(empty_planes(spec, setup));
    notes.extend(double_phase(spec, setup));
    notes
}

/// A note about a target that uses a small part of its file's range, such as one of 12 bits in a file of 16 bits.
fn dark_target(target: &Plane<f32>, region: RegionOfInterest) -> Option<String> {
    let rows = (0..target.height_px()).filter_map(|y| Some(&target.row(y)[region.columns(y)?]));
    let brightest = rows.flatten().copied().fold(0.0, f32::max);
    (brightest > 0.0 && brightest < DARK).then(|| {
        format!(
            "the brightest pixel of the target has {:.2} % of full scale in linear light; the PSNR counts from full scale, \
             and from this pixel it is {:.1} dB less; if the file has fewer bits than its format, as 12 bits in 16, scale \
             its values to the whole range",
            100.0 * brightest,
            -20.0 * f64::from(brightest).log10()
        )
    })
}

/// A note about a number of wavelengths that shows no colours.
fn grey_of_colours(spec: &OptimizeHologram) -> Option<String> {
    let wavelengths = spec.wavelengths.len();
    (wavelengths != 1 && wavelengths != 3).then(|| {
        format!("each of the {wavelengths} wavelengths shows the grey picture; colours of a target are shown by three wavelengths")
    })
}

/// A note about planes to which the depth map gives no pixel.
fn empty_planes(spec: &OptimizeHologram, setup: &HologramSetup) -> Option<String> {
    let pixels = pixels_of_planes(setup.depths.as_ref()?, setup.planes.len(), setup.region);
    let empty: Vec<String> = spec
        .planes
        .iter()
        .zip(pixels)
        .filter(|(_, pixels)| *pixels == 0)
        .map(|(plane, _)| plane.distance.to_string())
        .collect();
    (!empty.is_empty()).then(|| {
        format!(
            "no pixel of the depth map belongs to {}, whose figures are those of the whole picture; white is at the first \
             distance, black at the last",
            empty.join(", ")
        )
    })
}

/// A note about double phase on a display that lets the light of its chequerboard through, at half a cycle per pixel along
/// both axes.
fn double_phase(spec: &OptimizeHologram, setup: &HologramSetup) -> Option<String> {
    let orders = setup.display.declared.orders;
    let is_filtered = matches!(orders, Orders::Filtered(filter) if filter.width.min(filter.height) < 1.0);
    (spec.method == HologramMethod::DoublePhase && !is_filtered).then(|| {
        "double phase needs optics that filter its chequerboard away, but this display was declared without such a filter, \
         so its picture is poor; declare the filter (display create --filter), or use lbfgs"
            .to_owned()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_optics::Grid;

    #[test]
    fn targets_that_use_a_small_part_of_their_range_get_a_note() {
        let grid = Grid::try_new(10, 10, 8e-6).unwrap();
        let region = RegionOfInterest::middle(&grid);
        // 12 bits in a file of 16 bits, linear.
        let dark = Plane::from_fn(10, 10, |y, _| if y == 0 { 1.0 } else { 4095.0 / 65535.0 });
        let note = dark_target(&dark, region).unwrap();
        assert!(note.contains("has 6.25 % of full scale") && note.contains("it is 24.1 dB less"), "{note}");
        assert_eq!(dark_target(&Plane::filled(10, 10, 0.5), region), None);
        assert_eq!(dark_target(&Plane::filled(10, 10, 0.0), region), None);
    }
}
