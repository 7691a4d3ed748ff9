use crate::material::{assert_succeeded_once, declare, hologram, request, target};
use crate::server::TestServer;
use lightpath::v1::{self, SubmitJobRequest, job::State};
use lightpath::{Client, Error};
use lightpath_artifacts::SpaceLimits;
use lightpath_server::upkeep::check;
use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;
use tonic::Code;

const DISK_MIB: u64 = 48;
/// So long that no test waits for its end.
const ENDLESS: u32 = 10_000;

/// A disk of [`DISK_MIB`], unmounted when dropped.
struct TinyDisk {
    folder: TempDir,
}

impl TinyDisk {
    /// `None` where this user may not mount one.
    fn mount() -> Option<Self> {
        let folder = TempDir::new().unwrap();
        let size = format!("size={DISK_MIB}m");
        let mount = Command::new("mount").args(["-t", "tmpfs", "-o", &size, "tmpfs"]).arg(folder.path()).output();
        mount.is_ok_and(|output| output.status.success()).then_some(Self { folder })
    }

    fn data_dir(&self) -> PathBuf {
        self.folder.path().join("data")
    }

    /// Takes all space but the last `leave_mib`; gone when the filler is removed.
    fn fill(&self, leave_mib: u64) -> Filler {
        let filler = Filler(self.folder.path().join("filler"));
        let mut file = File::create(&filler.0).unwrap();
        let block = vec![0; 64 << 10];
        while file.write_all(&block).is_ok() {}
        let full = file.metadata().unwrap().len();
        file.set_len(full.saturating_sub(leave_mib << 20)).unwrap();
        filler
    }
}

impl Drop for TinyDisk {
    fn drop(&mut self) {
        drop(Command::new("umount").arg("--lazy").arg(self.folder.path()).status());
    }
}

struct Filler(PathBuf);

impl Drop for Filler {
    fn drop(&mut self) {
        fs::remove_file(&self.0).unwrap();
    }
}

async fn serve(data_dir: &Path, limits: SpaceLimits) -> TestServer {
    TestServer::with(|config| {
        config.data_dir = data_dir.to_owned();
        config.disk_reserve_mib = limits.reserve_bytes as f64 / f64::from(1 << 20);
        config.stored_mib_max = limits.stored_bytes_max as f64 / f64::from(1 << 20);
    })
    .await
}

fn refused(error: &Error) -> (Code, String) {
    match error {
        Error::Refused(refusal) => (refusal.status.code(), refusal.reason.clone()),
        other => panic!("{other:?}"),
    }
}

async fn submit(client: &Client, target: &str, request_id: &str) -> Result<v1::Job, Error> {
    let request: SubmitJobRequest = request(hologram("lab", target, 3, 1), request_id);
    client.submit_job(request).await
}

/// Every read answers.
async fn reads_go_on(client: &Client, job: &v1::Job, target: &str, bytes: &[u8]) {
    assert!(!client.list_jobs(v1::ListJobsRequest::default()).await.unwrap().jobs.is_empty());
    client.get_job(v1::GetJobRequest { name: job.name.clone() }).await.unwrap();
    client.list_displays(v1::ListDisplaysRequest::default()).await.unwrap();
    assert_eq!(client.download(target).await.unwrap(), bytes);
}

async fn until(client: &Client, job: &v1::Job, wanted: impl Fn(&v1::Job) -> bool) {
    let mut watch = client.watch_job(v1::WatchJobRequest { name: job.name.clone() }).await.unwrap();
    while !wanted(&watch.message().await.unwrap().expect("the watch ends with the job")) {}
}

#[tokio::test(flavor = "multi_thread")]
async fn little_room_refuses_new_work_and_no_other() {
    let data = TempDir::new().unwrap();
    let server = serve(data.path(), SpaceLimits::default()).await;
    declare(&server.client, "lab", 64, 64).await;
    let bytes = target(64, 64, 0);
    let picture = server.client.upload_bytes(bytes.clone()).await.unwrap();
    let job = submit(&server.client, &picture, "accepted").await.unwrap();
    server.client.wait(&job.name, |_| ()).await.unwrap();
    server.stop().await;

    // A reserve that no disk has.
    let server = serve(data.path(), SpaceLimits { reserve_bytes: 1 << 60, stored_bytes_max: 0 }).await;
    let client = &server.client;
    let low = (Code::ResourceExhausted, "DISK_LOW".to_owned());
    assert_eq!(refused(&submit(client, &picture, "new").await.unwrap_err()), low);
    assert_eq!(refused(&client.upload_bytes(target(64, 64, 1)).await.unwrap_err()), low);
    let display = Some(crate::material::display("other", 64, 64));
    assert_eq!(refused(&client.create_display(v1::CreateDisplayRequest { display }).await.unwrap_err()), low);
    assert_eq!(client.upload_bytes(bytes.clone()).await.unwrap(), picture, "it is there already");
    reads_go_on(client, &job, &picture, &bytes).await;
    server.stop().await;

    // All artifacts together have what they may have.
    let server = serve(data.path(), SpaceLimits { reserve_bytes: 0, stored_bytes_max: 1 }).await;
    let spent = (Code::ResourceExhausted, "STORED_BYTES".to_owned());
    assert_eq!(refused(&server.client.upload_bytes(target(64, 64, 1)).await.unwrap_err()), spent);
    server.stop().await;
    assert_eq!(check(data.path()).await.unwrap().problems, []);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_full_disk_loses_nothing_and_the_server_recovers_by_itself() {
    let Some(disk) = TinyDisk::mount() else {
        writeln!(std::io::stderr(), "NOT TESTED: a really full disk, which needs the right to mount one (root)")
            .unwrap();
        return;
    };
    let server = serve(&disk.data_dir(), SpaceLimits::default()).await;
    let client = &server.client;
    declare(client, "lab", 64, 64).await;
    let bytes = target(64, 64, 0);
    let picture = client.upload_bytes(bytes.clone()).await.unwrap();
    // Large enough that it is still running when the disk has room again.
    declare(client, "wide", 256, 256).await;
    let long = client.submit(request(hologram("wide", &picture, ENDLESS, 1), "long")).await.unwrap();
    until(client, &long, |job| job.progress.as_ref().is_some_and(|progress| progress.step > 0)).await;

    let filler = disk.fill(0);
    let mut accepted = Vec::new();
    let full = (Code::ResourceExhausted, "DISK_FULL".to_owned());
    // The log has some room of its own: some submits may still be accepted, and those count.
    let refusal = loop {
        match submit(client, &picture, &format!("full-{}", accepted.len())).await {
            Ok(job) => accepted.push(job),
            Err(error) => break refused(&error),
        }
    };
    assert_eq!(refusal, full);
    let noise: Vec<u8> = (0..2_000_000_u32).map(|n| (n.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    assert_eq!(refused(&client.upload_bytes(noise.clone()).await.unwrap_err()), full);
    reads_go_on(client, &long, &picture, &bytes).await;

    drop(filler);
    let uploaded = client.upload_bytes(noise.clone()).await.unwrap();
    assert_eq!(client.download(&uploaded).await.unwrap(), noise);
    accepted.push(submit(client, &picture, "after").await.unwrap());
    client.cancel_job(v1::CancelJobRequest { name: long.name.clone() }).await.unwrap();
    let ended = client.wait(&long.name, |_| ()).await.unwrap();
    assert_eq!(ended.state(), State::Cancelled, "{ended:?}");
    for job in &accepted {
        assert_eq!(client.wait(&job.name, |_| ()).await.unwrap().state(), State::Succeeded);
        assert_succeeded_once(client, &job.name).await;
    }
    server.stop().await;
    assert_eq!(check(&disk.data_dir()).await.unwrap().problems, []);
}

#[tokio::test(flavor = "multi_thread")]
async fn jobs_wait_for_room_and_the_reserve_lets_those_that_run_end() {
    let Some(disk) = TinyDisk::mount() else {
        writeln!(std::io::stderr(), "NOT TESTED: a really low disk, which needs the right to mount one (root)")
            .unwrap();
        return;
    };
    let limits = SpaceLimits { reserve_bytes: (DISK_MIB / 2) << 20, stored_bytes_max: 0 };
    let server = serve(&disk.data_dir(), limits).await;
    let client = &server.client;
    declare(client, "lab", 64, 64).await;
    let picture = client.upload_bytes(target(64, 64, 0)).await.unwrap();
    let running = client.submit(request(hologram("lab", &picture, 1500, 1), "running")).await.unwrap();
    until(client, &running, |job| job.state() == State::Running).await;
    let waiting = submit(client, &picture, "waiting").await.unwrap();

    let filler = disk.fill(4);
    let low = (Code::ResourceExhausted, "DISK_LOW".to_owned());
    assert_eq!(refused(&submit(client, &picture, "new").await.unwrap_err()), low);
    let done = client.wait(&running.name, |_| ()).await.unwrap();
    assert_eq!((done.state(), done.attempt), (State::Succeeded, 1), "{done:?}");
    let job = client.get_job(v1::GetJobRequest { name: waiting.name.clone() }).await.unwrap();
    assert_eq!(job.state(), State::Queued, "nothing starts that may not be able to end");
    drop(filler);
    assert_eq!(client.wait(&waiting.name, |_| ()).await.unwrap().state(), State::Succeeded);
    server.stop().await;
}
