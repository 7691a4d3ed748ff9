//! Datasets that jobs align and finalize, and kernels that jobs report on.

use crate::jobs::{submit, submit_long, watch_to_end};
use crate::kernels;
use crate::optics_lab::{CENTRE, Dataset, HEIGHT, Lab, WIDTH};
use crate::serving::Serving;
use lightpath_optics::alignment::Homography;
use lightpath_proto::v1::dataset_service_client::DatasetServiceClient;
use lightpath_proto::v1::job_result::Kind as Gave;
use lightpath_proto::v1::job_spec::Kind;
use lightpath_proto::v1::prepare_dataset::{Finalize, Step};
use lightpath_proto::v1::{self, job::State};

/// What a job gave; the message of the refusal where none was made, or `REASON: message` where it failed.
async fn done(serving: &Serving, kind: Kind) -> Result<Gave, String> {
    let job = submit(serving, kind, "").await.map_err(|status| status.message().to_owned())?;
    let job = watch_to_end(serving, &job.name).await;
    match (job.result.and_then(|result| result.kind), job.error) {
        (Some(gave), None) => {
            assert!(job.progress.is_some_and(|progress| !progress.stage.is_empty()), "progress was told");
            Ok(gave)
        }
        (_, Some(error)) => Err(format!("{}: {}", error.reason, error.message)),
        (None, None) => panic!("neither a result nor an error"),
    }
}

/// A dataset after a job has prepared it.
pub(crate) async fn prepare(serving: &Serving, name: &str, step: Step) -> Result<v1::Dataset, String> {
    let spec = v1::PrepareDataset { dataset: name.to_owned(), step: Some(step) };
    let Gave::Prepare(result) = done(serving, Kind::PrepareDataset(spec)).await? else { panic!("another kind") };
    let mut client = DatasetServiceClient::new(serving.channel.clone());
    let request = v1::GetDatasetRequest { name: name.to_owned() };
    let dataset = client.get_dataset(request).await.unwrap().into_inner();
    assert_eq!(
        (&result.alignment, &result.findings, &result.digest),
        (&dataset.alignment, &dataset.findings, &dataset.digest)
    );
    Ok(dataset)
}

/// A dataset that a job has finalized with the defaults.
pub(crate) async fn finalize(serving: &Serving, name: &str) -> Result<v1::Dataset, String> {
    prepare(serving, name, Step::Finalize(Finalize::default())).await
}

/// A kernel version's report.
pub(crate) async fn report(serving: &Serving, kernel_version: &str) -> Result<v1::ReportResult, String> {
    let spec = v1::ReportKernel { kernel_version: kernel_version.to_owned() };
    match done(serving, Kind::ReportKernel(spec)).await? {
        Gave::Report(result) => Ok(result),
        other => panic!("{other:?}"),
    }
}

/// Asserts how the refusal begins.
pub(crate) fn refused<T: std::fmt::Debug>(answer: Result<T, String>, start: &str) {
    let message = answer.unwrap_err();
    assert!(message.starts_with(start), "{message}");
}

#[tokio::test]
async fn reports_hold_up_no_submit() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    kernels::import(&serving, &kernels::kernel(64, 0.3), 0.05).await.unwrap();
    let report = v1::ReportKernel { kernel_version: format!("{}/versions/1", kernels::KERNEL) };
    let mut reports = Vec::new();
    for _ in 0..8 {
        reports.push(submit(&serving, Kind::ReportKernel(report.clone()), "").await.unwrap());
    }
    let hologram = submit_long(&serving).await;
    let last = v1::GetJobRequest { name: reports[7].name.clone() };
    let last = serving.jobs().get_job(last).await.unwrap().into_inner();
    assert!(matches!(last.state(), State::Queued | State::Running), "{last:?}");
    for job in reports {
        assert_eq!(watch_to_end(&serving, &job.name).await.state(), State::Succeeded);
    }
    serving.jobs().cancel_job(v1::CancelJobRequest { name: hologram.name }).await.unwrap();
}

#[tokio::test]
async fn a_job_that_waits_prepares_what_is_there_when_it_starts() {
    let (lab, mut dataset) = (Lab::new(3), Dataset::open().await);
    let mut phases = (0..3).map(|card| lab.hologram(card));
    let mut add = async |dataset: &mut Dataset, id: &str| {
        let phase = phases.next().unwrap();
        dataset.add(id, &phase, &lab.photo(&phase, 1, &Homography::IDENTITY, HEIGHT, WIDTH)).await
    };
    add(&mut dataset, "p0").await;
    add(&mut dataset, "p1").await;
    let pause = v1::PauseQueueRequest::default();
    dataset.serving.jobs().pause_queue(pause).await.unwrap();
    let step = Some(Step::Finalize(Finalize::default()));
    let spec = Kind::PrepareDataset(v1::PrepareDataset { dataset: "datasets/d".into(), step });
    let job = submit(&dataset.serving, spec, "").await.unwrap();
    add(&mut dataset, "p2").await;
    dataset.serving.jobs().resume_queue(v1::ResumeQueueRequest::default()).await.unwrap();
    let job = watch_to_end(&dataset.serving, &job.name).await;
    assert_eq!(job.state(), State::Succeeded, "{job:?}");
    let Some(Gave::Prepare(result)) = job.result.and_then(|result| result.kind) else { panic!("another kind") };
    assert_eq!(result.train_pairs + result.test_pairs + result.left_out_pairs, 3);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_restart_while_a_dataset_is_prepared_leaves_it_whole() {
    let (lab, mut dataset) = (Lab::new(3), Dataset::open().await);
    let turned = Homography::similarity(CENTRE, 1.0_f64.to_radians(), 1.0, [2.0, 0.0]);
    for card in 0..4 {
        let phase = lab.hologram(card);
        dataset.add(&format!("p{card}"), &phase, &lab.photo(&phase, 1, &turned, HEIGHT, WIDTH)).await;
    }
    let step = Some(Step::Finalize(Finalize::default()));
    let spec = Kind::PrepareDataset(v1::PrepareDataset { dataset: "datasets/d".into(), step });
    let job = submit(&dataset.serving, spec, "").await.unwrap();
    let watch = v1::WatchJobRequest { name: job.name.clone() };
    let mut changes = dataset.serving.jobs().watch_job(watch).await.unwrap().into_inner();
    let is_aligning = |job: v1::Job| job.progress.is_some_and(|progress| progress.stage.starts_with("align"));
    while !changes.message().await.unwrap().is_none_or(is_aligning) {}
    drop(changes);
    let serving = dataset.serving.restart().await;
    let job = watch_to_end(&serving, &job.name).await;
    assert_eq!(job.state(), State::Succeeded, "{job:?}");
    let Some(Gave::Prepare(result)) = job.result.and_then(|result| result.kind) else { panic!("another kind") };
    // What the job told, the dataset is: the same again changes nothing.
    let closed = finalize(&serving, "datasets/d").await.unwrap();
    assert_eq!((&closed.digest, &closed.alignment), (&result.digest, &result.alignment));
    assert!(closed.alignment.is_some() && result.train_pairs >= 1 && result.test_pairs >= 1);
}
