//! A record of everything that a server has acknowledged. After each kill the tests check that the server has kept it.

use crate::material::{assert_succeeded_once, events, hologram, request};
use lightpath::v1::optimize_hologram_result::WavelengthResult;
use lightpath::v1::{self, OptimizeHologram, OptimizeHologramResult, SubmitJobRequest, job::State};
use lightpath::{Client, hologram_result, names};
use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

/// Number of different jobs. Jobs with the same seed must give the same bytes.
const SEEDS: u64 = 3;
/// Iterations of a job: so many that it is often interrupted, so few that many jobs end.
const ITERATIONS: u32 = 150;
/// Uploads between two kills.
const UPLOADS_PER_LIFE: u32 = 2;
/// Promotions between two kills.
const PROMOTIONS_PER_LIFE: u32 = 4;
/// Number of latest uploads that are checked after each kill.
const UPLOADS_CHECKED: usize = 20;
/// Pause between two lists.
const LIST_PAUSE: Duration = Duration::from_millis(50);
/// Entries of a page.
const PAGE: u32 = 1000;

/// Requests and the server's answers to them.
#[derive(Debug, Default)]
pub(crate) struct Ledger {
    /// Request ids with the job that the server answered. `None` without an answer so far.
    asked: BTreeMap<String, Option<String>>,
    /// Results of jobs that the server has reported as succeeded.
    succeeded: BTreeMap<String, OptimizeHologramResult>,
    /// Digests of acknowledged uploads.
    uploads: Vec<String>,
    /// Reasons of acknowledged promotions, in order.
    promotions: Vec<String>,
    /// Result of the jobs of each seed.
    results: BTreeMap<u64, OptimizeHologramResult>,
}

/// The target and kernel that the requests use.
#[derive(Clone, Debug)]
pub(crate) struct Material {
    /// Digest of the target.
    pub(crate) target: String,
    /// Name of a kernel with two versions.
    pub(crate) kernel: String,
}

impl Ledger {
    /// Adds a job to submit.
    pub(crate) fn ask(&mut self, request_id: String) {
        self.asked.insert(request_id, None);
    }

    /// Sends all kinds of requests that the server acknowledges, until the server is killed. The number `life` makes
    /// the requests unique.
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
            let mut active = client.get_kernel(kernel).await?.active_version();
            for n in 0..PROMOTIONS_PER_LIFE {
                let reason = format!("life {life}, promotion {n}");
                let request = v1::PromoteKernelRequest {
                    kernel: material.kernel.clone(),
                    version: if active == 1 { 2 } else { 1 },
                    reason: reason.clone(),
                    // A promotion of the version that is active would leave no trace.
                    expected_active_version: Some(active),
                    force: false,
                };
                active = client.promote_kernel(request).await?.active_version();
                promotions.push(reason);
            }
            std::future::pending::<Result<(), lightpath::Error>>().await
        };
        let listing = async {
            loop {
                let state = State::Succeeded.into();
                match client.list_jobs(v1::ListJobsRequest { state, ..Default::default() }).await {
                    Ok(page) => record_results(succeeded, page.jobs),
                    Err(error) => break Err::<(), lightpath::Error>(error),
                }
                tokio::time::sleep(LIST_PAUSE).await;
            }
        };
        // The server is killed during these calls. The first failing call ends all.
        drop(tokio::try_join!(submitting, uploading, promoting, listing));
    }

    /// Checks that a restarted server has kept everything that was acknowledged.
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
        // `check` compares all records with the disk.
        for digest in self.uploads.iter().rev().take(UPLOADS_CHECKED) {
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
        assert_eq!(next, None, "an acknowledged promotion is missing in the history or out of order");
    }

    /// Waits until all jobs have ended, and checks all results.
    pub(crate) async fn settle(&mut self, client: &Client, material: &Material) {
        let mut attempts = 0;
        for (request_id, answered) in &mut self.asked {
            if answered.is_none() {
                *answered = Some(client.submit(submission(&material.target, request_id)).await.unwrap().name);
            }
        }
        for (request_id, name) in self.asked.iter().filter_map(|(id, name)| Some((id, name.as_ref()?))) {
            let job = client.wait(name, |_| ()).await.unwrap();
            assert_eq!(job.state(), State::Succeeded, "{job:?} {:#?}", events(client, name).await);
            assert_succeeded_once(client, name).await;
            attempts += job.attempt;
            let result = hologram_result(&job).unwrap();
            let first = self.results.entry(seed_of(request_id)).or_insert_with(|| result.clone());
            assert_same_bytes(first, result);
        }
        let names: BTreeSet<_> = self.asked.values().flatten().collect();
        assert_eq!(names.len(), self.asked.len(), "each request created one job");
        assert_eq!(all_jobs(client).await.len(), self.asked.len(), "there is no other job");
        for digest in &self.uploads {
            client.get_artifact(v1::GetArtifactRequest { digest: digest.clone() }).await.unwrap();
        }
        assert!(attempts as usize > self.asked.len(), "no job was ever interrupted: {attempts} attempts");
        assert_eq!(self.results.len() as u64, SEEDS.min(self.asked.len() as u64));
    }

    /// Checks that all jobs gave the bytes that this server, on which nothing was disturbed, gives.
    pub(crate) async fn assert_as_on(&self, client: &Client, target: &str) {
        for (seed, result) in &self.results {
            let request_id = (0..).map(|n| format!("undisturbed {n}")).find(|id| seed_of(id) == *seed).unwrap();
            let job = client.submit(submission(target, &request_id)).await.unwrap();
            let job = client.wait(&job.name, |_| ()).await.unwrap();
            assert_same_bytes(hologram_result(&job).unwrap(), result);
        }
    }

    /// The number of acknowledged requests, as text.
    pub(crate) fn summary(&self) -> String {
        let (jobs, uploads, promotions) = (self.asked.len(), self.uploads.len(), self.promotions.len());
        format!("{jobs} jobs, {uploads} uploads and {promotions} promotions acknowledged and kept")
    }
}

/// Compares results of equal requests. The kernel that was active when a job was submitted judges its hologram, too, and
/// was not the same for both.
pub(crate) fn assert_same_bytes(one: &OptimizeHologramResult, other: &OptimizeHologramResult) {
    assert_eq!(by_own_kernel(one), by_own_kernel(other));
}

fn by_own_kernel(result: &OptimizeHologramResult) -> Vec<WavelengthResult> {
    let mut wavelengths = result.wavelengths.clone();
    for plane in wavelengths.iter_mut().flat_map(|wavelength| &mut wavelength.planes) {
        plane.judgements.retain(|judged| judged.kernel_version.is_empty());
        plane.judgements.iter_mut().for_each(|judged| judged.headline = false);
    }
    wavelengths
}

fn submission(target: &str, request_id: &str) -> SubmitJobRequest {
    // The active version changes all the time, so do not use it.
    let kernel = Some(v1::KernelChoice::ideal());
    let spec = OptimizeHologram { kernel, ..hologram("lab", target, ITERATIONS, seed_of(request_id)) };
    SubmitJobRequest { attempts_max: Some(20), ..request(spec, request_id) }
}

fn seed_of(request_id: &str) -> u64 {
    request_id.bytes().map(u64::from).sum::<u64>() % SEEDS
}

/// Reasons of all changes of the active version, oldest first.
async fn all_moves(client: &Client, kernel: &str) -> Vec<String> {
    let mut request =
        v1::ListKernelMovesRequest { kernel: kernel.to_owned(), page_size: PAGE, page_token: String::new() };
    let mut reasons = Vec::new();
    loop {
        let page = client.list_kernel_moves(request.clone()).await.unwrap();
        reasons.extend(page.moves.into_iter().map(|entry| entry.reason));
        if page.next_page_token.is_empty() {
            reasons.reverse();
            return reasons;
        }
        request.page_token = page.next_page_token;
    }
}

/// Records the results of jobs that are not recorded yet.
fn record_results(succeeded: &mut BTreeMap<String, OptimizeHologramResult>, jobs: Vec<v1::Job>) {
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

/// Name of the kernel of the display `lab` at the distance of the tests.
pub(crate) fn kernel_name() -> String {
    format!("{}/kernels/515nm-50mm", names::display("lab"))
}
