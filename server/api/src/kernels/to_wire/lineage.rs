//! Conversion of lineages into messages.

use crate::enumerations::OnWire as _;
use crate::optics::to_wire::{place, region_message};
use crate::time::timestamp;
use lightpath_domain::lineage::{
    Import, KernelLineage, KernelOrigin, LearnedDataset, Learning, LearningParameters, Made,
};
use lightpath_proto::v1;
use lightpath_proto::v1::kernel_lineage::{self as wire, Origin, import::Original};

/// Converts the lineage of a version into its message.
pub(super) fn message(lineage: KernelLineage) -> v1::KernelLineage {
    let origin = match lineage.origin {
        KernelOrigin::Learned(learned) => Origin::Learned(learning(learned)),
        KernelOrigin::Interpolated(from) => Origin::Interpolated(learning(from)),
        KernelOrigin::Imported(file) => Origin::Imported(import(file)),
    };
    v1::KernelLineage { origin: Some(origin), code_version: lineage.code_version }
}

fn learning(Learning { job, datasets, parent_version, parameters }: Learning) -> wire::Learning {
    wire::Learning {
        job: name_of("jobs", job),
        datasets: datasets.into_iter().map(dataset).collect(),
        parent_version: parent_version.unwrap_or_default(),
        parameters: parameters.map(asked),
    }
}

fn dataset(LearnedDataset { distance, id, digest }: LearnedDataset) -> wire::LearnedDataset {
    wire::LearnedDataset { place: place(distance), name: name_of("datasets", id), digest }
}

/// Resource name of an id; empty if the id is not known.
fn name_of(collection: &str, id: String) -> String {
    if id.is_empty() { id } else { format!("{collection}/{id}") }
}

fn asked(parameters: LearningParameters) -> v1::LearningParameters {
    v1::LearningParameters {
        model: parameters.model.to_wire(),
        degree: parameters.degree,
        epochs: parameters.epochs,
        learning_rate: parameters.learning_rate,
        refinement_evaluations: parameters.refinement_evaluations,
        seed: parameters.seed,
        detector: parameters.detector.to_wire(),
        region: Some(region_message(parameters.region_of_interest)),
    }
}

fn import(Import { format, artifact, note, version, made }: Import) -> wire::Import {
    let original = made.map(|made| match made {
        Made::Learned(learned) => Original::Learned(learning(learned)),
        Made::Interpolated(from) => Original::Interpolated(learning(from)),
    });
    let (original_version, original_create_time) =
        version.map(|version| (version.name, timestamp(version.create_time_ms))).unzip();
    wire::Import {
        format: format.to_wire(),
        artifact,
        note: note.unwrap_or_default(),
        original_version: original_version.unwrap_or_default(),
        original_create_time,
        original,
    }
}
