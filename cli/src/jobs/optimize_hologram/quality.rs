//! Quality of holograms as text.

use crate::show;
use crate::table::Table;
use lightpath::Words as _;
use lightpath::judgements::{self, judgement};
use lightpath::v1::{
    Detector, Judgement, Measure, PropagationMethod, UsedKernel, judgement::Stage, optimize_hologram::Judging,
    optimize_hologram_result::PlaneResult,
};

/// A table of all metrics for each detector: for the phase as optimized and as displayed in levels.
pub(super) fn table(plane: &PlaneResult) -> String {
    let mut table =
        Table::new("detector|phase|>PSNR|>SSIM?|>MS-SSIM???|>efficiency??|>in frame????|>speckle contrast?????");
    let mut rows = 0;
    for detector in [Detector::Point, Detector::Pixel, Detector::Supersampled] {
        for (phase, stage) in [("as optimized", Stage::Optimized), ("displayed", Stage::Displayed)] {
            let Some(judged) = judgement(&plane.judgements, stage, detector) else { continue };
            rows += 1;
            table.row([
                detector.word().to_owned(),
                phase.to_owned(),
                show::decibel(judged.psnr()),
                similarity(judged.ssim),
                similarity(judged.ms_ssim),
                or_dash(judged.diffraction_efficiency, percent),
                or_dash(judged.frame_efficiency, percent),
                or_dash(judged.speckle_contrast, |contrast| format!("{contrast:.3}")),
            ]);
        }
    }
    if rows == 0 { String::new() } else { table.text() }
}

/// What stands in the place of what a photograph is expected to show, in a job that judges nothing.
pub(super) fn without_headline(judged: Judging) -> Option<String> {
    (judged == Judging::None).then(|| not_judged(judged))
}

/// What stands in the place of the other optics and the second opinion, in a job that judges quickly.
pub(super) fn without_others(judged: Judging) -> Option<String> {
    (judged == Judging::Quick).then(|| not_judged(judged))
}

/// For example `not judged (judge quick)`.
fn not_judged(judged: Judging) -> String {
    format!("not judged (judge {})", judged.word())
}

/// The judgement to believe: what a photograph is expected to show; `None`: it was not measured.
fn headline(plane: &PlaneResult) -> Option<&Judgement> {
    plane.judgements.iter().find(|judged| judged.headline)
}

/// The PSNR to believe \[dB\]; `None`: it was not measured.
pub(crate) fn headline_psnr(plane: &PlaneResult) -> Option<Measure> {
    headline(plane)?.psnr_db
}

/// What a photograph is expected to show, for example `19.1 ± 0.8 dB expected, by
/// displays/lab/kernels/515nm-150mm/versions/3, the active kernel of the display`; `None`: it was not measured. `kernel` is
/// that of the hologram.
pub(super) fn in_photograph(plane: &PlaneResult, kernel: Option<&UsedKernel>) -> Option<String> {
    let judged = headline(plane)?;
    let psnr = show::measured_decibel(judged.psnr_db?);
    let by = match (judged.kernel_version.as_str(), kernel.map_or("", |kernel| &kernel.kernel_version)) {
        ("", "") => {
            return Some(format!("{psnr} if the optics are ideal; no kernel of the display is active to say more"));
        }
        ("", _) => "the kernel of the hologram".to_owned(),
        (version, _) => format!("{version}, the active kernel of the display"),
    };
    Some(match judged.stage() {
        Stage::Photographed => format!("{psnr} expected, by {by}"),
        _ => format!("{psnr} at most, by {by}, whose own error no test photograph has shown"),
    })
}

/// What the figure in a photograph leaves out; `None`: nothing. `kernel` is that of the hologram.
pub(super) fn in_photograph_note(plane: &PlaneResult, kernel: Option<&UsedKernel>) -> Option<&'static str> {
    let judged = headline(plane)?;
    let is_ideal = judged.kernel_version.is_empty() && kernel.is_none_or(|kernel| kernel.kernel_version.is_empty());
    match judged.stage() {
        Stage::Photographed => None,
        _ if is_ideal => {
            Some("in a photograph: if the optics are ideal; no kernel of the display is active to say more")
        }
        _ => Some("in a photograph: at most; no test photograph has shown the error of the kernel that says so"),
    }
}

/// What the figures of the hologram's own kernel are not good for; `None`: no other kernel gives the headline.
pub(super) fn own_kernel_note(plane: &PlaneResult) -> Option<String> {
    let judged = headline(plane)?;
    let note = "PSNR of the detectors is by the kernel of each hologram: it compares detectors, not kernels";
    (!judged.kernel_version.is_empty()).then(|| note.to_owned())
}

/// What the hologram would show on a display of the other kind, for example `21.3 dB on a display that shows all
/// diffraction orders`; `None`: unknown.
pub(super) fn other_orders(plane: &PlaneResult) -> Option<String> {
    let psnr = show::decibel(judgements::other_orders(&plane.judgements)?.psnr());
    let shows_all = plane.propagation.as_ref().is_some_and(|report| report.method() == PropagationMethod::AllOrders);
    let other =
        if shows_all { "that shows only the first diffraction order" } else { "that shows all diffraction orders" };
    Some(format!("{psnr} (pixel, displayed) on a display {other}"))
}

/// The second opinion on the displayed hologram, for example `agrees: the independent model finds -0.02 dB on 8
/// rows`; `None`: there is none.
pub(super) fn second_opinion(plane: &PlaneResult) -> Option<String> {
    let (engine, independent) = judgements::opinions(&plane.judgements).next()?;
    let (rows, difference_db) = (independent.rows(), independent.psnr() - engine.psnr());
    Some(if independent.contradicts {
        let (engine, independent) = (show::decibel(engine.psnr()), show::decibel(independent.psnr()));
        format!("contradicts: {independent} by the independent model, {engine} by the engine, on the same {rows} rows")
    } else {
        format!("agrees: the independent model finds {difference_db:+.2} dB on {rows} rows")
    })
}

/// Six cells: PSNR that a photograph is expected to show, then PSNR of the optimized phase by the hologram's own kernel for
/// the detectors point, pixel and supersampled, then SSIM and diffraction efficiency that a photograph is expected to show.
pub(super) fn summary(plane: &PlaneResult, judged: Judging) -> [String; 6] {
    let optimized = [Detector::Point, Detector::Pixel, Detector::Supersampled].map(|detector| {
        let judged = judgement(&plane.judgements, Stage::Optimized, detector);
        or_dash(judged.map(Judgement::psnr), show::decibel)
    });
    let expected = headline(plane);
    let [point, pixel, supersampled] = optimized;
    let efficiency = expected.and_then(|judged| judged.diffraction_efficiency);
    [
        headline_psnr(plane)
            .map(show::measured_decibel)
            .or_else(|| without_headline(judged))
            .unwrap_or_else(|| "–".to_owned()),
        point,
        pixel,
        supersampled,
        similarity(expected.and_then(|judged| judged.ssim)),
        or_dash(efficiency, percent),
    ]
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
    use lightpath::v1::ValidityReport;
    use lightpath::v1::judgement::{Model, Orders};

    fn judged(detector: Detector, psnr_db: f64) -> Judgement {
        Judgement {
            model: Model::Engine.into(),
            stage: Stage::Optimized.into(),
            detector: detector.into(),
            orders: Orders::Own.into(),
            psnr_db: Some(Measure { value: psnr_db, ..Measure::default() }),
            ..Judgement::default()
        }
    }

    fn plane(judgements: Vec<Judgement>) -> PlaneResult {
        PlaneResult { judgements, ..PlaneResult::default() }
    }

    #[test]
    fn quality_table_has_every_detector_and_dashes_for_unknown_values() {
        let pixel = Judgement {
            ssim: Some(0.912_34),
            ms_ssim: Some(0.987_65),
            diffraction_efficiency: Some(0.712_3),
            frame_efficiency: Some(0.95),
            speckle_contrast: Some(0.0314),
            ..judged(Detector::Pixel, 27.7)
        };
        let shown = plane(vec![judged(Detector::Point, 46.31), pixel]);
        let text = table(&shown);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 3, "{text}");
        let words = |line: &str| line.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(words(lines[1]), "point as optimized 46.3 dB – – – – –");
        assert_eq!(words(lines[2]), "pixel as optimized 27.7 dB 0.9123 0.9877 71.2 % 95.0 % 0.031");
        assert_eq!(table(&PlaneResult::default()), "");
        assert_eq!(summary(&shown, Judging::Full), ["–", "46.3 dB", "27.7 dB", "–", "–", "–"]);
        assert_eq!((other_orders(&shown), second_opinion(&shown), headline_psnr(&shown)), (None, None, None));
        assert_eq!(summary(&shown, Judging::None)[0], "not judged (judge none)");
        let quick = Some("not judged (judge quick)".to_owned());
        assert_eq!((without_headline(Judging::Quick), without_others(Judging::Quick)), (None, quick));
        assert_eq!((without_headline(Judging::Full), without_others(Judging::Full)), (None, None));
    }

    #[test]
    fn other_orders_and_the_second_opinion_are_told_apart_from_the_headline() {
        let displayed = Judgement { stage: Stage::Displayed.into(), ..judged(Detector::Pixel, 40.25) };
        let headline = Judgement { headline: true, ..displayed.clone() };
        let others = Judgement { orders: Orders::Other.into(), ..judged(Detector::Pixel, 21.34) };
        let opinion = |db: f64| {
            let engine =
                Judgement { rows: Some(8), psnr_db: judged(Detector::Pixel, 40.0).psnr_db, ..displayed.clone() };
            let psnr_db = judged(Detector::Pixel, db).psnr_db;
            let contradicts = (db - 40.0).abs() > 0.5;
            [engine.clone(), Judgement { model: Model::Independent.into(), psnr_db, contradicts, ..engine }]
        };
        let report = ValidityReport { method: PropagationMethod::AllOrders.into(), ..ValidityReport::default() };
        let with = |db| {
            let judgements = [headline.clone(), others.clone()].into_iter().chain(opinion(db)).collect();
            PlaneResult { propagation: Some(report.clone()), ..plane(judgements) }
        };
        assert_eq!(headline_psnr(&with(39.98)).map(|psnr| psnr.value), Some(40.25));
        let text = "21.3 dB (pixel, displayed) on a display that shows only the first diffraction order";
        assert_eq!(other_orders(&with(39.98)).as_deref(), Some(text));
        let agrees = "agrees: the independent model finds -0.02 dB on 8 rows";
        assert_eq!(second_opinion(&with(39.98)).as_deref(), Some(agrees));
        let text = "contradicts: 38.0 dB by the independent model, 40.0 dB by the engine, on the same 8 rows";
        assert_eq!(second_opinion(&with(38.0)).as_deref(), Some(text));
    }

    #[test]
    fn active_kernel_says_what_a_photograph_shows() {
        let own = Judgement { stage: Stage::Displayed.into(), ..judged(Detector::Pixel, 48.31) };
        let alone = plane(vec![Judgement { headline: true, ..own.clone() }]);
        let ideal = "48.3 dB if the optics are ideal; no kernel of the display is active to say more";
        assert_eq!(in_photograph(&alone, Some(&UsedKernel::default())).as_deref(), Some(ideal));
        let kernel_version = "displays/lab/kernels/515nm-150mm/versions/2".to_owned();
        let learned = UsedKernel { kernel_version, ..UsedKernel::default() };
        let text = "48.3 dB at most, by the kernel of the hologram, whose own error no test photograph has shown";
        assert_eq!(in_photograph(&alone, Some(&learned)).as_deref(), Some(text));
        let active = Judgement {
            headline: true,
            stage: Stage::Photographed.into(),
            kernel_version: "displays/lab/kernels/515nm-150mm/versions/3".to_owned(),
            psnr_db: Some(Measure { value: 19.14, std: Some(0.83), ..Measure::default() }),
            ..own.clone()
        };
        let both = plane(vec![own, active]);
        let text =
            "19.1 ± 0.8 dB expected, by displays/lab/kernels/515nm-150mm/versions/3, the active kernel of the display";
        assert_eq!(in_photograph(&both, Some(&UsedKernel::default())).as_deref(), Some(text));
        assert_eq!(summary(&both, Judging::Quick)[0], "19.1 ± 0.8 dB");
        assert!(own_kernel_note(&both).is_some_and(|note| note.contains("not kernels")));
        assert_eq!(own_kernel_note(&alone), None);
        assert!(in_photograph_note(&alone, None).is_some_and(|note| note.contains("if the optics are ideal")));
        assert!(table(&both).contains("48.3 dB"), "the table is that of the kernel of the hologram");
    }
}
