//! Kernels as messages.

use crate::time::timestamp;
use lightpath_domain::kernel::{Kernel, KernelLineage, KernelMetrics, KernelModel, KernelMove, KernelVersion};
use lightpath_media::kernel_formats::KernelFormat;
use lightpath_proto::v1;

/// The kernel as clients see it.
pub(crate) fn kernel(kernel: &Kernel) -> v1::Kernel {
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
pub(crate) fn version(version: KernelVersion) -> v1::KernelVersion {
    let content = version.content;
    v1::KernelVersion {
        name: format!("{}/versions/{}", version.key, version.version),
        version: version.version,
        model: model(content.model),
        artifact: content.artifact,
        size_bytes: content.size_bytes,
        metrics: Some(metrics(&content.metrics)),
        interpolated: content.lineage.is_interpolated(),
        lineage: Some(lineage(content.lineage)),
        create_time: Some(timestamp(version.create_time_ms)),
        active: version.active,
    }
}

/// How good a kernel is, as clients see it.
pub(crate) fn metrics(metrics: &KernelMetrics) -> v1::KernelMetrics {
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
pub(crate) fn kernel_move(moved: KernelMove) -> v1::KernelMove {
    v1::KernelMove {
        time: Some(timestamp(moved.time_ms)),
        from_version: moved.from_version.unwrap_or(0),
        to_version: moved.to_version,
        reason: moved.reason,
        rollback: moved.rollback,
    }
}

fn lineage(lineage: KernelLineage) -> v1::KernelLineage {
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

pub(crate) fn model(model: KernelModel) -> i32 {
    match model {
        KernelModel::Paper => v1::KernelModel::Paper.into(),
        KernelModel::Dense => v1::KernelModel::Dense.into(),
        KernelModel::Smooth => v1::KernelModel::Smooth.into(),
        KernelModel::Display => v1::KernelModel::Display.into(),
        KernelModel::Varying => v1::KernelModel::Varying.into(),
    }
}

pub(crate) fn kernel_format(format: KernelFormat) -> i32 {
    let format = match format {
        KernelFormat::Safetensors => v1::KernelFormat::Safetensors,
        KernelFormat::Compact => v1::KernelFormat::Compact,
        KernelFormat::Pt => v1::KernelFormat::Pt,
        KernelFormat::Npy => v1::KernelFormat::Npy,
        KernelFormat::Npz => v1::KernelFormat::Npz,
        KernelFormat::Complex64 => v1::KernelFormat::Complex64,
        KernelFormat::F16 => v1::KernelFormat::F16,
    };
    format.into()
}
