//! Propagation methods and their validity as text.

use super::table::{Facts, Table};
use lightpath::Words as _;
use lightpath::units::show_m;
use lightpath::v1::{PlanPropagationResponse, ValidityReport};

/// Adds the method, the reason for its choice, and the warnings, if they are known.
pub(crate) fn add(report: Option<&ValidityReport>, facts: &mut Facts) {
    let Some(report) = report else { return };
    facts.add("propagation", format!("{}: {}", report.method().word(), report.explanation));
    for warning in &report.warnings {
        facts.add("warning", format!("{}: {}", warning.code, warning.text));
    }
}

/// Text with all facts about a plan and its alternatives.
pub(crate) fn plan(plan: &PlanPropagationResponse) -> String {
    let mut facts = Facts::default();
    add(plan.report.as_ref(), &mut facts);
    if let Some(report) = &plan.report {
        numbers(report, &mut facts);
    }
    let mut table = Table::new("method|possible|for jobs?|because_");
    let yes_no = |yes: bool| if yes { "yes" } else { "no" }.to_owned();
    for other in &plan.alternatives {
        let method = other.method().word().to_owned();
        table.row([method, yes_no(other.possible), yes_no(other.optimizable), other.text.clone()]);
    }
    format!("{}\n{}", facts.text(), table.text())
}

fn numbers(report: &ValidityReport, facts: &mut Facts) {
    if let Some(window) = &report.window {
        let centre = match (window.centre_x_m, window.centre_y_m) {
            (0.0, 0.0) => "centred on the axis".to_owned(),
            (x_m, y_m) => format!("centred at ({}, {})", show_m(x_m), show_m(y_m)),
        };
        let pitch = show_m(window.pitch_x_m);
        facts.add("image", format!("{}x{} px of {pitch}, {centre}", window.width_px, window.height_px));
    }
    let [critical_x, critical_y] = [report.critical_distance_x_m, report.critical_distance_y_m].map(millimetres);
    facts.add("critical distance", format!("{critical_x} along x, {critical_y} along y"));
    let [x, y, area] = [report.band_kept_x, report.band_kept_y, report.band_kept_area].map(|part| 100.0 * part);
    facts.add("band in the image", format!("{x:.1} % along x, {y:.1} % along y, {area:.1} % of all light"));
    let angle = report.diffraction_angle_rad.to_degrees();
    let spread = report.spread_m.map_or_else(|| "an unlimited distance".to_owned(), millimetres);
    facts.add("steepest light", format!("{angle:.3}°, which moves {spread} sideways"));
    let [cone_x, cone_y] = [report.full_cone_x_m, report.full_cone_y_m].map(millimetres);
    let cone = match (report.full_cone_x_m, report.full_cone_y_m) {
        (0.0, 0.0) => "at no point of the image".to_owned(),
        _ => format!("in the middle {cone_x} along x, {cone_y} along y"),
    };
    facts.add("light at all angles", cone);
    facts.add("Fresnel number", format!("{:.1}", report.fresnel_number));
    if report.neglected_phase_rad > 0.0 {
        facts.add("neglected phase", format!("up to {:.3} rad", report.neglected_phase_rad));
    }
}

/// A length in millimetres, for example `4.83 mm`. Images are some millimetres wide.
fn millimetres(value_m: f64) -> String {
    format!("{:.2} mm", 1e3 * value_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath::v1::{PropagationAlternative, PropagationMethod, PropagationWarning};

    #[test]
    fn plan_shows_reason_numbers_and_alternatives() {
        let warning = PropagationWarning { code: "BAND_LIMITED".into(), text: "only 53.7 % along y".into() };
        let report = ValidityReport {
            method: PropagationMethod::RayleighSommerfeld.into(),
            explanation: "500 mm is beyond".into(),
            critical_distance_x_m: 0.477_204,
            critical_distance_y_m: 0.268_427,
            band_kept_x: 0.954,
            band_kept_y: 0.537,
            band_kept_area: 0.512,
            diffraction_angle_rad: 0.032_195,
            spread_m: Some(0.016_1),
            warnings: vec![warning],
            ..ValidityReport::default()
        };
        let refused = PropagationAlternative {
            method: PropagationMethod::AngularSpectrum.into(),
            text: "up to 268 mm".into(),
            ..PropagationAlternative::default()
        };
        let text = plan(&PlanPropagationResponse { report: Some(report), alternatives: vec![refused] });
        for part in [
            "rayleigh-sommerfeld: 500 mm is beyond",
            "BAND_LIMITED: only 53.7 % along y",
            "477.20 mm along x, 268.43 mm along y",
            "95.4 % along x, 53.7 % along y, 51.2 % of all light",
            "1.845°, which moves 16.10 mm sideways",
            "at no point of the image",
            "angular-spectrum  no        no        up to 268 mm",
        ] {
            assert!(text.contains(part), "{part} is not in\n{text}");
        }
    }
}
