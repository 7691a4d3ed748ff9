//! Traces of a display in answers: its name, the ids of its jobs, and the digests of its artifacts.

use super::person::Person;
use super::world::World;
use lightpath_proto::v1;
use prost::Message;
use std::collections::BTreeSet;

/// Length of a digest: `sha256-` and 64 digits.
const DIGEST_BYTES: usize = 71;
/// Length of `jobs/` and a UUID.
const JOB_BYTES: usize = 41;

/// Texts that only someone who may see a display knows.
pub(super) struct Traces(BTreeSet<String>);

impl Traces {
    /// The texts in the answers about a display.
    pub(super) fn of(world: &World, answers: &[u8]) -> Self {
        let mut texts = BTreeSet::from([world.prefix.to_owned()]);
        texts.insert(world.prefix.bytes().map(|byte| format!("{byte:02x}")).collect());
        for (start, length) in [("sha256-", DIGEST_BYTES), ("jobs/", JOB_BYTES)] {
            for at in 0..answers.len().saturating_sub(length) {
                if answers[at..].starts_with(start.as_bytes()) {
                    texts.insert(String::from_utf8_lossy(&answers[at + start.len()..at + length]).into_owned());
                }
            }
        }
        assert!(texts.len() > 20, "{texts:?}");
        Self(texts)
    }

    /// A trace in an answer.
    pub(super) fn found_in(&self, answer: &[u8]) -> Option<&str> {
        let is_in = |text: &&String| answer.windows(text.len()).any(|window| window == text.as_bytes());
        self.0.iter().find(is_in).map(String::as_str)
    }
}

/// Everything that the server knows about a display, as the messages of its answers.
pub(super) async fn snapshot(admin: &Person<'_>, id: &str) -> Vec<u8> {
    let display = format!("displays/{id}");
    let mut all = Vec::new();
    let get = v1::GetDisplayRequest { name: display.clone() };
    add(&mut all, &admin.ask::<v1::Display>("DisplayService/GetDisplay", get).await.unwrap());
    let page_size = 1000;
    let list = v1::ListDatasetsRequest { page_size, display: display.clone(), ..Default::default() };
    let listed: v1::ListDatasetsResponse = admin.ask("DatasetService/ListDatasets", list).await.unwrap();
    for dataset in &listed.datasets {
        let get = v1::GetDatasetRequest { name: dataset.name.clone() };
        add(&mut all, &admin.ask::<v1::Dataset>("DatasetService/GetDataset", get).await.unwrap());
        let list = v1::ListPairsRequest { dataset: dataset.name.clone(), page_size, ..Default::default() };
        add(&mut all, &admin.ask::<v1::ListPairsResponse>("DatasetService/ListPairs", list).await.unwrap());
    }
    let list = v1::ListJobsRequest { page_size, display: display.clone(), ..Default::default() };
    let listed: v1::ListJobsResponse = admin.ask("JobService/ListJobs", list).await.unwrap();
    add(&mut all, &listed);
    for job in &listed.jobs {
        let list = v1::ListJobEventsRequest { name: job.name.clone(), page_size, ..Default::default() };
        add(&mut all, &admin.ask::<v1::ListJobEventsResponse>("JobService/ListJobEvents", list).await.unwrap());
    }
    add_kernels(&mut all, admin, &display).await;
    let queue: v1::Queue = admin.ask("JobService/GetQueue", v1::GetQueueRequest {}).await.unwrap();
    // Signs of life come without a call.
    add(&mut all, &v1::Queue { processes: Vec::new(), ..queue });
    all
}

async fn add_kernels(all: &mut Vec<u8>, admin: &Person<'_>, display: &str) {
    let page_size = 1000;
    let list = v1::ListKernelsRequest { page_size, display: display.to_owned(), ..Default::default() };
    let listed: v1::ListKernelsResponse = admin.ask("KernelService/ListKernels", list).await.unwrap();
    add(all, &listed);
    for kernel in listed.kernels {
        let list = v1::ListKernelVersionsRequest { kernel: kernel.name.clone(), page_size, ..Default::default() };
        let versions = admin.ask::<v1::ListKernelVersionsResponse>("KernelService/ListKernelVersions", list);
        add(all, &versions.await.unwrap());
        let list = v1::ListKernelMovesRequest { kernel: kernel.name.clone(), page_size, ..Default::default() };
        add(all, &admin.ask::<v1::ListKernelMovesResponse>("KernelService/ListKernelMoves", list).await.unwrap());
        let list = v1::ListRolloutsRequest { kernel: kernel.name, page_size, ..Default::default() };
        add(all, &admin.ask::<v1::ListRolloutsResponse>("RolloutService/ListRollouts", list).await.unwrap());
    }
    let get = v1::GetPromotionGateRequest { display: display.to_owned() };
    add(all, &admin.ask::<v1::DisplayGate>("KernelService/GetPromotionGate", get).await.unwrap());
    let list = v1::ListDevicesRequest { display: display.to_owned(), page_size, ..Default::default() };
    add(all, &admin.ask::<v1::ListDevicesResponse>("DeviceService/ListDevices", list).await.unwrap());
}

fn add(all: &mut Vec<u8>, message: &impl Message) {
    all.extend(message.encode_to_vec());
}
