use crate::job_shapes::{HD, Hologram, LBFGS, Shape, Spec, adam, all_orders, double_phase, gerchberg_saxton, hologram};
use crate::process::Daemon;
use lightpath::v1::{self, Detector, job::State, job_spec};
use std::io::Write as _;
use std::path::Path;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Longest time between a cancellation and the end of the job up to 1920×1080 px.
const END_MAX: Duration = Duration::from_secs(1);
/// The same for any larger job.
const LARGE_END_MAX: Duration = Duration::from_secs(5);
/// Longest time until a job is cancelled.
const RUN_MAX: Duration = Duration::from_secs(30);

/// Shapes, each with the number of moments at which its jobs are cancelled.
fn few() -> Vec<(Shape, u32)> {
    vec![(hologram("L-BFGS, 24 subframes, 2 planes", (640, 360), Hologram { subframes: 24, planes: 2, ..LBFGS }), 2)]
}

fn all() -> Vec<(Shape, u32)> {
    let (model, dense, large) = (v1::KernelModel::Display, v1::KernelModel::Dense, (8192, 4096));
    let mut shapes = few();
    shapes.extend([
        (hologram("L-BFGS, 24 subframes, 4 planes", HD, Hologram { subframes: 24, planes: 4, ..LBFGS }), 8),
        (hologram("Adam, supersampled", HD, Hologram { detector: Detector::Supersampled, ..adam() }), 8),
        (hologram("L-BFGS, 3 iterations", HD, Hologram { iterations: 3, ..LBFGS }), 8),
        (hologram("Gerchberg–Saxton", HD, gerchberg_saxton()), 4),
        (hologram("L-BFGS, all orders", HD, Hologram { orders: Some(all_orders()), ..LBFGS }), 8),
        (Shape { name: "1920×1080".into(), size_px: HD, spec: Spec::Verify }, 8),
        (Shape { name: "display, 1920×1080".into(), size_px: HD, spec: Spec::Dataset(model) }, 10),
        (Shape { name: "dense, 1920×1080".into(), size_px: HD, spec: Spec::Dataset(dense) }, 10),
        (Shape { name: "capture, 1920×1080".into(), size_px: HD, spec: Spec::Capture }, 8),
        (Shape { name: "13 dense versions, 1920×1080".into(), size_px: HD, spec: Spec::DenseReport(12) }, 8),
        (hologram("Adam, 2 iterations", large, Hologram { iterations: 2, ..adam() }), 16),
        (hologram("L-BFGS", large, LBFGS), 6),
        (hologram("double phase", large, double_phase()), 10),
        (Shape { name: "capture, 4096×4096".into(), size_px: (4096, 4096), spec: Spec::Capture }, 8),
    ]);
    shapes
}

/// The shapes that are measured: `LIGHTPATH_CANCEL_SHAPES` is `all`, or a part of the names of some shapes.
fn chosen() -> Vec<(Shape, u32)> {
    match std::env::var("LIGHTPATH_CANCEL_SHAPES") {
        Err(_) => few(),
        Ok(which) if which == "all" => all(),
        Ok(which) => all().into_iter().filter(|(shape, _)| shape.name.contains(&which)).collect(),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn cancelled_jobs_end_within_a_second_or_five() {
    let mut late = Vec::new();
    for (shape, moments) in chosen() {
        let data = TempDir::new().unwrap();
        let daemon = start(data.path()).await;
        for (kind, spec) in shape.prepare(&daemon.client).await {
            let longest = longest_end(&daemon, &spec, moments).await;
            if let Spec::Dataset(_) = shape.spec {
                // The next job of the dataset needs the result of this one.
                let job = submit(&daemon, spec).await;
                assert_eq!(daemon.client.wait(&job.name, |_| ()).await.unwrap().state(), State::Succeeded);
            }
            let bound = bound_of(shape.size_px);
            let line = format!("| {kind}: {} | {longest:.2?} | {bound:?} |", shape.name);
            writeln!(std::io::stderr(), "{line}").unwrap();
            if longest > bound {
                late.push(line);
            }
        }
        daemon.kill().await;
    }
    assert!(late.is_empty(), "longest time until the end, and its bound: {late:#?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn stopped_server_ends_within_a_second_or_five() {
    for (shape, _) in chosen() {
        let Spec::Hologram(_) = shape.spec else { continue };
        let data = TempDir::new().unwrap();
        let mut daemon = start(data.path()).await;
        let (_, spec) = shape.prepare(&daemon.client).await.remove(0);
        let job = submit(&daemon, spec).await;
        wait_until_running(&daemon, &job.name).await;
        tokio::time::sleep(Duration::from_millis(700)).await;
        let asked = Instant::now();
        daemon.signal("TERM");
        daemon.wait().await;
        let took = asked.elapsed();
        let bound = bound_of(shape.size_px) + Duration::from_millis(500);
        writeln!(std::io::stderr(), "| stop: {} | {took:.2?} | {bound:?} |", shape.name).unwrap();
        assert!(took < bound, "{}: the server took {took:?} to stop", shape.name);
        let daemon = start(data.path()).await;
        let state = daemon.client.get_job(v1::GetJobRequest { name: job.name }).await.unwrap().state();
        assert!([State::Queued, State::Running, State::Succeeded].contains(&state), "{}: {state:?}", shape.name);
        daemon.kill().await;
    }
}

fn bound_of((width_px, height_px): (u32, u32)) -> Duration {
    if width_px * height_px <= HD.0 * HD.1 { END_MAX } else { LARGE_END_MAX }
}

async fn start(data: &Path) -> Daemon {
    let limits = ["--job-memory-mib-max", "200000", "--job-time-s-max", "1000000", "--compute-threads", "2"];
    Daemon::start(data, &limits).await
}

async fn submit(daemon: &Daemon, spec: job_spec::Kind) -> v1::Job {
    let request = v1::SubmitJobRequest { spec: Some(lightpath::job_spec(spec)), ..Default::default() };
    daemon.client.submit(request).await.unwrap()
}

/// Cancels a job at several moments of its estimated time. Returns the longest time until it ended.
async fn longest_end(daemon: &Daemon, spec: &job_spec::Kind, moments: u32) -> Duration {
    let mut longest = Duration::ZERO;
    for moment in 0..moments {
        let job = submit(daemon, spec.clone()).await;
        wait_until_running(daemon, &job.name).await;
        let run = Duration::from_secs_f64(job.estimated_time_s()).min(RUN_MAX);
        tokio::time::sleep(run * (2 * moment + 1) / (2 * moments)).await;
        let asked = Instant::now();
        if daemon.client.cancel_job(v1::CancelJobRequest { name: job.name.clone() }).await.is_err() {
            // The job has ended.
            continue;
        }
        daemon.client.wait(&job.name, |_| ()).await.unwrap();
        longest = longest.max(asked.elapsed());
    }
    longest
}

async fn wait_until_running(daemon: &Daemon, name: &str) {
    let mut watch = daemon.client.watch_job(v1::WatchJobRequest { name: name.to_owned() }).await.unwrap();
    while let Some(job) = watch.message().await.unwrap() {
        if job.state() != State::Queued {
            return;
        }
    }
}
