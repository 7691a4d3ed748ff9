//! The chapter about the modulator: the parts that the model has, and its phase response.

use super::chapter::Chapter;
use super::evidence::Evidence;
use crate::figures::{Chart, Line};
use lightpath_optics::DisplayModel;
use lightpath_optics::learning::PartStrength;
use std::f64::consts::TAU;
use std::fmt::Write as _;

/// The chapter about the modulator.
pub(super) fn chapter(model: &DisplayModel, evidence: Option<&Evidence>) -> Chapter {
    let uncertainty = evidence.and_then(|evidence| evidence.response.as_ref());
    let strengths = evidence.and_then(|evidence| evidence.strengths.clone());
    let zero = model.zero_order.norm();
    let mut body = format!(
        "<p>Undiffracted light: its amplitude is {:.4} of that of the modulated light, its phase is {:.2} rad, and its \
         intensity is {:.2} % of that of the modulated light.</p>",
        zero,
        model.zero_order.arg(),
        100.0 * zero * zero
    );
    body.push_str(&parts(&strengths.unwrap_or_else(|| PartStrength::all_of(model))));
    let mut chapter = Chapter { title: "Modulator", ..Chapter::default() };
    if model.response.is_empty() {
        body.push_str(
            "<p>The phase response was not learned. The model assumes that the modulator shows the requested phase.</p>",
        );
        chapter.body = body;
        return chapter;
    }
    let requested_rad = |i: usize| TAU * i as f64 / STEPS as f64;
    let curve: Vec<f64> = (0..=STEPS).map(|i| response_error_rad(model, requested_rad(i))).collect();
    let mean = curve.iter().take(STEPS).sum::<f64>() / STEPS as f64;
    let worst = curve.iter().map(|value| (value - mean).abs()).fold(0.0, f64::max);
    let _ = write!(
        body,
        "<p>The modulator's phase differs from the requested phase by up to {worst:.3} rad around the mean \
         difference.</p>"
    );
    let deviations: Vec<f64> = uncertainty
        .iter()
        .flat_map(|uncertainty| (0..=STEPS).map(|i| uncertainty.deviation_rad(requested_rad(i))))
        .collect();
    match deviations.iter().copied().reduce(f64::max) {
        Some(largest) => {
            let _ = write!(
                body,
                "<p>The band around the curve is one standard deviation, at most {largest:.4} rad. It estimates how \
                 much the curve would differ if it were learned from other photographs.</p>"
            );
            chapter.array("response_deviation_rad", &[STEPS + 1], deviations.iter().copied());
        }
        None => body
            .push_str("<p>The uncertainty of the curve is unknown. Its estimate needs three training photographs.</p>"),
    }
    let chart = response_chart(&curve, &deviations);
    chapter.svg("response", "Shown phase minus requested phase of the modulator", chart.svg());
    chapter.array("response_error_rad", &[STEPS + 1], curve);
    chapter.body = body;
    chapter
}

/// The parts of the model that this display needed, how strong they are, how certain that is, and what the photographs
/// could not show.
fn parts(strengths: &[PartStrength]) -> String {
    let (kept, lacking): (Vec<_>, Vec<_>) = strengths.iter().partition(|strength| strength.kept);
    let mut text: String = kept.into_iter().map(paragraph).collect();
    if text.is_empty() {
        let titles: Vec<&str> = lacking.iter().map(|strength| strength.title()).collect();
        text = format!(
            "<p>The model has none of these parts: {}. The photographs did not need them, or the model does not know \
             them.</p>",
            titles.join("; ")
        );
    }
    let hidden =
        lacking.iter().map(|strength| (strength.title(), strength.text(0))).filter(|(_, text)| !text.is_empty());
    let hidden: Vec<String> = hidden.map(|(title, text)| format!("{title}, up to {text}")).collect();
    if !hidden.is_empty() {
        let _ = write!(
            text,
            "<p>The display could have more than the photographs show: {}. With less than these two standard deviations \
             the photographs would look the same. Photographs of other holograms can tell (lightpath dataset \
             suggest).</p>",
            hidden.join("; ")
        );
    }
    text
}

/// A part and its strength.
fn paragraph(strength: &PartStrength) -> String {
    let title = strength.title();
    let (first, rest) = title.split_at(title.chars().next().map_or(0, char::len_utf8));
    let note = match strength.note() {
        "" => String::new(),
        note => format!(" {note}"),
    };
    format!("<p>{}{rest}: {}.{note}</p>", first.to_uppercase(), strength.text(0))
}

/// Number of steps in the curve of the phase response.
const STEPS: usize = 128;

/// Error of the modulator's phase \[rad\] for the requested phase `requested_rad`: shown phase minus requested phase.
fn response_error_rad(model: &DisplayModel, requested_rad: f64) -> f64 {
    let harmonic = |(k, [a, b]): (u32, &[f64; 2])| {
        a * (f64::from(k) * requested_rad).sin() + b * (f64::from(k) * requested_rad).cos()
    };
    (1..).zip(&model.response).map(harmonic).sum()
}

fn response_chart(curve: &[f64], deviations: &[f64]) -> Chart<'static> {
    let requested_rad = |i: usize| TAU * i as f64 / STEPS as f64;
    let around = |(i, deviation): (usize, &f64)| (requested_rad(i), [curve[i] - deviation, curve[i] + deviation]);
    let band = deviations.iter().enumerate().map(around).collect();
    let points = curve.iter().enumerate().map(|(i, &value)| (requested_rad(i), value)).collect();
    Chart {
        title: "Phase response",
        x_label: "requested phase [rad]",
        y_label: "shown − requested [rad]",
        logarithmic: false,
        lines: vec![
            Line { label: "learned".to_owned(), points, dashed: false },
            Line { label: "linear".to_owned(), points: vec![(0.0, 0.0), (TAU, 0.0)], dashed: true },
        ],
        band,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_optics::{Crosstalk, Grid, OpticalSetup};

    #[test]
    fn parts_are_told_with_their_strengths_and_what_could_hide() {
        let setup = OpticalSetup::try_new(Grid::try_new(8, 8, 8e-6).unwrap(), 515e-9, 3e-3).unwrap();
        let ideal = DisplayModel::ideal(setup);
        let text = parts(&PartStrength::all_of(&ideal));
        assert!(text.starts_with("<p>The model has none of these parts: uneven surface of the modulator; "), "{text}");
        let crossed = DisplayModel { crosstalk: Crosstalk::of_sigma_px([0.45, 0.3]), ..ideal };
        let mut strengths = PartStrength::all_of(&crossed);
        for measure in strengths.iter_mut().filter(|strength| !strength.kept).flat_map(|other| &mut other.measures) {
            measure.hidden = (measure.name == "rms").then_some(0.012);
        }
        assert_eq!(
            parts(&strengths).split_inclusive("</p>").collect::<Vec<_>>(),
            [
                "<p>Cross-talk between neighbouring pixels: σ 0.45 px along x, 0.30 px along y.</p>",
                "<p>The display could have more than the photographs show: change of the phase response over the \
                 modulator, up to 1.2 % RMS. With less than these two standard deviations the photographs would look the \
                 same. Photographs of other holograms can tell (lightpath dataset suggest).</p>",
            ]
        );
    }
}
