//! Jobs and their results on the wire.

use super::encodings::{detector_to_wire, model_to_wire, region_to_wire, split_to_wire};
use super::holograms::{hologram_to_wire, optimize_to_wire};
use super::kernels::metrics_to_wire;
use super::propagation::report_to_wire;
use super::time::timestamp;
use lightpath_domain::job::{
    EvaluateKernel, Job, JobError, JobResult, JobSpec, JobState, JointResult, LearnKernel, Progress, Quality,
    SimulateCapture,
};
use lightpath_proto::v1::{self, job_result, job_spec};

/// The job as clients see it.
pub(super) fn to_wire(job: Job) -> v1::Job {
    v1::Job {
        name: format!("jobs/{}", job.id),
        request_id: job.request_id,
        spec: Some(spec_to_wire(job.spec)),
        state: state_to_wire(job.state).into(),
        priority: job.priority,
        attempt: job.attempt,
        attempts_max: job.attempts_max,
        create_time: Some(timestamp(job.create_time_ms)),
        start_time: job.start_time_ms.map(timestamp),
        finish_time: job.finish_time_ms.map(timestamp),
        run_time: Some(timestamp(job.run_time_ms)),
        progress: job.progress.map(progress_to_wire),
        error: job.error.map(error_to_wire),
        result: job.result.map(result_to_wire),
        cancel_requested: job.cancel_requested,
        revision: job.revision,
        owner: job.scheduling.owner,
        batch: job.scheduling.batch.unwrap_or_default(),
        unique_key: job.scheduling.unique_key.unwrap_or_default(),
        timeout_s: job.scheduling.timeout_ms.map_or(0.0, |ms| ms as f64 / 1e3),
        after: job.scheduling.after.iter().map(|id| format!("jobs/{id}")).collect(),
        waiting_for: job.waiting_for,
    }
}

fn state_to_wire(state: JobState) -> v1::job::State {
    match state {
        JobState::Queued => v1::job::State::Queued,
        JobState::Running => v1::job::State::Running,
        JobState::Succeeded => v1::job::State::Succeeded,
        JobState::Failed => v1::job::State::Failed,
        JobState::Cancelled => v1::job::State::Cancelled,
    }
}

/// The state that a filter names; `None`: any.
pub(super) fn state_from_wire(value: i32) -> Option<Option<JobState>> {
    Some(match v1::job::State::try_from(value).ok()? {
        v1::job::State::Unspecified => None,
        v1::job::State::Queued => Some(JobState::Queued),
        v1::job::State::Running => Some(JobState::Running),
        v1::job::State::Succeeded => Some(JobState::Succeeded),
        v1::job::State::Failed => Some(JobState::Failed),
        v1::job::State::Cancelled => Some(JobState::Cancelled),
    })
}

fn progress_to_wire(progress: Progress) -> v1::Progress {
    let Progress { stage, step, steps_total, loss, eta_s } = progress;
    v1::Progress { stage, step, steps_total, loss, eta_s }
}

fn error_to_wire(error: JobError) -> v1::JobError {
    let JobError { reason, message, retryable } = error;
    v1::JobError { reason, message, retryable }
}

fn spec_to_wire(spec: JobSpec) -> v1::JobSpec {
    let kind = match spec {
        JobSpec::OptimizeHologram(spec) => job_spec::Kind::OptimizeHologram(optimize_to_wire(*spec)),
        JobSpec::LearnKernel(spec) => job_spec::Kind::LearnKernel(learn_to_wire(spec)),
        JobSpec::SimulateCapture(spec) => job_spec::Kind::SimulateCapture(simulate_to_wire(spec)),
        JobSpec::EvaluateKernel(spec) => job_spec::Kind::EvaluateKernel(evaluate_to_wire(spec)),
    };
    v1::JobSpec { kind: Some(kind) }
}

/// What a job's `kernel` was resolved to, in the form that a request may name it.
pub(super) fn kernel_choice(version: Option<u32>) -> String {
    version.map_or_else(|| "ideal".to_owned(), |version| version.to_string())
}

fn learn_to_wire(spec: LearnKernel) -> v1::LearnKernel {
    v1::LearnKernel {
        dataset: format!("datasets/{}", spec.dataset),
        model: model_to_wire(spec.model),
        epochs: spec.epochs.unwrap_or(0),
        refinement_evaluations: spec.refinement_evaluations,
        learning_rate: spec.learning_rate.unwrap_or(0.0),
        seed: spec.seed,
        order: spec.order.unwrap_or(0),
        detector: detector_to_wire(spec.detector),
        region_of_interest: Some(region_to_wire(spec.region_of_interest)),
        start_version: spec.start_version.unwrap_or(0),
        joint_datasets: spec.joint_datasets.iter().map(|id| format!("datasets/{id}")).collect(),
    }
}

fn simulate_to_wire(spec: SimulateCapture) -> v1::SimulateCapture {
    v1::SimulateCapture {
        display: format!("displays/{}", spec.display),
        wavelength_m: spec.wavelength.m(),
        distance_m: spec.distance.m(),
        phase: spec.phase,
        seed: spec.seed,
        elapsed_s: spec.elapsed_s,
    }
}

fn evaluate_to_wire(spec: EvaluateKernel) -> v1::EvaluateKernel {
    v1::EvaluateKernel {
        dataset: format!("datasets/{}", spec.dataset),
        kernel: kernel_choice(spec.kernel_version),
        kernel_version: spec.kernel_version.unwrap_or(0),
        region_of_interest: Some(region_to_wire(spec.region_of_interest)),
    }
}

fn result_to_wire(result: JobResult) -> v1::JobResult {
    let propagation = match &result {
        JobResult::Hologram(result) => result.propagation(),
        JobResult::Learn(result) => result.propagation.as_ref(),
        JobResult::Capture(result) => result.propagation.as_ref(),
        JobResult::Evaluate(result) => result.propagation.as_ref(),
    };
    let propagation = propagation.cloned().map(report_to_wire);
    let kind = match result {
        JobResult::Hologram(result) => job_result::Kind::Hologram(hologram_to_wire(*result)),
        JobResult::Learn(result) => job_result::Kind::Learn(v1::LearnResult {
            kernel_version: result.kernel_version,
            metrics: Some(metrics_to_wire(&result.metrics)),
            loss_history: result.loss_history,
            left_out_pairs: result.left_out_pairs,
            order: result.order,
            joint: result.joint.into_iter().map(joint_to_wire).collect(),
        }),
        JobResult::Capture(result) => job_result::Kind::Capture(v1::CaptureResult { photo: result.photo }),
        JobResult::Evaluate(result) => {
            let pairs = result.pairs.into_iter().map(|pair| v1::evaluate_result::PairLoss {
                pair: pair.pair,
                split: split_to_wire(Some(pair.split)),
                loss: pair.loss,
                loss_full_frame: pair.loss_full_frame,
            });
            job_result::Kind::Evaluate(v1::EvaluateResult { pairs: pairs.collect() })
        }
    };
    v1::JobResult { kind: Some(kind), propagation }
}

fn joint_to_wire(JointResult { kernel_version, metrics }: JointResult) -> v1::learn_result::JointResult {
    v1::learn_result::JointResult { kernel_version, metrics: Some(metrics_to_wire(&metrics)) }
}

pub(super) fn quality_to_wire(Quality { point, pixel, supersampled }: Quality) -> v1::Quality {
    v1::Quality {
        psnr_point_db: point.psnr_db,
        psnr_pixel_db: pixel.psnr_db,
        psnr_supersampled_db: supersampled.psnr_db,
        ssim_point: point.ssim,
        ssim_pixel: pixel.ssim,
        ssim_supersampled: supersampled.ssim,
        ms_ssim_point: point.ms_ssim,
        ms_ssim_pixel: pixel.ms_ssim,
        ms_ssim_supersampled: supersampled.ms_ssim,
        diffraction_efficiency_point: point.diffraction_efficiency,
        diffraction_efficiency_pixel: pixel.diffraction_efficiency,
        diffraction_efficiency_supersampled: supersampled.diffraction_efficiency,
        frame_efficiency_point: point.frame_efficiency,
        frame_efficiency_pixel: pixel.frame_efficiency,
        frame_efficiency_supersampled: supersampled.frame_efficiency,
        speckle_contrast_point: point.speckle_contrast,
        speckle_contrast_pixel: pixel.speckle_contrast,
        speckle_contrast_supersampled: supersampled.speckle_contrast,
    }
}
