//! What each call does, decided by its path before its handler runs.

/// What a call needs of the server's disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Effect {
    /// Nothing.
    Reads,
    /// Little, for something that is there already: answered as long as the disk has any room. Uploads look for
    /// themselves whether there is room for as much as they bring.
    Steers,
    /// It brings new work, which must leave the disk's reserve alone.
    Takes,
}

const EFFECTS: &[(&str, Effect)] = &[
    ("ArtifactService/GetArtifact", Effect::Reads),
    ("ArtifactService/GetUpload", Effect::Reads),
    ("ArtifactService/WriteArtifact", Effect::Steers),
    ("ArtifactService/ReadArtifact", Effect::Reads),
    ("DatasetService/CreateDataset", Effect::Takes),
    ("DatasetService/GetDataset", Effect::Reads),
    ("DatasetService/ListDatasets", Effect::Reads),
    ("DatasetService/AddPair", Effect::Takes),
    ("DatasetService/FinalizeDataset", Effect::Steers),
    ("DisplayService/CreateDisplay", Effect::Takes),
    ("DisplayService/GetDisplay", Effect::Reads),
    ("DisplayService/ListDisplays", Effect::Reads),
    ("DisplayService/DeleteDisplay", Effect::Steers),
    ("DisplayService/PlanPropagation", Effect::Reads),
    ("JobService/SubmitJob", Effect::Takes),
    ("JobService/GetJob", Effect::Reads),
    ("JobService/ListJobs", Effect::Reads),
    ("JobService/WatchJob", Effect::Reads),
    ("JobService/CancelJob", Effect::Steers),
    ("JobService/RetryJob", Effect::Takes),
    ("JobService/ListJobEvents", Effect::Reads),
    ("JobService/GetBatch", Effect::Reads),
    ("JobService/GetQueue", Effect::Reads),
    ("JobService/PauseQueue", Effect::Steers),
    ("JobService/ResumeQueue", Effect::Steers),
    ("KernelService/GetKernel", Effect::Reads),
    ("KernelService/ListKernels", Effect::Reads),
    ("KernelService/GetKernelVersion", Effect::Reads),
    ("KernelService/ListKernelVersions", Effect::Reads),
    ("KernelService/FetchKernel", Effect::Reads),
    ("KernelService/WatchKernel", Effect::Reads),
    ("KernelService/PromoteKernel", Effect::Steers),
    ("KernelService/RollbackKernel", Effect::Steers),
    ("KernelService/ListKernelMoves", Effect::Reads),
    ("KernelService/ImportKernel", Effect::Takes),
];

/// What the gRPC method at `path` does; `None` where it is none of ours.
pub(crate) fn effect(path: &str) -> Option<Effect> {
    let method = path.strip_prefix("/lightpath.v1.")?;
    EFFECTS.iter().find(|(name, _)| *name == method).map(|(_, effect)| *effect)
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
        let mut rules: Vec<&str> = EFFECTS.iter().map(|(name, _)| *name).collect();
        methods.sort();
        rules.sort_unstable();
        assert_eq!(methods, rules, "every method of the API needs a line in this file");
    }
}
