//! How good a hologram is, as a table; how good a kernel is.

use super::show;
use super::table::{Facts, Table};
use lightpath::v1::{KernelMetrics, Quality, hologram_result::PlaneResult};

/// Every metric in the eyes of each detector, of the phase as optimized and as the display shows it.
pub(crate) fn table(plane: &PlaneResult) -> String {
    let mut table = Table::new(&[
        "detector",
        "phase",
        ">PSNR",
        ">SSIM",
        ">MS-SSIM",
        ">efficiency",
        ">in frame",
        ">speckle contrast",
    ]);
    let seen = |quality: Quality| [quality.point, quality.pixel, quality.supersampled].map(Option::unwrap_or_default);
    let phases = [("as optimized", plane.quality), ("quantized", plane.quantized_quality)];
    let phases: Vec<_> = phases.into_iter().filter_map(|(phase, quality)| Some((phase, seen(quality?)))).collect();
    for (i, detector) in ["point", "pixel", "supersampled"].into_iter().enumerate() {
        for (phase, seen) in &phases {
            let seen = &seen[i];
            table.row([
                detector.to_owned(),
                (*phase).to_owned(),
                show::decibel(seen.psnr_db),
                similarity(seen.ssim),
                similarity(seen.ms_ssim),
                percent(seen.diffraction_efficiency),
                percent(seen.frame_efficiency),
                or_dash(seen.speckle_contrast, |contrast| format!("{contrast:.3}")),
            ]);
        }
    }
    if phases.is_empty() { String::new() } else { table.text() }
}

/// PSNR as each detector sees the phase as optimized; then PSNR, SSIM and efficiency of the quantized one over the pixels.
pub(crate) fn in_short(plane: PlaneResult) -> [String; 6] {
    let Quality { point, pixel, supersampled } = plane.quality.unwrap_or_default();
    let quantized = plane.quantized_quality.and_then(|quality| quality.pixel).unwrap_or_default();
    let [point, pixel, supersampled] =
        [point, pixel, supersampled].map(|seen| show::decibel(seen.unwrap_or_default().psnr_db));
    let (psnr, efficiency) = (show::decibel(quantized.psnr_db), percent(quantized.diffraction_efficiency));
    [point, pixel, supersampled, psnr, similarity(quantized.ssim), efficiency]
}

/// What new holograms through a kernel look like, and whether it is good for anything.
pub(crate) fn verdict(metrics: &KernelMetrics, facts: &mut Facts) {
    if let Some(captured) = metrics.captured {
        let (learned, ideal) = (show::decibel(captured.psnr_db), show::decibel(captured.ideal_psnr_db));
        facts.add("captured", format!("{learned} (ideal kernel {ideal}), new holograms"));
    }
    if metrics.no_better_than_ideal {
        facts.add("verdict", "no better than the ideal kernel; promoted only with --force");
    }
}

/// `0.9876`, or `–`.
fn similarity(value: Option<f64>) -> String {
    or_dash(value, |value| format!("{value:.4}"))
}

/// `12.3 %`.
fn percent(value: f64) -> String {
    format!("{:.1} %", 100.0 * value)
}

fn or_dash(value: Option<f64>, show: impl Fn(f64) -> String) -> String {
    value.map_or_else(|| "–".to_owned(), show)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath::v1::SeenQuality;

    #[test]
    fn the_table_has_every_detector_and_dashes_for_what_is_unknown() {
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
        assert_eq!(table(&PlaneResult::default()), "");
        assert_eq!(in_short(plane), ["46.3 dB", "27.7 dB", "0.0 dB", "0.0 dB", "–", "0.0 %"]);
    }
}
