//! Changes of the versions that `active` and other aliases name, and their history.

use super::changes::Change;
use super::kernels::{find, find_version};
use super::rows::{cause_of, json, to_json};
use super::sql::{Row, from_row, query, scalar};
use super::write::Write;
use super::{AbortReason, Result, Store, StoreError, page};
use lightpath_domain::kernel::{ACTIVE, Cause, Kernel, KernelKey, KernelMove};
use lightpath_domain::reason::PreconditionReason;

/// Limit on the aliases of a kernel besides `active`: a page of them can be read.
pub const ALIASES_MAX: usize = 64;

/// A change of the version that an alias names.
struct Move<'a> {
    alias: &'a str,
    from: Option<u32>,
    to: Option<u32>,
    cause: Cause,
    overridden: &'a [String],
    undoes: Option<i64>,
}

/// What an alias shall name, for [`Store::set_alias`].
#[derive(Clone, Debug)]
pub struct AliasMove {
    /// The alias; not `active`.
    pub alias: String,
    /// The version; `None`: the alias is removed.
    pub version: Option<u32>,
    /// Version that the alias must name before (`Some(None)`: none); `None`: whichever it names.
    pub expected: Option<Option<u32>>,
    /// Who moves it, and why.
    pub cause: Cause,
}

/// A version to make active, for [`Store::promote`].
#[derive(Clone, Debug)]
pub struct Promotion {
    /// Number of the version.
    pub version: u32,
    /// Version that must be active before (`None`: no version).
    pub expected_active: Option<u32>,
    /// Who makes it active, and why.
    pub cause: Cause,
    /// What failed of the promotion gate and was overridden.
    pub overridden: Vec<String>,
}

impl Store {
    /// Makes a version active. Promoting the active version changes nothing.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`] if the version does not exist; [`StoreError::Aborted`] if a version other than the
    /// expected one is active; [`StoreError::Precondition`] while a rollout of the kernel is running.
    pub async fn promote(&self, key: &KernelKey, promotion: Promotion, now_ms: i64) -> Result<Kernel> {
        let key = key.clone();
        self.write(async move |write| {
            let (_, kernel) = find(write.sql(), &key).await?;
            require_no_rollout(&kernel)?;
            promote(write, &key, promotion, now_ms).await
        })
        .await
    }

    /// Lets an alias other than `active` name a version, or removes it.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`] if the version does not exist; [`StoreError::Aborted`] if the alias names another
    /// version than expected; [`StoreError::Precondition`] if the kernel has [`ALIASES_MAX`] aliases.
    pub async fn set_alias(&self, key: &KernelKey, step: AliasMove, now_ms: i64) -> Result<Kernel> {
        let key = key.clone();
        self.write(async move |write| set_alias(write, &key, step, now_ms).await).await
    }

    /// Undoes the latest promotion that has not been undone. The version `expected` (`None`: no version) must be active
    /// before, so that of two rollbacks at the same time only one takes effect. A later rollback undoes the promotion
    /// before.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`]; [`StoreError::Aborted`] if a version other than `expected` is active;
    /// [`StoreError::Precondition`] if there is no promotion to undo, or the version before is deprecated.
    pub async fn rollback(&self, key: &KernelKey, expected: Option<u32>, cause: &Cause, now_ms: i64) -> Result<Kernel> {
        let (key, cause) = (key.clone(), cause.clone());
        self.write(async move |write| rollback(write, &key, expected, cause, now_ms).await).await
    }

    /// Raises the generation of every display to at least `least`. Devices have seen the generations of moves that a
    /// restored database lacks.
    pub async fn raise_generations(&self, least: u64) -> Result<()> {
        self.write(async move |write| {
            query("update display set generation = $1 where generation < $1")
                .bind(least as i64)
                .execute(write.sql())
                .await?;
            Ok(())
        })
        .await
    }

    /// At most `limit` moves of a kernel, newest first and older than the move `before`.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`] if the kernel does not exist.
    pub async fn kernel_moves(&self, key: &KernelKey, before: Option<i64>, limit: u32) -> Result<Vec<KernelMove>> {
        let mut read = self.readers().begin().await?;
        let (id, _) = find(&mut read, key).await?;
        let rows =
            query("select * from kernel_move where kernel = $1 and sequence < $2 order by sequence desc limit $3")
                .bind((id, before.unwrap_or(i64::MAX), page(limit)))
                .fetch_all(&mut read)
                .await?;
        rows.iter().map(move_of).collect()
    }
}

fn move_of(row: &Row) -> Result<KernelMove> {
    Ok(from_row!(row, KernelMove {
        sequence, alias, time_ms, from_version, to_version, generation;
        cause: cause_of(row)?,
        overridden: json(row, "kernel_move.overridden")?,
        rollback: row.try_get::<Option<i64>>("undoes")?.is_some(),
    }))
}

/// Makes a version active within the caller's transaction.
pub(super) async fn promote(write: &mut Write, key: &KernelKey, promotion: Promotion, now_ms: i64) -> Result<Kernel> {
    let Promotion { version, expected_active, cause, overridden } = promotion;
    let (id, kernel) = find(write.sql(), key).await?;
    require_version(&kernel, version)?;
    require_active(&kernel, expected_active)?;
    if kernel.active_version == Some(version) {
        return Ok(kernel);
    }
    let from = kernel.active_version;
    let step = Move { alias: ACTIVE, from, to: Some(version), cause, overridden: &overridden, undoes: None };
    let generation = raise_generation(write, key, now_ms).await?;
    apply(write, id, key, step, generation, now_ms).await
}

async fn set_alias(
    write: &mut Write,
    key: &KernelKey,
    AliasMove { alias, version, expected, cause }: AliasMove,
    now_ms: i64,
) -> Result<Kernel> {
    let (id, kernel) = find(write.sql(), key).await?;
    if let Some(version) = version {
        require_version(&kernel, version)?;
    }
    let from = kernel.aliases.get(&alias).copied();
    if expected.is_some_and(|expected| expected != from) {
        let now = from.map_or_else(|| "no version".to_owned(), |version| format!("version {version}"));
        let message = format!("the alias {alias} of {key} names {now}; read the kernel again");
        return Err(StoreError::Aborted { reason: AbortReason::AliasChanged, message });
    }
    if from == version {
        return Ok(kernel);
    }
    if from.is_none() && kernel.aliases.len() >= ALIASES_MAX {
        let message = format!("{key} has {ALIASES_MAX} aliases, which is the limit; remove one first");
        return Err(StoreError::precondition(PreconditionReason::KernelFull, message));
    }
    let generation: i64 =
        scalar("select generation from display where id = $1").bind(&key.display).fetch_one(write.sql()).await?;
    let step = Move { alias: &alias, from, to: version, cause, overridden: &[], undoes: None };
    apply(write, id, key, step, generation, now_ms).await
}

/// Refuses a version that does not exist.
pub(super) fn require_version(kernel: &Kernel, version: u32) -> Result<()> {
    match version {
        1.. if version <= kernel.latest_version => Ok(()),
        _ => Err(StoreError::not_found(format!("{}/versions/{version}", kernel.key))),
    }
}

/// Refuses a move of `active` while a rollout of the kernel is running.
pub(super) fn require_no_rollout(kernel: &Kernel) -> Result<()> {
    let Some(number) = kernel.rollout else { return Ok(()) };
    let message = format!("{}/rollouts/{number} is running; complete or halt it first", kernel.key);
    Err(StoreError::precondition(PreconditionReason::RolloutRunning, message))
}

/// Checks that the version `expected` is active (`None`: no version).
pub(super) fn require_active(kernel: &Kernel, expected: Option<u32>) -> Result<()> {
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
    cause: Cause,
    now_ms: i64,
) -> Result<Kernel> {
    let (id, kernel) = find(write.sql(), key).await?;
    require_no_rollout(&kernel)?;
    require_active(&kernel, expected)?;
    let last = query(
        "select sequence, from_version from kernel_move m where kernel = $1 and alias = 'active' and undoes is null \
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
    if let Some(deprecation) = find_version(write.sql(), key, to).await?.deprecation {
        let message = format!(
            "{key} would go back to version {to}, which is deprecated: {}; promote another version, or this one with force \
             and a reason",
            deprecation.cause.reason
        );
        return Err(StoreError::precondition(PreconditionReason::VersionDeprecated, message));
    }
    let (from, to) = (kernel.active_version, Some(to));
    let step = Move { alias: ACTIVE, from, to, cause, overridden: &[], undoes: Some(undone) };
    let generation = raise_generation(write, key, now_ms).await?;
    apply(write, id, key, step, generation, now_ms).await
}

/// Raises the generation of a kernel's display, because what its devices get changes.
pub(super) async fn raise_generation(write: &mut Write, key: &KernelKey, now_ms: i64) -> Result<i64> {
    let raise = "update display set generation = generation + 1, \
                 generation_time_ms = max(generation_time_ms, $2) where id = $1 returning generation";
    write.announce(Change::Kernel(key.clone()));
    Ok(scalar(raise).bind((&key.display, now_ms)).fetch_one(write.sql()).await?)
}

async fn apply(
    write: &mut Write,
    id: i64,
    key: &KernelKey,
    step: Move<'_>,
    generation: i64,
    now_ms: i64,
) -> Result<Kernel> {
    query(
        "insert into kernel_move \
         (kernel, alias, time_ms, caller, from_version, to_version, reason, overridden, generation, undoes) \
         values ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10)",
    )
    .bind((id, step.alias, now_ms, step.cause.caller, step.from, step.to, step.cause.reason))
    .bind((to_json("kernel_move.overridden", &step.overridden)?, generation, step.undoes))
    .execute(write.sql())
    .await?;
    let change = match (step.alias, step.to) {
        (ACTIVE, _) => "update kernel set active_version = $3 where id = $1",
        (_, None) => "delete from kernel_alias where kernel = $1 and alias = $2 and $3 is null",
        (_, Some(_)) => {
            "insert into kernel_alias values ($1, $2, $3) on conflict (kernel, alias) do update set version = excluded.version"
        }
    };
    query(change).bind((id, step.alias, step.to)).execute(write.sql()).await?;
    write.announce(Change::Kernel(key.clone()));
    Ok(find(write.sql(), key).await?.1)
}
