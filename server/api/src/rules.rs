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
    Steers,
    /// The call creates new work, which must not use the reserve of the disk.
    Takes,
}

/// The callers that may make a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Access {
    /// Every client that can connect: such calls only reveal that the server is running.
    Anybody,
    /// Callers with one of these roles.
    Only(&'static [Role]),
}

/// The rule for a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Rule {
    pub(crate) access: Access,
    pub(crate) effect: Effect,
}

use Role::{Admin, Curator, Firmware, Submitter, Viewer};

const LOOK: Access = Access::Only(&[Viewer, Submitter, Curator, Admin]);
const FETCH: Access = Access::Only(&[Viewer, Submitter, Curator, Firmware, Admin]);
const WORK: Access = Access::Only(&[Submitter, Curator, Admin]);
const DECIDE: Access = Access::Only(&[Curator, Admin]);
const RUN: Access = Access::Only(&[Admin]);

const fn rule(access: Access, effect: Effect) -> Rule {
    Rule { access, effect }
}

/// Rules for the methods of the API.
pub(crate) const METHODS: &[(&str, Rule)] = &[
    ("ArtifactService/GetArtifact", rule(LOOK, Effect::Reads)),
    ("ArtifactService/GetUpload", rule(WORK, Effect::Reads)),
    ("ArtifactService/WriteArtifact", rule(WORK, Effect::Steers)),
    ("ArtifactService/ReadArtifact", rule(LOOK, Effect::Reads)),
    ("DatasetService/CreateDataset", rule(WORK, Effect::Takes)),
    ("DatasetService/GetDataset", rule(LOOK, Effect::Reads)),
    ("DatasetService/ListDatasets", rule(LOOK, Effect::Reads)),
    ("DatasetService/AddPair", rule(WORK, Effect::Takes)),
    ("DatasetService/CreateCalibrationTarget", rule(WORK, Effect::Takes)),
    ("DisplayService/CreateDisplay", rule(RUN, Effect::Takes)),
    ("DisplayService/GetDisplay", rule(LOOK, Effect::Reads)),
    ("DisplayService/ListDisplays", rule(LOOK, Effect::Reads)),
    ("DisplayService/DeleteDisplay", rule(RUN, Effect::Steers)),
    ("DisplayService/PlanPropagation", rule(LOOK, Effect::Reads)),
    ("JobService/SubmitJob", rule(WORK, Effect::Takes)),
    ("JobService/GetJob", rule(LOOK, Effect::Reads)),
    ("JobService/ListJobs", rule(LOOK, Effect::Reads)),
    ("JobService/WatchJob", rule(LOOK, Effect::Reads)),
    ("JobService/CancelJob", rule(WORK, Effect::Steers)),
    ("JobService/RetryJob", rule(WORK, Effect::Takes)),
    ("JobService/ListJobEvents", rule(LOOK, Effect::Reads)),
    ("JobService/GetBatch", rule(LOOK, Effect::Reads)),
    ("JobService/GetQueue", rule(LOOK, Effect::Reads)),
    ("JobService/PauseQueue", rule(RUN, Effect::Steers)),
    ("JobService/ResumeQueue", rule(RUN, Effect::Steers)),
    ("KernelService/GetKernel", rule(FETCH, Effect::Reads)),
    ("KernelService/ListKernels", rule(LOOK, Effect::Reads)),
    ("KernelService/GetKernelVersion", rule(FETCH, Effect::Reads)),
    ("KernelService/ListKernelVersions", rule(LOOK, Effect::Reads)),
    ("KernelService/FetchKernel", rule(FETCH, Effect::Reads)),
    ("KernelService/WatchKernel", rule(FETCH, Effect::Reads)),
    ("KernelService/PromoteKernel", rule(DECIDE, Effect::Steers)),
    ("KernelService/RollbackKernel", rule(DECIDE, Effect::Steers)),
    ("KernelService/ListKernelMoves", rule(LOOK, Effect::Reads)),
    ("KernelService/ImportKernel", rule(DECIDE, Effect::Takes)),
    ("KernelService/InterpolateKernel", rule(WORK, Effect::Takes)),
];

/// Rules for all other routes and paths.
const ROUTES: &[(&str, Rule)] = &[
    ("/healthz", rule(Access::Anybody, Effect::Reads)),
    ("/metrics", rule(LOOK, Effect::Reads)),
    ("/v1/jobs", rule(LOOK, Effect::Reads)),
    ("/v1/jobs/{id}", rule(LOOK, Effect::Reads)),
    ("/grpc.health.v1.Health/Check", rule(Access::Anybody, Effect::Reads)),
    ("/grpc.health.v1.Health/Watch", rule(Access::Anybody, Effect::Reads)),
    ("/grpc.health.v1.Health/List", rule(Access::Anybody, Effect::Reads)),
    ("/grpc.reflection.v1.ServerReflection/ServerReflectionInfo", rule(LOOK, Effect::Reads)),
    ("/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", rule(LOOK, Effect::Reads)),
];

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
    fn what_is_not_named_has_no_rule() {
        for path in
            ["/", "/v1", "/v1/jobs/", "/lightpath.v1.JobService/Other", "/lightpath.v1.JobService/GetJob/", "/x"]
        {
            assert_eq!(rule_of(path, None), None, "{path}");
        }
        assert!(rule_of("/v1/jobs/0193", Some("/v1/jobs/{id}")).is_some());
    }

    #[test]
    fn no_mutation_is_for_everybody() {
        for (name, rule) in METHODS.iter().chain(ROUTES) {
            let open = match rule.access {
                Access::Anybody => true,
                Access::Only(roles) => roles.contains(&Viewer) || roles.contains(&Firmware),
            };
            assert!(!open || rule.effect == Effect::Reads, "{name}");
        }
    }
}
