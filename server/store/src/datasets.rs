//! Datasets and their pairs.

use super::changes::Changed;
use super::rows::{from_word, json, json_option, to_json, to_word, word};
use super::sql::{Builder, Connection, Row, from_row, query, query_as, scalar};
use super::write::Write;
use super::{AbortReason, Result, Store, StoreError, page};
use lightpath_domain::dataset::{DATASETS_MAX, Dataset, Encoding, Exposure, Finding, PAIRS_MAX, Pair};
use lightpath_domain::reason::PreconditionReason;
use lightpath_domain::units::{Distance, Wavelength};

/// Which pairs of a dataset are wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PairFilter {
    /// All pairs.
    All,
    /// Pairs that have findings.
    WithFindings,
}

/// Some pairs of a dataset.
#[derive(Clone, Debug, PartialEq)]
pub struct PairsOf {
    /// The dataset without its pairs.
    pub dataset: Dataset,
    /// The pairs with their findings.
    pub pairs: Vec<(Pair, Vec<Finding>)>,
}

impl Store {
    /// Creates an open dataset without pairs. The id, display, wavelength, distance, encoding and bit depth of
    /// `dataset` are used. Creating the same dataset again returns the existing one.
    ///
    /// # Errors
    ///
    /// [`StoreError::AlreadyExists`] if a dataset with other properties has this id; [`StoreError::NotFound`] if the
    /// display is missing; [`StoreError::Precondition`] if the display has [`DATASETS_MAX`] datasets.
    pub async fn create_dataset(&self, dataset: &Dataset, now_ms: i64) -> Result<Dataset> {
        let dataset = dataset.clone();
        self.write(async move |write| create(write, dataset, now_ms).await).await
    }

    /// A dataset with its pairs.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`].
    pub async fn dataset(&self, id: &str) -> Result<Dataset> {
        // One transaction, so that the pairs agree with their count.
        let mut read = self.readers().begin().await?;
        with_pairs(&mut read, id).await
    }

    /// A dataset without its pairs and their findings.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`].
    pub async fn dataset_alone(&self, id: &str) -> Result<Dataset> {
        let mut read = self.readers().begin().await?;
        find(&mut read, id).await
    }

    /// A dataset without its pairs, and at most `limit` of them with their findings, in the order of their ids and
    /// behind `after`.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`].
    pub async fn pairs(&self, id: &str, filter: PairFilter, after: Option<&str>, limit: u32) -> Result<PairsOf> {
        // One transaction, so that the uses of the pairs agree with the state of the dataset.
        let mut read = self.readers().begin().await?;
        let dataset = find(&mut read, id).await?;
        let mut query = Builder::new("select * from pair where dataset = ");
        query.push_bind(id).push(" and id > ").push_bind(after.unwrap_or(""));
        if filter == PairFilter::WithFindings {
            query.push(" and findings <> '[]'");
        }
        query.push(" order by id limit ").push_bind(page(limit));
        let rows = query.build().fetch_all(&mut read).await?;
        let pairs = rows.iter().map(|row| Ok((pair_of(row)?, json(row, "pair.findings")?))).collect::<Result<_>>()?;
        Ok(PairsOf { dataset, pairs })
    }

    /// At most `limit` datasets, without their pairs, in the order of their ids and behind `after`.
    pub async fn datasets(&self, display: Option<&str>, after: Option<&str>, limit: u32) -> Result<Vec<Dataset>> {
        let mut query = Builder::new("select * from dataset where id > ");
        query.push_bind(after.unwrap_or(""));
        if let Some(display) = display {
            query.push(" and display = ").push_bind(display);
        }
        query.push(" order by id limit ").push_bind(page(limit));
        query.build().fetch_all(self.readers()).await?.iter().map(dataset_of).collect()
    }

    /// Deletes a dataset with its pairs, unless a waiting or running job reads or prepares it. Kernels learned from it
    /// are kept. Its photographs and holograms are kept for their time of grace.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`]; [`StoreError::Precondition`] while a job uses it.
    pub async fn delete_dataset(&self, id: &str, now_ms: i64) -> Result<()> {
        let id = id.to_owned();
        self.write(async move |write| delete(write, &id, now_ms).await).await
    }

    /// Adds pairs to an open dataset, all or none, and returns the dataset without its pairs. Pairs that the dataset
    /// already has change nothing. `findings` contains the findings about these pairs, and all findings about the whole
    /// dataset, which have no pair id.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`] if the dataset or an artifact is missing; [`StoreError::AlreadyExists`] if another pair
    /// has the id, hologram or photograph of one of them; [`StoreError::Precondition`] if the dataset is finalized or
    /// has no room for all; [`StoreError::Aborted`] if a pair was measured with another alignment than the dataset now
    /// has.
    pub async fn add_pairs(&self, dataset_id: &str, pairs: &[Pair], findings: &[Finding]) -> Result<Dataset> {
        let (id, pairs, findings) = (dataset_id.to_owned(), pairs.to_vec(), findings.to_vec());
        self.write(async move |write| add_pairs(write, &id, &pairs, &findings).await).await
    }
}

async fn create(write: &mut Write, dataset: Dataset, now_ms: i64) -> Result<Dataset> {
    require_room(write.sql(), &dataset).await?;
    query(
        "insert into dataset (id, display, wavelength_pm, distance_nm, photo_encoding, photo_bit_depth, create_time_ms) \
         values ($1, $2, $3, $4, $5, $6, $7) on conflict do nothing",
    )
    .bind((&dataset.id, &dataset.display, dataset.wavelength.pm, dataset.distance.nm))
    .bind((to_word::<Encoding>("dataset.photo_encoding", &dataset.photo_encoding)?, dataset.photo_bit_depth, now_ms))
    .execute(write.sql())
    .await?;
    let stored = with_pairs(write.sql(), &dataset.id).await?;
    let same = (&stored.display, stored.wavelength, stored.distance, stored.photo_encoding, stored.photo_bit_depth)
        == (&dataset.display, dataset.wavelength, dataset.distance, dataset.photo_encoding, dataset.photo_bit_depth);
    if !same {
        return Err(StoreError::exists(
            format!("datasets/{}", dataset.id),
            "with other properties; choose another name",
        ));
    }
    write.announce_changed(changed(&stored));
    Ok(stored)
}

/// Checks that the display exists and has room for the dataset, unless the dataset exists already.
async fn require_room(sql: &mut Connection, dataset: &Dataset) -> Result<()> {
    let (has_display, exists, count): (bool, bool, u32) = query_as(
        "select exists (select 1 from display where id = $1), exists (select 1 from dataset where id = $2), \
         (select count(*) from dataset where display = $1)",
    )
    .bind((&dataset.display, &dataset.id))
    .fetch_one(sql)
    .await?;
    let display = &dataset.display;
    if !has_display {
        return Err(StoreError::not_found(format!("displays/{display}")));
    }
    if !exists && count >= DATASETS_MAX {
        let message = format!("displays/{display} has {DATASETS_MAX} datasets, which is the limit; delete one of them");
        return Err(StoreError::precondition(PreconditionReason::DisplayFull, message));
    }
    Ok(())
}

async fn delete(write: &mut Write, id: &str, now_ms: i64) -> Result<()> {
    let user: Option<String> = scalar(
        "select id from job where state in ('queued', 'running') and (dataset = $1 \
         or exists (select 1 from json_each(job.spec, '$.datasets') where value = $1)) limit 1",
    )
    .bind(id)
    .fetch_optional(write.sql())
    .await?;
    if let Some(job) = user {
        let message = format!("datasets/{id} cannot be deleted while jobs/{job} uses it; cancel the job first");
        return Err(StoreError::precondition(PreconditionReason::DatasetInUse, message));
    }
    // Clients may be about to use the files in another dataset.
    let keep = "update artifact set use_time_ms = max(use_time_ms, $2) where digest in \
                (select pattern from pair where dataset = $1 union select photo from pair where dataset = $1)";
    query(keep).bind((id, now_ms)).execute(write.sql()).await?;
    let delete = scalar("delete from dataset where id = $1 returning display");
    let display: Option<String> = delete.bind(id).fetch_optional(write.sql()).await?;
    let display = display.ok_or_else(|| StoreError::not_found(format!("datasets/{id}")))?;
    write.announce_changed(Changed::Dataset { id: id.to_owned(), display });
    Ok(())
}

/// The announcement of a change of the dataset.
pub(super) fn changed(dataset: &Dataset) -> Changed {
    Changed::Dataset { id: dataset.id.clone(), display: dataset.display.clone() }
}

async fn add_pairs(write: &mut Write, id: &str, pairs: &[Pair], findings: &[Finding]) -> Result<Dataset> {
    let mut dataset = find(write.sql(), id).await?;
    let count_before = dataset.pair_count;
    for pair in pairs {
        if !contains_pair(write.sql(), id, pair).await? {
            require_pair_allowed(&dataset, pair)?;
            insert_pair(write, id, pair, findings).await?;
            dataset.pair_count += 1;
        }
    }
    if dataset.pair_count == count_before {
        return Ok(dataset);
    }
    let dataset_findings: Vec<&Finding> = findings.iter().filter(|finding| finding.pair.is_empty()).collect();
    let sql = "update dataset set pair_count = $2, findings = $3, revision = revision + 1 where id = $1 returning *";
    let findings = to_json("dataset.findings", &dataset_findings)?;
    let row = query(sql).bind((id, dataset.pair_count, findings)).fetch_one(write.sql()).await?;
    write.announce_changed(changed(&dataset));
    dataset_of(&row)
}

/// Inserts a pair with those of the findings that are about it.
async fn insert_pair(write: &mut Write, id: &str, pair: &Pair, findings: &[Finding]) -> Result<()> {
    for digest in [&pair.pattern, &pair.photo] {
        require_artifact(write.sql(), digest).await?;
    }
    let exposure =
        (pair.exposure != Exposure::default()).then(|| to_json("pair.exposure", &pair.exposure)).transpose()?;
    let checks = pair.checks.as_ref().map(|checks| to_json("pair.checks", checks)).transpose()?;
    let findings: Vec<&Finding> = findings.iter().filter(|finding| finding.pair == pair.id).collect();
    let sql = "insert into pair (dataset, id, pattern, photo, split, exposure, checks, findings) values ($1, $2, $3, $4, $5, $6, $7, $8)";
    query(sql)
        .bind((id, &pair.id, &pair.pattern, &pair.photo))
        .bind((pair.split.map(|split| to_word("pair.split", &split)).transpose()?, exposure, checks))
        .bind(to_json("pair.findings", &findings)?)
        .execute(write.sql())
        .await?;
    Ok(())
}

/// Whether the dataset contains the same pair. Returns an error if another pair has its id, hologram or photograph.
async fn contains_pair(sql: &mut Connection, id: &str, pair: &Pair) -> Result<bool> {
    let rows = query("select * from pair where dataset = $1 and (id = $2 or pattern = $3 or photo = $4)")
        .bind((id, &pair.id, &pair.pattern, &pair.photo))
        .fetch_all(sql)
        .await?;
    let stored: Vec<Pair> = rows.iter().map(pair_of).collect::<Result<_, _>>()?;
    match stored.as_slice() {
        [] => Ok(false),
        [one] if one.is_given_again_by(pair) => Ok(true),
        [one, ..] => {
            let (resource, detail) = describe_conflict(id, pair, one);
            Err(StoreError::exists(resource, detail))
        }
    }
}

/// Checks that the dataset is open, is not full, and has the alignment with which the pair was measured.
fn require_pair_allowed(dataset: &Dataset, pair: &Pair) -> Result<()> {
    let id = &dataset.id;
    if dataset.digest.is_some() {
        let message = format!("datasets/{id} is finalized and takes no more pairs; create another dataset");
        return Err(StoreError::precondition(PreconditionReason::DatasetFinalized, message));
    }
    if dataset.pair_count >= PAIRS_MAX {
        let message = format!("datasets/{id} has {PAIRS_MAX} pairs, which is the limit; create another dataset");
        return Err(StoreError::precondition(PreconditionReason::DatasetFull, message));
    }
    if pair.checks.as_ref().is_some_and(|checks| checks.map != dataset.camera_map()) {
        let message = format!("datasets/{id} was aligned while pair \"{}\" was checked; add the pair again", pair.id);
        return Err(StoreError::Aborted { reason: AbortReason::DatasetChanged, message });
    }
    Ok(())
}

/// Names the part of `pair` that the stored pair already uses, and describes the difference.
fn describe_conflict(dataset: &str, pair: &Pair, stored: &Pair) -> (String, String) {
    if pair.id == stored.id {
        let resource = format!("pair \"{}\" of datasets/{dataset}", pair.id);
        return (resource, "with another hologram, photograph, exposure or split".to_owned());
    }
    let resource = match pair.pattern == stored.pattern {
        true => format!("pattern {} of datasets/{dataset}", pair.pattern),
        false => format!("photograph {} of datasets/{dataset}", pair.photo),
    };
    (resource, format!("in pair \"{}\"", stored.id))
}

/// The dataset with its pairs and all its findings.
pub(super) async fn with_pairs(sql: &mut Connection, id: &str) -> Result<Dataset> {
    let mut dataset = find(&mut *sql, id).await?;
    let rows = query("select * from pair where dataset = $1 order by id").bind(id).fetch_all(sql).await?;
    let mut findings = Vec::new();
    for row in &rows {
        dataset.pairs.push(pair_of(row)?);
        findings.append(&mut json(row, "pair.findings")?);
    }
    findings.append(&mut dataset.findings);
    Ok(Dataset { findings, ..dataset })
}

async fn find(sql: &mut Connection, id: &str) -> Result<Dataset> {
    let row = query("select * from dataset where id = $1").bind(id).fetch_optional(sql).await?;
    dataset_of(&row.ok_or_else(|| StoreError::not_found(format!("datasets/{id}")))?)
}

/// Checks that the artifact is recorded.
pub(super) async fn require_artifact(sql: &mut Connection, digest: &str) -> Result<()> {
    let known: bool =
        scalar("select exists (select 1 from artifact where digest = $1)").bind(digest).fetch_one(sql).await?;
    if known { Ok(()) } else { Err(StoreError::not_found(format!("artifact {digest}"))) }
}

fn dataset_of(row: &Row) -> Result<Dataset> {
    Ok(from_row!(row, Dataset {
        id, display, photo_bit_depth, pair_count, revision, digest, create_time_ms, finalize_time_ms;
        wavelength: Wavelength { pm: row.try_get("wavelength_pm")? },
        distance: Distance { nm: row.try_get("distance_nm")? },
        photo_encoding: word(row, "dataset.photo_encoding")?,
        alignment: json_option(row, "dataset.alignment")?,
        pairs: Vec::new(),
        findings: json(row, "dataset.findings")?,
        finalization: json_option(row, "dataset.finalization")?,
        split_counts: json_option(row, "dataset.split_counts")?,
    }))
}

fn pair_of(row: &Row) -> Result<Pair> {
    let split: Option<String> = row.try_get("split")?;
    Ok(from_row!(row, Pair {
        id, pattern, photo;
        split: split.map(|word| from_word("pair.split", word)).transpose()?,
        exposure: json_option(row, "pair.exposure")?.unwrap_or_default(),
        checks: json_option(row, "pair.checks")?,
    }))
}
