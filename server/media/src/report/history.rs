//! Chapters about the learning of the kernel, and about its differences to other versions.

use super::chapter::Chapter;
use super::input::{KernelDifference, ReportInput};
use crate::figures::{Chart, Line};
use lightpath_optics::DisplayModel;
use std::fmt::Write as _;

/// Number of frequencies along an axis at which versions are compared.
const SAMPLES: usize = 48;

/// The chapter about the losses during learning. `None`: they are not known.
pub(super) fn losses(input: &ReportInput) -> Option<Chapter> {
    if input.loss_history.is_empty() {
        return None;
    }
    let points = (1..).zip(&input.loss_history).map(|(step, &loss)| (f64::from(step), loss)).collect();
    let metrics = &input.version.content.metrics;
    let steps = input.loss_history.len() as f64;
    let mut lines = vec![Line { label: "training".to_owned(), points, dashed: false }];
    for (label, level) in
        [("held out, at the end", metrics.test_loss), ("held out, ideal kernel", metrics.ideal_test_loss)]
    {
        if level > 0.0 {
            lines.push(Line {
                label: label.to_owned(),
                points: vec![(1.0, level), (steps.max(2.0), level)],
                dashed: true,
            });
        }
    }
    let chart = Chart {
        title: "Loss while learning",
        x_label: "epoch, then refinement step",
        y_label: "mean squared error",
        logarithmic: true,
        lines,
        band: Vec::new(),
    };
    let mut chapter = Chapter { title: "Learning", ..Chapter::default() };
    chapter.svg("losses", "Loss of each epoch and refinement step", chart.svg());
    chapter.array("loss_history", &[input.loss_history.len()], input.loss_history.iter().copied());
    Some(chapter)
}

/// The chapter about the differences between this version and others. `None`: there are no others.
pub(super) fn drift(input: &ReportInput) -> Option<Chapter> {
    if input.other_versions.is_empty() {
        return None;
    }
    let mut body = "<p>Differences of other versions from this version, over the modulator's band. Gain and constant \
                    phase of each version are fitted before the comparison. Versions that were learned from the same \
                    display on different days show its drift.</p><table><tr><th>version</th>\
                    <th class=n>relative difference</th><th class=n>phase, rms [rad]</th>\
                    <th class=n>gain of the image</th><th class=n>held-out loss</th></tr>"
        .to_owned();
    for other in &input.other_versions {
        let KernelDifference { relative, phase_rad, gain } = other.difference;
        let loss = other.test_loss.map_or_else(|| "–".to_owned(), |loss| format!("{loss:.3e}"));
        // Writing to a string cannot fail.
        let _ = write!(
            body,
            "<tr><td>{}</td><td class=n>{relative:.4}</td><td class=n>{phase_rad:.3}</td><td class=n>{gain:.3}</td>\
             <td class=n>{loss}</td></tr>",
            other.version
        );
    }
    body.push_str("</table>");
    Some(Chapter { title: "Other versions", body, ..Chapter::default() })
}

/// Difference of the kernel H of `model` and the kernel H' of `other`, over the modulator's band.
#[must_use]
pub fn difference(model: &DisplayModel, other: &DisplayModel) -> KernelDifference {
    let nyquist = 0.5 / model.setup.grid().pixel_pitch_m();
    let along = |i: usize| nyquist * ((2 * i + 1) as f64 / SAMPLES as f64 - 1.0);
    let (h, g) = (model.sampled(), other.sampled());
    let at = |i: usize| (along(i % SAMPLES), along(i / SAMPLES));
    KernelDifference::of((0..SAMPLES * SAMPLES).map(at).map(|(fx, fy)| (h(fx, fy), g(fx, fy)))).0
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_optics::{Grid, KernelShape, OpticalSetup, SmoothField};

    #[test]
    fn kernel_equals_itself_and_differs_from_a_tilted_one_by_the_tilt() {
        let setup = OpticalSetup::try_new(Grid::try_new(32, 48, 8e-6).unwrap(), 515e-9, 3e-3).unwrap();
        let ideal = DisplayModel::ideal(setup);
        let KernelDifference { relative, phase_rad, gain } = difference(&ideal, &ideal);
        assert!(relative < 1e-12 && phase_rad < 1e-6 && (gain - 1.0).abs() < 1e-12);
        let mut errors = SmoothField::flat(1);
        errors.phase[0] = 0.1;
        let tilted = DisplayModel { kernel: KernelShape::Smooth(errors), ..ideal.clone() };
        // A tilt of ±0.1 rad over the band has an rms of 0.1/√3.
        let phase_rad = difference(&ideal, &tilted).phase_rad;
        assert!((phase_rad - 0.1 / 3.0_f64.sqrt()).abs() < 1e-3, "{phase_rad}");
    }
}
