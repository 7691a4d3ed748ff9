//! Datasets and their pairs.

use super::rows::{from_json_option, from_word, to_json, to_word};
use super::write::Write;
use super::{AbortReason, PreconditionReason, Store, StoreError, page};
use lightpath_domain::dataset::{Alignment, Dataset, Encoding, Exposure, Pair, PairChecks, Split};
use lightpath_domain::units::{Distance, Wavelength};
use sqlx::sqlite::SqliteRow;
use sqlx::{QueryBuilder, Row, Sqlite, SqliteConnection};

/// Limit on the pairs of a dataset: they are read as a whole, and learning holds them in memory.
pub const PAIRS_MAX: u32 = 10_000;

impl Store {
    /// Creates an open dataset without pairs. The id, display, wavelength, distance, encoding and bit depth of
    /// `dataset` are used. Creating the same dataset again returns the existing one.
    ///
    /// # Errors
    ///
    /// [`StoreError::AlreadyExists`] if a dataset with other properties has this id; [`StoreError::NotFound`] if the
    /// display is missing.
    pub async fn create_dataset(&self, dataset: &Dataset, now_ms: i64) -> Result<Dataset, StoreError> {
        let dataset = dataset.clone();
        self.write(move |write| Box::pin(create(write, dataset, now_ms))).await
    }

    /// A dataset with its pairs.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`].
    pub async fn dataset(&self, id: &str) -> Result<Dataset, StoreError> {
        // One transaction, so that the pairs agree with their count.
        let mut read = self.readers().begin().await?;
        let mut dataset = find(&mut read, id).await?;
        dataset.pairs = pairs(&mut read, id).await?;
        Ok(dataset)
    }

    /// At most `limit` datasets, without their pairs, in the order of their ids and behind `after`.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`].
    pub async fn datasets(
        &self,
        display: Option<&str>,
        after: Option<&str>,
        limit: u32,
    ) -> Result<Vec<Dataset>, StoreError> {
        let mut query = QueryBuilder::<Sqlite>::new("select * from dataset where id > ");
        query.push_bind(after.unwrap_or(""));
        if let Some(display) = display {
            query.push(" and display = ").push_bind(display);
        }
        query.push(" order by id limit ").push_bind(page(limit));
        query.build().fetch_all(self.readers()).await?.iter().map(dataset_of).collect()
    }

    /// Adds a pair to an open dataset and returns the dataset without its pairs. Adding the same pair again changes
    /// nothing.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`] if the dataset or an artifact is missing; [`StoreError::AlreadyExists`] if another pair
    /// has this id, hologram or photograph; [`StoreError::Precondition`] if the dataset is finalized or full.
    pub async fn add_pair(&self, dataset_id: &str, pair: &Pair) -> Result<Dataset, StoreError> {
        let (id, pair) = (dataset_id.to_owned(), pair.clone());
        self.write(move |write| Box::pin(async move { add_pair(write, &id, &pair).await })).await
    }

    /// Sets or removes the alignment of an open dataset and returns the dataset with its pairs.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`] if the dataset or a picture of the alignment is missing; [`StoreError::Precondition`]
    /// if the dataset is finalized.
    pub async fn align_dataset(&self, id: &str, alignment: Option<&Alignment>) -> Result<Dataset, StoreError> {
        let (id, alignment) = (id.to_owned(), alignment.cloned());
        self.write(move |write| Box::pin(async move { align(write, &id, alignment).await })).await
    }

    /// Stores the measurements of pairs of an open dataset. Pairs that no longer exist are skipped.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`].
    pub async fn keep_checks(&self, id: &str, checks: &[(String, PairChecks)]) -> Result<(), StoreError> {
        let (id, checks) = (id.to_owned(), checks.to_vec());
        self.write(move |write| Box::pin(async move { keep_checks(write, &id, checks).await })).await
    }

    /// Finalizes a dataset: stores the split of every pair (`None`: the pair is not used) and the digest. A finalized
    /// dataset never changes. Finalizing it again with the same digest has no effect.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`]; [`StoreError::Precondition`] if a training or a test pair is missing, or if the
    /// dataset was finalized with another digest; [`StoreError::Aborted`] if `splits` does not name exactly the pairs
    /// of the dataset, because a pair was added in the meantime.
    pub async fn finalize_dataset(
        &self,
        id: &str,
        splits: &[(String, Option<Split>)],
        digest: &str,
        now_ms: i64,
    ) -> Result<Dataset, StoreError> {
        let (id, splits, digest) = (id.to_owned(), splits.to_vec(), digest.to_owned());
        self.write(move |write| Box::pin(async move { finalize(write, &id, splits, &digest, now_ms).await })).await
    }
}

async fn create(write: &mut Write, dataset: Dataset, now_ms: i64) -> Result<Dataset, StoreError> {
    let known: bool = sqlx::query_scalar("select exists (select 1 from display where id = ?)")
        .bind(&dataset.display)
        .fetch_one(write.sql())
        .await?;
    if !known {
        return Err(StoreError::not_found(format!("displays/{}", dataset.display)));
    }
    sqlx::query(
        "insert into dataset (id, display, wavelength_pm, distance_nm, photo_encoding, photo_bit_depth, create_time_ms) \
         values (?, ?, ?, ?, ?, ?, ?) on conflict do nothing",
    )
    .bind(&dataset.id)
    .bind(&dataset.display)
    .bind(dataset.wavelength.pm)
    .bind(dataset.distance.nm)
    .bind(to_word::<Encoding>("dataset.photo_encoding", &dataset.photo_encoding)?)
    .bind(dataset.photo_bit_depth)
    .bind(now_ms)
    .execute(write.sql())
    .await?;
    let mut stored = find(write.sql(), &dataset.id).await?;
    let same = (&stored.display, stored.wavelength, stored.distance, stored.photo_encoding, stored.photo_bit_depth)
        == (&dataset.display, dataset.wavelength, dataset.distance, dataset.photo_encoding, dataset.photo_bit_depth);
    if !same {
        return Err(StoreError::exists(
            format!("datasets/{}", dataset.id),
            "with other properties; choose another name",
        ));
    }
    stored.pairs = pairs(write.sql(), &dataset.id).await?;
    Ok(stored)
}

async fn add_pair(write: &mut Write, id: &str, pair: &Pair) -> Result<Dataset, StoreError> {
    let dataset = find(write.sql(), id).await?;
    let rows = sqlx::query("select * from pair where dataset = ?1 and (id = ?2 or phase = ?3 or photo = ?4)")
        .bind(id)
        .bind(&pair.id)
        .bind(&pair.phase)
        .bind(&pair.photo)
        .fetch_all(write.sql())
        .await?;
    if let [row] = rows.as_slice() {
        let stored = pair_of(row)?;
        let same_split = pair.split.is_none() || pair.split == stored.split;
        let same = (&stored.id, &stored.phase, &stored.photo, stored.exposure)
            == (&pair.id, &pair.phase, &pair.photo, pair.exposure);
        if same_split && same {
            return Ok(dataset);
        }
    }
    if let Some(row) = rows.first() {
        let stored = pair_of(row)?;
        let (what, detail) = conflict(id, pair, &stored);
        return Err(StoreError::exists(what, detail));
    }
    if dataset.digest.is_some() {
        let message = format!("datasets/{id} is finalized and takes no more pairs; create another dataset");
        return Err(StoreError::precondition(PreconditionReason::DatasetFinalized, message));
    }
    if dataset.pair_count >= PAIRS_MAX {
        let message = format!("datasets/{id} has {PAIRS_MAX} pairs, and takes no more");
        return Err(StoreError::precondition(PreconditionReason::DatasetFull, message));
    }
    for digest in [&pair.phase, &pair.photo] {
        require_artifact(write.sql(), digest).await?;
    }
    let exposure =
        (pair.exposure != Exposure::default()).then(|| to_json("pair.exposure", &pair.exposure)).transpose()?;
    let checks = pair.checks.as_ref().map(|checks| to_json("pair.checks", checks)).transpose()?;
    sqlx::query("insert into pair (dataset, id, phase, photo, split, exposure, checks) values (?, ?, ?, ?, ?, ?, ?)")
        .bind(id)
        .bind(&pair.id)
        .bind(&pair.phase)
        .bind(&pair.photo)
        .bind(pair.split.map(|split| to_word("pair.split", &split)).transpose()?)
        .bind(exposure)
        .bind(checks)
        .execute(write.sql())
        .await?;
    let row = sqlx::query("update dataset set pair_count = pair_count + 1 where id = ? returning *")
        .bind(id)
        .fetch_one(write.sql())
        .await?;
    dataset_of(&row)
}

/// Describes which part of `pair` the stored pair already uses, and what differs.
fn conflict(dataset: &str, pair: &Pair, stored: &Pair) -> (String, String) {
    if pair.id == stored.id {
        let what = format!("pair \"{}\" of datasets/{dataset}", pair.id);
        return (what, "with another hologram, photograph, exposure or split".to_owned());
    }
    let what = match pair.phase == stored.phase {
        true => format!("hologram {} of datasets/{dataset}", pair.phase),
        false => format!("photograph {} of datasets/{dataset}", pair.photo),
    };
    (what, format!("in pair \"{}\"", stored.id))
}

async fn align(write: &mut Write, id: &str, alignment: Option<Alignment>) -> Result<Dataset, StoreError> {
    let mut dataset = find(write.sql(), id).await?;
    if dataset.digest.is_some() {
        let message = format!("datasets/{id} is finalized, and its alignment with it; create another dataset");
        return Err(StoreError::precondition(PreconditionReason::DatasetFinalized, message));
    }
    for digest in alignment.iter().flat_map(|found| [&found.photo, &found.before, &found.after]) {
        if !digest.is_empty() {
            require_artifact(write.sql(), digest).await?;
        }
    }
    sqlx::query("update dataset set alignment = ? where id = ?")
        .bind(alignment.as_ref().map(|found| to_json("dataset.alignment", found)).transpose()?)
        .bind(id)
        .execute(write.sql())
        .await?;
    dataset.alignment = alignment;
    dataset.pairs = pairs(write.sql(), id).await?;
    Ok(dataset)
}

async fn keep_checks(write: &mut Write, id: &str, checks: Vec<(String, PairChecks)>) -> Result<(), StoreError> {
    for (pair, checks) in checks {
        sqlx::query(
            "update pair set checks = ? where dataset = ? and id = ? \
             and exists (select 1 from dataset where dataset.id = pair.dataset and digest is null)",
        )
        .bind(to_json("pair.checks", &checks)?)
        .bind(id)
        .bind(pair)
        .execute(write.sql())
        .await?;
    }
    Ok(())
}

async fn finalize(
    write: &mut Write,
    id: &str,
    mut splits: Vec<(String, Option<Split>)>,
    digest: &str,
    now_ms: i64,
) -> Result<Dataset, StoreError> {
    let mut dataset = find(write.sql(), id).await?;
    dataset.pairs = pairs(write.sql(), id).await?;
    if let Some(stored) = &dataset.digest {
        if stored == digest {
            return Ok(dataset);
        }
        let message = format!("datasets/{id} is finalized already, with another split");
        return Err(StoreError::precondition(PreconditionReason::DatasetFinalized, message));
    }
    splits.sort_by(|a, b| a.0.cmp(&b.0));
    if !splits.iter().map(|(id, _)| id).eq(dataset.pairs.iter().map(|pair| &pair.id)) {
        let message = format!("the pairs of datasets/{id} have changed meanwhile; finalize it again");
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
        sqlx::query("update pair set split = ? where dataset = ? and id = ?")
            .bind(split.map(|split| to_word("pair.split", &split)).transpose()?)
            .bind(id)
            .bind(&pair.id)
            .execute(write.sql())
            .await?;
    }
    sqlx::query("update dataset set digest = ?, finalize_time_ms = ? where id = ?")
        .bind(digest)
        .bind(now_ms)
        .bind(id)
        .execute(write.sql())
        .await?;
    Ok(Dataset { digest: Some(digest.to_owned()), finalize_time_ms: Some(now_ms), ..dataset })
}

async fn find(sql: &mut SqliteConnection, id: &str) -> Result<Dataset, StoreError> {
    let row = sqlx::query("select * from dataset where id = ?").bind(id).fetch_optional(sql).await?;
    dataset_of(&row.ok_or_else(|| StoreError::not_found(format!("datasets/{id}")))?)
}

async fn pairs(sql: &mut SqliteConnection, id: &str) -> Result<Vec<Pair>, StoreError> {
    let rows = sqlx::query("select * from pair where dataset = ? order by id").bind(id).fetch_all(sql).await?;
    rows.iter().map(pair_of).collect()
}

/// Checks that the artifact is recorded.
pub(super) async fn require_artifact(sql: &mut SqliteConnection, digest: &str) -> Result<(), StoreError> {
    let known: bool = sqlx::query_scalar("select exists (select 1 from artifact where digest = ?)")
        .bind(digest)
        .fetch_one(sql)
        .await?;
    if known { Ok(()) } else { Err(StoreError::not_found(format!("artifact {digest}"))) }
}

fn dataset_of(row: &SqliteRow) -> Result<Dataset, StoreError> {
    Ok(Dataset {
        id: row.try_get("id")?,
        display: row.try_get("display")?,
        wavelength: Wavelength { pm: row.try_get("wavelength_pm")? },
        distance: Distance { nm: row.try_get("distance_nm")? },
        photo_encoding: from_word("dataset.photo_encoding", row.try_get("photo_encoding")?)?,
        photo_bit_depth: row.try_get("photo_bit_depth")?,
        alignment: from_json_option("dataset.alignment", row.try_get("alignment")?)?,
        pairs: Vec::new(),
        pair_count: row.try_get("pair_count")?,
        digest: row.try_get("digest")?,
        create_time_ms: row.try_get("create_time_ms")?,
        finalize_time_ms: row.try_get("finalize_time_ms")?,
    })
}

fn pair_of(row: &SqliteRow) -> Result<Pair, StoreError> {
    let split: Option<String> = row.try_get("split")?;
    Ok(Pair {
        id: row.try_get("id")?,
        phase: row.try_get("phase")?,
        photo: row.try_get("photo")?,
        split: split.map(|word| from_word("pair.split", word)).transpose()?,
        exposure: from_json_option("pair.exposure", row.try_get("exposure")?)?.unwrap_or_default(),
        checks: from_json_option("pair.checks", row.try_get("checks")?)?,
    })
}
