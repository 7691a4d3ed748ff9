//! A valid request for every method. Names such as `$near` stand for the things of a world.

use super::person::Person;
use super::world::{WEBHOOK_ORIGIN, World};
use lightpath_proto::v1;
use prost::Message;
use prost::bytes::Bytes;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use tonic::{Code, Status};

/// Content of the artifact that the examples upload.
pub(super) const UPLOADED: &[u8] = b"uploaded";
/// Digest that a device reports. It names nothing on the server.
const DIGEST: &str = "sha256-0000000000000000000000000000000000000000000000000000000000000000";

/// Messages for a method, and the answer to a caller who may use everything that they name.
#[derive(Clone)]
pub(super) struct Example {
    pub(super) method: &'static str,
    pub(super) messages: Vec<Value>,
    pub(super) answer: Code,
    encode: fn(&Value) -> Vec<u8>,
}

impl Example {
    fn new<M: Message + DeserializeOwned>(method: &'static str, message: Value) -> Self {
        let encode = |message: &Value| serde_json::from_value::<M>(message.clone()).unwrap().encode_to_vec();
        Self { method, messages: vec![message], answer: Code::Ok, encode }
    }

    fn then(mut self, message: Value) -> Self {
        self.messages.push(message);
        self
    }

    /// The example, whose answer has this code.
    fn refused(self, answer: Code) -> Self {
        Self { answer, ..self }
    }

    /// The messages with the names of a world.
    pub(super) fn in_world(&self, world: &World) -> Vec<Value> {
        self.messages.iter().map(|message| world.resolved(message)).collect()
    }

    pub(super) async fn send(&self, person: &Person<'_>, messages: &[Value]) -> Result<Vec<Bytes>, Status> {
        person.send(self.method, messages.iter().map(self.encode).collect()).await
    }
}

/// Examples for every method, in an order in which all succeed one after the other.
pub(super) fn examples() -> Vec<Example> {
    [
        artifacts(),
        datasets(),
        displays(),
        jobs(),
        holograms(),
        other_jobs(),
        kernels(),
        rollouts(),
        changes_of_kernels(),
        devices(),
        photos_and_rigs(),
        webhooks(),
        last(),
    ]
    .concat()
}

fn artifacts() -> Vec<Example> {
    use base64_of as base64;
    let size = UPLOADED.len();
    vec![
        Example::new::<v1::GetArtifactRequest>("ArtifactService/GetArtifact", json!({ "digest": "$target" })),
        Example::new::<v1::GetUploadRequest>("ArtifactService/GetUpload", json!({ "digest": "$target" })),
        Example::new::<v1::GetUploadRequest>("ArtifactService/GetUpload", json!({ "digest": "$upload" })),
        Example::new::<v1::WriteArtifactRequest>(
            "ArtifactService/WriteArtifact",
            json!({ "start": { "digest": "$uploaded", "size_bytes": size } }),
        )
        .then(json!({ "chunk": base64(UPLOADED) })),
        // A caller cannot continue the upload of another.
        Example::new::<v1::WriteArtifactRequest>(
            "ArtifactService/WriteArtifact",
            json!({ "start": { "digest": "$upload", "size_bytes": 100, "offset_bytes": 50 } }),
        )
        .refused(Code::Aborted),
        Example::new::<v1::ReadArtifactRequest>("ArtifactService/ReadArtifact", json!({ "digest": "$target" })),
    ]
}

fn datasets() -> Vec<Example> {
    let pair = json!({ "id": "new", "pattern": "$pair_phase", "photo": "$pair_photo" });
    vec![
        Example::new::<v1::CreateDatasetRequest>(
            "DatasetService/CreateDataset",
            json!({ "dataset": { "name": "$new_dataset", "display": "$display", "place": { "distance_m": 4e-3 } } }),
        ),
        Example::new::<v1::GetDatasetRequest>("DatasetService/GetDataset", json!({ "name": "$near" })),
        Example::new::<v1::ListDatasetsRequest>(
            "DatasetService/ListDatasets",
            json!({ "display": "$display", "page_size": 1, "page_token": "" }),
        ),
        Example::new::<v1::ListPairsRequest>(
            "DatasetService/ListPairs",
            json!({ "dataset": "$near", "page_size": 1, "page_token": "" }),
        ),
        Example::new::<v1::AddPairsRequest>("DatasetService/AddPairs", json!({ "dataset": "$open", "pairs": [pair] })),
        Example::new::<v1::DeleteDatasetRequest>("DatasetService/DeleteDataset", json!({ "name": "$new_dataset" })),
        Example::new::<v1::CreateCalibrationTargetRequest>(
            "DatasetService/CreateCalibrationTarget",
            json!({ "display": "$spare" }),
        ),
    ]
}

fn displays() -> Vec<Example> {
    let spare = json!({ "name": "$spare", "modulator": { "width_px": 128, "height_px": 96, "pixel_pitch_x_m": 8e-6 }, "wavelengths_m": [515e-9] });
    vec![
        Example::new::<v1::CreateDisplayRequest>("DisplayService/CreateDisplay", json!({ "display": spare })),
        Example::new::<v1::GetDisplayRequest>("DisplayService/GetDisplay", json!({ "name": "$display" })),
        Example::new::<v1::ListDisplaysRequest>(
            "DisplayService/ListDisplays",
            json!({ "page_size": 1, "page_token": "" }),
        ),
        Example::new::<v1::UpdateDisplayRequest>(
            "DisplayService/UpdateDisplay",
            json!({ "display": { "name": "$spare", "notes": "why" } }),
        ),
        Example::new::<v1::PlanPropagationRequest>(
            "DisplayService/PlanPropagation",
            json!({ "display": "$display", "place": { "distance_m": 4e-3 } }),
        ),
    ]
}

fn jobs() -> Vec<Example> {
    let named = |key: &str| json!({ "name": key });
    vec![
        Example::new::<v1::GetJobRequest>("JobService/GetJob", named("$ended")),
        Example::new::<v1::GetJobRequest>("JobService/GetJob", named("$mixed")),
        Example::new::<v1::GetJobRequest>("JobService/GetJob", named("$failed")),
        Example::new::<v1::WatchEventsRequest>("EventService/WatchEvents", json!({ "last_event_id": "" })),
        Example::new::<v1::WatchJobRequest>("JobService/WatchJob", named("$waiting")),
        Example::new::<v1::WatchJobRequest>("JobService/WatchJob", named("$failed")),
        Example::new::<v1::ListJobsRequest>(
            "JobService/ListJobs",
            json!({ "display": "$display", "batch": "$batch", "page_size": 1, "page_token": "" }),
        ),
        Example::new::<v1::ListJobsRequest>("JobService/ListJobs", json!({ "display": "$display" })),
        Example::new::<v1::ListJobsRequest>(
            "JobService/ListJobs",
            json!({ "display": "$display", "owner": "ada", "since": "2026-01-01T00:00:00Z", "text": "a", "view": "VIEW_BASIC" }),
        ),
        Example::new::<v1::ListJobsRequest>("JobService/ListJobs", json!({ "display": "$display", "id_prefix": "0" })),
        Example::new::<v1::ListJobEventsRequest>(
            "JobService/ListJobEvents",
            json!({ "name": "$ended", "page_size": 1, "page_token": "" }),
        ),
        Example::new::<v1::ListJobEventsRequest>("JobService/ListJobEvents", named("$failed")),
        // The jobs of a batch and of the queue may be about any display.
        Example::new::<v1::GetBatchRequest>("JobService/GetBatch", json!({ "batch": "$batch" }))
            .refused(Code::PermissionDenied),
        Example::new::<v1::GetQueueRequest>("JobService/GetQueue", json!({})).refused(Code::PermissionDenied),
        Example::new::<v1::RetryJobRequest>("JobService/RetryJob", named("$failed")).refused(Code::FailedPrecondition),
        Example::new::<v1::RetryJobRequest>("JobService/RetryJob", named("$cancelled")),
    ]
}

fn submit_all(specs: &[Value]) -> Example {
    let requests: Vec<Value> = specs.iter().map(|spec| json!({ "spec": spec, "owner": "$owner" })).collect();
    Example::new::<v1::SubmitJobsRequest>("JobService/SubmitJobs", json!({ "requests": requests }))
}

fn submit(spec: Value) -> Example {
    let message = json!({ "spec": spec, "owner": "$owner", "after": ["$waiting"] });
    Example::new::<v1::SubmitJobRequest>("JobService/SubmitJob", message)
}

fn holograms() -> Vec<Example> {
    let plane = |distance_m: f64| json!({ "place": { "distance_m": distance_m }, "target": "$target" });
    let one_plane = json!({
        "display": "$display",
        "planes": [plane(4e-3)],
        "kernel": { "version": "$version" },
        "initial_phase": { "given": { "phases": ["$phase_npy"] } },
        "weight_mask": "$target",
    });
    let two_planes = json!({ "display": "$display", "planes": [plane(4e-3), plane(6e-3)], "depth_map": "$target", "kernel": { "ideal": {} } });
    let estimated = json!({ "spec": { "optimize_hologram": &one_plane } });
    vec![
        Example::new::<v1::EstimateJobRequest>("JobService/EstimateJob", estimated),
        submit(json!({ "optimize_hologram": one_plane })),
        submit(json!({ "optimize_hologram": two_planes })),
    ]
}

fn other_jobs() -> Vec<Example> {
    vec![
        submit(json!({ "learn_kernel": { "datasets": ["$near", "$far"], "start_version": "$version" } })),
        submit(
            json!({ "simulate_capture": { "display": "$display", "place": { "distance_m": 4e-3 }, "pattern": "$levels" } }),
        ),
        submit(json!({ "evaluate_kernel": { "dataset": "$near", "kernel": { "version": "$version" } } })),
        submit_all(&[
            json!({ "evaluate_kernel": { "dataset": "$near", "kernel": { "version": "$version" } } }),
            json!({ "report_kernel": { "kernel_version": "$version" } }),
        ]),
        submit(json!({ "prepare_dataset": { "dataset": "$open", "align": { "dots_photo": "$pair_photo" } } })),
        submit(json!({ "report_kernel": { "kernel_version": "$version" } })),
        submit(json!({ "suggest_holograms": { "kernel_version": "$learned_version", "holograms": 1 } })),
        submit(json!({ "verify_hologram": { "job": "$hologram" } })),
        submit(json!({ "capture_photos": {
            "display": "$display",
            "place": { "distance_m": 4e-3 },
            "patterns": [{ "id": "p", "pattern": "$phase_npy" }],
        } })),
        submit(json!({ "capture_photos": { "display": "$display", "aligned_by": "$near" } }))
            .refused(Code::InvalidArgument),
    ]
}

fn kernels() -> Vec<Example> {
    let page = json!({ "kernel": "$kernel", "page_size": 1, "page_token": "" });
    vec![
        Example::new::<v1::GetKernelRequest>("KernelService/GetKernel", json!({ "name": "$kernel" })),
        Example::new::<v1::ListKernelsRequest>(
            "KernelService/ListKernels",
            json!({ "display": "$display", "page_size": 1, "page_token": "" }),
        ),
        Example::new::<v1::GetKernelVersionRequest>("KernelService/GetKernelVersion", json!({ "name": "$version" })),
        Example::new::<v1::ListKernelVersionsRequest>("KernelService/ListKernelVersions", page.clone()),
        Example::new::<v1::FetchKernelRequest>(
            "KernelService/FetchKernel",
            json!({ "kernel": "$kernel", "version": "$number" }),
        ),
        Example::new::<v1::GetKernelManifestRequest>("KernelService/GetKernelManifest", json!({ "kernel": "$kernel" })),
        Example::new::<v1::GetKeyringRequest>("KernelService/GetKeyring", json!({})),
        Example::new::<v1::GetServerRequest>("ServerService/GetServer", json!({})),
        Example::new::<v1::WatchKernelRequest>("KernelService/WatchKernel", json!({ "name": "$kernel" })),
        Example::new::<v1::ListKernelMovesRequest>("KernelService/ListKernelMoves", page),
        Example::new::<v1::CheckPromotionRequest>("KernelService/CheckPromotion", json!({ "name": "$version" })),
        Example::new::<v1::GetPromotionGateRequest>("KernelService/GetPromotionGate", json!({ "display": "$display" })),
        Example::new::<v1::CompareKernelVersionsRequest>(
            "KernelService/CompareKernelVersions",
            json!({ "first": "$learned_version", "second": "$version" }),
        ),
        Example::new::<v1::FindNearestKernelsRequest>(
            "KernelService/FindNearestKernels",
            json!({ "display": "$display", "place": { "distance_m": 4.5e-3 } }),
        ),
    ]
}

fn changes_of_kernels() -> Vec<Example> {
    let rollback = json!({ "kernel": "$kernel", "reason": "why", "expected_active_version": "$number" });
    let mut promotion = rollback.clone();
    promotion["version"] = "$number".into();
    let at = |distance_m: f64| json!({ "display": "$display", "place": { "distance_m": distance_m } });
    let mut file = at(4e-3);
    file["artifact"] = "$file".into();
    let gate = json!({ "display": "$display", "gate": { "worse_than_ideal_allowed": true }, "reason": "why" });
    let alias = json!({ "kernel": "$kernel", "alias": "candidate", "version": "$number", "reason": "why" });
    let mut next_alias = alias.clone();
    next_alias["version"] = 1.into();
    next_alias["expected_version"] = "$number".into();
    let deprecation = json!({ "name": "$version", "reason": "why" });
    vec![
        Example::new::<v1::SetPromotionGateRequest>("KernelService/SetPromotionGate", gate),
        Example::new::<v1::SetKernelAliasRequest>("KernelService/SetKernelAlias", alias),
        Example::new::<v1::SetKernelAliasRequest>("KernelService/SetKernelAlias", next_alias),
        Example::new::<v1::PromoteKernelRequest>("KernelService/PromoteKernel", promotion),
        Example::new::<v1::RollbackKernelRequest>("KernelService/RollbackKernel", rollback),
        Example::new::<v1::ImportKernelRequest>("KernelService/ImportKernel", file),
        Example::new::<v1::InterpolateKernelRequest>("KernelService/InterpolateKernel", at(5e-3)),
        Example::new::<v1::DeprecateKernelVersionRequest>("KernelService/DeprecateKernelVersion", deprecation),
    ]
}

fn started() -> Value {
    json!({ "kernel": "$kernel", "version": "$number", "share": 0.05, "group": "first", "reason": "why", "force": true })
}

fn rollouts() -> Vec<Example> {
    let list = json!({ "kernel": "$far_kernel", "page_size": 1, "page_token": "" });
    let mut start = started();
    start["version"] = 1.into();
    start["expected_active_version"] = "$number".into();
    let halt = json!({ "name": "$next_rollout", "reason": "why" });
    vec![
        Example::new::<v1::GetRolloutRequest>("RolloutService/GetRollout", json!({ "name": "$rollout" })),
        Example::new::<v1::ListRolloutsRequest>("RolloutService/ListRollouts", list),
        Example::new::<v1::WidenRolloutRequest>(
            "RolloutService/WidenRollout",
            json!({ "name": "$rollout", "share": 0.5 }),
        ),
        Example::new::<v1::CompleteRolloutRequest>("RolloutService/CompleteRollout", json!({ "name": "$rollout" })),
        Example::new::<v1::StartRolloutRequest>("RolloutService/StartRollout", start),
        Example::new::<v1::HaltRolloutRequest>("RolloutService/HaltRollout", halt),
    ]
}

fn devices() -> Vec<Example> {
    let list = json!({ "display": "$display", "page_size": 1, "page_token": "" });
    let report = json!({
        "name": "$device", "kernel": "515nm-4mm", "version": "$number", "format": "compact", "digest": DIGEST,
        "generation": "1", "message": "why", "agent": "agent 1"
    });
    let trial = json!({ "name": "$device", "kernel": "515nm-4mm", "tried_version": "$number", "message": "why" });
    let group = json!({ "name": "$device", "group": "second" });
    vec![
        Example::new::<v1::ReportDeviceRequest>("DeviceService/ReportDevice", report).refused(Code::InvalidArgument),
        Example::new::<v1::ReportDeviceRequest>("DeviceService/ReportDevice", trial),
        Example::new::<v1::ListDevicesRequest>("DeviceService/ListDevices", list),
        Example::new::<v1::SetDeviceGroupRequest>("DeviceService/SetDeviceGroup", group),
        Example::new::<v1::DeleteDeviceRequest>("DeviceService/DeleteDevice", json!({ "name": "$device" })),
    ]
}

fn photos_and_rigs() -> Vec<Example> {
    let request = json!({ "photo": "$target", "target": "$target" });
    let rig = json!({ "description": {
        "name": "$rig",
        "program": "rig 1",
        "slm": { "width_px": 64, "height_px": 48, "bit_depth": 8 },
        "camera": {
            "width_px": 64, "height_px": 48, "bit_depth": 8, "exposure_min_s": 0.001, "exposure_max_s": 1.0
        },
        "wavelengths_m": [515e-9],
        "place": { "distance_m": 4e-3 },
    } });
    vec![
        Example::new::<v1::ScorePhotoRequest>("PhotoService/ScorePhoto", request),
        Example::new::<v1::ServeRigRequest>("RigService/ServeRig", rig),
        Example::new::<v1::ListRigsRequest>("RigService/ListRigs", json!({})),
    ]
}

fn webhooks() -> Vec<Example> {
    let named = |key: &str| json!({ "name": key });
    let create = json!({
        "id": "$new_webhook_id", "url": WEBHOOK_ORIGIN, "events": ["job.failed"], "display": "$display"
    });
    let list = json!({ "webhook": "$webhook", "page_size": 1, "page_token": "" });
    vec![
        Example::new::<v1::CreateWebhookRequest>("WebhookService/CreateWebhook", create),
        Example::new::<v1::GetWebhookRequest>("WebhookService/GetWebhook", named("$webhook")),
        Example::new::<v1::ListWebhooksRequest>("WebhookService/ListWebhooks", json!({})),
        Example::new::<v1::UpdateWebhookRequest>(
            "WebhookService/UpdateWebhook",
            json!({ "webhook": { "name": "$webhook", "display": "$display" } }),
        ),
        Example::new::<v1::TestWebhookRequest>("WebhookService/TestWebhook", named("$webhook")),
        Example::new::<v1::ListWebhookDeliveriesRequest>("WebhookService/ListWebhookDeliveries", list),
        Example::new::<v1::DeleteWebhookRequest>("WebhookService/DeleteWebhook", named("$new_webhook")),
    ]
}

/// Changes after which some of the other examples would not succeed.
fn last() -> Vec<Example> {
    vec![
        Example::new::<v1::CancelJobRequest>("JobService/CancelJob", json!({ "name": "$waiting" })),
        Example::new::<v1::StartRolloutRequest>("RolloutService/StartRollout", started()),
        Example::new::<v1::PauseQueueRequest>(
            "JobService/PauseQueue",
            json!({ "display": "$display", "reason": "why" }),
        ),
        Example::new::<v1::ResumeQueueRequest>("JobService/ResumeQueue", json!({ "display": "$display" })),
        Example::new::<v1::DeleteDisplayRequest>("DisplayService/DeleteDisplay", json!({ "name": "$spare" })),
    ]
}

/// Bytes as the JSON form of protobuf writes them.
fn base64_of(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let of_chunk = |chunk: &[u8]| -> String {
        let number = (0..3).fold(0_u32, |number, i| number << 8 | u32::from(chunk.get(i).copied().unwrap_or(0)));
        let digit = |i: usize| char::from(DIGITS[(number >> (18 - 6 * i)) as usize & 63]);
        (0..4).map(|i| if i <= chunk.len() { digit(i) } else { '=' }).collect()
    };
    bytes.chunks(3).map(of_chunk).collect()
}
