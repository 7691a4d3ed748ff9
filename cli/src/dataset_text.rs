//! Datasets as text.

use super::show;
use super::table::{Facts, Table, indented};
use lightpath::v1::{self, Dataset, dataset::State};
use lightpath::{Words as _, names};

/// Text about a dataset and its findings as a whole.
pub(crate) fn facts(dataset: &Dataset) -> String {
    table(dataset).text() + &findings(&dataset.findings)
}

/// Text about a dataset, with its pairs and the findings about all of them.
pub(crate) fn facts_with_pairs(dataset: &Dataset, pairs: &[v1::Pair]) -> String {
    let mut text = table(dataset).text();
    if !pairs.is_empty() {
        text = format!("{text}\n{}", pair_table(pairs).text());
    }
    let all: Vec<v1::Finding> =
        pairs.iter().flat_map(|pair| &pair.findings).chain(&dataset.findings).cloned().collect();
    text + &findings(&all)
}

fn table(dataset: &Dataset) -> Facts {
    let mut facts = Facts::default();
    facts.add("dataset", names::id(&dataset.name));
    facts.add("display", names::id(&dataset.display));
    facts.add("optics", show::optics(dataset.wavelength_m(), dataset.place.as_ref()));
    facts.add(
        "state",
        match dataset.state() {
            State::Open => "open: pairs can be added",
            State::Finalized | State::Unspecified => dataset.state().word(),
        },
    );
    facts.add("photographs", dataset.photo_encoding().word());
    facts.add("pairs", pairs(dataset));
    facts.add_some("created", dataset.create_time.as_ref().map(show::time));
    facts.add_some("finalized", dataset.finalize_time.as_ref().map(show::time));
    if !dataset.digest.is_empty() {
        facts.add("digest", &dataset.digest);
    }
    if let Some(alignment) = &dataset.alignment {
        add_alignment(alignment, &mut facts);
    }
    facts
}

/// The number of pairs, and of a finalized dataset those of each use.
fn pairs(dataset: &Dataset) -> String {
    let count = dataset.pair_count;
    let Some(v1::SplitCounts { train, validation, test, excluded }) = dataset.split_counts else {
        return count.to_string();
    };
    let left_out = if excluded > 0 { format!(", {excluded} left out") } else { String::new() };
    format!("{count}: {train} for training, {validation} for validation, {test} for the test{left_out}")
}

/// Text with a line for each finding. Empty without findings.
pub(crate) fn findings(findings: &[v1::Finding]) -> String {
    let mut text = String::new();
    if !findings.is_empty() {
        text.push_str("\nFindings\n");
        for finding in findings {
            let pair = if finding.pair.is_empty() { "all".to_owned() } else { format!("pair {}", finding.pair) };
            let left_out = if finding.excludes { " (left out)" } else { "" };
            text.push_str(&indented(&format!("{pair}: {}{left_out}", finding.message)));
        }
    }
    text
}

/// Adds the source of an alignment and its quality.
pub(crate) fn add_alignment(alignment: &v1::Alignment, facts: &mut Facts) {
    facts.add("alignment", quality(alignment));
    if !alignment.explanation.is_empty() {
        facts.add("alignment by pairs", &alignment.explanation);
    }
}

fn quality(alignment: &v1::Alignment) -> String {
    let (origin, unit) = match alignment.method() {
        v1::alignment::Method::Dots => ("from a photograph of the dots", "dots"),
        v1::alignment::Method::Pairs => ("from the pairs", "tiles"),
        v1::alignment::Method::Points | v1::alignment::Method::Unspecified => ("from points", "points"),
    };
    let lens = match [alignment.k1, alignment.k2, alignment.p1, alignment.p2] {
        [0.0, 0.0, 0.0, 0.0] => String::new(),
        // The displacement of a corner, at r = 1.
        [k1, k2, ..] => format!("; the lens moves the corners by {:+.1} % of their distance", 100.0 * (k1 + k2)),
    };
    format!(
        "{origin}: corrects {:.2} px, residual {:.3} px over {} {unit}; photographs of {}×{} px{lens}",
        alignment.corrected_px,
        alignment.residual_px,
        alignment.points,
        alignment.photo_width_px,
        alignment.photo_height_px
    )
}

fn pair_table(pairs: &[v1::Pair]) -> Table {
    let mut table = Table::new("pair|split|>saturated?|>black??|>contrast??|>match|>off|hologram???|photograph???");
    for pair in pairs {
        let split = match pair.split() {
            v1::Split::Unspecified => "–".to_owned(),
            split => split.word().to_owned(),
        };
        let checks = pair.checks.as_ref();
        let cell = |value: Option<f64>, text: fn(f64) -> String| value.map_or_else(|| "–".to_owned(), text);
        let percent = |value: f64| format!("{:.1} %", 100.0 * value);
        table.row([
            pair.id.clone(),
            split,
            cell(checks.map(|checks| checks.saturated), percent),
            cell(checks.map(|checks| checks.black), percent),
            cell(checks.map(|checks| checks.contrast), |value| format!("{value:.2}")),
            cell(checks.and_then(|checks| checks.correlation), |value| format!("{value:.2}")),
            cell(checks.and_then(|checks| checks.misalignment_px), |value| format!("{value:.2} px")),
            short(&pair.pattern),
            short(&pair.photo),
        ]);
    }
    table
}

/// The first 12 digits of a digest. `--output json` shows all digits.
fn short(digest: &str) -> String {
    digest.strip_prefix("sha256-").map_or_else(|| digest.to_owned(), |hex| hex.chars().take(12).collect())
}
