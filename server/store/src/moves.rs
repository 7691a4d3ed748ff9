//! Changes of the active version of a kernel, and their history.

use super::changes::Change;
use super::kernels::find;
use super::write::Write;
use super::{AbortReason, Store, StoreError, page};
use lightpath_domain::kernel::{Kernel, KernelKey, KernelMove, MoveCause};
use lightpath_domain::reason::PreconditionReason;
use sqlx::Row;

/// A promotion or a rollback.
struct Move {
    from: Option<u32>,
    to: u32,
    cause: MoveCause,
    undoes: Option<i64>,
}

impl Store {
    /// Makes a version active. If `expected` is given, the active version must be that one before (`Some(None)`: no
    /// version). Promoting the active version changes nothing.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`] if the version does not exist; [`StoreError::Aborted`] if a version other than
    /// `expected` is active.
    pub async fn promote(
        &self,
        key: &KernelKey,
        version: u32,
        expected: Option<Option<u32>>,
        cause: &MoveCause,
        now_ms: i64,
    ) -> Result<Kernel, StoreError> {
        let (key, cause) = (key.clone(), cause.clone());
        self.write(move |write| Box::pin(async move { promote(write, &key, version, expected, cause, now_ms).await }))
            .await
    }

    /// Undoes the latest promotion that has not been undone. The version `expected` (`None`: no version) must be active
    /// before, so that of two rollbacks at the same time only one takes effect. A later rollback undoes the promotion
    /// before.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`]; [`StoreError::Aborted`] if a version other than `expected` is active;
    /// [`StoreError::Precondition`] if there is no promotion to undo.
    pub async fn rollback(
        &self,
        key: &KernelKey,
        expected: Option<u32>,
        cause: &MoveCause,
        now_ms: i64,
    ) -> Result<Kernel, StoreError> {
        let (key, cause) = (key.clone(), cause.clone());
        self.write(move |write| Box::pin(async move { rollback(write, &key, expected, cause, now_ms).await })).await
    }

    /// Raises the generation of every display to at least `least`. Devices have seen the generations of moves that a
    /// restored database lacks.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`].
    pub async fn raise_generations(&self, least: u64) -> Result<(), StoreError> {
        self.write(move |write| {
            Box::pin(async move {
                sqlx::query("update display set generation = ?1 where generation < ?1")
                    .bind(least as i64)
                    .execute(write.sql())
                    .await?;
                Ok(())
            })
        })
        .await
    }

    /// At most `limit` moves of a kernel, newest first and older than the move `before`.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`] if the kernel does not exist.
    pub async fn kernel_moves(
        &self,
        key: &KernelKey,
        before: Option<i64>,
        limit: u32,
    ) -> Result<Vec<KernelMove>, StoreError> {
        let mut read = self.readers().begin().await?;
        let (id, _) = find(&mut read, key).await?;
        let rows =
            sqlx::query("select * from kernel_move where kernel = ? and sequence < ? order by sequence desc limit ?")
                .bind(id)
                .bind(before.unwrap_or(i64::MAX))
                .bind(page(limit))
                .fetch_all(&mut *read)
                .await?;
        rows.iter()
            .map(|row| {
                Ok(KernelMove {
                    sequence: row.try_get("sequence")?,
                    time_ms: row.try_get("time_ms")?,
                    caller: row.try_get("caller")?,
                    from_version: row.try_get("from_version")?,
                    to_version: row.try_get("to_version")?,
                    reason: row.try_get("reason")?,
                    generation: row.try_get::<i64, _>("generation")?.unsigned_abs(),
                    rollback: row.try_get::<Option<i64>, _>("undoes")?.is_some(),
                })
            })
            .collect()
    }
}

async fn promote(
    write: &mut Write,
    key: &KernelKey,
    version: u32,
    expected: Option<Option<u32>>,
    cause: MoveCause,
    now_ms: i64,
) -> Result<Kernel, StoreError> {
    let (id, kernel) = find(write.sql(), key).await?;
    if version == 0 || version > kernel.latest_version {
        return Err(StoreError::not_found(format!("{key}/versions/{version}")));
    }
    if let Some(expected) = expected {
        require_active(&kernel, expected)?;
    }
    if kernel.active_version == Some(version) {
        return Ok(kernel);
    }
    let step = Move { from: kernel.active_version, to: version, cause, undoes: None };
    apply(write, id, key, step, now_ms).await
}

/// Checks that the version `expected` is active (`None`: no version).
fn require_active(kernel: &Kernel, expected: Option<u32>) -> Result<(), StoreError> {
    if expected == kernel.active_version {
        return Ok(());
    }
    let key = &kernel.key;
    let message = match kernel.active_version {
        Some(active) => format!("version {active} of {key} is active now; read the kernel again"),
        None => format!("no version of {key} is active now; read the kernel again"),
    };
    Err(StoreError::Aborted { reason: AbortReason::ActiveVersionChanged, message })
}

async fn rollback(
    write: &mut Write,
    key: &KernelKey,
    expected: Option<u32>,
    cause: MoveCause,
    now_ms: i64,
) -> Result<Kernel, StoreError> {
    let (id, kernel) = find(write.sql(), key).await?;
    require_active(&kernel, expected)?;
    let last = sqlx::query(
        "select sequence, from_version from kernel_move m where kernel = ? and undoes is null \
         and not exists (select 1 from kernel_move u where u.undoes = m.sequence) order by sequence desc limit 1",
    )
    .bind(id)
    .fetch_optional(write.sql())
    .await?;
    let last: Option<(i64, Option<u32>)> = match last {
        Some(row) => Some((row.try_get("sequence")?, row.try_get("from_version")?)),
        None => None,
    };
    let Some((undone, Some(to))) = last else {
        let message = format!("{key} has no earlier active version to go back to");
        return Err(StoreError::precondition(PreconditionReason::NoEarlierVersion, message));
    };
    let step = Move { from: kernel.active_version, to, cause, undoes: Some(undone) };
    apply(write, id, key, step, now_ms).await
}

async fn apply(write: &mut Write, id: i64, key: &KernelKey, step: Move, now_ms: i64) -> Result<Kernel, StoreError> {
    let generation: i64 = sqlx::query_scalar(
        "update display set generation = generation + 1, generation_time_ms = max(generation_time_ms, ?2) where id = ?1 \
         returning generation",
    )
    .bind(&key.display)
    .bind(now_ms)
    .fetch_one(write.sql())
    .await?;
    sqlx::query(
        "insert into kernel_move (kernel, time_ms, caller, from_version, to_version, reason, generation, undoes) \
         values (?, ?, ?, ?, ?, ?, ?, ?)",
    )
    .bind(id)
    .bind(now_ms)
    .bind(step.cause.caller)
    .bind(step.from)
    .bind(step.to)
    .bind(step.cause.reason)
    .bind(generation)
    .bind(step.undoes)
    .execute(write.sql())
    .await?;
    sqlx::query("update kernel set active_version = ? where id = ?")
        .bind(step.to)
        .bind(id)
        .execute(write.sql())
        .await?;
    write.announce(Change::Kernel(key.clone()));
    Ok(find(write.sql(), key).await?.1)
}
