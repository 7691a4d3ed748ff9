//! Conversion of kernels into messages.

mod lineage;
pub(crate) mod parts;

use crate::enumerations::OnWire as _;
use crate::optics::to_wire::place;
use crate::time::timestamp;
use lightpath_domain::kernel::{CapturedQuality, Deprecation, Kernel, KernelMetrics, KernelMove, KernelVersion};
use lightpath_domain::promotion::{GateChange, GateCheck, PromotionGate};
use lightpath_proto::v1;

/// Converts a kernel into its message.
pub(crate) fn kernel(kernel: &Kernel) -> v1::Kernel {
    v1::Kernel {
        name: kernel.key.to_string(),
        display: format!("displays/{}", kernel.key.display),
        wavelength_m: kernel.key.wavelength.m(),
        place: place(kernel.key.distance),
        active_version: kernel.active_version,
        latest_version: kernel.latest_version,
        create_time: Some(timestamp(kernel.create_time_ms)),
        interpolated: kernel.interpolated,
        aliases: kernel.aliases.clone().into_iter().collect(),
        rollout: kernel.rollout.map(|number| format!("{}/rollouts/{number}", kernel.key)).unwrap_or_default(),
    }
}

/// Converts a version into its message.
pub(crate) fn version(version: KernelVersion) -> v1::KernelVersion {
    let content = version.content;
    v1::KernelVersion {
        name: format!("{}/versions/{}", version.key, version.version),
        version: version.version,
        model: content.model.to_wire(),
        artifact: content.artifact,
        size_bytes: content.size_bytes,
        metrics: metrics(&content.metrics),
        lineage: Some(lineage::message(content.lineage)),
        create_time: Some(timestamp(version.create_time_ms)),
        active: version.active,
        deprecation: version.deprecation.map(deprecation),
    }
}

fn deprecation(Deprecation { time_ms, cause }: Deprecation) -> v1::Deprecation {
    v1::Deprecation { time: Some(timestamp(time_ms)), caller: cause.caller, reason: cause.reason }
}

/// Converts a promotion gate into its message.
pub(crate) fn gate(gate: PromotionGate) -> v1::PromotionGate {
    v1::PromotionGate {
        loss_reduction_min: gate.loss_reduction_min,
        worse_than_ideal_allowed: gate.worse_than_ideal_allowed,
        test_pairs_min: gate.test_pairs_min,
        formats: gate.forms.iter().map(|form| form.as_str().to_owned()).collect(),
    }
}

/// Converts a promotion gate that was set into its message.
pub(crate) fn gate_change(change: GateChange) -> v1::GateChange {
    v1::GateChange {
        time: Some(timestamp(change.time_ms)),
        caller: change.cause.caller,
        reason: change.cause.reason,
        gate: Some(gate(change.gate)),
    }
}

/// Converts a check of a promotion gate into its message.
pub(crate) fn gate_check(GateCheck { passed, finding, is_unmeasured }: GateCheck) -> v1::GateCheck {
    v1::GateCheck { passed, finding, not_measured: is_unmeasured }
}

/// Converts the metrics of a version into their message; `None`: it was not measured.
pub(crate) fn metrics(metrics: &KernelMetrics) -> Option<v1::KernelMetrics> {
    metrics.is_measured().then(|| v1::KernelMetrics {
        train_pairs: metrics.train_pairs,
        validation_pairs: metrics.validation_pairs,
        test_pairs: metrics.test_pairs,
        train_loss: metrics.train_loss,
        validation_loss: (metrics.validation_pairs > 0).then_some(metrics.validation_loss),
        test_loss: metrics.test_loss,
        ideal_test_loss: metrics.ideal_test_loss,
        test_loss_full_frame: metrics.test_loss_full_frame,
        ideal_test_loss_full_frame: metrics.ideal_test_loss_full_frame,
        captured: metrics
            .captured
            .map(|CapturedQuality { psnr_db, ideal_psnr_db }| v1::CapturedQuality { psnr_db, ideal_psnr_db }),
        no_better_than_ideal: metrics.no_better_than_ideal(),
        parts: metrics.parts.iter().map(parts::cost).collect(),
    })
}

/// Converts a move into its message.
pub(crate) fn kernel_move(moved: KernelMove) -> v1::KernelMove {
    v1::KernelMove {
        time: Some(timestamp(moved.time_ms)),
        alias: moved.alias,
        caller: moved.cause.caller,
        from_version: moved.from_version,
        to_version: moved.to_version,
        reason: moved.cause.reason,
        overridden: moved.overridden,
        rollback: moved.rollback,
        generation: moved.generation,
    }
}
