use crate::material::{assert_succeeded_once, declare, hologram, request, target};
use crate::server::TestServer;
use crate::uploads::{noise, send};
use lightpath::v1::{self, SubmitJobRequest, job::State};
use lightpath::{Client, Error, digest_of};
use lightpath_artifacts::SpaceLimits;
use lightpath_server::upkeep::check;
use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;
use tonic::Code;

/// Size of the test disk \[MiB\].
pub(crate) const DISK_MIB: u64 = 48;
/// Iterations of a job that the test cancels before its end.
const ENDLESS: u32 = 10_000;

/// A mounted disk. It is unmounted when dropped.
pub(crate) struct TinyDisk {
    folder: TempDir,
}

impl TinyDisk {
    /// Mounts a disk. `None` if the user lacks the right to mount.
    pub(crate) fn mount(size_mib: u64) -> Option<Self> {
        let folder = TempDir::new().unwrap();
        let size = format!("size={size_mib}m");
        let mount = Command::new("mount").args(["-t", "tmpfs", "-o", &size, "tmpfs"]).arg(folder.path()).output();
        mount.is_ok_and(|output| output.status.success()).then_some(Self { folder })
    }

    pub(crate) fn data_dir(&self) -> PathBuf {
        self.folder.path().join("data")
    }

    /// Free space \[MiB\].
    pub(crate) fn free_mib(&self) -> u64 {
        let space = rustix::fs::statvfs(self.folder.path()).unwrap();
        (space.f_bavail * space.f_frsize) >> 20
    }

    /// Fills the disk except for `leave_mib` \[MiB\]. Dropping the filler frees the space.
    pub(crate) fn fill(&self, leave_mib: u64) -> Filler {
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

/// A file that fills a disk. Dropping it removes the file.
pub(crate) struct Filler(PathBuf);

impl Drop for Filler {
    fn drop(&mut self) {
        fs::remove_file(&self.0).unwrap();
    }
}

/// Starts a server with these limits.
async fn serve(data_dir: &Path, limits: SpaceLimits) -> TestServer {
    TestServer::with(|config| {
        config.data_dir = data_dir.to_owned();
        config.disk_reserve_mib = limits.reserve_bytes as f64 / f64::from(1 << 20);
        config.stored_mib_max = limits.stored_bytes_max as f64 / f64::from(1 << 20);
    })
    .await
}

/// Code and reason of a refusal.
fn refused(error: &Error) -> (Code, String) {
    match error {
        Error::Refused(refusal) => (refusal.status.code(), refusal.reason.clone()),
        other => panic!("{other:?}"),
    }
}

/// Free space of the server's disk \[bytes\].
async fn free_bytes(client: &Client) -> u64 {
    client.get_server(v1::GetServerRequest {}).await.unwrap().disk_free_bytes
}

/// Submits a short job.
async fn submit(client: &Client, target: &str, request_id: &str) -> Result<v1::Job, Error> {
    let request: SubmitJobRequest = request(hologram("lab", target, 3, 1), request_id);
    client.submit_job(request).await
}

/// Checks that calls that only read succeed.
async fn assert_reads_succeed(client: &Client, job: &v1::Job, target: &str, bytes: &[u8]) {
    assert!(!client.list_jobs(v1::ListJobsRequest::default()).await.unwrap().jobs.is_empty());
    client.get_job(v1::GetJobRequest { name: job.name.clone() }).await.unwrap();
    client.list_displays(v1::ListDisplaysRequest::default()).await.unwrap();
    assert_eq!(client.download(target).await.unwrap(), bytes);
}

/// Waits until `wanted` holds for a job.
async fn wait_until(client: &Client, job: &v1::Job, wanted: impl Fn(&v1::Job) -> bool) {
    let mut watch = client.watch_job(v1::WatchJobRequest { name: job.name.clone() }).await.unwrap();
    while !wanted(&watch.message().await.unwrap().expect("the watch ends with the job")) {}
}

#[tokio::test(flavor = "multi_thread")]
async fn low_disk_refuses_new_work_but_not_reads() {
    let data = TempDir::new().unwrap();
    let server = serve(data.path(), SpaceLimits::default()).await;
    declare(&server.client, "lab", 64, 64).await;
    let bytes = target(64, 64, 0);
    let picture = server.client.upload_bytes(bytes.clone()).await.unwrap();
    let job = submit(&server.client, &picture, "accepted").await.unwrap();
    server.client.wait(&job.name, |_| ()).await.unwrap();
    server.stop().await;

    // No disk has this much free space.
    let server = serve(data.path(), SpaceLimits { reserve_bytes: 1 << 60, stored_bytes_max: 0 }).await;
    let client = &server.client;
    let low = (Code::ResourceExhausted, "DISK_LOW".to_owned());
    assert_eq!(refused(&submit(client, &picture, "new").await.unwrap_err()), low);
    assert_eq!(refused(&client.upload_bytes(target(64, 64, 1)).await.unwrap_err()), low);
    let display = Some(crate::material::display("other", 64, 64));
    assert_eq!(refused(&client.create_display(v1::CreateDisplayRequest { display }).await.unwrap_err()), low);
    assert_eq!(client.upload_bytes(bytes.clone()).await.unwrap(), picture, "the artifact is stored already");
    assert_reads_succeed(client, &job, &picture, &bytes).await;
    server.stop().await;

    // The stored artifacts exceed the limit for all artifacts together.
    let server = serve(data.path(), SpaceLimits { reserve_bytes: 0, stored_bytes_max: 1 }).await;
    let spent = (Code::ResourceExhausted, "STORED_BYTES".to_owned());
    assert_eq!(refused(&server.client.upload_bytes(target(64, 64, 1)).await.unwrap_err()), spent);
    server.stop().await;
    assert_eq!(check(data.path()).await.unwrap().problems, []);
}

#[tokio::test(flavor = "multi_thread")]
async fn full_disk_loses_nothing_and_server_recovers_by_itself() {
    let Some(disk) = TinyDisk::mount(DISK_MIB) else {
        writeln!(std::io::stderr(), "NOT TESTED: a full disk; the test needs the right to mount one (root)").unwrap();
        return;
    };
    let server = serve(&disk.data_dir(), SpaceLimits::default()).await;
    let client = &server.client;
    declare(client, "lab", 64, 64).await;
    let bytes = target(64, 64, 0);
    let picture = client.upload_bytes(bytes.clone()).await.unwrap();
    // The display is so large that the job is still running when the disk has space again.
    declare(client, "wide", 256, 256).await;
    let long = client.submit(request(hologram("wide", &picture, ENDLESS, 1), "long")).await.unwrap();
    wait_until(client, &long, |job| job.progress.as_ref().is_some_and(|progress| progress.step > 0)).await;

    let filler = disk.fill(0);
    let mut accepted = Vec::new();
    let full = (Code::ResourceExhausted, "DISK_FULL".to_owned());
    // The database's log has reserved space, so the server may still accept some jobs. It must not lose them.
    let refusal = loop {
        match submit(client, &picture, &format!("full-{}", accepted.len())).await {
            Ok(job) => accepted.push(job),
            Err(error) => break refused(&error),
        }
    };
    assert_eq!(refusal, full);
    let noise: Vec<u8> = (0..2_000_000_u32).map(|n| (n.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    assert_eq!(refused(&client.upload_bytes(noise.clone()).await.unwrap_err()), full);
    assert_reads_succeed(client, &long, &picture, &bytes).await;

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
async fn uploads_never_use_the_reserve_and_interrupted_ones_make_room() {
    let Some(disk) = TinyDisk::mount(DISK_MIB) else {
        writeln!(std::io::stderr(), "NOT TESTED: a low disk; the test needs the right to mount one (root)").unwrap();
        return;
    };
    let limits = SpaceLimits { reserve_bytes: 16 << 20, stored_bytes_max: 0 };
    let server = serve(&disk.data_dir(), limits).await;
    let client = &server.client;
    declare(client, "lab", 64, 64).await;
    let picture = client.upload_bytes(target(64, 64, 0)).await.unwrap();

    // Each of fourteen callers sends 6 of 7 MiB, and then its connection breaks.
    let cut = |seed: u64| {
        let url = server.url().to_owned();
        tokio::spawn(async move {
            let bytes = noise(7 << 20, seed);
            send(&url, &digest_of(&bytes), bytes.len() as u64, 0, &bytes[..6 << 20]).await.unwrap_err().code()
        })
    };
    let uploads: Vec<_> = (0..14).map(cut).collect();
    let mut least_free_bytes = u64::MAX;
    while uploads.iter().any(|upload| !upload.is_finished()) {
        least_free_bytes = least_free_bytes.min(free_bytes(client).await);
    }
    let mut codes = Vec::new();
    for upload in uploads {
        codes.push(upload.await.unwrap());
    }
    let count = |code: Code| codes.iter().filter(|&&found| found == code).count();
    assert!(count(Code::InvalidArgument) >= 3, "some have room: {codes:?}");
    assert_eq!(count(Code::InvalidArgument) + count(Code::ResourceExhausted), 14, "{codes:?}");
    // The database writes a little meanwhile, for which the reserve is.
    assert!(least_free_bytes + (1 << 20) >= limits.reserve_bytes, "{} MiB were free", least_free_bytes >> 20);

    // The disk fills up: new work takes the room of interrupted uploads.
    let filler = disk.fill(10);
    let job = submit(client, &picture, "new").await.unwrap();
    assert!(free_bytes(client).await >= limits.reserve_bytes - (1 << 20));
    assert_eq!(client.wait(&job.name, |_| ()).await.unwrap().state(), State::Succeeded);
    drop(filler);
    client.upload_bytes(noise(7 << 20, 99)).await.unwrap();
    server.stop().await;
    assert_eq!(check(&disk.data_dir()).await.unwrap().problems, []);
}

#[tokio::test(flavor = "multi_thread")]
async fn queued_jobs_wait_for_space_and_running_jobs_finish_in_reserve() {
    let Some(disk) = TinyDisk::mount(DISK_MIB) else {
        writeln!(std::io::stderr(), "NOT TESTED: a low disk; the test needs the right to mount one (root)").unwrap();
        return;
    };
    let limits = SpaceLimits { reserve_bytes: (DISK_MIB / 2) << 20, stored_bytes_max: 0 };
    let server = serve(&disk.data_dir(), limits).await;
    let client = &server.client;
    declare(client, "lab", 64, 64).await;
    let picture = client.upload_bytes(target(64, 64, 0)).await.unwrap();
    let running = client.submit(request(hologram("lab", &picture, 1500, 1), "running")).await.unwrap();
    wait_until(client, &running, |job| job.state() == State::Running).await;
    let waiting = submit(client, &picture, "waiting").await.unwrap();

    let filler = disk.fill(4);
    let low = (Code::ResourceExhausted, "DISK_LOW".to_owned());
    assert_eq!(refused(&submit(client, &picture, "new").await.unwrap_err()), low);
    let done = client.wait(&running.name, |_| ()).await.unwrap();
    assert_eq!((done.state(), done.attempt), (State::Succeeded, 1), "{done:?}");
    let job = client.get_job(v1::GetJobRequest { name: waiting.name.clone() }).await.unwrap();
    assert_eq!(job.state(), State::Queued, "no job starts while it may lack the space to finish");
    drop(filler);
    assert_eq!(client.wait(&waiting.name, |_| ()).await.unwrap().state(), State::Succeeded);
    server.stop().await;
}
