//! How good a hologram is, as a table; how good a kernel is.

use super::show;
use super::table::{Facts, Table};
use lightpath::v1::{HologramResult, KernelMetrics, Quality};

/// Every metric in the eyes of each detector, of the phase as optimized and as the display shows it.
pub(crate) fn table(result: &HologramResult) -> String {
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
    let phases = [("as optimized", &result.quality), ("quantized", &result.quantized_quality)];
    let phases =
        phases.iter().filter_map(|(phase, quality)| Some((*phase, seen(quality.as_ref()?)))).collect::<Vec<_>>();
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

/// What new holograms through a kernel look like, and whether it is good for anything.
pub(crate) fn verdict(metrics: &KernelMetrics, facts: &mut Facts) {
    if let (Some(learned), Some(ideal)) = (metrics.captured_psnr_db, metrics.ideal_captured_psnr_db) {
        let (learned, ideal) = (show::decibel(learned), show::decibel(ideal));
        facts.add("captured", format!("{learned} (ideal kernel {ideal}), new holograms"));
    }
    if metrics.no_better_than_ideal {
        facts.add("verdict", "no better than the ideal kernel; promoted only with --force");
    }
}

/// `0.9876`, or `–`.
pub(crate) fn similarity(value: Option<f64>) -> String {
    or_dash(value, |value| format!("{value:.4}"))
}

/// `12.3 %`, or `–`.
pub(crate) fn percent(value: Option<f64>) -> String {
    or_dash(value, |value| format!("{:.1} %", 100.0 * value))
}

fn or_dash(value: Option<f64>, show: impl Fn(f64) -> String) -> String {
    value.map_or_else(|| "–".to_owned(), show)
}

/// What one detector sees.
struct Seen {
    psnr_db: f64,
    ssim: Option<f64>,
    ms_ssim: Option<f64>,
    diffraction_efficiency: Option<f64>,
    frame_efficiency: Option<f64>,
    speckle_contrast: Option<f64>,
}

/// Point, pixel, supersampled.
fn seen(quality: &Quality) -> [Seen; 3] {
    [
        Seen {
            psnr_db: quality.psnr_point_db,
            ssim: quality.ssim_point,
            ms_ssim: quality.ms_ssim_point,
            diffraction_efficiency: quality.diffraction_efficiency_point,
            frame_efficiency: quality.frame_efficiency_point,
            speckle_contrast: quality.speckle_contrast_point,
        },
        Seen {
            psnr_db: quality.psnr_pixel_db,
            ssim: quality.ssim_pixel,
            ms_ssim: quality.ms_ssim_pixel,
            diffraction_efficiency: quality.diffraction_efficiency_pixel,
            frame_efficiency: quality.frame_efficiency_pixel,
            speckle_contrast: quality.speckle_contrast_pixel,
        },
        Seen {
            psnr_db: quality.psnr_supersampled_db,
            ssim: quality.ssim_supersampled,
            ms_ssim: quality.ms_ssim_supersampled,
            diffraction_efficiency: quality.diffraction_efficiency_supersampled,
            frame_efficiency: quality.frame_efficiency_supersampled,
            speckle_contrast: quality.speckle_contrast_supersampled,
        },
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_has_every_detector_and_dashes_for_what_is_unknown() {
        let quality = Quality {
            psnr_point_db: 46.31,
            psnr_pixel_db: 27.7,
            ssim_pixel: Some(0.912_34),
            ms_ssim_pixel: Some(0.987_65),
            diffraction_efficiency_pixel: Some(0.712_3),
            frame_efficiency_pixel: Some(0.95),
            speckle_contrast_pixel: Some(0.0314),
            ..Quality::default()
        };
        let result = HologramResult { quality: Some(quality), ..HologramResult::default() };
        let text = table(&result);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 4, "{text}");
        assert_eq!(lines[1].split_whitespace().collect::<Vec<_>>().join(" "), "point as optimized 46.3 dB – – – – –");
        assert_eq!(
            lines[2].split_whitespace().collect::<Vec<_>>().join(" "),
            "pixel as optimized 27.7 dB 0.9123 0.9877 71.2 % 95.0 % 0.031"
        );
        assert_eq!(table(&HologramResult::default()), "");
    }
}
