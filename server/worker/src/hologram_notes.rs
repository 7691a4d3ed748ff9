//! Notes about a hologram: why its figures may say less than they seem to.

use crate::context::TaskError;
use crate::hologram_setup::{HologramSetup, PlaneSetup};
use lightpath_domain::job::{OptimizeHologram, pixels_of_planes};
use lightpath_optics::hologram::{HologramMethod, light_of_frames};
use lightpath_optics::metrics::{Gain, psnr_db};
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

/// Phases that span more than so many radians may be degrees: 16 turns.
const DEGREES_SPAN: f32 = 100.0;
/// Phases from 0 to 1 that span more than this may be turns.
const TURNS_SPAN: f32 = 0.9;
/// Gain by which the opposite sign is better than by chance \[dB\].
const SIGN_GAIN_DB: f64 = 3.0;

/// A note about phases \[rad\] of another program that may be in another unit.
pub(super) fn unit_of_given(phases: &[f32]) -> Option<String> {
    let least = phases.iter().copied().fold(f32::INFINITY, f32::min);
    let most = phases.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let question = match most - least {
        span if span > DEGREES_SPAN => "are these degrees? Then multiply them by π/180",
        span if span > TURNS_SPAN && least >= 0.0 && most <= 1.0 => "are these turns? Then multiply them by 2π",
        _ => return None,
    };
    Some(format!("the phases are {least:.2} to {most:.2} rad; {question}"))
}

/// A note about phases of another program that show `target` better with the opposite sign. `shown` is the light of
/// `displayed`.
pub(super) fn sign_of_given(
    plane: &PlaneSetup,
    region: RegionOfInterest,
    displayed: &[Plane<f32>],
    shown: &Plane<f32>,
) -> Result<Option<String>, TaskError> {
    let negated: Vec<Plane<f32>> = displayed.iter().map(|phase| phase.map(|phi| -phi)).collect();
    let of_negated = light_of_frames(&plane.engine, &negated)?;
    let [own_db, negated_db] = [shown, &of_negated].map(|light| psnr_db(light, &plane.target, region, Gain::Fitted));
    let (own_db, negated_db) = (own_db?, negated_db?);
    Ok((negated_db > own_db + SIGN_GAIN_DB).then(|| {
        format!(
            "with the opposite sign of its phase the hologram would show {negated_db:.1} dB instead of {own_db:.1} dB; here the \
             field is exp(+iφ), and light travels as exp(+i2πz/λ): a program with the other sign needs −φ"
        )
    }))
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
    fn phases_that_may_be_degrees_or_turns_get_a_question() {
        let ramp = |most: f32| (0..=360).map(|i| most * i as f32 / 360.0).collect::<Vec<_>>();
        assert!(unit_of_given(&ramp(360.0)).unwrap().contains("0.00 to 360.00 rad; are these degrees?"));
        assert!(unit_of_given(&ramp(1.0)).unwrap().contains("are these turns?"));
        for most in [6.0, 0.5, 90.0, -1.0] {
            assert_eq!(unit_of_given(&ramp(most)), None, "{most}");
        }
    }

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
