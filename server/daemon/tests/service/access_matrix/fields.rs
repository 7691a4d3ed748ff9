//! What each field of each request names.

use super::examples::{Example, examples};
use crate::raw;
use prost::Message as _;
use prost_types::field_descriptor_proto::Type;
use prost_types::{DescriptorProto, FieldDescriptorProto};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};

/// What a field names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Names {
    Display,
    Dataset,
    /// The id of a new dataset or webhook. Another one may have it.
    NewId,
    Job,
    Kernel,
    KernelVersion,
    Rollout,
    Device,
    Webhook,
    /// A version of the kernel that another field names.
    VersionNumber,
    Artifact,
    /// An artifact that is uploaded. Everyone who has its bytes may upload it.
    Upload,
    Batch,
    Owner,
    /// A text that the caller chooses for a new job.
    Label,
    PageToken,
    /// Something inside the resource that another field names, or a text for people.
    Nothing,
    /// The field is a message, whose fields have lines of their own.
    Parts,
    /// The server ignores the field in requests.
    Ignored,
}

use Names::{
    Artifact, Batch, Dataset, Device, Display, Ignored, Job, Kernel, KernelVersion, Label, NewId, Nothing, Owner,
    PageToken, Parts, Rollout, Upload, VersionNumber, Webhook,
};

/// All fields of requests that are texts, messages or numbers of versions.
#[rustfmt::skip]
const FIELDS: &[(&str, Names)] = &[
    ("GetArtifactRequest.digest", Artifact),
    ("GetUploadRequest.digest", Upload),
    ("WriteArtifactRequest.start", Parts),
    ("WriteArtifactStart.digest", Upload),
    ("ReadArtifactRequest.digest", Artifact),

    ("CreateDatasetRequest.dataset", Parts),
    ("Dataset.name", NewId),
    ("Dataset.display", Display),
    ("Dataset.place", Parts),
    ("Dataset.split_counts", Ignored),
    ("Dataset.digest", Ignored),
    ("Dataset.create_time", Ignored),
    ("Dataset.finalize_time", Ignored),
    ("Dataset.alignment", Ignored),
    ("Dataset.findings", Ignored),
    ("GetDatasetRequest.name", Dataset),
    ("ListDatasetsRequest.page_token", PageToken),
    ("ListDatasetsRequest.display", Display),
    ("ListPairsRequest.dataset", Dataset),
    ("ListPairsRequest.page_token", PageToken),
    ("AddPairsRequest.dataset", Dataset),
    ("AddPairsRequest.pairs", Parts),
    ("Pair.id", Nothing),
    ("Pair.pattern", Artifact),
    ("Pair.photo", Artifact),
    ("Pair.checks", Ignored),
    ("Pair.findings", Ignored),
    ("DeleteDatasetRequest.name", Dataset),
    ("CreateCalibrationTargetRequest.display", Display),

    ("CreateDisplayRequest.display", Parts),
    ("Display.name", Display),
    ("Display.modulator", Parts),
    ("Modulator.phase", Parts),
    ("Display.first_order", Parts),
    ("Display.all_orders", Parts),
    ("Display.order_filter", Parts),
    ("Display.notes", Nothing),
    ("Display.simulated_bench", Parts),
    ("Display.create_time", Ignored),
    ("GetDisplayRequest.name", Display),
    ("ListDisplaysRequest.page_token", PageToken),
    ("UpdateDisplayRequest.display", Parts),
    ("UpdateDisplayRequest.update_mask", Nothing),
    ("DeleteDisplayRequest.name", Display),
    ("PlanPropagationRequest.display", Display),
    ("PlanPropagationRequest.place", Parts),
    ("PlanPropagationRequest.window", Parts),

    ("SubmitJobRequest.spec", Parts),
    ("SubmitJobRequest.request_id", Label),
    ("SubmitJobRequest.owner", Owner),
    ("SubmitJobRequest.batch", Label),
    ("SubmitJobRequest.unique_key", Label),
    ("SubmitJobRequest.not_before", Parts),
    ("SubmitJobRequest.after", Job),
    ("SubmitJobRequest.label", Nothing),
    ("SubmitJobRequest.needs", Nothing),
    ("JobSpec.optimize_hologram", Parts),
    ("JobSpec.learn_kernel", Parts),
    ("JobSpec.simulate_capture", Parts),
    ("JobSpec.evaluate_kernel", Parts),
    ("JobSpec.prepare_dataset", Parts),
    ("JobSpec.report_kernel", Parts),
    ("JobSpec.verify_hologram", Parts),
    ("JobSpec.suggest_holograms", Parts),
    ("JobSpec.capture_photos", Parts),
    ("OptimizeHologram.display", Display),
    ("OptimizeHologram.planes", Parts),
    ("OptimizeHologram.ImagePlane.target", Artifact),
    ("OptimizeHologram.ImagePlane.place", Parts),
    ("OptimizeHologram.depth_map", Artifact),
    ("OptimizeHologram.kernel", Parts),
    ("OptimizeHologram.initial_phase", Parts),
    ("OptimizeHologram.InitialPhase.random", Parts),
    ("OptimizeHologram.InitialPhase.back_propagated", Parts),
    ("OptimizeHologram.InitialPhase.quadratic", Parts),
    ("OptimizeHologram.InitialPhase.constant", Parts),
    ("OptimizeHologram.InitialPhase.given", Parts),
    ("OptimizeHologram.InitialPhase.Given.phases", Artifact),
    ("OptimizeHologram.loss", Parts),
    ("OptimizeHologram.region", Parts),
    ("OptimizeHologram.weight_mask", Artifact),
    ("LearnKernel.datasets", Dataset),
    ("LearnKernel.start_version", KernelVersion),
    ("LearnKernel.region", Parts),
    ("SimulateCapture.display", Display),
    ("SimulateCapture.place", Parts),
    ("SimulateCapture.pattern", Artifact),
    ("EvaluateKernel.dataset", Dataset),
    ("EvaluateKernel.kernel", Parts),
    ("KernelChoice.ideal", Parts),
    ("KernelChoice.active", Parts),
    ("KernelChoice.alias", Nothing),
    ("KernelChoice.version", KernelVersion),
    ("EvaluateKernel.region", Parts),
    ("PrepareDataset.dataset", Dataset),
    ("PrepareDataset.align", Parts),
    ("PrepareDataset.Align.points", Parts),
    ("AlignmentPoints.points", Parts),
    ("PrepareDataset.Align.dots_photo", Artifact),
    ("PrepareDataset.Align.pairs", Parts),
    ("PrepareDataset.Align.none", Parts),
    ("PrepareDataset.finalize", Parts),
    ("ReportKernel.kernel_version", KernelVersion),
    ("VerifyHologram.job", Job),
    ("SuggestHolograms.kernel_version", KernelVersion),
    ("CapturePhotos.display", Display),
    ("CapturePhotos.place", Parts),
    ("CapturePhotos.patterns", Parts),
    ("CapturePhotos.Pattern.id", Nothing),
    ("CapturePhotos.Pattern.pattern", Artifact),
    ("CapturePhotos.aligned_by", Dataset),
    ("SubmitJobsRequest.requests", Parts),
    ("EstimateJobRequest.spec", Parts),
    ("GetJobRequest.name", Job),
    ("ListJobsRequest.page_token", PageToken),
    ("ListJobsRequest.display", Display),
    ("ListJobsRequest.batch", Batch),
    ("ListJobsRequest.owner", Nothing),
    ("ListJobsRequest.since", Parts),
    ("ListJobsRequest.text", Nothing),
    ("ListJobsRequest.id_prefix", Nothing),
    ("WatchEventsRequest.last_event_id", Nothing),
    ("WatchJobRequest.name", Job),
    ("CancelJobRequest.name", Job),
    ("RetryJobRequest.name", Job),
    ("ListJobEventsRequest.name", Job),
    ("ListJobEventsRequest.page_token", PageToken),
    ("GetBatchRequest.batch", Batch),
    ("PauseQueueRequest.display", Display),
    ("PauseQueueRequest.reason", Nothing),
    ("ResumeQueueRequest.display", Display),

    ("GetKernelRequest.name", Kernel),
    ("ListKernelsRequest.page_token", PageToken),
    ("ListKernelsRequest.display", Display),
    ("ListKernelsRequest.place", Parts),
    ("GetKernelVersionRequest.name", KernelVersion),
    ("ListKernelVersionsRequest.kernel", Kernel),
    ("ListKernelVersionsRequest.page_token", PageToken),
    ("FetchKernelRequest.kernel", Kernel),
    ("FetchKernelRequest.version", VersionNumber),
    ("GetKernelManifestRequest.kernel", Kernel),
    ("GetKernelManifestRequest.device", Nothing),
    ("WatchKernelRequest.name", Kernel),
    ("PromoteKernelRequest.kernel", Kernel),
    ("PromoteKernelRequest.version", VersionNumber),
    ("PromoteKernelRequest.reason", Nothing),
    ("PromoteKernelRequest.expected_active_version", VersionNumber),
    ("CheckPromotionRequest.name", KernelVersion),
    ("SetPromotionGateRequest.display", Display),
    ("SetPromotionGateRequest.gate", Parts),
    ("SetPromotionGateRequest.reason", Nothing),
    ("PromotionGate.formats", Nothing),
    ("GetPromotionGateRequest.display", Display),
    ("SetKernelAliasRequest.kernel", Kernel),
    ("SetKernelAliasRequest.alias", Nothing),
    ("SetKernelAliasRequest.version", VersionNumber),
    ("SetKernelAliasRequest.reason", Nothing),
    ("SetKernelAliasRequest.expected_version", VersionNumber),
    ("DeprecateKernelVersionRequest.name", KernelVersion),
    ("DeprecateKernelVersionRequest.reason", Nothing),
    ("CompareKernelVersionsRequest.first", KernelVersion),
    ("CompareKernelVersionsRequest.second", KernelVersion),
    ("FindNearestKernelsRequest.display", Display),
    ("FindNearestKernelsRequest.place", Parts),
    ("RollbackKernelRequest.kernel", Kernel),
    ("RollbackKernelRequest.reason", Nothing),
    ("RollbackKernelRequest.expected_active_version", VersionNumber),
    ("ListKernelMovesRequest.kernel", Kernel),
    ("ListKernelMovesRequest.page_token", PageToken),
    ("ImportKernelRequest.display", Display),
    ("ImportKernelRequest.place", Parts),
    ("ImportKernelRequest.artifact", Artifact),
    ("ImportKernelRequest.request_id", Label),
    ("InterpolateKernelRequest.display", Display),
    ("InterpolateKernelRequest.place", Parts),
    ("InterpolateKernelRequest.request_id", Label),

    ("StartRolloutRequest.kernel", Kernel),
    ("StartRolloutRequest.version", VersionNumber),
    ("StartRolloutRequest.group", Nothing),
    ("StartRolloutRequest.reason", Nothing),
    ("StartRolloutRequest.request_id", Label),
    ("StartRolloutRequest.expected_active_version", VersionNumber),
    ("WidenRolloutRequest.name", Rollout),
    ("CompleteRolloutRequest.name", Rollout),
    ("HaltRolloutRequest.name", Rollout),
    ("HaltRolloutRequest.reason", Nothing),
    ("GetRolloutRequest.name", Rollout),
    ("ListRolloutsRequest.kernel", Kernel),
    ("ListRolloutsRequest.page_token", PageToken),
    ("ReportDeviceRequest.name", Device),
    ("ReportDeviceRequest.kernel", Nothing),
    ("ReportDeviceRequest.version", VersionNumber),
    ("ReportDeviceRequest.format", Nothing),
    ("ReportDeviceRequest.digest", Nothing),
    ("ReportDeviceRequest.tried_version", VersionNumber),
    ("ReportDeviceRequest.message", Nothing),
    ("ReportDeviceRequest.agent", Nothing),
    ("ListDevicesRequest.display", Display),
    ("ListDevicesRequest.page_token", PageToken),
    ("SetDeviceGroupRequest.name", Device),
    ("SetDeviceGroupRequest.group", Nothing),
    ("DeleteDeviceRequest.name", Device),

    ("ServeRigRequest.description", Parts),
    ("Rig.name", Display),
    ("Rig.program", Nothing),
    ("Rig.slm", Parts),
    ("Rig.camera", Parts),
    ("Rig.place", Parts),
    ("ServeRigRequest.taken", Parts),
    ("ServeRigRequest.Taken.take", Nothing),
    // An artifact, but of a rig that has described its bench: `rigs` tests it.
    ("ServeRigRequest.Taken.photo", Nothing),
    ("ServeRigRequest.Taken.levels_sha256", Nothing),
    ("ServeRigRequest.Taken.exposure_time", Parts),
    ("ServeRigRequest.failed", Parts),
    ("ServeRigRequest.Failed.take", Nothing),
    ("ServeRigRequest.Failed.message", Nothing),
    ("ScorePhotoRequest.photo", Artifact),
    ("ScorePhotoRequest.target", Artifact),
    ("ScorePhotoRequest.region", Parts),

    ("CreateWebhookRequest.id", NewId),
    ("CreateWebhookRequest.url", Nothing),
    ("CreateWebhookRequest.events", Nothing),
    ("CreateWebhookRequest.display", Display),
    ("GetWebhookRequest.name", Webhook),
    ("UpdateWebhookRequest.webhook", Parts),
    ("UpdateWebhookRequest.update_mask", Nothing),
    ("Webhook.name", Webhook),
    ("Webhook.url", Nothing),
    ("Webhook.events", Nothing),
    ("Webhook.display", Display),
    ("Webhook.caller", Ignored),
    ("Webhook.create_time", Ignored),
    ("Webhook.secret", Ignored),
    ("TestWebhookRequest.name", Webhook),
    ("ListWebhookDeliveriesRequest.webhook", Webhook),
    ("ListWebhookDeliveriesRequest.page_token", PageToken),
    ("DeleteWebhookRequest.name", Webhook),
];

fn names_of(field: &str) -> Option<Names> {
    FIELDS.iter().find(|(known, _)| *known == field).map(|(_, names)| *names)
}

/// A name in an example.
#[derive(Clone, Debug)]
pub(super) struct Reference {
    /// Place in the first message, as a JSON pointer.
    pub(super) pointer: String,
    /// Key of the name in every world, such as `$near`.
    pub(super) key: String,
    pub(super) names: Names,
    field: String,
}

/// The messages of the API and the requests of its methods.
pub(super) struct Api {
    messages: BTreeMap<String, DescriptorProto>,
    /// Name of the request message of each method.
    requests: BTreeMap<String, String>,
}

impl Api {
    pub(super) fn read() -> Self {
        let set = prost_types::FileDescriptorSet::decode(lightpath_proto::DESCRIPTORS).unwrap();
        let (mut messages, mut requests) = (BTreeMap::new(), BTreeMap::new());
        for file in set.file {
            for service in &file.service {
                for method in &service.method {
                    let name = format!("{}/{}", service.name(), method.name());
                    requests.insert(name, short(method.input_type()).to_owned());
                }
            }
            for message in file.message_type {
                add_message(&mut messages, message.name().to_owned(), message);
            }
        }
        Self { messages, requests }
    }

    /// The names of all methods, such as `JobService/GetJob`.
    pub(super) fn methods(&self) -> impl Iterator<Item = &str> {
        self.requests.keys().map(String::as_str)
    }

    /// The names in the first message of an example.
    pub(super) fn references(&self, example: &Example) -> Vec<Reference> {
        let mut found = Vec::new();
        self.find(&self.requests[example.method], &example.messages[0], "", &mut found);
        found
    }

    fn find(&self, message: &str, value: &Value, at: &str, found: &mut Vec<Reference>) {
        for (name, value) in value.as_object().unwrap() {
            let field = self.messages[message].field.iter().find(|field| field.name() == name).unwrap();
            let items = match value {
                Value::Array(items) => {
                    items.iter().enumerate().map(|(i, item)| (format!("{at}/{name}/{i}"), item)).collect()
                }
                one => vec![(format!("{at}/{name}"), one)],
            };
            for (pointer, item) in items {
                match item {
                    Value::Object(_) => self.find(short(field.type_name()), item, &pointer, found),
                    Value::String(key) if key.starts_with('$') => {
                        let field = format!("{message}.{name}");
                        let names = names_of(&field).unwrap();
                        found.push(Reference { pointer, key: key.clone(), names, field });
                    }
                    _ => {}
                }
            }
        }
    }

    /// The fields of all requests that need a line in the table.
    fn fields(&self) -> BTreeSet<String> {
        let (mut fields, mut visited) = (BTreeSet::new(), BTreeSet::new());
        let mut waiting: Vec<String> = self.requests.values().cloned().collect();
        while let Some(message) = waiting.pop() {
            if !visited.insert(message.clone()) {
                continue;
            }
            let Some(descriptor) = self.messages.get(&message) else { continue };
            for field in descriptor.field.iter().filter(|field| may_name(field)) {
                let name = format!("{message}.{}", field.name());
                if field.r#type() == Type::Message && names_of(&name) != Some(Ignored) {
                    waiting.push(short(field.type_name()).to_owned());
                }
                fields.insert(name);
            }
        }
        fields
    }
}

fn add_message(messages: &mut BTreeMap<String, DescriptorProto>, name: String, message: DescriptorProto) {
    for nested in &message.nested_type {
        add_message(messages, format!("{name}.{}", nested.name()), nested.clone());
    }
    messages.insert(name, message);
}

/// A type's name without the package of the API.
fn short(type_name: &str) -> &str {
    type_name.strip_prefix(".lightpath.v1.").unwrap_or(type_name)
}

fn may_name(field: &FieldDescriptorProto) -> bool {
    matches!(field.r#type(), Type::String | Type::Message) || field.name().contains("version")
}

#[test]
fn the_table_has_every_field_and_every_name_has_an_example() {
    let api = Api::read();
    let table: BTreeSet<String> = FIELDS.iter().map(|(field, _)| (*field).to_owned()).collect();
    let fields = api.fields();
    let different: Vec<&String> = fields.symmetric_difference(&table).collect();
    assert!(different.is_empty(), "every field of a request needs a line that says what it names: {different:?}");
    let examples = examples();
    let with_example: BTreeSet<&str> = examples.iter().map(|example| example.method).collect();
    assert_eq!(api.methods().collect::<BTreeSet<_>>(), with_example, "every method needs an example");
    assert_eq!(raw::methods().len(), with_example.len());
    let named: BTreeSet<String> =
        examples.iter().flat_map(|example| api.references(example)).map(|reference| reference.field).collect();
    let needed = FIELDS.iter().filter(|(_, names)| !matches!(names, Label | PageToken | Nothing | Parts | Ignored));
    let needed: BTreeSet<String> = needed.map(|(field, _)| (*field).to_owned()).collect();
    assert_eq!(named, needed, "every field with a name needs an example with a name of a world");
}
