//! Access rules: which roles may make each call, and what the call needs of the disk. The path of the call decides,
//! before its handler runs. A call without a rule is refused.

use lightpath_domain::access::Role;

/// What a call needs of the server's disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Effect {
    /// The call needs no space.
    Reads,
    /// The call writes little about an existing resource, and is accepted as long as the disk has any space. Uploads
    /// check the space for their bytes themselves.
    Changes,
    /// The call creates new work, which must not use the reserve of the disk.
    Creates,
}

/// The callers that may make a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Access {
    /// Every client that can connect: such calls only reveal that the server is running.
    Everyone,
    /// Callers with one of these roles.
    Only(&'static [Role]),
}

/// The rule for a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Rule {
    pub(crate) access: Access,
    pub(crate) effect: Effect,
}

use Role::{Admin, Curator, Firmware, Rig, Submitter, Viewer};

const READERS: Access = Access::Only(&[Viewer, Submitter, Curator, Admin]);
const KERNEL_READERS: Access = Access::Only(&[Viewer, Submitter, Curator, Firmware, Admin]);
const SUBMITTERS: Access = Access::Only(&[Submitter, Curator, Admin]);
const CURATORS: Access = Access::Only(&[Curator, Admin]);
/// Devices, and people who try what devices do.
const REPORTERS: Access = Access::Only(&[Curator, Firmware, Admin]);
/// Rigs, and people who try what rigs do.
const RIGS: Access = Access::Only(&[Rig, Admin]);
/// Those who read files, and rigs, which read patterns.
const FILE_READERS: Access = Access::Only(&[Viewer, Submitter, Curator, Rig, Admin]);
/// Those who upload files.
const UPLOADERS: Access = Access::Only(&[Submitter, Curator, Rig, Admin]);
/// Those who read a display: also its devices and its rig.
const DISPLAY_READERS: Access = Access::Only(&[Viewer, Submitter, Curator, Firmware, Rig, Admin]);
const ADMINS: Access = Access::Only(&[Admin]);

const fn rule(access: Access, effect: Effect) -> Rule {
    Rule { access, effect }
}

/// Rules for the methods of the API.
pub(crate) const METHODS: &[(&str, Rule)] = &[
    ("ArtifactService/GetArtifact", rule(READERS, Effect::Reads)),
    ("ArtifactService/GetUpload", rule(UPLOADERS, Effect::Reads)),
    ("ArtifactService/WriteArtifact", rule(UPLOADERS, Effect::Changes)),
    ("ArtifactService/ReadArtifact", rule(FILE_READERS, Effect::Reads)),
    ("DatasetService/CreateDataset", rule(SUBMITTERS, Effect::Creates)),
    ("DatasetService/GetDataset", rule(READERS, Effect::Reads)),
    ("DatasetService/ListDatasets", rule(READERS, Effect::Reads)),
    ("DatasetService/ListPairs", rule(READERS, Effect::Reads)),
    ("DatasetService/AddPairs", rule(SUBMITTERS, Effect::Creates)),
    ("DatasetService/DeleteDataset", rule(CURATORS, Effect::Changes)),
    ("DatasetService/CreateCalibrationTarget", rule(SUBMITTERS, Effect::Creates)),
    ("DisplayService/CreateDisplay", rule(ADMINS, Effect::Creates)),
    ("DisplayService/GetDisplay", rule(DISPLAY_READERS, Effect::Reads)),
    ("DisplayService/ListDisplays", rule(READERS, Effect::Reads)),
    ("DisplayService/UpdateDisplay", rule(ADMINS, Effect::Changes)),
    ("DisplayService/DeleteDisplay", rule(ADMINS, Effect::Changes)),
    ("DisplayService/PlanPropagation", rule(READERS, Effect::Reads)),
    ("EventService/WatchEvents", rule(READERS, Effect::Reads)),
    ("JobService/SubmitJob", rule(SUBMITTERS, Effect::Creates)),
    ("JobService/SubmitJobs", rule(SUBMITTERS, Effect::Creates)),
    // It decodes pictures as SubmitJob does, so it is for those who may submit.
    ("JobService/EstimateJob", rule(SUBMITTERS, Effect::Reads)),
    ("JobService/GetJob", rule(READERS, Effect::Reads)),
    ("JobService/ListJobs", rule(READERS, Effect::Reads)),
    ("JobService/WatchJob", rule(READERS, Effect::Reads)),
    ("JobService/CancelJob", rule(SUBMITTERS, Effect::Changes)),
    ("JobService/RetryJob", rule(SUBMITTERS, Effect::Creates)),
    ("JobService/ListJobEvents", rule(READERS, Effect::Reads)),
    ("JobService/GetBatch", rule(READERS, Effect::Reads)),
    ("JobService/GetQueue", rule(READERS, Effect::Reads)),
    ("JobService/PauseQueue", rule(ADMINS, Effect::Changes)),
    ("JobService/ResumeQueue", rule(ADMINS, Effect::Changes)),
    ("KernelService/GetKernel", rule(KERNEL_READERS, Effect::Reads)),
    ("KernelService/ListKernels", rule(KERNEL_READERS, Effect::Reads)),
    ("KernelService/GetKernelVersion", rule(KERNEL_READERS, Effect::Reads)),
    ("KernelService/ListKernelVersions", rule(KERNEL_READERS, Effect::Reads)),
    ("KernelService/FetchKernel", rule(KERNEL_READERS, Effect::Reads)),
    ("KernelService/GetKernelManifest", rule(KERNEL_READERS, Effect::Reads)),
    ("KernelService/GetKeyring", rule(KERNEL_READERS, Effect::Reads)),
    ("KernelService/WatchKernel", rule(KERNEL_READERS, Effect::Reads)),
    ("KernelService/PromoteKernel", rule(CURATORS, Effect::Changes)),
    ("KernelService/CheckPromotion", rule(READERS, Effect::Reads)),
    ("KernelService/SetPromotionGate", rule(CURATORS, Effect::Changes)),
    ("KernelService/GetPromotionGate", rule(READERS, Effect::Reads)),
    ("KernelService/SetKernelAlias", rule(CURATORS, Effect::Changes)),
    ("KernelService/DeprecateKernelVersion", rule(CURATORS, Effect::Changes)),
    ("KernelService/CompareKernelVersions", rule(READERS, Effect::Reads)),
    ("KernelService/FindNearestKernels", rule(KERNEL_READERS, Effect::Reads)),
    ("KernelService/RollbackKernel", rule(CURATORS, Effect::Changes)),
    ("KernelService/ListKernelMoves", rule(READERS, Effect::Reads)),
    ("KernelService/ImportKernel", rule(CURATORS, Effect::Creates)),
    ("KernelService/InterpolateKernel", rule(SUBMITTERS, Effect::Creates)),
    ("RolloutService/StartRollout", rule(CURATORS, Effect::Changes)),
    ("RolloutService/WidenRollout", rule(CURATORS, Effect::Changes)),
    ("RolloutService/CompleteRollout", rule(CURATORS, Effect::Changes)),
    ("RolloutService/HaltRollout", rule(CURATORS, Effect::Changes)),
    ("RolloutService/GetRollout", rule(READERS, Effect::Reads)),
    ("RolloutService/ListRollouts", rule(READERS, Effect::Reads)),
    ("DeviceService/ReportDevice", rule(REPORTERS, Effect::Changes)),
    ("DeviceService/ListDevices", rule(READERS, Effect::Reads)),
    ("DeviceService/SetDeviceGroup", rule(CURATORS, Effect::Changes)),
    ("DeviceService/DeleteDevice", rule(CURATORS, Effect::Changes)),
    ("RigService/ServeRig", rule(RIGS, Effect::Changes)),
    ("RigService/ListRigs", rule(READERS, Effect::Reads)),
    ("PhotoService/ScorePhoto", rule(SUBMITTERS, Effect::Creates)),
    // What a webhook learns leaves the server, so only admins may decide about it.
    ("WebhookService/CreateWebhook", rule(ADMINS, Effect::Creates)),
    ("WebhookService/GetWebhook", rule(ADMINS, Effect::Reads)),
    ("WebhookService/ListWebhooks", rule(ADMINS, Effect::Reads)),
    ("WebhookService/UpdateWebhook", rule(ADMINS, Effect::Changes)),
    ("WebhookService/TestWebhook", rule(ADMINS, Effect::Changes)),
    ("WebhookService/ListWebhookDeliveries", rule(ADMINS, Effect::Reads)),
    ("WebhookService/DeleteWebhook", rule(ADMINS, Effect::Changes)),
    ("ServerService/GetServer", rule(KERNEL_READERS, Effect::Reads)),
];

/// Rules for all other routes and paths.
const ROUTES: &[(&str, Rule)] = &[
    ("/healthz", rule(Access::Everyone, Effect::Reads)),
    // The page itself holds no secrets, and asks for a token.
    ("/", rule(Access::Everyone, Effect::Reads)),
    ("/page/{*file}", rule(Access::Everyone, Effect::Reads)),
    ("/metrics", rule(READERS, Effect::Reads)),
    ("/v1/artifacts/{digest}/content", rule(READERS, Effect::Reads)),
    ("/v1/artifacts/{digest}/picture", rule(READERS, Effect::Reads)),
    ("/v1/colormaps/{colormap}", rule(READERS, Effect::Reads)),
    ("/v1/jobs/{job}/picture", rule(READERS, Effect::Reads)),
    ("/v1/artifacts/{digest}/upload", rule(SUBMITTERS, Effect::Changes)),
    ("/v1/artifacts", rule(SUBMITTERS, Effect::Changes)),
    ("/openapi.json", rule(KERNEL_READERS, Effect::Reads)),
    ("/v1/keyring", rule(KERNEL_READERS, Effect::Reads)),
    ("/v1/displays/{display}/kernels/{kernel}/manifest", rule(KERNEL_READERS, Effect::Reads)),
    (
        "/v1/displays/{display}/kernels/{kernel}/versions/{version}/{format}/{digest}",
        rule(KERNEL_READERS, Effect::Reads),
    ),
    ("/v1/displays/{display}/kernels/{kernel}/versions/{version}/file", rule(KERNEL_READERS, Effect::Reads)),
    ("/grpc.health.v1.Health/Check", rule(Access::Everyone, Effect::Reads)),
    ("/grpc.health.v1.Health/Watch", rule(Access::Everyone, Effect::Reads)),
    ("/grpc.reflection.v1.ServerReflection/ServerReflectionInfo", rule(READERS, Effect::Reads)),
    ("/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", rule(READERS, Effect::Reads)),
];

/// The rule for a path of the API with another verb. The answer only names the right verbs.
pub(crate) const WRONG_VERB: Rule = rule(DISPLAY_READERS, Effect::Reads);

/// The rule for a request, by its path or its route.
pub(crate) fn rule_of(path: &str, route: Option<&str>) -> Option<Rule> {
    if let Some(method) = path.strip_prefix("/lightpath.v1.") {
        return METHODS.iter().find(|(name, _)| *name == method).map(|(_, rule)| *rule);
    }
    ROUTES.iter().find(|(name, _)| *name == path || Some(*name) == route).map(|(_, rule)| *rule)
}

#[cfg(test)]
mod tests {
    use super::*;
    use prost::Message as _;

    #[test]
    fn every_method_has_a_rule_and_every_rule_a_method() {
        let set = prost_types::FileDescriptorSet::decode(lightpath_proto::DESCRIPTORS).unwrap();
        let services = set.file.into_iter().flat_map(|file| file.service);
        let mut methods: Vec<String> = services
            .flat_map(|service| {
                let name = service.name().to_owned();
                service.method.into_iter().map(move |method| format!("{name}/{}", method.name()))
            })
            .collect();
        let mut rules: Vec<&str> = METHODS.iter().map(|(name, _)| *name).collect();
        methods.sort();
        rules.sort_unstable();
        assert_eq!(methods, rules, "every method of the API needs a line in this file");
    }

    #[test]
    fn unknown_paths_have_no_rule() {
        for path in
            ["/page", "/v1", "/v1/jobs/", "/lightpath.v1.JobService/Other", "/lightpath.v1.JobService/GetJob/", "/x"]
        {
            assert_eq!(rule_of(path, None), None, "{path}");
        }
        let manifest = "/v1/displays/{display}/kernels/{kernel}/manifest";
        assert!(rule_of("/v1/displays/lab/kernels/red/manifest", Some(manifest)).is_some());
    }

    #[test]
    fn viewers_and_firmware_may_only_read_and_firmware_also_report() {
        for (name, rule) in METHODS.iter().chain(ROUTES) {
            let is_open = match rule.access {
                Access::Everyone => true,
                Access::Only(roles) => roles.contains(&Viewer) || roles.contains(&Firmware),
            };
            let is_report = rule.access == REPORTERS && name.to_ascii_lowercase().contains("report");
            assert!(!is_open || rule.effect == Effect::Reads || is_report, "{name}");
        }
    }
}
