use crate::material::{assert_succeeded_once, declare, events, hologram, request, target};
use crate::server::TestServer;
use lightpath::v1::{self, job::State};
use lightpath::{Client, JobChange, hologram_result};
use tonic::Code;

/// Iterations of a job that the test cancels before its end.
const ENDLESS: u32 = 10_000;

/// Starts a server with the display `lab` and a target. Returns the digest of the target too.
async fn start() -> (TestServer, String) {
    let server = TestServer::start().await;
    declare(&server.client, "lab", 64, 64).await;
    let target = server.client.upload_bytes(target(64, 64, 0)).await.unwrap();
    (server, target)
}

/// Waits until the job is in this state.
async fn wait_until(client: &Client, job: &str, state: State) -> v1::Job {
    let mut watch = client.watch_job(v1::WatchJobRequest { name: job.to_owned() }).await.unwrap();
    loop {
        let job = watch.message().await.unwrap().expect("the watch ends with the job");
        if job.state() == state {
            return job;
        }
    }
}

fn name_of(job: &v1::Job) -> String {
    job.name.clone()
}

#[tokio::test(flavor = "multi_thread")]
async fn running_and_queued_jobs_can_be_cancelled_and_retried() {
    let (server, target) = start().await;
    let client = &server.client;
    let running = client.submit(request(hologram("lab", &target, ENDLESS, 1), "")).await.unwrap();
    wait_until(client, &running.name, State::Running).await;
    // The only worker is busy.
    let queued = client.submit(request(hologram("lab", &target, 3, 2), "")).await.unwrap();

    let cancelled = client.cancel_job(v1::CancelJobRequest { name: name_of(&queued) }).await.unwrap();
    assert_eq!(cancelled.state(), State::Cancelled);
    let asked = client.cancel_job(v1::CancelJobRequest { name: name_of(&running) }).await.unwrap();
    assert!(asked.cancel_requested);
    let ended = client.wait(&running.name, |_| ()).await.unwrap();
    assert_eq!(ended.state(), State::Cancelled);
    assert!(ended.result.is_none());

    let again = client.cancel_job(v1::CancelJobRequest { name: name_of(&running) }).await.unwrap_err();
    assert_eq!(again.code(), Some(Code::FailedPrecondition));
    let retried = client.retry_job(v1::RetryJobRequest { name: name_of(&queued) }).await.unwrap();
    assert_eq!(retried.name, queued.name);
    let done = client.wait(&queued.name, |_| ()).await.unwrap();
    assert_eq!(done.state(), State::Succeeded, "{done:?}");
    assert_succeeded_once(client, &queued.name).await;
    let retried = client.retry_job(v1::RetryJobRequest { name: name_of(&queued) }).await.unwrap_err();
    assert_eq!(retried.code(), Some(Code::FailedPrecondition));
    assert!(events(client, &queued.name).await.iter().any(|event| event.contains("cancelled")));
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn watch_reports_progress_and_end() {
    let (server, target) = start().await;
    let client = &server.client;
    let job = client.submit(request(hologram("lab", &target, 4000, 1), "")).await.unwrap();
    let (mut states, mut steps, mut revisions) = (Vec::new(), Vec::new(), Vec::new());
    let done = client.wait(&job.name, |change| {
        let JobChange::Job(job) = change else { panic!("the connection broke") };
        states.push(job.state());
        revisions.push(job.revision);
        let iterating = job.progress.as_ref().filter(|progress| progress.stage == "optimize");
        steps.extend(iterating.map(|progress| (progress.step, progress.steps_total)));
    });
    let done = done.await.unwrap();
    states.dedup();
    assert!(states.ends_with(&[State::Running, State::Succeeded]), "{states:?}");
    assert!(revisions.is_sorted(), "{revisions:?}");
    assert!(steps.is_sorted() && steps.iter().all(|&(step, total)| step <= total && total == 4000), "{steps:?}");
    assert!(steps.len() > 1, "no progress was reported: {steps:?}");
    let result = hologram_result(&done).unwrap();
    assert_eq!(result.iterations, 4000);
    let unknown = client.wait("jobs/0193ffff-0000-7000-8000-000000000000", |_| ()).await.unwrap_err();
    assert_eq!(unknown.code(), Some(Code::NotFound));
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn jobs_with_lower_priority_number_run_first() {
    let (server, target) = start().await;
    let client = &server.client;
    let busy = client.submit(request(hologram("lab", &target, ENDLESS, 1), "")).await.unwrap();
    wait_until(client, &busy.name, State::Running).await;
    let mut waiting = Vec::new();
    for (priority, seed) in [(5, 2), (-5, 3), (0, 4)] {
        let request = v1::SubmitJobRequest { priority, ..request(hologram("lab", &target, 3, seed), "") };
        waiting.push(client.submit(request).await.unwrap().name);
    }
    client.cancel_job(v1::CancelJobRequest { name: busy.name }).await.unwrap();
    let mut starts = Vec::new();
    for job in &waiting {
        let done = client.wait(job, |_| ()).await.unwrap();
        let start = done.start_time.unwrap();
        starts.push((start.seconds, start.nanos));
    }
    assert!(starts[1] < starts[2] && starts[2] < starts[0], "{starts:?}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn artifacts_are_stored_once_and_downloaded_unchanged() {
    let server = TestServer::start().await;
    let client = &server.client;
    let bytes: Vec<u8> = (0..3_000_001_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("big.bin");
    std::fs::write(&path, &bytes).unwrap();
    let digest = client.upload_file(&path).await.unwrap();
    assert_eq!(digest, lightpath::digest_of(&bytes));
    assert_eq!(client.upload_bytes(bytes.clone()).await.unwrap(), digest);
    assert!(client.download(&digest).await.unwrap() == bytes);
    let copy = folder.path().join("copy.bin");
    client.download_to(&digest, &copy).await.unwrap();
    assert!(std::fs::read(&copy).unwrap() == bytes);
    let missing = client.download(&lightpath::digest_of(b"missing")).await.unwrap_err();
    assert_eq!(missing.code(), Some(Code::NotFound));
    server.assert_tidy();
    server.stop().await;
}
