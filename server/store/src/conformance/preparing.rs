//! Tests of jobs that align and finalize datasets while other jobs or callers change the same dataset.

use super::*;
use crate::AbortReason;
use crate::sql::query;
use lightpath_domain::dataset::{
    Alignment, AlignmentMethod, CameraMap, Finalization, Finding, FindingKind, PairChecks, PreparedDataset, Split,
    Splits, digest as dataset_digest, draw_split,
};
use lightpath_domain::job::{AlignBy, Job, Lease, PrepareDataset, PrepareResult, PrepareStep};
use lightpath_domain::reason::PreconditionReason;
use std::collections::BTreeMap;

const FINALIZATION: Finalization =
    Finalization { validation_fraction: 0.2, test_fraction: 0.2, seed: 1, keep_alignment: false };

/// Starts a job that prepares a dataset, and returns its lease. The store does not read the step of the job.
async fn start_job(store: &Store, request_id: &str, id: &str) -> Lease {
    let step = PrepareStep::Align(AlignBy::None);
    let spec = PrepareDataset { dataset: id.to_owned(), display: "lab".to_owned(), step };
    let new = NewJob { spec: JobSpec::PrepareDataset(spec), ..new_job(request_id, 1) };
    store.submit(&new, 10, QUEUE_LIMIT).await.unwrap();
    let (job, lease) = store.claim(10, LEASE_MS, "w").await.unwrap().unwrap();
    assert_eq!(job.request_id, request_id);
    lease
}

async fn finish(store: &Store, lease: &Lease, prepared: PreparedDataset) -> Result<Job, StoreError> {
    let result = PrepareResult { alignment: prepared.alignment.clone(), ..PrepareResult::default() };
    store.finish(lease, JobResult::PrepareDataset(result), JobEffect::Dataset(Box::new(prepared)), 20).await
}

/// The result of a job that changes nothing.
fn unchanged(dataset: &Dataset) -> PreparedDataset {
    PreparedDataset {
        dataset: dataset.id.clone(),
        revision: dataset.revision,
        alignment: dataset.alignment.clone(),
        checks: BTreeMap::new(),
        findings: dataset.findings.clone(),
        closing: None,
    }
}

fn splits(dataset: &Dataset) -> Splits {
    let drawn =
        draw_split(&dataset.pairs, FINALIZATION.validation_fraction, FINALIZATION.test_fraction, FINALIZATION.seed);
    drawn.into_iter().map(|(id, split)| (id, Some(split))).collect()
}

/// The result of a job that finalizes the dataset.
fn finalized(dataset: &Dataset) -> PreparedDataset {
    PreparedDataset { closing: Some((FINALIZATION, splits(dataset))), ..unchanged(dataset) }
}

fn alignment(shift_px: f64) -> Alignment {
    Alignment {
        method: AlignmentMethod::Points,
        map: CameraMap { homography: [1.0, 0.0, shift_px, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], distortion: [0.0; 4] },
        photo_height_px: 48,
        photo_width_px: 64,
        points: 4,
        residual_px: 0.0,
        corrected_px: shift_px,
        left_px: 0.0,
        explanation: String::new(),
        photo: String::new(),
        before: digest(0),
        after: String::new(),
    }
}

/// A dataset of five pairs.
async fn open_dataset(store: &Store, id: &str) -> Dataset {
    record(store, 12).await;
    store.create_dataset(&dataset(id), 5).await.unwrap();
    for n in 0..5 {
        store.add_pairs(id, &[pair(n)], &[]).await.unwrap();
    }
    store.dataset(id).await.unwrap()
}

/// Finalizes a dataset with a job, and returns the finalized dataset.
pub(super) async fn finalize(store: &Store, id: &str) -> Dataset {
    let lease = start_job(store, &format!("finalize {id}"), id).await;
    let open = store.dataset(id).await.unwrap();
    let job = finish(store, &lease, finalized(&open)).await.unwrap();
    let closed = store.dataset(id).await.unwrap();
    let Some(JobResult::PrepareDataset(result)) = job.result else { panic!("{:?}", job.result) };
    assert_eq!((result.dataset_digest, closed.finalization), (closed.digest.clone(), Some(FINALIZATION)));
    closed
}

#[tokio::test]
async fn finished_job_stores_alignment_checks_findings_and_digest() {
    let (store, database) = store().await;
    let open = open_dataset(&store, "d").await;
    let lease = start_job(&store, "align", "d").await;
    let checks = PairChecks { contrast: 0.5, map: Some(alignment(2.0).map), ..PairChecks::default() };
    let finding = |pair: &str, kind| Finding { pair: pair.into(), kind, excludes: false, message: "check it".into() };
    let findings = vec![finding("p1", FindingKind::Saturated), finding("", FindingKind::Misaligned)];
    let prepared = PreparedDataset {
        alignment: Some(alignment(2.0)),
        checks: BTreeMap::from([("p1".to_owned(), checks.clone())]),
        findings: findings.clone(),
        ..unchanged(&open)
    };
    finish(&store, &lease, prepared).await.unwrap();
    let aligned = store.dataset("d").await.unwrap();
    assert_eq!((&aligned.alignment, &aligned.findings), (&Some(alignment(2.0)), &findings));
    assert_eq!(aligned.pairs[1].checks, Some(checks));
    assert!(aligned.revision > open.revision && aligned.digest.is_none());
    assert_eq!(store.datasets(None, None, 9).await.unwrap()[0].findings, findings[1..]);

    let closed = finalize(&store, "d").await;
    assert_eq!(closed.digest, Some(dataset_digest(&closed)));
    assert_ne!(closed.digest, Some(dataset_digest(&Dataset { alignment: None, ..closed.clone() })));
    let given: Splits = closed.pairs.iter().map(|pair| (pair.id.clone(), pair.split)).collect();
    assert_eq!((given, &closed.findings), (splits(&open), &findings));
    let end = finish(&store, &start_job(&store, "late", "d").await, unchanged(&closed)).await;
    assert!(
        matches!(end, Err(StoreError::Precondition { reason: PreconditionReason::DatasetFinalized, .. })),
        "{end:?}"
    );
    assert_eq!(store.dataset("d").await.unwrap(), closed);

    // The check for dangling references does not mistake the dataset's digest for an artifact.
    store.close().await;
    let mut inspection = database.inspect().await;
    let dangling = inspection.dangling_references().await.unwrap();
    assert!(dangling.is_empty(), "{dangling:?}");
    inspection.close().await.unwrap();
}

#[tokio::test]
async fn second_of_two_concurrent_jobs_changes_nothing() {
    let (store, _folder) = store().await;
    let open = open_dataset(&store, "d").await;
    let (first, second) = (start_job(&store, "align", "d").await, start_job(&store, "finalize", "d").await);
    let aligned = PreparedDataset { alignment: Some(alignment(2.0)), ..unchanged(&open) };
    finish(&store, &first, aligned).await.unwrap();
    let end = finish(&store, &second, finalized(&open)).await;
    assert!(matches!(end, Err(StoreError::Aborted { reason: AbortReason::DatasetChanged, .. })), "{end:?}");
    let now = store.dataset("d").await.unwrap();
    assert_eq!((&now.alignment, &now.digest), (&Some(alignment(2.0)), &None));
    assert!(now.pairs.iter().all(|pair| pair.split.is_none()));
    // The lease is still valid, so the job can end with the reason.
    store.fail(&second, io_error(), None, 21).await.unwrap();
    assert_eq!(finalize(&store, "d").await.alignment, Some(alignment(2.0)));
}

/// A step of one of two jobs on the same dataset, or of a caller who adds a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    ReadToAlign,
    Align,
    ReadToFinalize,
    Finalize,
    AddPair,
}

/// All orders of the steps in which each job reads the dataset before it ends.
fn orders() -> Vec<Vec<Step>> {
    use Step::{AddPair, Align, Finalize, ReadToAlign, ReadToFinalize};
    let mut orders = vec![Vec::new()];
    for step in [ReadToAlign, Align, ReadToFinalize, Finalize, AddPair] {
        let longer = orders.iter().flat_map(|order: &Vec<Step>| {
            (0..=order.len()).map(move |place| [&order[..place], &[step], &order[place..]].concat())
        });
        orders = longer.collect();
    }
    let position = |order: &[Step], step| order.iter().position(|other| *other == step);
    orders.retain(|order| {
        position(order, ReadToAlign) < position(order, Align)
            && position(order, ReadToFinalize) < position(order, Finalize)
    });
    orders
}

#[tokio::test]
async fn digest_matches_the_dataset_in_every_order_of_aligning_finalizing_and_adding() {
    let (store, database) = store().await;
    let orders = orders();
    assert_eq!(orders.len(), 30);
    let (mut finalized_and_aligned, mut finalized_only) = (0, 0);
    for (n, order) in orders.iter().enumerate() {
        let id = format!("d{n}");
        open_dataset(&store, &id).await;
        let leases = [
            start_job(&store, &format!("align {n}"), &id).await,
            start_job(&store, &format!("finalize {n}"), &id).await,
        ];
        let mut read = [None, None];
        for step in order {
            let now = store.dataset(&id).await.unwrap();
            match step {
                Step::ReadToAlign => read[0] = Some(now),
                Step::ReadToFinalize => read[1] = Some(now),
                Step::Align => {
                    let seen = read[0].as_ref().unwrap();
                    let aligned = PreparedDataset { alignment: Some(alignment(2.0)), ..unchanged(seen) };
                    let ended = finish(&store, &leases[0], aligned).await;
                    assert_eq!(ended.is_ok(), now.revision == seen.revision && now.digest.is_none(), "{order:?}");
                }
                Step::Finalize => {
                    let seen = read[1].as_ref().unwrap();
                    let ended = finish(&store, &leases[1], finalized(seen)).await;
                    assert_eq!(ended.is_ok(), now.revision == seen.revision, "{order:?}");
                }
                Step::AddPair => assert_eq!(store.add_pairs(&id, &[pair(5)], &[]).await.is_ok(), now.digest.is_none()),
            }
        }
        let end = store.dataset(&id).await.unwrap();
        if let Some(digest) = &end.digest {
            assert_eq!(*digest, dataset_digest(&end), "{order:?}");
            finalized_and_aligned += u32::from(end.alignment.is_some());
            finalized_only += u32::from(end.alignment.is_none());
        }
        for lease in leases {
            // A job that was refused still runs.
            drop(store.fail(&lease, io_error(), None, 30).await);
        }
    }
    assert!(finalized_and_aligned > 0 && finalized_only > 0);
    store.close().await;
    let mut inspection = database.inspect().await;
    assert_eq!(inspection.changed_datasets().await.unwrap(), Vec::<String>::new());
    inspection.close().await.unwrap();
}

#[tokio::test]
async fn check_finds_a_finalized_dataset_that_was_changed() {
    let (store, database) = store().await;
    open_dataset(&store, "d").await;
    finalize(&store, "d").await;
    open_dataset(&store, "open").await;
    store.close().await;
    let changed = async || {
        let mut inspection = database.inspect().await;
        let changed = inspection.changed_datasets().await.unwrap();
        inspection.close().await.unwrap();
        changed
    };
    assert_eq!(changed().await, Vec::<String>::new());
    // The database refuses such a change, unless its triggers are removed.
    let mut connection = database.connect().await;
    let alignment = serde_json::to_string(&alignment(2.0)).unwrap();
    let change = || query("update dataset set alignment = $1 where id = 'd'").bind(&alignment);
    assert!(change().execute(&mut connection).await.is_err());
    let on = if database.url.is_some() { " on dataset" } else { "" };
    database.change(&format!("drop trigger finalized_dataset_stays{on}")).await;
    change().execute(&mut connection).await.unwrap();
    connection.close().await.unwrap();
    assert_eq!(changed().await, ["d"]);
}

#[tokio::test]
async fn pair_added_during_a_job_is_kept_and_the_job_changes_nothing() {
    let (store, _folder) = store().await;
    let open = open_dataset(&store, "d").await;
    let lease = start_job(&store, "finalize", "d").await;
    store.add_pairs("d", &[pair(5)], &[]).await.unwrap();
    let end = finish(&store, &lease, finalized(&open)).await;
    assert!(matches!(end, Err(StoreError::Aborted { reason: AbortReason::DatasetChanged, .. })), "{end:?}");
    store.add_pairs("d", &[pair(5)], &[]).await.unwrap();
    let now = store.dataset("d").await.unwrap();
    assert_eq!((now.pairs.len(), now.digest.is_none(), now.revision), (6, true, open.revision + 1));
}

#[tokio::test]
async fn pair_measured_with_another_alignment_is_refused() {
    let (store, _folder) = store().await;
    let open = open_dataset(&store, "d").await;
    let aligned = PreparedDataset { alignment: Some(alignment(2.0)), ..unchanged(&open) };
    finish(&store, &start_job(&store, "align", "d").await, aligned).await.unwrap();
    let measured = |map| {
        let checks = PairChecks { map, ..PairChecks::default() };
        Pair { checks: Some(checks), ..pair(5) }
    };
    let refused = store.add_pairs("d", &[measured(None)], &[]).await;
    assert!(matches!(refused, Err(StoreError::Aborted { reason: AbortReason::DatasetChanged, .. })), "{refused:?}");
    store.add_pairs("d", &[measured(Some(alignment(2.0).map))], &[]).await.unwrap();
}

#[tokio::test]
async fn lost_lease_missing_artifact_or_invalid_split_stores_nothing() {
    let (store, _folder) = store().await;
    let open = open_dataset(&store, "d").await;
    let lease = start_job(&store, "prepare", "d").await;
    let lost = Lease { attempt: 2, ..lease.clone() };
    assert!(matches!(finish(&store, &lost, finalized(&open)).await, Err(StoreError::LeaseLost)));
    let unknown = Alignment { after: digest(99), ..alignment(1.0) };
    let unknown = PreparedDataset { alignment: Some(unknown), ..unchanged(&open) };
    assert!(matches!(finish(&store, &lease, unknown).await, Err(StoreError::NotFound { .. })));
    let all_train = splits(&open).into_iter().map(|(id, _)| (id, Some(Split::Train))).collect();
    let all_train = PreparedDataset { closing: Some((FINALIZATION, all_train)), ..unchanged(&open) };
    let end = finish(&store, &lease, all_train).await;
    assert!(
        matches!(end, Err(StoreError::Precondition { reason: PreconditionReason::DatasetSplitEmpty, .. })),
        "{end:?}"
    );
    let few = PreparedDataset { closing: Some((FINALIZATION, splits(&open)[1..].to_vec())), ..unchanged(&open) };
    assert!(matches!(finish(&store, &lease, few).await, Err(StoreError::Aborted { .. })));
    assert_eq!(store.dataset("d").await.unwrap(), open);
    finish(&store, &lease, finalized(&open)).await.unwrap();
}
