//! How good kernels are, as text.

use super::show;
use super::table::{Facts, Table};
use lightpath::v1::KernelMetrics;

/// A loss and that of the ideal kernel, for example `0.00139 (ideal kernel 0.0213)`.
pub(crate) fn against_ideal(learned: f64, ideal: f64) -> String {
    format!("{} (ideal kernel {})", show::loss(learned), show::loss(ideal))
}

/// Numbers of pairs, for example `12 train, 2 validation, 2 test`.
pub(crate) fn pairs(metrics: &KernelMetrics) -> String {
    let KernelMetrics { train_pairs, validation_pairs, test_pairs, .. } = metrics;
    format!("{train_pairs} train, {validation_pairs} validation, {test_pairs} test")
}

/// A table of what each part of a learned model explains; empty if that was not measured.
pub(crate) fn parts(metrics: &KernelMetrics) -> String {
    if metrics.parts.is_empty() {
        return String::new();
    }
    let mut table = Table::new("part of the model|>worse without it|>over the photographs?");
    for part in &metrics.parts {
        let cost = part.cost_db.unwrap_or_default();
        let range = cost.low.zip(cost.high).map(|(low, high)| format!("{low:.1} to {high:.1} dB"));
        table.row([part.name.replace('_', " "), show::decibel(cost.value), range.unwrap_or_default()]);
    }
    table.text()
}

/// Adds the quality of photographs of new holograms, and a warning for a kernel that is no better than the ideal one.
pub(crate) fn verdict(metrics: &KernelMetrics, facts: &mut Facts) {
    if let Some(captured) = metrics.captured {
        let (learned, ideal) = (show::decibel(captured.psnr_db), show::decibel(captured.ideal_psnr_db));
        facts.add("captured", format!("{learned} (ideal kernel {ideal}), new holograms"));
    }
    if metrics.no_better_than_ideal {
        facts.add("verdict", "no better than the ideal kernel; it can be promoted only with --force");
    }
}
