//! Several processes on one database and one bucket: what runs where, and what a server says of it. They need the servers
//! of `scripts/with-postgres` and `scripts/s3-for-tests`.

use crate::bucket::{settings, start};
use crate::serving::Serving;
use lightpath_domain::origin::Origins;
use lightpath_domain::webhook::{Webhook, WebhookSecret, WebhookUrl};
use lightpath_proto::v1::{self, job_spec};
use lightpath_server::config::Config;
use lightpath_server::worker_process;
use lightpath_store::Store;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

/// Longest wait for something that takes a few seconds.
const SOON: Duration = Duration::from_secs(60);

/// A process that only runs jobs, in this process.
struct WorkerProcess {
    stop: CancellationToken,
    running: JoinHandle<()>,
    _folder: TempDir,
}

impl WorkerProcess {
    fn start(settings: &Config, name: &str, labels: &str, memory_mib: f64) -> Self {
        let folder = TempDir::new().unwrap();
        let config = Config {
            data_dir: folder.path().join("data"),
            worker_name: Some(name.to_owned()),
            worker_labels: labels.to_owned(),
            job_memory_mib_max: memory_mib,
            compute_threads: 1,
            ..settings.clone()
        };
        let stop = CancellationToken::new();
        let stopped = stop.clone().cancelled_owned();
        let running = tokio::spawn(async { worker_process::run(None, config, None, stopped).await.unwrap() });
        Self { stop, running, _folder: folder }
    }

    async fn stop(self) {
        self.stop.cancel();
        self.running.await.unwrap();
    }
}

async fn queue(serving: &Serving) -> v1::Queue {
    serving.jobs().get_queue(v1::GetQueueRequest {}).await.unwrap().into_inner()
}

/// Waits until the processes with these names live.
async fn wait_for_processes(serving: &Serving, names: &[&str]) -> Vec<v1::queue::Process> {
    let started = Instant::now();
    loop {
        let processes = queue(serving).await.processes;
        if processes.iter().map(|process| process.name.as_str()).eq(names.iter().copied()) {
            return processes;
        }
        assert!(started.elapsed() < SOON, "{processes:?}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

/// A server that runs no jobs, with a display and a target.
async fn server(settings: &Config) -> (Serving, String) {
    let settings = Config { no_worker: true, worker_name: Some("server".to_owned()), ..settings.clone() };
    let serving = start(&settings).await;
    serving.display("lab").await;
    let target = serving.upload(&crate::jobs::picture()).await;
    (serving, target)
}

fn request(target: &str, needs: &[&str]) -> v1::SubmitJobRequest {
    let hologram = v1::OptimizeHologram { iterations: Some(3), ..crate::jobs::optimize(target) };
    let kind = Some(job_spec::Kind::OptimizeHologram(hologram));
    let needs = needs.iter().map(|need| (*need).to_owned()).collect();
    v1::SubmitJobRequest { spec: Some(v1::JobSpec { kind }), needs, ..Default::default() }
}

async fn submit(serving: &Serving, request: v1::SubmitJobRequest) -> v1::Job {
    serving.jobs().submit_job(request).await.unwrap().into_inner()
}

/// Waits for the end of a job and returns the name of the worker that ran it.
async fn worker_of(serving: &Serving, job: &v1::Job) -> String {
    let ended = crate::jobs::watch_to_end(serving, &job.name).await;
    assert_eq!(ended.state(), v1::job::State::Succeeded, "{:?}", ended.error);
    let request = v1::ListJobEventsRequest { name: job.name.clone(), ..Default::default() };
    let events = serving.jobs().list_job_events(request).await.unwrap().into_inner().events;
    let started = events.iter().find_map(|event| event.message.split_once(" started by ")).unwrap().1;
    let (worker, computer) = started.split_once(" on ").expect("the event names what computes");
    assert_eq!(ended.computer, computer);
    assert!(computer.starts_with(concat!("lightpath ", env!("CARGO_PKG_VERSION"), ", ")), "{computer}");
    worker.rsplit_once('-').unwrap().0.to_owned()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn jobs_run_where_their_labels_are() {
    let Some(settings) = settings().await else { return };
    let (serving, target) = server(&settings).await;
    let lonely = submit(&serving, request(&target, &[])).await;
    assert_eq!(lonely.waits_for, "no living process runs jobs");
    let gpu = submit(&serving, request(&target, &["gpu"])).await;
    assert_eq!(
        (gpu.waits_for.as_str(), gpu.needs.clone()),
        ("no living process that runs jobs has the label gpu", vec!["gpu".into()])
    );
    let both = v1::SubmitJobRequest { priority: -9, ..request(&target, &["gpu", "bench-2"]) };
    let both = submit(&serving, both).await;

    // A job of a higher priority that nobody can run stops nobody.
    let one = WorkerProcess::start(&settings, "one", "bench-2", 4096.0);
    assert_eq!(worker_of(&serving, &lonely).await, "one");
    let two = WorkerProcess::start(&settings, "two", "gpu", 4096.0);
    assert_eq!(worker_of(&serving, &gpu).await, "two");
    let processes = wait_for_processes(&serving, &["one", "server", "two"]).await;
    assert_eq!((processes[0].labels.as_slice(), processes[0].workers), (["bench-2".to_owned()].as_slice(), 1));
    assert_eq!(
        (processes[0].kind(), processes[1].kind()),
        (v1::queue::process::Kind::Worker, v1::queue::process::Kind::Server)
    );
    assert_eq!((processes[0].memory_bytes, processes[1].memory_bytes), (Some((4096 - 256) << 20), None));
    assert_eq!(processes[2].version, env!("CARGO_PKG_VERSION"));
    let waiting = serving.jobs().get_job(v1::GetJobRequest { name: both.name.clone() }).await.unwrap().into_inner();
    assert_eq!(waiting.waits_for, "no living process that runs jobs has the labels bench-2, gpu");
    let list = v1::ListJobsRequest {
        view: v1::list_jobs_request::View::Basic.into(),
        state: v1::job::State::Queued.into(),
        ..Default::default()
    };
    let summary = serving.jobs().list_jobs(list).await.unwrap().into_inner().summaries.remove(0);
    assert_eq!((summary.waits_for, summary.needs), (waiting.waits_for, vec!["bench-2".to_owned(), "gpu".to_owned()]));
    let (_, metrics) = crate::http::get(&serving, "/metrics").await;
    assert!(metrics.contains("lightpath_processes{kind=\"worker\"} "), "{metrics}");

    one.stop().await;
    wait_for_processes(&serving, &["server", "two"]).await;
    let three = WorkerProcess::start(&settings, "three", "bench-2,gpu,lab", 4096.0);
    wait_for_processes(&serving, &["server", "three", "two"]).await;
    let none = submit(&serving, request(&target, &["lab", "gpu"])).await;
    assert!(!none.waits_for.contains("no living process"), "a process that has just come counts: {}", none.waits_for);
    assert_eq!(worker_of(&serving, &both).await, "three");
    assert_eq!(worker_of(&serving, &none).await, "three");
    two.stop().await;
    three.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn jobs_run_where_their_memory_is() {
    let Some(settings) = settings().await else { return };
    // The server alone would accept no job at all.
    let (serving, target) = server(&Config { job_memory_mib_max: 64.0, ..settings.clone() }).await;
    let display = crate::serving::sized_display("large", 704, 704);
    let request_display = v1::CreateDisplayRequest { display: Some(display) };
    serving.displays().create_display(request_display).await.unwrap();
    let large = |frames| {
        let mut request = request(&target, &[]);
        if let Some(job_spec::Kind::OptimizeHologram(spec)) = request.spec.as_mut().and_then(|spec| spec.kind.as_mut())
        {
            (spec.display, spec.subframes) = ("displays/large".to_owned(), Some(frames));
        }
        request
    };
    let refused = serving.jobs().submit_job(large(1)).await.unwrap_err();
    assert!(refused.message().contains("a job gets at most 56 MiB"), "{refused:?}");
    let small = WorkerProcess::start(&settings, "small", "", 128.0);
    let big = WorkerProcess::start(&settings, "big", "", 4096.0);
    wait_for_processes(&serving, &["big", "server", "small"]).await;
    let jobs = [submit(&serving, large(1)).await, submit(&serving, large(2)).await];
    for job in &jobs {
        assert!(job.estimated_memory_bytes() > 112 << 20, "{}", job.estimated_memory_bytes());
        assert_eq!(worker_of(&serving, job).await, "big");
        assert!(!job.waits_for.contains("no living process"), "{}", job.waits_for);
    }
    big.stop().await;
    wait_for_processes(&serving, &["server", "small"]).await;
    let retried = submit(&serving, request(&target, &[])).await;
    assert_eq!(worker_of(&serving, &retried).await, "small");
    small.stop().await;
}

/// A server that stops while a receiver does not answer lets go of the webhook, so that another server takes it over at once.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_that_stops_lets_go_of_its_webhooks() {
    const HOLD_MS: i64 = 30_000;
    let Some(settings) = settings().await else { return };
    let url = settings.database_url.as_ref().unwrap().reveal();
    let (one, other) = (Store::connect(url).await.unwrap(), Store::connect(url).await.unwrap());
    let receiver = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let origin = format!("http://{}", receiver.local_addr().unwrap());
    let webhook = Webhook {
        id: "ci".to_owned(),
        url: WebhookUrl::parse(&format!("{origin}/hook")).unwrap(),
        events: Vec::new(),
        display: None,
        caller: "ada".to_owned(),
        create_time_ms: 1,
        revision: 1,
    };
    one.create_webhook(&webhook, &WebhookSecret::generate().unwrap()).await.unwrap();
    one.test_webhook("ci", "ada", one.now_ms()).await.unwrap();
    let stopping = CancellationToken::new();
    let telling = tokio::spawn(lightpath_webhooks::run(one, Origins::parse(&origin).unwrap(), stopping.clone()));
    let (_connection, _) = receiver.accept().await.unwrap();
    assert!(!other.hold_webhook("ci", other.now_ms(), HOLD_MS).await.unwrap(), "the first server tells it");
    stopping.cancel();
    telling.await.unwrap();
    assert!(other.hold_webhook("ci", other.now_ms(), HOLD_MS).await.unwrap());
}
