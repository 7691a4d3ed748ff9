//! The parts that a learned display needed, as text: how strong they are, how certain that is, and what the photographs
//! could not show.

use crate::table::Facts;
use lightpath::v1::LearnResult;
use lightpath::v1::learn_result::BlockStrengths;

/// Largest number of decimal places of a strength.
const DIGITS_MAX: usize = 4;

/// Adds the parts of the display to the facts about a result.
pub(super) fn add(result: &LearnResult, facts: &mut Facts) {
    let (blocks, deviations) = (result.blocks.unwrap_or_default(), result.deviations.unwrap_or_default());
    let along = |x: Option<f64>, y: Option<f64>, dx, dy| {
        Some(format!("σ {} px along x, {} px along y", with(x?, dx, 1.0, 2), with(y?, dy, 1.0, 2)))
    };
    let BlockStrengths { crosstalk_x_px, crosstalk_y_px, image_spread_x_px, image_spread_y_px, .. } = blocks;
    let percent = |value: Option<f64>, deviation| Some(with(100.0 * value?, deviation, 100.0, 1));
    let surface = blocks.surface_rms_rad.map(|rms| with(rms, deviations.surface_rms_rad, 1.0, 2));
    facts.add_some("fine source", surface.map(|rms| format!("surface of {rms} rad RMS")));
    let crosstalk = along(crosstalk_x_px, crosstalk_y_px, deviations.crosstalk_x_px, deviations.crosstalk_y_px);
    facts.add_some("cross-talk", crosstalk);
    let BlockStrengths { light_blur_x_px, light_blur_y_px, .. } = blocks;
    let blur = along(light_blur_x_px, light_blur_y_px, deviations.light_blur_x_px, deviations.light_blur_y_px);
    facts.add_some("blur of the light", blur);
    let uneven = percent(blocks.response_variation_rms, deviations.response_variation_rms);
    facts.add_some("uneven response", uneven.map(|rms| format!("{rms} % RMS")));
    let ghost = percent(blocks.ghost_share, deviations.ghost_share);
    facts.add_some("ghost", ghost.map(|share| format!("{share} % of the light")));
    let spread =
        along(image_spread_x_px, image_spread_y_px, deviations.image_spread_x_px, deviations.image_spread_y_px);
    facts.add_some("partly coherent", spread.map(|spread| format!("images of several modes, {spread}")));
    let dust = percent(blocks.dust_contrast, None);
    facts.add_some("dust and fringes", dust.map(|contrast| format!("contrast of {contrast} %")));
    if blocks.kernel_varies {
        facts.add("kernel", "varies over the modulator");
    }
    facts.add_some("could be hidden", hidden(&result.hidden.unwrap_or_default()));
}

/// A strength in a unit, with one standard deviation if it is known.
fn with(value: f64, deviation: Option<f64>, unit: f64, digits: usize) -> String {
    let Some(deviation) = deviation.map(|deviation| unit * deviation) else { return format!("{value:.digits$}") };
    // As many digits as a small deviation needs.
    let digits = (digits..digits + 2).find(|&digits| deviation >= 0.5 * 0.1f64.powi(digits as i32));
    let digits = digits.unwrap_or(DIGITS_MAX);
    format!("{value:.digits$} ± {deviation:.digits$}")
}

/// What the photographs could not show.
fn hidden(hidden: &BlockStrengths) -> Option<String> {
    let crosstalk = hidden.crosstalk_x_px.zip(hidden.crosstalk_y_px);
    let crosstalk = crosstalk.map(|(x, y)| format!("cross-talk up to σ {x:.2} px along x, {y:.2} px along y"));
    let uneven = hidden.response_variation_rms.map(|rms| format!("an uneven response up to {:.1} % RMS", 100.0 * rms));
    let all: Vec<String> = crosstalk.into_iter().chain(uneven).collect();
    (!all.is_empty()).then(|| all.join("; "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strengths_have_deviations_and_what_could_hide_is_named() {
        let blocks = BlockStrengths {
            crosstalk_x_px: Some(0.45),
            crosstalk_y_px: Some(0.3),
            dust_contrast: Some(0.1),
            light_blur_x_px: Some(0.5),
            light_blur_y_px: Some(0.52),
            ..Default::default()
        };
        let deviations =
            BlockStrengths { crosstalk_x_px: Some(0.011), crosstalk_y_px: Some(0.0023), ..Default::default() };
        let hidden = BlockStrengths { response_variation_rms: Some(0.004), ..Default::default() };
        let result = LearnResult {
            blocks: Some(blocks),
            deviations: Some(deviations),
            hidden: Some(hidden),
            ..Default::default()
        };
        let mut facts = Facts::default();
        add(&result, &mut facts);
        let text = facts.text();
        assert!(text.contains("σ 0.45 ± 0.01 px along x, 0.300 ± 0.002 px along y"), "{text}");
        assert!(text.contains("blur of the light") && text.contains("σ 0.50 px along x, 0.52 px along y"), "{text}");
        assert!(text.contains("contrast of 10.0 %") && text.contains("an uneven response up to 0.4 % RMS"), "{text}");
        assert!(!text.contains("ghost") && !text.contains("fine source"), "{text}");
    }
}
