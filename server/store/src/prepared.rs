//! Storage of the results of jobs that align or finalize datasets.
//!
//! A job reads a dataset and computes. One transaction then ends the job and stores its results. The transaction fails
//! if the dataset has changed since the job read it. So the digest of a finalized dataset always matches its stored
//! pairs and alignment, even if other callers add pairs or align the dataset at the same time.

use super::datasets::{changed, require_artifact, with_pairs};
use super::rows::{to_json, to_word};
use super::sql::query;
use super::write::Write;
use super::{AbortReason, Result, StoreError};
use lightpath_domain::dataset::{
    self, Dataset, Finalization, Finding, Pair, PairChecks, PreparedDataset, Split, SplitCounts, Splits,
};
use lightpath_domain::reason::PreconditionReason;
use std::collections::BTreeMap;

/// Stores the results of a job that aligned or finalized a dataset, and returns the changed dataset.
pub(super) async fn store_prepared(write: &mut Write, prepared: PreparedDataset, now_ms: i64) -> Result<Dataset> {
    let PreparedDataset { dataset: id, revision, alignment, mut checks, findings, closing } = prepared;
    let before = with_pairs(write.sql(), &id).await?;
    require_unchanged(&before, revision)?;
    for digest in alignment.iter().flat_map(|alignment| [&alignment.photo, &alignment.before, &alignment.after]) {
        if !digest.is_empty() {
            require_artifact(write.sql(), digest).await?;
        }
    }
    let mut after = Dataset { alignment, revision: revision + 1, ..before.clone() };
    for pair in &mut after.pairs {
        if let Some(checks) = checks.remove(&pair.id) {
            pair.checks = Some(checks);
        }
    }
    if let Some((finalization, splits)) = closing {
        finalize(&mut after, finalization, splits, now_ms)?;
    }
    let (findings_before, findings_after) = (group_by_pair(&before.findings), group_by_pair(&findings));
    for (pair, pair_before) in after.pairs.iter().zip(&before.pairs) {
        let pair_findings = findings_after.get(pair.id.as_str());
        if pair != pair_before || pair_findings != findings_before.get(pair.id.as_str()) {
            update_pair(write, &id, pair, pair_findings.map_or(&[], Vec::as_slice)).await?;
        }
    }
    after.findings.clone_from(&findings);
    update_dataset(write, &after).await?;
    Ok(after)
}

/// Groups findings by the id of their pair. The key of findings about the whole dataset is the empty text.
fn group_by_pair(findings: &[Finding]) -> BTreeMap<&str, Vec<&Finding>> {
    findings.iter().fold(BTreeMap::new(), |mut groups, finding| {
        groups.entry(finding.pair.as_str()).or_insert_with(Vec::new).push(finding);
        groups
    })
}

/// Checks that the dataset is open and still has the revision that the job read.
fn require_unchanged(dataset: &Dataset, revision: u64) -> Result<()> {
    let id = &dataset.id;
    if dataset.digest.is_some() {
        let message =
            format!("datasets/{id} was finalized during the job and can no longer change; create another dataset");
        return Err(StoreError::precondition(PreconditionReason::DatasetFinalized, message));
    }
    if dataset.revision != revision {
        let message =
            format!("datasets/{id} changed during the job: pairs were added, or it was aligned; submit the job again");
        return Err(StoreError::Aborted { reason: AbortReason::DatasetChanged, message });
    }
    Ok(())
}

/// Finalizes the dataset: sets the split of every pair and the digest of the dataset.
fn finalize(dataset: &mut Dataset, finalization: Finalization, mut splits: Splits, now_ms: i64) -> Result<()> {
    splits.sort_by(|a, b| a.0.cmp(&b.0));
    let id = &dataset.id;
    if !splits.iter().map(|(id, _)| id).eq(dataset.pairs.iter().map(|pair| &pair.id)) {
        let message = format!("the pairs of datasets/{id} differ from the pairs in the split; submit the job again");
        return Err(StoreError::Aborted { reason: AbortReason::DatasetChanged, message });
    }
    for (needed, word) in [(Split::Train, "training"), (Split::Test, "test")] {
        if !splits.iter().any(|(_, split)| *split == Some(needed)) {
            let message = format!("datasets/{id} has no {word} pair; add pairs, or set the split of a pair");
            return Err(StoreError::precondition(PreconditionReason::DatasetSplitEmpty, message));
        }
    }
    dataset.split_counts = Some(SplitCounts::of(splits.iter().map(|(_, split)| *split)));
    for (pair, (_, split)) in dataset.pairs.iter_mut().zip(splits) {
        pair.split = split;
    }
    dataset.digest = Some(dataset::digest(dataset));
    dataset.finalization = Some(finalization);
    dataset.finalize_time_ms = Some(now_ms);
    Ok(())
}

async fn update_pair(write: &mut Write, dataset: &str, pair: &Pair, findings: &[&Finding]) -> Result<()> {
    let checks_json = |checks: &PairChecks| to_json("pair.checks", checks);
    query("update pair set split = $3, checks = $4, findings = $5 where dataset = $1 and id = $2")
        .bind((dataset, &pair.id, pair.split.map(|split| to_word("pair.split", &split)).transpose()?))
        .bind((pair.checks.as_ref().map(checks_json).transpose()?, to_json("pair.findings", &findings)?))
        .execute(write.sql())
        .await?;
    Ok(())
}

async fn update_dataset(write: &mut Write, dataset: &Dataset) -> Result<()> {
    let dataset_findings: Vec<&Finding> = dataset.findings.iter().filter(|finding| finding.pair.is_empty()).collect();
    query(
        "update dataset set alignment = $2, findings = $3, revision = $4, digest = $5, finalization = $6, \
         finalize_time_ms = $7, split_counts = $8 where id = $1",
    )
    .bind(&dataset.id)
    .bind(dataset.alignment.as_ref().map(|alignment| to_json("dataset.alignment", alignment)).transpose()?)
    .bind((to_json("dataset.findings", &dataset_findings)?, dataset.revision as i64, &dataset.digest))
    .bind(dataset.finalization.as_ref().map(|finalization| to_json("dataset.finalization", finalization)).transpose()?)
    .bind(dataset.finalize_time_ms)
    .bind(dataset.split_counts.as_ref().map(|counts| to_json("dataset.split_counts", counts)).transpose()?)
    .execute(write.sql())
    .await?;
    write.announce_changed(changed(dataset));
    Ok(())
}
