//! Datasets that jobs align and finalize, while others add pairs or do the same.

use super::*;
use crate::{AbortReason, Inspection, PreconditionReason};
use lightpath_domain::dataset::{
    Alignment, AlignmentMethod, Finalization, Finding, FindingKind, PairChecks, PreparedDataset, Split, Splits,
    digest as dataset_digest, draw_split,
};
use lightpath_domain::job::{AlignBy, Job, Lease, PrepareDataset, PrepareResult, PrepareStep};
use std::collections::BTreeMap;

const HOW: Finalization = Finalization { validation_fraction: 0.2, test_fraction: 0.2, seed: 1, keep_alignment: false };

/// A running job that prepares a dataset; what it is to do only its worker reads.
async fn running(store: &Store, request_id: &str, id: &str) -> Lease {
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
    store.finish(lease, JobResult::Prepare(result), JobEffect::Dataset(Box::new(prepared)), 20).await
}

/// What a job found that changes nothing.
fn as_it_is(dataset: &Dataset) -> PreparedDataset {
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
    let drawn = draw_split(&dataset.pairs, HOW.validation_fraction, HOW.test_fraction, HOW.seed);
    drawn.into_iter().map(|(id, split)| (id, Some(split))).collect()
}

fn closing(dataset: &Dataset) -> PreparedDataset {
    PreparedDataset { closing: Some((HOW, splits(dataset))), ..as_it_is(dataset) }
}

fn alignment(shift_px: f64) -> Alignment {
    Alignment {
        method: AlignmentMethod::Points,
        homography: [1.0, 0.0, shift_px, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        photo_height_px: 48,
        photo_width_px: 64,
        points: 4,
        residual_px: 0.0,
        corrected_px: shift_px,
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
        store.add_pair(id, &pair(n), &[]).await.unwrap();
    }
    store.dataset(id).await.unwrap()
}

/// Closes a dataset by a job, and returns what that left.
pub(super) async fn finalize(store: &Store, id: &str) -> Dataset {
    let lease = running(store, &format!("finalize {id}"), id).await;
    let open = store.dataset(id).await.unwrap();
    let job = finish(store, &lease, closing(&open)).await.unwrap();
    let closed = store.dataset(id).await.unwrap();
    let Some(JobResult::Prepare(result)) = job.result else { panic!("{:?}", job.result) };
    assert_eq!((result.dataset_digest, closed.finalization), (closed.digest.clone(), Some(HOW)));
    closed
}

#[tokio::test]
async fn what_a_job_found_is_stored_when_it_ends_and_the_digest_says_what_the_dataset_is() {
    let (store, folder) = store().await;
    let open = open_dataset(&store, "d").await;
    let lease = running(&store, "align", "d").await;
    let checks = PairChecks { contrast: 0.5, homography: Some(alignment(2.0).homography), ..PairChecks::default() };
    let finding = |pair: &str, kind| Finding { pair: pair.into(), kind, excludes: false, message: "look".into() };
    let findings = vec![finding("p1", FindingKind::Saturated), finding("", FindingKind::Misaligned)];
    let prepared = PreparedDataset {
        alignment: Some(alignment(2.0)),
        checks: BTreeMap::from([("p1".to_owned(), checks.clone())]),
        findings: findings.clone(),
        ..as_it_is(&open)
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
    let end = finish(&store, &running(&store, "late", "d").await, as_it_is(&closed)).await;
    assert!(
        matches!(end, Err(StoreError::Precondition { reason: PreconditionReason::DatasetFinalized, .. })),
        "{end:?}"
    );
    assert_eq!(store.dataset("d").await.unwrap(), closed);

    // A dataset's digest is not taken for an artifact's.
    let path = folder.path().join("lightpath.db");
    store.close().await;
    let mut inspection = Inspection::open(&path).await.unwrap();
    let dangling = inspection.dangling_references().await.unwrap();
    assert!(dangling.is_empty(), "{dangling:?}");
    inspection.close().await.unwrap();
}

#[tokio::test]
async fn of_two_jobs_that_read_the_same_dataset_the_second_changes_nothing() {
    let (store, _folder) = store().await;
    let open = open_dataset(&store, "d").await;
    let (first, second) = (running(&store, "align", "d").await, running(&store, "finalize", "d").await);
    let aligned = PreparedDataset { alignment: Some(alignment(2.0)), ..as_it_is(&open) };
    finish(&store, &first, aligned).await.unwrap();
    let end = finish(&store, &second, closing(&open)).await;
    assert!(matches!(end, Err(StoreError::Aborted { reason: AbortReason::DatasetChanged, .. })), "{end:?}");
    let now = store.dataset("d").await.unwrap();
    assert_eq!((&now.alignment, &now.digest), (&Some(alignment(2.0)), &None));
    assert!(now.pairs.iter().all(|pair| pair.split.is_none()));
    // The lease still holds: the job can be told why.
    store.fail(&second, trouble(), None, 21).await.unwrap();
    assert_eq!(finalize(&store, "d").await.alignment, Some(alignment(2.0)));
}

#[tokio::test]
async fn a_pair_that_comes_in_between_stays_and_the_job_changes_nothing() {
    let (store, _folder) = store().await;
    let open = open_dataset(&store, "d").await;
    let lease = running(&store, "finalize", "d").await;
    store.add_pair("d", &pair(5), &[]).await.unwrap();
    let end = finish(&store, &lease, closing(&open)).await;
    assert!(matches!(end, Err(StoreError::Aborted { reason: AbortReason::DatasetChanged, .. })), "{end:?}");
    store.add_pair("d", &pair(5), &[]).await.unwrap();
    let now = store.dataset("d").await.unwrap();
    assert_eq!((now.pairs.len(), now.digest.is_none(), now.revision), (6, true, open.revision + 1));
}

#[tokio::test]
async fn a_pair_that_was_measured_with_another_alignment_is_refused() {
    let (store, _folder) = store().await;
    let open = open_dataset(&store, "d").await;
    let aligned = PreparedDataset { alignment: Some(alignment(2.0)), ..as_it_is(&open) };
    finish(&store, &running(&store, "align", "d").await, aligned).await.unwrap();
    let measured = |homography| {
        let checks = PairChecks { homography, ..PairChecks::default() };
        Pair { checks: Some(checks), ..pair(5) }
    };
    let refused = store.add_pair("d", &measured(None), &[]).await;
    assert!(matches!(refused, Err(StoreError::Aborted { reason: AbortReason::DatasetChanged, .. })), "{refused:?}");
    store.add_pair("d", &measured(Some(alignment(2.0).homography)), &[]).await.unwrap();
}

#[tokio::test]
async fn nothing_is_stored_without_a_lease_a_picture_or_a_pair_for_the_test() {
    let (store, _folder) = store().await;
    let open = open_dataset(&store, "d").await;
    let lease = running(&store, "prepare", "d").await;
    let lost = Lease { attempt: 2, ..lease.clone() };
    assert!(matches!(finish(&store, &lost, closing(&open)).await, Err(StoreError::LeaseLost)));
    let unknown = Alignment { after: digest(99), ..alignment(1.0) };
    let unknown = PreparedDataset { alignment: Some(unknown), ..as_it_is(&open) };
    assert!(matches!(finish(&store, &lease, unknown).await, Err(StoreError::NotFound { .. })));
    let all_train = splits(&open).into_iter().map(|(id, _)| (id, Some(Split::Train))).collect();
    let all_train = PreparedDataset { closing: Some((HOW, all_train)), ..as_it_is(&open) };
    let end = finish(&store, &lease, all_train).await;
    assert!(
        matches!(end, Err(StoreError::Precondition { reason: PreconditionReason::DatasetSplitEmpty, .. })),
        "{end:?}"
    );
    let few = PreparedDataset { closing: Some((HOW, splits(&open)[1..].to_vec())), ..as_it_is(&open) };
    assert!(matches!(finish(&store, &lease, few).await, Err(StoreError::Aborted { .. })));
    assert_eq!(store.dataset("d").await.unwrap(), open);
    finish(&store, &lease, closing(&open)).await.unwrap();
}
