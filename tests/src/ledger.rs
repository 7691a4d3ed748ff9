//! What a server has promised, written down as its answers come, to be held against it after each of its deaths.

use crate::material::{assert_succeeded_once, events, hologram, request};
use lightpath::v1::{self, HologramResult, OptimizeHologram, SubmitJobRequest, job::State};
use lightpath::{Client, hologram_result, names};
use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

/// Different jobs; those with the same seed must give the same bytes.
const SEEDS: u64 = 3;
/// Long enough to be interrupted often, short enough that many end.
const ITERATIONS: u32 = 150;
const UPLOADS_PER_LIFE: u32 = 2;
const PROMOTIONS_PER_LIFE: u32 = 4;
/// How many of the latest uploads are asked for after each death.
const UPLOADS_ASKED: usize = 20;
const LIST_PAUSE: Duration = Duration::from_millis(50);
const PAGE: u32 = 1000;

/// Promises, by what was asked for.
#[derive(Debug, Default)]
pub(crate) struct Ledger {
    /// Request ids, and the job that answered; `None` while no answer came.
    asked: BTreeMap<String, Option<String>>,
    /// Jobs that were seen to have succeeded, with what they gave.
    succeeded: BTreeMap<String, HologramResult>,
    /// Digests of uploads that were answered.
    uploads: Vec<String>,
    /// Reasons of promotions that were answered, in order.
    promotions: Vec<String>,
    /// What the jobs of each seed gave.
    results: BTreeMap<u64, HologramResult>,
}

/// What the promises are about.
#[derive(Clone, Debug)]
pub(crate) struct Material {
    pub(crate) target: String,
    /// A kernel with two versions.
    pub(crate) kernel: String,
}

impl Ledger {
    pub(crate) fn ask(&mut self, request_id: String) {
        self.asked.insert(request_id, None);
    }

    /// Uses the server in every way that it makes promises in, until it is gone. `life` makes what is sent unique.
    pub(crate) async fn load(&mut self, client: &Client, material: &Material, life: u64) {
        let Self { asked, succeeded, uploads, promotions, .. } = self;
        let submitting = async {
            for (request_id, job) in asked.iter_mut().filter(|(_, job)| job.is_none()) {
                *job = Some(client.submit(submission(&material.target, request_id)).await?.name);
            }
            std::future::pending::<Result<(), lightpath::Error>>().await
        };
        let uploading = async {
            for n in 0..UPLOADS_PER_LIFE {
                let bytes = format!("life {life}, upload {n}").repeat(2000).into_bytes();
                uploads.push(client.upload_bytes(bytes).await?);
            }
            std::future::pending::<Result<(), lightpath::Error>>().await
        };
        let promoting = async {
            let kernel = v1::GetKernelRequest { name: material.kernel.clone() };
            let mut active = client.get_kernel(kernel).await?.active_version;
            for n in 0..PROMOTIONS_PER_LIFE {
                let reason = format!("life {life}, promotion {n}");
                let request = v1::PromoteKernelRequest {
                    kernel: material.kernel.clone(),
                    version: if active == 1 { 2 } else { 1 },
                    reason: reason.clone(),
                    expected_active_version: None,
                    force: false,
                };
                active = client.promote_kernel(request).await?.active_version;
                promotions.push(reason);
            }
            std::future::pending::<Result<(), lightpath::Error>>().await
        };
        let listing = async {
            loop {
                let state = State::Succeeded.into();
                match client.list_jobs(v1::ListJobsRequest { state, ..Default::default() }).await {
                    Ok(page) => note(succeeded, page.jobs),
                    Err(error) => break Err::<(), lightpath::Error>(error),
                }
                tokio::time::sleep(LIST_PAUSE).await;
            }
        };
        // The server dies meanwhile; whoever notices first ends the life.
        drop(tokio::try_join!(submitting, uploading, promoting, listing));
    }

    /// Holds a server that has just started to what was promised.
    pub(crate) async fn assert_kept(&self, client: &Client, material: &Material) {
        let jobs: BTreeMap<String, v1::Job> =
            all_jobs(client).await.into_iter().map(|job| (job.name.clone(), job)).collect();
        for (request_id, name) in &self.asked {
            if let Some(name) = name {
                let job = &jobs[name];
                assert_eq!(&job.request_id, request_id);
                assert!(matches!(job.state(), State::Queued | State::Running | State::Succeeded), "{job:?}");
            }
        }
        for (name, result) in &self.succeeded {
            assert_eq!(hologram_result(&jobs[name]).unwrap(), result, "a result changed");
        }
        // Whether all that are recorded are on disk is for `check` to say.
        for digest in self.uploads.iter().rev().take(UPLOADS_ASKED) {
            client.get_artifact(v1::GetArtifactRequest { digest: digest.clone() }).await.unwrap();
        }
        let moves = all_moves(client, &material.kernel).await;
        let mut promised = self.promotions.iter();
        let mut next = promised.next();
        for reason in moves {
            if next == Some(&reason) {
                next = promised.next();
            }
        }
        assert_eq!(next, None, "an answered promotion is not in the history, or not in its order");
    }

    /// Lets everything end, and looks at all of it.
    pub(crate) async fn settle(&mut self, client: &Client, material: &Material) {
        let mut attempts = 0;
        for (request_id, answered) in &mut self.asked {
            let name = match answered {
                Some(name) => name.clone(),
                None => client.submit(submission(&material.target, request_id)).await.unwrap().name,
            };
            let job = client.wait(&name, |_| ()).await.unwrap();
            assert_eq!(job.state(), State::Succeeded, "{job:?} {:#?}", events(client, &name).await);
            assert_succeeded_once(client, &name).await;
            attempts += job.attempt;
            let result = hologram_result(&job).unwrap();
            let first = self.results.entry(seed_of(request_id)).or_insert_with(|| result.clone());
            assert_same_bytes(first, result);
            *answered = Some(name);
        }
        let names: BTreeSet<_> = self.asked.values().flatten().collect();
        assert_eq!(names.len(), self.asked.len(), "each request made one job");
        assert_eq!(all_jobs(client).await.len(), self.asked.len(), "and no other");
        for digest in &self.uploads {
            client.get_artifact(v1::GetArtifactRequest { digest: digest.clone() }).await.unwrap();
        }
        assert!(attempts as usize > self.asked.len(), "no job was ever interrupted: {attempts} attempts");
        assert_eq!(self.results.len() as u64, SEEDS.min(self.asked.len() as u64));
    }

    /// For people.
    pub(crate) fn summary(&self) -> String {
        let (jobs, uploads, promotions) = (self.asked.len(), self.uploads.len(), self.promotions.len());
        format!("{jobs} jobs, {uploads} uploads and {promotions} promotions promised and kept")
    }
}

pub(crate) fn assert_same_bytes(one: &HologramResult, other: &HologramResult) {
    assert_eq!(one.wavelengths, other.wavelengths);
}

fn submission(target: &str, request_id: &str) -> SubmitJobRequest {
    // What is active moves all the time.
    let kernel = "ideal".to_owned();
    let spec = OptimizeHologram { kernel, ..hologram("lab", target, ITERATIONS, seed_of(request_id)) };
    SubmitJobRequest { attempts_max: 20, ..request(spec, request_id) }
}

fn seed_of(request_id: &str) -> u64 {
    request_id.bytes().map(u64::from).sum::<u64>() % SEEDS
}

/// Reasons of all moves, oldest first.
async fn all_moves(client: &Client, kernel: &str) -> Vec<String> {
    let mut request =
        v1::ListKernelMovesRequest { kernel: kernel.to_owned(), page_size: PAGE, page_token: String::new() };
    let mut reasons = Vec::new();
    loop {
        let page = client.list_kernel_moves(request.clone()).await.unwrap();
        reasons.extend(page.moves.into_iter().map(|it| it.reason));
        if page.next_page_token.is_empty() {
            reasons.reverse();
            return reasons;
        }
        request.page_token = page.next_page_token;
    }
}

/// Keeps what jobs gave when it is seen for the first time.
fn note(succeeded: &mut BTreeMap<String, HologramResult>, jobs: Vec<v1::Job>) {
    for job in jobs {
        let result = hologram_result(&job).unwrap();
        succeeded.entry(job.name.clone()).or_insert_with(|| result.clone());
    }
}

async fn all_jobs(client: &Client) -> Vec<v1::Job> {
    let mut request = v1::ListJobsRequest { page_size: PAGE, ..Default::default() };
    let mut jobs = Vec::new();
    loop {
        let page = client.list_jobs(request.clone()).await.unwrap();
        jobs.extend(page.jobs);
        if page.next_page_token.is_empty() {
            return jobs;
        }
        request.page_token = page.next_page_token;
    }
}

/// The kernel of the display `lab` at the distance of the tests.
pub(crate) fn kernel_name() -> String {
    format!("{}/kernels/515nm-50mm", names::display("lab"))
}
