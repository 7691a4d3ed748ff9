//! Kernels on the wire.

use super::encodings::model_to_wire;
use super::time::timestamp;
use lightpath_domain::kernel::{Kernel, KernelLineage, KernelMetrics, KernelMove, KernelVersion};
use lightpath_proto::v1;

/// The kernel as clients see it.
pub(super) fn to_wire(kernel: &Kernel) -> v1::Kernel {
    v1::Kernel {
        name: kernel.key.to_string(),
        display: format!("displays/{}", kernel.key.display),
        wavelength_m: kernel.key.wavelength.m(),
        distance_m: kernel.key.distance.m(),
        active_version: kernel.active_version.unwrap_or(0),
        latest_version: kernel.latest_version,
        create_time: Some(timestamp(kernel.create_time_ms)),
        interpolated: kernel.interpolated,
    }
}

/// The version as clients see it.
pub(super) fn version_to_wire(version: KernelVersion) -> v1::KernelVersion {
    let content = version.content;
    v1::KernelVersion {
        name: format!("{}/versions/{}", version.key, version.version),
        version: version.version,
        model: model_to_wire(content.model),
        artifact: content.artifact,
        size_bytes: content.size_bytes,
        metrics: Some(metrics_to_wire(&content.metrics)),
        interpolated: content.lineage.is_interpolated(),
        lineage: Some(lineage_to_wire(content.lineage)),
        create_time: Some(timestamp(version.create_time_ms)),
        active: version.active,
    }
}

/// How good a kernel is, as clients see it.
pub(super) fn metrics_to_wire(metrics: &KernelMetrics) -> v1::KernelMetrics {
    v1::KernelMetrics {
        train_pairs: metrics.train_pairs,
        validation_pairs: metrics.validation_pairs,
        test_pairs: metrics.test_pairs,
        train_loss: metrics.train_loss,
        validation_loss: metrics.validation_loss,
        test_loss: metrics.test_loss,
        ideal_test_loss: metrics.ideal_test_loss,
        test_loss_full_frame: metrics.test_loss_full_frame,
        ideal_test_loss_full_frame: metrics.ideal_test_loss_full_frame,
        captured_psnr_db: metrics.captured.map(|captured| captured.psnr_db),
        ideal_captured_psnr_db: metrics.captured.map(|captured| captured.ideal_psnr_db),
        no_better_than_ideal: metrics.no_better_than_ideal(),
    }
}

/// The move as clients see it.
pub(super) fn move_to_wire(moved: KernelMove) -> v1::KernelMove {
    v1::KernelMove {
        time: Some(timestamp(moved.time_ms)),
        from_version: moved.from_version.unwrap_or(0),
        to_version: moved.to_version,
        reason: moved.reason,
        rollback: moved.rollback,
    }
}

fn lineage_to_wire(lineage: KernelLineage) -> v1::KernelLineage {
    let named = |collection: &str, id: String| if id.is_empty() { id } else { format!("{collection}/{id}") };
    v1::KernelLineage {
        job: named("jobs", lineage.job),
        dataset: named("datasets", lineage.dataset),
        dataset_digest: lineage.dataset_digest,
        parameters_json: lineage.parameters_json,
        seed: lineage.seed,
        code_version: lineage.code_version,
        parent_version: lineage.parent_version,
        over_distance: lineage.over_distance.map(|over| v1::OverDistance {
            distances_m: over.distances.iter().map(|distance| distance.m()).collect(),
            datasets: over.datasets.into_iter().map(|id| named("datasets", id)).collect(),
            dataset_digests: over.dataset_digests,
        }),
    }
}
