//! Quality of holograms as text.

use crate::show;
use crate::table::Table;
use lightpath::v1::{PropagationMethod, Quality, SecondOpinion, hologram_result::PlaneResult};

/// A table of all metrics for each detector: for the phase as optimized and as quantized for the display.
pub(super) fn table(plane: &PlaneResult) -> String {
    let mut table =
        Table::new("detector|phase|>PSNR|>SSIM?|>MS-SSIM???|>efficiency??|>in frame????|>speckle contrast?????");
    let by_detector =
        |quality: Quality| [quality.point, quality.pixel, quality.supersampled].map(Option::unwrap_or_default);
    let phases = [("as optimized", plane.quality), ("quantized", plane.quantized_quality)];
    let phases: Vec<_> =
        phases.into_iter().filter_map(|(phase, quality)| Some((phase, by_detector(quality?)))).collect();
    for (i, detector) in ["point", "pixel", "supersampled"].into_iter().enumerate() {
        for (phase, qualities) in &phases {
            let quality = &qualities[i];
            table.row([
                detector.to_owned(),
                (*phase).to_owned(),
                show::decibel(quality.psnr_db),
                similarity(quality.ssim),
                similarity(quality.ms_ssim),
                percent(quality.diffraction_efficiency),
                percent(quality.frame_efficiency),
                or_dash(quality.speckle_contrast, |contrast| format!("{contrast:.3}")),
            ]);
        }
    }
    if phases.is_empty() { String::new() } else { table.text() }
}

/// What the quantized hologram would show on a display of the other kind, for example `21.3 dB on a display that shows
/// all diffraction orders`; `None`: unknown.
pub(super) fn other_orders(plane: &PlaneResult) -> Option<String> {
    let psnr = show::decibel(plane.other_orders_psnr_db?);
    let shows_all = plane.propagation.as_ref().is_some_and(|report| report.method() == PropagationMethod::AllOrders);
    let other =
        if shows_all { "that shows only the first diffraction order" } else { "that shows all diffraction orders" };
    Some(format!("{psnr} (pixel, quantized) on a display {other}"))
}

/// The second opinion on the quantized hologram, for example `agrees: the independent model finds -0.02 dB on 8
/// rows`; `None`: there is none.
pub(super) fn second_opinion(plane: &PlaneResult) -> Option<String> {
    let opinion = plane.second_opinion?;
    let SecondOpinion { rows, engine_psnr_db, independent_psnr_db, contradicts } = opinion;
    let difference_db = independent_psnr_db - engine_psnr_db;
    Some(if contradicts {
        let (engine, independent) = (show::decibel(engine_psnr_db), show::decibel(independent_psnr_db));
        format!("contradicts: {independent} by the independent model, {engine} by the engine, on the same {rows} rows")
    } else {
        format!("agrees: the independent model finds {difference_db:+.2} dB on {rows} rows")
    })
}

/// Six cells: PSNR of the optimized phase for the detectors point, pixel and supersampled, then PSNR, SSIM and
/// diffraction efficiency of the quantized phase for the detector pixel.
pub(super) fn summary(plane: PlaneResult) -> [String; 6] {
    let Quality { point, pixel, supersampled } = plane.quality.unwrap_or_default();
    let quantized = plane.quantized_quality.and_then(|quality| quality.pixel).unwrap_or_default();
    let [point, pixel, supersampled] =
        [point, pixel, supersampled].map(|quality| show::decibel(quality.unwrap_or_default().psnr_db));
    let (psnr, efficiency) = (show::decibel(quantized.psnr_db), percent(quantized.diffraction_efficiency));
    [point, pixel, supersampled, psnr, similarity(quantized.ssim), efficiency]
}

/// An SSIM value, for example `0.9876`, or `–`.
fn similarity(value: Option<f64>) -> String {
    or_dash(value, |value| format!("{value:.4}"))
}

/// A fraction in per cent, for example `12.3 %`.
fn percent(value: f64) -> String {
    format!("{:.1} %", 100.0 * value)
}

fn or_dash(value: Option<f64>, show: impl Fn(f64) -> String) -> String {
    value.map_or_else(|| "–".to_owned(), show)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath::v1::{SeenQuality, ValidityReport};

    #[test]
    fn quality_table_has_every_detector_and_dashes_for_unknown_values() {
        let point = SeenQuality { psnr_db: 46.31, ..SeenQuality::default() };
        let pixel = SeenQuality {
            psnr_db: 27.7,
            ssim: Some(0.912_34),
            ms_ssim: Some(0.987_65),
            diffraction_efficiency: 0.712_3,
            frame_efficiency: 0.95,
            speckle_contrast: Some(0.0314),
        };
        let quality = Quality { point: Some(point), pixel: Some(pixel), supersampled: None };
        let plane = PlaneResult { quality: Some(quality), ..PlaneResult::default() };
        let text = table(&plane);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 4, "{text}");
        let words = |line: &str| line.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(words(lines[1]), "point as optimized 46.3 dB – – 0.0 % 0.0 % –");
        assert_eq!(words(lines[2]), "pixel as optimized 27.7 dB 0.9123 0.9877 71.2 % 95.0 % 0.031");
        assert_eq!(other_orders(&plane), None);
        let report = ValidityReport { method: PropagationMethod::AllOrders.into(), ..ValidityReport::default() };
        let seen = PlaneResult { other_orders_psnr_db: Some(21.34), propagation: Some(report), ..plane.clone() };
        let text = "21.3 dB (pixel, quantized) on a display that shows only the first diffraction order";
        assert_eq!(other_orders(&seen).as_deref(), Some(text));
        assert_eq!(table(&PlaneResult::default()), "");
        assert_eq!(second_opinion(&plane), None);
        let opinion = |independent_psnr_db: f64| {
            let contradicts = (independent_psnr_db - 40.0).abs() > 0.5;
            SecondOpinion { rows: 8, engine_psnr_db: 40.0, independent_psnr_db, contradicts }
        };
        let judged = |db| second_opinion(&PlaneResult { second_opinion: Some(opinion(db)), ..plane.clone() }).unwrap();
        assert_eq!(judged(39.98), "agrees: the independent model finds -0.02 dB on 8 rows");
        let text = "contradicts: 38.0 dB by the independent model, 40.0 dB by the engine, on the same 8 rows";
        assert_eq!(judged(38.0), text);
        assert_eq!(summary(plane), ["46.3 dB", "27.7 dB", "0.0 dB", "0.0 dB", "–", "0.0 %"]);
    }
}
