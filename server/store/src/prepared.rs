//! What jobs find out about datasets.
//!
//! A job reads a dataset, computes, and ends in one transaction that stores what it found, where the dataset is still the
//! one that it read. So a digest always says what the dataset is, whoever else adds pairs or aligns at the same time.

use super::datasets::{require_artifact, with_pairs};
use super::rows::{to_json, to_word};
use super::write::Write;
use super::{AbortReason, PreconditionReason, StoreError};
use lightpath_domain::dataset::{
    self, Dataset, Finalization, Finding, Pair, PairChecks, PreparedDataset, Split, Splits,
};
use std::collections::BTreeMap;

/// Stores what a job found out, and returns the dataset as it is now.
pub(super) async fn prepare(write: &mut Write, prepared: PreparedDataset, now_ms: i64) -> Result<Dataset, StoreError> {
    let PreparedDataset { dataset: id, revision, alignment, mut checks, findings, closing } = prepared;
    let before = with_pairs(write.sql(), &id).await?;
    require_unchanged(&before, revision)?;
    for digest in alignment.iter().flat_map(|found| [&found.photo, &found.before, &found.after]) {
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
        close(&mut after, finalization, splits, now_ms)?;
    }
    let (before_by_pair, after_by_pair) = (by_pair(&before.findings), by_pair(&findings));
    for (pair, pair_before) in after.pairs.iter().zip(&before.pairs) {
        let findings = after_by_pair.get(pair.id.as_str());
        if pair != pair_before || findings != before_by_pair.get(pair.id.as_str()) {
            update_pair(write, &id, pair, findings.map_or(&[], Vec::as_slice)).await?;
        }
    }
    after.findings.clone_from(&findings);
    update_dataset(write, &after).await?;
    Ok(after)
}

/// The findings of each pair that has some; of the whole dataset those of no pair.
fn by_pair(findings: &[Finding]) -> BTreeMap<&str, Vec<&Finding>> {
    findings.iter().fold(BTreeMap::new(), |mut groups, finding| {
        groups.entry(finding.pair.as_str()).or_insert_with(Vec::new).push(finding);
        groups
    })
}

fn require_unchanged(dataset: &Dataset, revision: u64) -> Result<(), StoreError> {
    let id = &dataset.id;
    if dataset.digest.is_some() {
        let message = format!("datasets/{id} was finalized meanwhile, and stays as it is; create another dataset");
        return Err(StoreError::precondition(PreconditionReason::DatasetFinalized, message));
    }
    if dataset.revision != revision {
        let message = format!("datasets/{id} was changed meanwhile: pairs were added, or it was aligned; try again");
        return Err(StoreError::Aborted { reason: AbortReason::DatasetChanged, message });
    }
    Ok(())
}

/// Gives every pair its split, and the dataset its digest.
fn close(dataset: &mut Dataset, how: Finalization, mut splits: Splits, now_ms: i64) -> Result<(), StoreError> {
    splits.sort_by(|a, b| a.0.cmp(&b.0));
    let id = &dataset.id;
    if !splits.iter().map(|(id, _)| id).eq(dataset.pairs.iter().map(|pair| &pair.id)) {
        let message = format!("the split of datasets/{id} is not of its pairs");
        return Err(StoreError::Aborted { reason: AbortReason::DatasetChanged, message });
    }
    for (needed, word) in [(Split::Train, "training"), (Split::Test, "test")] {
        if !splits.iter().any(|(_, split)| *split == Some(needed)) {
            let message = format!("datasets/{id} has no {word} pair; add pairs, or give one that split");
            return Err(StoreError::precondition(PreconditionReason::DatasetSplitEmpty, message));
        }
    }
    for (pair, (_, split)) in dataset.pairs.iter_mut().zip(splits) {
        pair.split = split;
    }
    dataset.digest = Some(dataset::digest(dataset));
    dataset.finalization = Some(how);
    dataset.finalize_time_ms = Some(now_ms);
    Ok(())
}

async fn update_pair(write: &mut Write, dataset: &str, pair: &Pair, findings: &[&Finding]) -> Result<(), StoreError> {
    let to_json_of = |checks: &PairChecks| to_json("pair.checks", checks);
    sqlx::query("update pair set split = ?3, checks = ?4, findings = ?5 where dataset = ?1 and id = ?2")
        .bind(dataset)
        .bind(&pair.id)
        .bind(pair.split.map(|split| to_word("pair.split", &split)).transpose()?)
        .bind(pair.checks.as_ref().map(to_json_of).transpose()?)
        .bind(to_json("pair.findings", &findings)?)
        .execute(write.sql())
        .await?;
    Ok(())
}

async fn update_dataset(write: &mut Write, dataset: &Dataset) -> Result<(), StoreError> {
    let whole: Vec<&Finding> = dataset.findings.iter().filter(|finding| finding.pair.is_empty()).collect();
    sqlx::query(
        "update dataset set alignment = ?2, findings = ?3, revision = ?4, digest = ?5, finalization = ?6, \
         finalize_time_ms = ?7 where id = ?1",
    )
    .bind(&dataset.id)
    .bind(dataset.alignment.as_ref().map(|found| to_json("dataset.alignment", found)).transpose()?)
    .bind(to_json("dataset.findings", &whole)?)
    .bind(dataset.revision as i64)
    .bind(&dataset.digest)
    .bind(dataset.finalization.as_ref().map(|how| to_json("dataset.finalization", how)).transpose()?)
    .bind(dataset.finalize_time_ms)
    .execute(write.sql())
    .await?;
    Ok(())
}
