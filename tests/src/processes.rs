use crate::crash::import_two_versions;
use crate::disk::{DISK_MIB, Filler, TinyDisk};
use crate::fault_proxy::{Fault, FaultProxy, Upstream};
use crate::ledger::{Ledger, assert_same_bytes};
use crate::material::{declare, events, hologram, request, target};
use crate::process::{Daemon, lightpathd, lightpathd_command};
use lightpath::{Client, hologram_result, v1};
use lightpath_fixtures::postgres_database;
use rand::seq::IndexedRandom as _;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use std::io::Write as _;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tokio::process::{Child, Command};

/// Number of faults, unless `LIGHTPATH_FAULTS` sets another. With it the test runs alone, and the database server restarts, too.
const FAULTS: u64 = 40;
/// Servers, which run no jobs, and workers.
const SERVERS: usize = 2;
const WORKERS: usize = 3;
/// Jobs submitted between two faults: so many that the workers are never idle for long.
const JOBS_PER_FAULT: u64 = 3;
/// Longest time that a fault lasts: more than two leases.
const FAULT_MS_MAX: u64 = 3000;
/// Longest time between two faults.
const BETWEEN_MS_MAX: u64 = 700;
/// Faults after which everything is mended and checked.
const FAULTS_PER_CHECK: u64 = 10;
/// A batch with this number of jobs, so many that each worker gets some, and the iterations of each.
const BATCH: &str = "video";
const FRAMES: u64 = 18;
const FRAME_ITERATIONS: u32 = 60;
/// Longest wait for a process that was mended.
const SOON: Duration = Duration::from_secs(60);
/// Settings of all processes: a checkpoint about every third iteration, and a short lease.
const SETTINGS: [&str; 9] = [
    "--checkpoint-interval-s",
    "0.1",
    "--lease-s",
    "1",
    "--compute-threads",
    "1",
    "--drain-deadline-s",
    "5",
    "--artifacts-allow-http",
];

/// What can go wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Trouble {
    /// A process is killed, and starts again when the fault ends.
    Kill,
    /// A process is stopped, and continues.
    Suspend,
    /// A process and the database, or a process and the bucket, cannot reach each other.
    Database(Fault),
    Bucket(Fault),
    /// The database server ends without warning, and starts again at once.
    RestartDatabase,
    /// The disk of a worker is full.
    FullDisk,
}

/// A server or a worker, behind proxies of its own.
struct Member {
    /// Address of a server; `None`: a worker.
    address: Option<String>,
    data: PathBuf,
    arguments: Vec<String>,
    database: FaultProxy,
    bucket: FaultProxy,
    process: Option<Child>,
}

impl Member {
    fn start(&mut self) {
        let arguments: Vec<&str> = self.arguments.iter().map(String::as_str).collect();
        self.process = Some(lightpathd_command(&arguments).spawn().unwrap());
    }

    async fn kill(&mut self) {
        if let Some(mut process) = self.process.take() {
            process.kill().await.unwrap();
        }
    }

    fn signal(&self, name: &str) {
        if let Some(id) = self.process.as_ref().and_then(Child::id) {
            std::process::Command::new("kill").args(["-s", name, &id.to_string()]).status().unwrap();
        }
    }

    fn client(&self) -> Client {
        Client::connect(&format!("http://{}", self.address.as_ref().expect("a server"))).unwrap()
    }

    /// Starts the process again if it has ended by itself, as systemd does.
    fn revive(&mut self) {
        if self.process.as_mut().is_none_or(|process| process.try_wait().unwrap().is_some()) {
            self.start();
        }
    }
}

/// All processes, the engines behind them, and what is wrong at the moment.
struct Cluster {
    members: Vec<Member>,
    /// The disk of the first worker; `None` if the user lacks the right to mount one.
    disk: Option<TinyDisk>,
    /// Troubles with their victims and their ends.
    active: Vec<(Trouble, usize, Instant)>,
    full: Option<Filler>,
    place: Vec<String>,
    _folders: Vec<TempDir>,
}

/// A worker says how it is, and does not start where it could not work with others.
#[tokio::test(flavor = "multi_thread")]
async fn worker_has_health_and_metrics_and_needs_what_it_shares() {
    let data = TempDir::new().unwrap();
    let folder = data.path().to_str().unwrap();
    let url = postgres_database().await;
    for command in [["worker", "--data-dir", folder].as_slice(), &["serve", "--no-worker", "--data-dir", folder]] {
        lightpathd(command).await.assert_refused(1, &["needs database_url", "Run several processes"]);
        let with_database = [command, &["--database-url", &url]].concat();
        lightpathd(&with_database).await.assert_refused(1, &["needs artifacts_url", "Run several processes"]);
    }
    let Some(mut cluster) = Cluster::new().await else { return };
    let worker = &mut cluster.members[SERVERS];
    let address = free_address();
    worker.arguments.extend(["--status-listen".to_owned(), address.clone()]);
    worker.start();
    let ask = async |path: &str| {
        let output =
            Command::new("curl").args(["--silent", &format!("http://{address}{path}")]).output().await.unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    let started = async {
        while ask("/healthz").await != "working\n" {
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    };
    tokio::time::timeout(SOON, started).await.expect("the worker works");
    let metrics = ask("/metrics").await;
    assert!(metrics.contains("lightpath_queue_work_seconds{kind=\"optimize_hologram\",needs=\"\"} 0"), "{metrics}");
    cluster.members[SERVERS].database.set(Fault::Cut);
    assert_ne!(ask("/healthz").await, "working\n");
}

/// Each worker computes a part of a batch, and the results are those of one machine.
#[tokio::test(flavor = "multi_thread")]
async fn a_batch_spreads_over_workers() {
    let Some(mut cluster) = Cluster::new().await else { return };
    lightpathd(&["--version"]).await.ok();
    cluster.mend().await;
    let client = cluster.members[0].client();
    declare(&client, "lab", 128, 96).await;
    let digest = client.upload_bytes(target(128, 96, 1)).await.unwrap();
    // The workers begin together, when all live and the whole batch waits.
    client.pause_queue(v1::PauseQueueRequest::default()).await.unwrap();
    let frames = submit_frames(&client, &digest).await;
    let all_live = async {
        let is_worker = |process: &v1::queue::Process| process.name.starts_with("worker");
        let living = async || client.get_queue(v1::GetQueueRequest {}).await.unwrap().processes;
        while living().await.iter().filter(|process| is_worker(process)).count() < WORKERS {
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    };
    tokio::time::timeout(SOON, all_live).await.expect("all workers live");
    client.resume_queue(v1::ResumeQueueRequest::default()).await.unwrap();

    let data = TempDir::new().unwrap();
    let alone = Daemon::start(data.path(), &["--compute-threads", "1"]).await;
    declare(&alone.client, "lab", 128, 96).await;
    assert_eq!(alone.client.upload_bytes(target(128, 96, 1)).await.unwrap(), digest);
    let mut workers = std::collections::BTreeSet::new();
    for (frame, here) in frames.iter().zip(submit_frames(&alone.client, &digest).await) {
        let (frame, here) =
            (client.wait(frame, |_| ()).await.unwrap(), alone.client.wait(&here, |_| ()).await.unwrap());
        assert_same_bytes(hologram_result(&frame).unwrap(), hologram_result(&here).unwrap());
        assert_eq!(frame.computer, here.computer);
        let events = events(&client, &frame.name).await;
        let started = events.iter().find_map(|event| event.strip_prefix("attempt 1 started by ")).unwrap();
        workers.insert(started.split('-').next().unwrap().to_owned());
    }
    assert_eq!(workers.len(), WORKERS, "{workers:?}");
    let batch = client.get_batch(v1::GetBatchRequest { batch: BATCH.into() }).await.unwrap();
    assert_eq!((batch.succeeded, batch.done), (FRAMES, 1.0));
}

/// Submits a batch, and returns the names of its jobs.
async fn submit_frames(client: &Client, target: &str) -> Vec<String> {
    let mut names = Vec::new();
    for seed in 0..FRAMES {
        let frame = request(hologram("lab", target, FRAME_ITERATIONS, seed), "");
        let frame = v1::SubmitJobRequest { batch: BATCH.into(), ..frame };
        names.push(client.submit(frame).await.unwrap().name);
    }
    names
}

/// `LIGHTPATH_FAULTS` faults strike two servers and three workers, often several at a time. No accepted request is lost,
/// no job ends twice, and the results are those of one machine.
#[tokio::test(flavor = "multi_thread")]
async fn processes_survive_faults_of_every_kind() {
    let Some(mut cluster) = Cluster::new().await else {
        writeln!(std::io::stderr(), "there is no S3 server: run scripts/s3-for-tests").unwrap();
        return;
    };
    // The first use of a program may build it.
    lightpathd(&["--version"]).await.ok();
    let faults = std::env::var("LIGHTPATH_FAULTS").map_or(FAULTS, |text| text.parse().unwrap());
    let seed = std::env::var("LIGHTPATH_FAULTS_SEED").map_or(2026, |text| text.parse().unwrap());
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    cluster.mend().await;
    let client = cluster.members[0].client();
    declare(&client, "lab", 128, 96).await;
    let digest = client.upload_bytes(target(128, 96, 1)).await.unwrap();
    let material = import_two_versions(&client, digest.clone()).await;
    let mut ledger = Ledger::default();
    let mut counts = std::collections::BTreeMap::<String, u32>::new();
    for number in 0..faults {
        (0..JOBS_PER_FAULT).for_each(|job| ledger.ask(format!("fault {number}, job {job}")));
        let trouble = cluster.strike(&mut random).await;
        *counts.entry(format!("{trouble:?}")).or_default() += 1;
        let client = cluster.members[random.random_range(0..SERVERS)].client();
        let time = Duration::from_millis(random.random_range(0..BETWEEN_MS_MAX));
        let load = async { (ledger.load(&client, &material, number).await, std::future::pending::<()>().await) };
        drop(tokio::time::timeout(time, load).await);
        cluster.heal_what_is_over().await;
        if number % FAULTS_PER_CHECK == FAULTS_PER_CHECK - 1 {
            cluster.mend().await;
            ledger.assert_kept(&cluster.members[number as usize % SERVERS].client(), &material).await;
        }
    }
    cluster.mend().await;
    ledger.settle(&cluster.members[0].client(), &material).await;
    for member in &mut cluster.members {
        member.kill().await;
    }
    let check =
        [&["check".to_owned(), "--data-dir".into(), path(&cluster.members[0].data)], &cluster.place[..]].concat();
    lightpathd(&check.iter().map(String::as_str).collect::<Vec<_>>()).await.ok();

    let data = TempDir::new().unwrap();
    let alone = Daemon::start(data.path(), &["--compute-threads", "1"]).await;
    declare(&alone.client, "lab", 128, 96).await;
    assert_eq!(alone.client.upload_bytes(target(128, 96, 1)).await.unwrap(), digest);
    ledger.assert_as_on(&alone.client, &digest).await;
    writeln!(std::io::stderr(), "{faults} faults with seed {seed}, {counts:?}: {}", ledger.summary()).unwrap();
}

impl Cluster {
    /// `None` without an S3 server.
    async fn new() -> Option<Self> {
        let endpoint = std::env::var("LIGHTPATH_TEST_S3").ok()?;
        let s3_port = endpoint.rsplit(':').next().unwrap().parse().unwrap();
        let database = postgres_database().await;
        let (socket, name) = socket_and_name(&database);
        let bucket = format!("s3://lightpath-tests/processes-{name}");
        let disk = TinyDisk::mount(DISK_MIB);
        let (mut members, mut folders) = (Vec::new(), Vec::new());
        for index in 0..SERVERS + WORKERS {
            let folder = TempDir::new().unwrap();
            let data = match &disk {
                Some(disk) if index == SERVERS => disk.data_dir(),
                _ => folder.path().to_owned(),
            };
            folders.push(folder);
            let to_database = FaultProxy::start(Upstream::Socket(socket.clone())).await;
            let to_bucket = FaultProxy::start(Upstream::Port(s3_port)).await;
            let address = (index < SERVERS).then(free_address);
            let mut arguments = match &address {
                Some(address) => ["serve", "--no-worker", "--listen", address].map(str::to_owned).to_vec(),
                None => {
                    let name = format!("worker{index}");
                    ["worker", "--workers", "2", "--disk-reserve-mib", "4", "--worker-name", &name]
                        .map(str::to_owned)
                        .to_vec()
                }
            };
            let database = format!("postgres://lightpath@127.0.0.1:{}/{name}?sslmode=disable", to_database.port);
            let endpoint = format!("http://127.0.0.1:{}", to_bucket.port);
            arguments.extend(["--data-dir".into(), path(&data), "--log-level".into(), log_level()]);
            arguments.extend(place(&database, &bucket, &endpoint));
            arguments.extend(SETTINGS.map(str::to_owned));
            members.push(Member { address, data, arguments, database: to_database, bucket: to_bucket, process: None });
        }
        let mut place = place(&database, &bucket, &endpoint);
        place.push("--artifacts-allow-http".into());
        Some(Self { members, disk, active: Vec::new(), full: None, place, _folders: folders })
    }

    /// Lets something go wrong.
    async fn strike(&mut self, random: &mut ChaCha8Rng) -> Trouble {
        use Trouble::{Bucket, Database, FullDisk, Kill, RestartDatabase, Suspend};
        let troubles = [
            Kill,
            Kill,
            Kill,
            Suspend,
            Suspend,
            Database(Fault::Cut),
            Database(Fault::Silence),
            Database(Fault::Slow),
            Bucket(Fault::Cut),
            Bucket(Fault::Silence),
            Bucket(Fault::Slow),
            Bucket(Fault::Unavailable),
            RestartDatabase,
            FullDisk,
        ];
        // Others may use the database server, unless this test runs alone.
        let is_possible = |trouble: &&Trouble| **trouble != RestartDatabase || runs_alone();
        let troubles: Vec<_> = troubles.iter().filter(is_possible).collect();
        let trouble = **troubles.choose(random).unwrap();
        let victim = if trouble == FullDisk { SERVERS } else { random.random_range(0..self.members.len()) };
        let lasts = Duration::from_millis(random.random_range(0..FAULT_MS_MAX));
        let member = &mut self.members[victim];
        match trouble {
            Kill => member.kill().await,
            Suspend => member.signal("STOP"),
            Database(fault) => member.database.set(fault),
            Bucket(fault) => member.bucket.set(fault),
            RestartDatabase => restart_database().await,
            FullDisk => {
                self.full = None;
                self.full = self.disk.as_ref().map(|disk| disk.fill(0));
            }
        }
        self.active.push((trouble, victim, Instant::now() + lasts));
        trouble
    }

    /// Ends the troubles whose time is over.
    async fn heal_what_is_over(&mut self) {
        let now = Instant::now();
        let (over, active) = self.active.drain(..).partition::<Vec<_>, _>(|(_, _, end)| *end <= now);
        self.active = active;
        for (trouble, victim, _) in over {
            self.heal(trouble, victim);
        }
    }

    fn heal(&mut self, trouble: Trouble, victim: usize) {
        let member = &mut self.members[victim];
        match trouble {
            Trouble::Kill => member.revive(),
            Trouble::Suspend => member.signal("CONT"),
            Trouble::Database(_) => member.database.set(Fault::None),
            Trouble::Bucket(_) => member.bucket.set(Fault::None),
            Trouble::RestartDatabase => {}
            Trouble::FullDisk => self.full = None,
        }
    }

    /// Ends all troubles, and waits until all servers answer.
    async fn mend(&mut self) {
        for (trouble, victim, _) in std::mem::take(&mut self.active) {
            self.heal(trouble, victim);
        }
        let mended = async {
            loop {
                // A process that could not reach its database at its start has ended.
                self.members.iter_mut().for_each(Member::revive);
                let mut answers = 0;
                for member in &self.members[..SERVERS] {
                    let list = v1::ListDisplaysRequest::default();
                    let answer =
                        tokio::time::timeout(Duration::from_secs(2), member.client().list_displays(list)).await;
                    answers += usize::from(answer.is_ok_and(|answer| answer.is_ok()));
                }
                if answers == SERVERS {
                    return;
                }
                tokio::time::sleep(Duration::from_millis(200)).await;
            }
        };
        tokio::time::timeout(SOON, mended).await.expect("all servers answer");
    }
}

/// The settings that say where database and artifacts are.
pub(crate) fn place(database: &str, bucket: &str, endpoint: &str) -> Vec<String> {
    let settings = [
        ["--database-url", database],
        ["--artifacts-url", bucket],
        ["--artifacts-endpoint", endpoint],
        ["--artifacts-access-key-id", "lightpath-tests"],
        ["--artifacts-secret-access-key", "lightpath-tests"],
    ];
    settings.concat().into_iter().map(str::to_owned).collect()
}

/// Socket of the database server, and name of the database at `url`.
pub(crate) fn socket_and_name(url: &str) -> (PathBuf, String) {
    let folder = std::env::var("LIGHTPATH_POSTGRES").unwrap().split("host=").nth(1).expect("a socket").to_owned();
    let name = url.split('?').next().unwrap().rsplit('/').next().unwrap().to_owned();
    (Path::new(&folder).join(".s.PGSQL.5432"), name)
}

/// Whether somebody chose the number of faults, to run this test alone.
fn runs_alone() -> bool {
    std::env::var_os("LIGHTPATH_FAULTS").is_some()
}

async fn restart_database() {
    let program = std::env::var("LIGHTPATH_POSTGRES_RESTART").expect("run scripts/with-postgres");
    assert!(Command::new(program).status().await.unwrap().success());
}

fn free_address() -> String {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string()
}

fn log_level() -> String {
    std::env::var("LIGHTPATH_FAULTS_LOG").unwrap_or_else(|_| "off".into())
}

fn path(path: &Path) -> String {
    path.to_str().unwrap().to_owned()
}
