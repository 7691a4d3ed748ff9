//! The chapter about the modulator: the parts that the model has, and its phase response.

use super::chapter::Chapter;
use super::evidence::Evidence;
use crate::figures::{Chart, Line};
use lightpath_optics::DisplayModel;
use lightpath_optics::learning::{BlockStrengths, StrengthUncertainty};
use std::f64::consts::TAU;
use std::fmt::Write as _;

/// The chapter about the modulator.
pub(super) fn chapter(model: &DisplayModel, evidence: Option<&Evidence>) -> Chapter {
    let uncertainty = evidence.and_then(|evidence| evidence.response.as_ref());
    let certainty = evidence.and_then(|evidence| evidence.strengths.as_ref());
    let zero = model.zero_order.norm();
    let mut body = format!(
        "<p>Undiffracted light: its amplitude is {:.4} of that of the modulated light, its phase is {:.2} rad, and its \
         intensity is {:.2} % of that of the modulated light.</p>",
        zero,
        model.zero_order.arg(),
        100.0 * zero * zero
    );
    body.push_str(&parts(model, certainty));
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

/// The parts of the model that this display needed, how strong they are, and how certain that is.
fn parts(model: &DisplayModel, certainty: Option<&StrengthUncertainty>) -> String {
    let (blocks, certainty) = (BlockStrengths::of(model), certainty.copied().unwrap_or_default());
    let (deviations, mut text) = (certainty.deviations, String::new());
    let pair = |values: [f64; 2], deviations: Option<[f64; 2]>| -> [String; 2] {
        std::array::from_fn(|axis| with(values[axis], deviations.map(|both| both[axis]), 1.0, 2))
    };
    let mut say = |paragraph: String| text.push_str(&format!("<p>{paragraph}</p>"));
    if let Some(rms) = blocks.surface_rms_rad {
        let rms = with(rms, deviations.surface_rms_rad, 1.0, 2);
        say(format!(
            "The light on the modulator needs a fine profile. Its phase, the surface of the modulator, has {rms} rad RMS \
             without tilt."
        ));
    }
    if let Some(sigma) = blocks.crosstalk_px {
        let [x, y] = pair(sigma, deviations.crosstalk_px);
        say(format!(
            "Cross-talk: the phases of neighbouring pixels blur into each other with a standard deviation of {x} px along \
             x and {y} px along y."
        ));
    }
    if let Some(sigma) = blocks.light_blur_px {
        let [x, y] = pair(sigma, deviations.light_blur_px);
        say(format!(
            "The light blurs with a standard deviation of {x} px along x and {y} px along y. The lens of a camera does \
             this, and so does a source with an extent; photographs at one distance cannot tell which."
        ));
    }
    if let Some(rms) = blocks.response_variation_rms {
        let rms = with(rms, deviations.response_variation_rms, 100.0, 1);
        say(format!("The phase response varies over the modulator by {rms} % RMS."));
    }
    if let Some(share) = blocks.ghost_share {
        let ([x, y], share) = (model.ghost.shift_px, with(share, deviations.ghost_share, 100.0, 2));
        say(format!(
            "A ghost, a second image with {share} % of the light, lies {x:.1} px and {y:.1} px beside the image along x \
             and y."
        ));
    }
    if let Some(contrast) = blocks.dust_contrast {
        let contrast = with(contrast, None, 100.0, 1);
        say(format!("Dust and fringes in the light on the modulator, with a contrast of {contrast} %."));
    }
    if let Some(spread) = blocks.image_spread_px {
        let [x, y] = pair(spread, deviations.image_spread_px);
        say(format!(
            "The light is partially coherent: it has several modes that do not interfere, and the places of their images \
             have a standard deviation of {x} px along x and {y} px along y. Pictures of the kernel show its first mode."
        ));
    }
    if text.is_empty() {
        text.push_str(
            "<p>The model has no uneven surface, no cross-talk, no variation of the phase response, no blur of the \
             light, no ghost, no dust and no further modes of light: the photographs did not need them, or the model does not know them.</p>",
        );
    }
    text + &hidden(&certainty.hidden)
}

/// Largest number of decimal places of a strength.
const DIGITS_MAX: usize = 4;

/// A strength in a unit, with one standard deviation if it is known.
fn with(value: f64, deviation: Option<f64>, unit: f64, digits: usize) -> String {
    let value = unit * value;
    let Some(deviation) = deviation.map(|deviation| unit * deviation) else { return format!("{value:.digits$}") };
    // As many digits as a small deviation needs.
    let digits = (digits..digits + 2).find(|&digits| deviation >= 0.5 * 0.1f64.powi(digits as i32));
    let digits = digits.unwrap_or(DIGITS_MAX);
    format!("{value:.digits$} ± {deviation:.digits$}")
}

/// What the photographs could not show.
fn hidden(hidden: &BlockStrengths) -> String {
    let crosstalk = hidden
        .crosstalk_px
        .map(|[x, y]| format!("cross-talk with a standard deviation of up to {x:.2} px along x and {y:.2} px along y"));
    let uneven = hidden
        .response_variation_rms
        .map(|rms| format!("a phase response that varies over the modulator by up to {:.1} % RMS", 100.0 * rms));
    let all: Vec<String> = crosstalk.into_iter().chain(uneven).collect();
    if all.is_empty() {
        return String::new();
    }
    format!(
        "<p>The display could have more than the photographs show: {}. With less than these two standard deviations the \
         photographs would look the same. Photographs of other holograms can tell (lightpath dataset suggest).</p>",
        all.join(", and ")
    )
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
