//! Tests of jobs that align and finalize datasets, and of jobs that report on kernels.

use crate::jobs::{submit, submit_long, watch_to_end};
use crate::kernels;
use crate::serving::{Serving, expect};
use crate::test_bench::{CENTRE, Dataset, HEIGHT, TestBench, WIDTH};
use lightpath_camera::alignment::Homography;
use lightpath_proto::v1::dataset_service_client::DatasetServiceClient;
use lightpath_proto::v1::job_result::Kind as JobResult;
use lightpath_proto::v1::job_spec::Kind;
use lightpath_proto::v1::prepare_dataset::align::{NoAlignment, Source};
use lightpath_proto::v1::prepare_dataset::{Align, Finalize, Step};
use lightpath_proto::v1::{self, job::State};
use tonic::Code;

/// Submits a job and returns its result. The error is the message of the refusal if the submit was refused, or
/// `REASON: message` if the job failed.
pub(crate) async fn run_job(serving: &Serving, kind: Kind) -> Result<JobResult, String> {
    let job = submit(serving, kind, "").await.map_err(|status| status.message().to_owned())?;
    let job = watch_to_end(serving, &job.name).await;
    match (job.result.and_then(|result| result.kind), job.error) {
        (Some(result), None) => {
            assert!(job.progress.is_some_and(|progress| !progress.stage.is_empty()), "the job reported its progress");
            Ok(result)
        }
        (_, Some(error)) => Err(format!("{}: {}", error.reason, error.message)),
        (None, None) => panic!("neither a result nor an error"),
    }
}

/// A dataset with all its pairs, and the findings about all of them and about the dataset.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct WholeDataset {
    dataset: v1::Dataset,
    pub(crate) pairs: Vec<v1::Pair>,
    pub(crate) findings: Vec<v1::Finding>,
}

impl std::ops::Deref for WholeDataset {
    type Target = v1::Dataset;

    fn deref(&self) -> &v1::Dataset {
        &self.dataset
    }
}

/// Aligns or finalizes a dataset with a job, and returns the changed dataset.
pub(crate) async fn prepare(serving: &Serving, name: &str, step: Step) -> Result<WholeDataset, String> {
    let spec = v1::PrepareDataset { dataset: name.to_owned(), step: Some(step) };
    let JobResult::PrepareDataset(result) = run_job(serving, Kind::PrepareDataset(spec)).await? else {
        panic!("the result is of another kind")
    };
    let mut client = DatasetServiceClient::new(serving.channel.clone());
    let request = v1::GetDatasetRequest { name: name.to_owned() };
    let dataset = client.get_dataset(request).await.unwrap().into_inner();
    let list = v1::ListPairsRequest { dataset: name.to_owned(), page_size: 1000, ..Default::default() };
    let pairs = client.list_pairs(list).await.unwrap().into_inner().pairs;
    assert_eq!(pairs.len(), dataset.pair_count as usize);
    let findings: Vec<_> = pairs.iter().flat_map(|pair| &pair.findings).chain(&dataset.findings).cloned().collect();
    assert_eq!((&result.alignment, &result.findings, &result.digest), (&dataset.alignment, &findings, &dataset.digest));
    Ok(WholeDataset { dataset, pairs, findings })
}

/// Finalizes a dataset with a job and the default settings, and returns the finalized dataset.
pub(crate) async fn finalize(serving: &Serving, name: &str) -> Result<WholeDataset, String> {
    prepare(serving, name, Step::Finalize(Finalize::default())).await
}

/// Reports on a kernel version with a job, and returns the result of the job.
pub(crate) async fn report(serving: &Serving, kernel_version: &str) -> Result<v1::ReportKernelResult, String> {
    let spec = v1::ReportKernel { kernel_version: kernel_version.to_owned() };
    match run_job(serving, Kind::ReportKernel(spec)).await? {
        JobResult::ReportKernel(result) => Ok(result),
        other => panic!("{other:?}"),
    }
}

/// Asserts that the answer is an error whose message begins with `start`.
pub(crate) fn assert_refused<T: std::fmt::Debug>(answer: Result<T, String>, start: &str) {
    let message = answer.unwrap_err();
    assert!(message.starts_with(start), "{message}");
}

#[tokio::test]
async fn waiting_reports_do_not_delay_submits() {
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
async fn waiting_job_finalizes_the_pairs_present_at_its_start() {
    let (bench, mut dataset) = (TestBench::new(3), Dataset::open().await);
    let mut phases = (0..3).map(|card| bench.hologram(card));
    let mut add = async |dataset: &mut Dataset, id: &str| {
        let phase = phases.next().unwrap();
        dataset.add(id, &phase, &bench.photo(&phase, 1, &Homography::IDENTITY, HEIGHT, WIDTH)).await
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
    let Some(JobResult::PrepareDataset(result)) = job.result.and_then(|result| result.kind) else {
        panic!("the result is of another kind")
    };
    let counts = result.split_counts.unwrap();
    assert_eq!(counts.train + counts.validation + counts.test + counts.excluded, 3);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn restart_during_finalization_leaves_the_dataset_consistent() {
    let (bench, mut dataset) = (TestBench::new(3), Dataset::open().await);
    let turned = Homography::similarity(CENTRE, 1.0_f64.to_radians(), 1.0, [2.0, 0.0]);
    for card in 0..4 {
        let phase = bench.hologram(card);
        dataset.add(&format!("p{card}"), &phase, &bench.photo(&phase, 1, &turned, HEIGHT, WIDTH)).await;
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
    let Some(JobResult::PrepareDataset(result)) = job.result.and_then(|result| result.kind) else {
        panic!("the result is of another kind")
    };
    // The dataset agrees with the result of the job, and finalizing it again changes nothing.
    let finalized = finalize(&serving, "datasets/d").await.unwrap();
    assert_eq!((&finalized.digest, &finalized.alignment), (&result.digest, &result.alignment));
    let counts = result.split_counts.unwrap();
    assert!(finalized.alignment.is_some() && counts.train >= 1 && counts.test >= 1);
    assert_eq!(finalized.split_counts, Some(counts));
}

#[tokio::test]
async fn dataset_is_deleted_unless_a_job_uses_it() {
    let mut dataset = Dataset::open().await;
    dataset.serving.jobs().pause_queue(v1::PauseQueueRequest::default()).await.unwrap();
    let step = Step::Align(Align { source: Some(Source::None(NoAlignment {})) });
    let spec = v1::PrepareDataset { dataset: "datasets/d".to_owned(), step: Some(step) };
    let job = submit(&dataset.serving, Kind::PrepareDataset(spec), "").await.unwrap();
    let request = v1::DeleteDatasetRequest { name: "datasets/d".into() };
    let refused = dataset.client.delete_dataset(request.clone()).await;
    expect(refused, Code::FailedPrecondition, "datasets/d cannot be deleted while jobs/");
    dataset.serving.jobs().cancel_job(v1::CancelJobRequest { name: job.name }).await.unwrap();
    dataset.client.delete_dataset(request.clone()).await.unwrap();
    let found = dataset.client.get_dataset(v1::GetDatasetRequest { name: "datasets/d".into() }).await;
    expect(found, Code::NotFound, "datasets/d does not exist");
    expect(dataset.client.delete_dataset(request).await, Code::NotFound, "datasets/d does not exist");
}
