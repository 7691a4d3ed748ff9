use crate::job_shapes::{
    HD, Hologram, LBFGS, SMALL, Shape, Spec, UHD, adam, all_orders, double_phase, gerchberg_saxton, half_order,
    hologram,
};
use crate::process::Daemon;
use lightpath::v1::{self, Detector, job::State, job_spec};
use std::io::Write as _;
use std::path::Path;
use std::time::Duration;
use tempfile::TempDir;

/// Largest ratio of an estimate to the measured memory. Learning is estimated for a display that needs every block.
const RATIO_MAX: f64 = 1.6;
/// Estimates below this are mostly what every job is assumed to take \[MiB\].
const SMALL_MIB: f64 = 48.0;
/// Time for an idle server to settle before its memory is measured.
const SETTLE: Duration = Duration::from_millis(400);

/// The shapes that are always measured.
fn few() -> Vec<Shape> {
    vec![
        hologram("L-BFGS, pixel", SMALL, LBFGS),
        hologram("Adam, point, 4 subframes", SMALL, Hologram { detector: Detector::Point, subframes: 4, ..adam() }),
        Shape { name: "display, 288×160".into(), size_px: (288, 160), spec: Spec::Dataset(v1::KernelModel::Display) },
        Shape { name: "on 4 dense versions, 960×540".into(), size_px: SMALL, spec: Spec::DenseReport(3) },
    ]
}

/// All shapes, up to the largest that this machine accepts.
fn all() -> Vec<Shape> {
    let square = (2048, 2048);
    let mut shapes = few();
    shapes.extend([
        hologram("L-BFGS, pixel", HD, LBFGS),
        hologram("L-BFGS, point", HD, Hologram { detector: Detector::Point, ..LBFGS }),
        hologram("L-BFGS, supersampled", HD, Hologram { detector: Detector::Supersampled, ..LBFGS }),
        hologram("L-BFGS, 8 subframes", HD, Hologram { subframes: 8, iterations: 20, ..LBFGS }),
        hologram("L-BFGS, 24 subframes", SMALL, Hologram { subframes: 24, iterations: 20, ..LBFGS }),
        hologram("L-BFGS, 3 planes", HD, Hologram { planes: 3, ..LBFGS }),
        hologram("L-BFGS, 16 planes", SMALL, Hologram { planes: 16, iterations: 20, ..LBFGS }),
        hologram("L-BFGS, 3 wavelengths", HD, Hologram { wavelengths: 3, ..LBFGS }),
        hologram("L-BFGS, masked", HD, Hologram { masked: true, ..LBFGS }),
        hologram(
            "L-BFGS, 4 planes, 4 subframes, masked",
            SMALL,
            Hologram { planes: 4, subframes: 4, masked: true, ..LBFGS },
        ),
        hologram("L-BFGS, quantized", square, Hologram { quantization_aware: true, ..LBFGS }),
        hologram("Adam, pixel", HD, adam()),
        hologram("Adam, back-propagated", HD, Hologram { back_propagated: true, ..adam() }),
        hologram("Adam, 8 subframes, 2 planes", SMALL, Hologram { subframes: 8, planes: 2, ..adam() }),
        hologram("L-BFGS, all orders", SMALL, Hologram { orders: Some(all_orders()), ..LBFGS }),
        hologram("L-BFGS, all orders", HD, Hologram { orders: Some(all_orders()), ..LBFGS }),
        hologram("L-BFGS, filtered", HD, Hologram { orders: Some(half_order()), ..LBFGS }),
        Shape { name: "960×540".into(), size_px: SMALL, spec: Spec::Verify },
        Shape { name: "1920×1080".into(), size_px: HD, spec: Spec::Verify },
        hologram("Gerchberg–Saxton", HD, gerchberg_saxton()),
        hologram("Gerchberg–Saxton, 3 planes", square, Hologram { planes: 3, ..gerchberg_saxton() }),
        hologram("double phase", HD, double_phase()),
        hologram("double phase, 3 subframes", UHD, Hologram { subframes: 3, ..double_phase() }),
        hologram("L-BFGS, pixel", UHD, LBFGS),
        hologram("Adam, point", UHD, Hologram { detector: Detector::Point, ..adam() }),
        hologram("Adam, pixel", (8192, 8192), Hologram { iterations: 2, ..adam() }),
        hologram("L-BFGS, pixel", (8192, 4096), Hologram { iterations: 4, ..LBFGS }),
        Shape { name: "display, 960×540".into(), size_px: SMALL, spec: Spec::Dataset(v1::KernelModel::Display) },
        Shape { name: "display, 1920×1080".into(), size_px: HD, spec: Spec::Dataset(v1::KernelModel::Display) },
        Shape { name: "dense, 1920×1080".into(), size_px: HD, spec: Spec::Dataset(v1::KernelModel::Dense) },
        Shape { name: "capture, 1920×1080".into(), size_px: HD, spec: Spec::Capture },
        Shape { name: "on 13 dense versions, 1920×1080".into(), size_px: HD, spec: Spec::DenseReport(12) },
    ]);
    shapes
}

#[tokio::test(flavor = "multi_thread")]
async fn memory_of_jobs_for_holograms_stays_below_its_estimate() {
    stays_below(|spec| matches!(spec, Spec::Hologram(_) | Spec::Verify)).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn memory_of_jobs_for_datasets_stays_below_its_estimate() {
    stays_below(|spec| matches!(spec, Spec::Dataset(_) | Spec::Capture)).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn memory_of_jobs_for_reports_stays_below_its_estimate() {
    stays_below(|spec| matches!(spec, Spec::DenseReport(_))).await;
}

/// Measures the jobs of the shapes of some kinds.
async fn stays_below(is_meant: impl Fn(&Spec) -> bool) {
    // `all`, or a part of the names of some shapes.
    let shapes = match std::env::var("LIGHTPATH_ESTIMATE_SHAPES") {
        Err(_) => few(),
        Ok(which) if which == "all" => all(),
        Ok(which) => all().into_iter().filter(|shape| shape.name.contains(&which)).collect(),
    };
    let mut wrong = Vec::new();
    for shape in shapes.into_iter().filter(|shape| is_meant(&shape.spec)) {
        for (name, job) in measure(&shape).await {
            let (ratio, time_ratio) = (job.estimate_mib / job.memory_mib, job.estimate_s / job.took_s);
            let small = job.estimate_mib < SMALL_MIB;
            let verdict = if ratio >= 1.0 && (ratio <= RATIO_MAX || small) { "" } else { " WRONG" };
            let Measured { estimate_mib, memory_mib, estimate_s, took_s } = job;
            let memory = format!("{estimate_mib:.0} MiB | {memory_mib:.0} MiB | {ratio:.2}");
            let line = format!("| {name} | {memory} | {estimate_s:.1} s | {took_s:.1} s | {time_ratio:.2} |{verdict}");
            let mut stderr = std::io::stderr();
            writeln!(stderr, "{line}").unwrap();
            if !verdict.is_empty() {
                wrong.push(line);
            }
        }
    }
    assert!(wrong.is_empty(), "estimated, measured, ratio: {wrong:#?}");
}

/// What was estimated for a job, and what it took.
struct Measured {
    estimate_mib: f64,
    memory_mib: f64,
    estimate_s: f64,
    took_s: f64,
}

/// Each job of a shape.
async fn measure(shape: &Shape) -> Vec<(String, Measured)> {
    let data = TempDir::new().unwrap();
    let daemon = start(data.path()).await;
    let kinds = shape.prepare(&daemon.client).await;
    daemon.kill().await;
    let mut measured = Vec::new();
    for (kind, spec) in kinds {
        measured.push((format!("{kind}: {}", shape.name), measure_job(data.path(), spec).await));
    }
    measured
}

/// Measures a job. The server that runs it has done nothing else before.
async fn measure_job(data: &Path, spec: job_spec::Kind) -> Measured {
    let before = start(data).await;
    before.client.pause_queue(v1::PauseQueueRequest::default()).await.unwrap();
    let request = v1::SubmitJobRequest { spec: Some(lightpath::job_spec(spec)), ..Default::default() };
    let job = before.client.submit(request).await.unwrap();
    before.kill().await;
    let daemon = start(data).await;
    // The server answers when it has started completely.
    daemon.client.list_jobs(v1::ListJobsRequest::default()).await.unwrap();
    tokio::time::sleep(SETTLE).await;
    let idle_kib = daemon.memory_kib();
    daemon.forget_memory_peak();
    daemon.client.resume_queue(v1::ResumeQueueRequest::default()).await.unwrap();
    let ended = daemon.client.wait(&job.name, |_| ()).await.unwrap();
    assert_eq!(ended.state(), State::Succeeded, "{ended:?}");
    let peak_kib = daemon.memory_peak_kib();
    daemon.kill().await;
    let [started, finished] = [ended.start_time, ended.end_time].map(|time| {
        let time = time.unwrap();
        time.seconds as f64 + 1e-9 * f64::from(time.nanos)
    });
    Measured {
        estimate_mib: job.estimated_memory_bytes() as f64 / 1_048_576.0,
        memory_mib: peak_kib.saturating_sub(idle_kib) as f64 / 1024.0,
        estimate_s: job.estimated_time_s(),
        took_s: finished - started,
    }
}

async fn start(data: &Path) -> Daemon {
    let limits = ["--job-memory-mib-max", "200000", "--job-time-s-max", "1000000", "--compute-threads", "2"];
    Daemon::start(data, &limits).await
}
