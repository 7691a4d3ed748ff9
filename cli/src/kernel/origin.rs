//! Where versions come from, as text.

use crate::show;
use crate::table::Facts;
use lightpath::v1::kernel_lineage::{Import, Learning, Origin, import::Original};
use lightpath::v1::{self, KernelLineage, LearningParameters};
use lightpath::{Words as _, names};

/// How a version was made, in a few words for a table: the id of the dataset of a learned version.
pub(super) fn word(lineage: &KernelLineage) -> String {
    match &lineage.origin {
        Some(Origin::Learned(learning)) => {
            learning.datasets.first().map(|dataset| names::id(&dataset.name)).unwrap_or_default().to_owned()
        }
        Some(Origin::Interpolated(_)) => "(interpolated)".to_owned(),
        Some(Origin::Imported(_)) => "(imported)".to_owned(),
        None => "(unknown)".to_owned(),
    }
}

/// Adds the origin of a version.
pub(super) fn add(lineage: &KernelLineage, facts: &mut Facts) {
    match &lineage.origin {
        Some(Origin::Learned(learning)) => learned(learning, facts),
        Some(Origin::Interpolated(learning)) => interpolated(learning, facts),
        Some(Origin::Imported(import)) => imported(import, facts),
        None => facts.add("origin", "unknown to this program; update it"),
    }
    facts.add("server", &lineage.code_version);
}

fn learned(learning: &Learning, facts: &mut Facts) {
    if learning.datasets.len() > 1 {
        facts.add("learned together", distances(learning));
    }
    facts.add("job", names::id(&learning.job));
    if let Some(dataset) = learning.datasets.first() {
        facts.add("dataset", format!("{} ({})", names::id(&dataset.name), dataset.digest));
    }
    facts.add_some("asked for", learning.parameters.as_ref().map(asked));
    facts.add_some("seed", learning.parameters.map(|parameters| parameters.seed.to_string()));
    let is_warm = !learning.parent_version.is_empty();
    facts.add("started from", if is_warm { &learning.parent_version } else { "the ideal kernel" });
}

fn interpolated(learning: &Learning, facts: &mut Facts) {
    facts.add("interpolated from", distances(learning));
    facts.add_some("job", given(names::id(&learning.job)));
}

fn imported(import: &Import, facts: &mut Facts) {
    facts.add("imported from", format!("{}, {}", import.format().word(), import.artifact));
    facts.add_some("note", given(&import.note));
    facts.add_some("bundle of", given(&import.original_version));
    facts.add_some("made there", import.original_create_time.as_ref().map(show::time));
    match &import.original {
        Some(Original::Learned(learning)) => learned(learning, facts),
        Some(Original::Interpolated(learning)) => interpolated(learning, facts),
        None => {}
    }
}

fn given(text: &str) -> Option<String> {
    (!text.is_empty()).then(|| text.to_owned())
}

/// The distances of the datasets, ascending.
fn distances(learning: &Learning) -> String {
    let places = learning.datasets.iter().filter_map(|dataset| dataset.place.as_ref());
    let mut distances_m: Vec<f64> = places.filter_map(v1::Place::distance_m).collect();
    distances_m.sort_by(f64::total_cmp);
    show::lengths(distances_m)
}

/// What was asked of a learning, without its seed and what was left to it.
fn asked(parameters: &LearningParameters) -> String {
    let LearningParameters { degree, epochs, learning_rate, refinement_evaluations, region, .. } = parameters;
    let chosen = [
        degree.map(|degree| format!("degree {degree}")),
        epochs.map(|epochs| format!("{epochs} epochs")),
        learning_rate.map(|rate| format!("learning rate {rate}")),
        refinement_evaluations.map(|evaluations| format!("{evaluations} refining evaluations")),
        (parameters.detector() == v1::Detector::Point).then(|| "detector point".to_owned()),
        region.map(|v1::Region { x_px, y_px, width_px, height_px }| {
            format!("region {x_px},{y_px},{width_px},{height_px}")
        }),
    ];
    let model = format!("model {}", parameters.model().word());
    [model].into_iter().chain(chosen.into_iter().flatten()).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath::v1::kernel_lineage::LearnedDataset;

    fn learning() -> Learning {
        let dataset = |id: &str, mm: f64| LearnedDataset {
            place: Some(v1::Place::at_m(mm * 1e-3)),
            name: format!("datasets/{id}"),
            digest: "sha256-1".to_owned(),
        };
        let region = Some(v1::Region { x_px: 6, y_px: 5, width_px: 52, height_px: 38 });
        let parameters = LearningParameters {
            model: v1::KernelModel::Smooth.into(),
            degree: Some(4),
            seed: 7,
            detector: v1::Detector::Pixel.into(),
            region,
            ..LearningParameters::default()
        };
        Learning {
            job: "jobs/0193".to_owned(),
            datasets: vec![dataset("far", 6.0), dataset("near", 4.0)],
            parent_version: String::new(),
            parameters: Some(parameters),
        }
    }

    fn text(origin: Origin) -> String {
        let mut facts = Facts::default();
        add(&KernelLineage { origin: Some(origin), code_version: "0.1.0".to_owned() }, &mut facts);
        facts.text()
    }

    #[test]
    fn a_version_from_a_bundle_says_where_and_how_it_was_learned() {
        let name = "displays/lab/kernels/515nm-4mm/versions/2";
        let import = Import {
            format: v1::KernelFormat::Bundle.into(),
            artifact: "sha256-2".to_owned(),
            original_version: name.to_owned(),
            original: Some(Original::Learned(learning())),
            ..Import::default()
        };
        let text = text(Origin::Imported(import));
        for part in [
            "bundle, sha256-2",
            name,
            "4 mm, 6 mm",
            "0193",
            "far (sha256-1)",
            "model smooth, degree 4, region 6,5,52,38",
        ] {
            assert!(text.contains(part), "{part} is not in\n{text}");
        }
        assert!(!text.contains("note"), "{text}");
    }

    #[test]
    fn an_interpolated_version_says_between_which_distances() {
        let text = text(Origin::Interpolated(learning()));
        assert!(text.contains("interpolated from") && text.contains("4 mm, 6 mm"), "{text}");
        assert!(!text.contains("dataset"), "no dataset is of its own distance:\n{text}");
    }
}
