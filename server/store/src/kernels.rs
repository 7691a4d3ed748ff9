//! Kernels and their versions.

use super::changes::Change;
use super::datasets::require_artifact;
use super::displays::require_display;
use super::kernel_filter::KernelFilter;
use super::made::{RequestMark, made_by, note_made};
use super::rows::{json, key_of, to_json, to_word, word};
use super::sql::{Builder, Connection, Row, from_row, query, scalar};
use super::write::Write;
use super::{Result, Store, StoreError, page};
use lightpath_domain::kernel::{Cause, Deprecation, Kernel, KernelKey, KernelVersion, NewKernelVersion, VERSIONS_MAX};
use lightpath_domain::reason::PreconditionReason;
use lightpath_domain::units::{Distance, Wavelength};
use std::collections::BTreeMap;

/// Selects kernels. `interpolated` describes the active version, or the latest one if no version is active.
const KERNELS: &str = "select kernel.*, exists (select 1 from kernel_version v where v.kernel = kernel.id \
                       and v.version = coalesce(kernel.active_version, kernel.latest_version) \
                       and v.interpolated = 1) as interpolated, \
                       (select string_agg(alias || '=' || version, ',') from kernel_alias a where a.kernel = kernel.id) \
                       as aliases, (select number from rollout r where r.kernel = kernel.id \
                       and r.state = 'running') as rollout from kernel";
/// Selects versions, with the newest row about their deprecation.
const VERSIONS: &str = "select v.*, k.active_version is not distinct from v.version as active, k.distance_nm, \
                        d.time_ms as deprecation_time_ms, d.caller as deprecation_caller, \
                        d.reason as deprecation_reason from kernel k join kernel_version v on v.kernel = k.id \
                        left join kernel_deprecation d on d.deprecated = 1 and d.sequence = (select max(sequence) \
                        from kernel_deprecation n where n.kernel = v.kernel and n.version = v.version)";

impl Store {
    /// Reads a kernel.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`].
    pub async fn kernel(&self, key: &KernelKey) -> Result<Kernel> {
        let mut read = self.readers().acquire().await?;
        Ok(find(&mut read, key).await?.1)
    }

    /// At most `limit` kernels that match the filter, in the order of their names (as `KernelKey` displays them), behind the
    /// name `after`.
    pub async fn kernels(&self, filter: &KernelFilter, after: Option<&str>, limit: u32) -> Result<Vec<Kernel>> {
        let mut query = Builder::new(KERNELS);
        query.push(" where name > ");
        query.push_bind(after.unwrap_or(""));
        if let Some(display) = &filter.display {
            query.push(" and display = ").push_bind(display);
        }
        if let Some(wavelength) = filter.wavelength {
            query.push(" and wavelength_pm = ").push_bind(wavelength.pm);
        }
        if let Some(distance) = filter.distance {
            query.push(" and distance_nm = ").push_bind(distance.nm);
        }
        query.push(" order by name limit ").push_bind(page(limit));
        query.build().fetch_all(self.readers()).await?.iter().map(kernel_of).collect()
    }

    /// The kernels with an active version whose distances are nearest to that of `key`, the nearest first: one at it,
    /// or at most one on each side.
    pub async fn nearest_kernels(&self, key: &KernelKey) -> Result<Vec<Kernel>> {
        let mut read = self.readers().begin().await?;
        let mut found = Vec::new();
        for (side, order) in [(" and distance_nm <= ", "desc"), (" and distance_nm > ", "asc")] {
            let mut query = Builder::new(KERNELS);
            query.push(" where active_version is not null and display = ").push_bind(&key.display);
            query.push(" and wavelength_pm = ").push_bind(key.wavelength.pm);
            query.push(side).push_bind(key.distance.nm);
            query.push(format!(" order by distance_nm {order} limit 1"));
            let row = query.build().fetch_optional(&mut read).await?;
            found.extend(row.as_ref().map(kernel_of).transpose()?);
            if found.first().is_some_and(|kernel| kernel.key == *key) {
                break;
            }
        }
        found.sort_by_key(|kernel| kernel.key.distance.nm.abs_diff(key.distance.nm));
        Ok(found)
    }

    /// Reads a version of a kernel.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`].
    pub async fn kernel_version(&self, key: &KernelKey, version: u32) -> Result<KernelVersion> {
        let mut read = self.readers().acquire().await?;
        find_version(&mut read, key, version).await
    }

    /// At most `limit` versions of a kernel, newest first and older than `before`.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`] if the kernel does not exist.
    pub async fn kernel_versions(
        &self,
        key: &KernelKey,
        before: Option<u32>,
        limit: u32,
    ) -> Result<Vec<KernelVersion>> {
        let mut read = self.readers().begin().await?;
        let (id, _) = find(&mut read, key).await?;
        let mut query = Builder::new(VERSIONS);
        query.push(" where k.id = ").push_bind(id);
        query.push(" and v.version < ").push_bind(before.map_or(i64::MAX, i64::from));
        query.push(" order by v.version desc limit ").push_bind(page(limit));
        let rows = query.build().fetch_all(&mut read).await?;
        rows.iter().map(|row| version_of(key, row)).collect()
    }

    /// At most `limit` kernel versions of a display and wavelength that were learned together as one model of several
    /// distances, newest first, then by distance.
    pub async fn joint_versions(
        &self,
        display: &str,
        wavelength: Wavelength,
        limit: u32,
    ) -> Result<Vec<KernelVersion>> {
        let mut query = Builder::new(VERSIONS);
        query.push(" where k.display = ").push_bind(display);
        query.push(" and k.wavelength_pm = ").push_bind(wavelength.pm);
        query.push(
            " and v.interpolated = 0 and v.datasets > 1 \
             order by v.create_time_ms desc, v.job, k.distance_nm limit ",
        );
        query.push_bind(page(limit));
        let rows = query.build().fetch_all(self.readers()).await?;
        let of_row = |row: &Row| {
            let distance = Distance { nm: row.try_get("distance_nm")? };
            version_of(&KernelKey { display: display.to_owned(), wavelength, distance }, row)
        };
        rows.iter().map(of_row).collect()
    }

    /// Marks a version as deprecated, or takes that back.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`] if the version does not exist.
    pub async fn deprecate_kernel_version(
        &self,
        key: &KernelKey,
        version: u32,
        deprecated: bool,
        cause: &Cause,
        now_ms: i64,
    ) -> Result<KernelVersion> {
        let (key, cause) = (key.clone(), cause.clone());
        self.write(async move |write| {
            find_version(write.sql(), &key, version).await?;
            query(
                "insert into kernel_deprecation (kernel, version, deprecated, time_ms, caller, reason) \
                 select id, $1, $2, $3, $4, $5 from kernel where name = $6",
            )
            .bind((version, deprecated, now_ms, cause.caller, cause.reason, key.to_string()))
            .execute(write.sql())
            .await?;
            write.announce(Change::Kernel(key.clone()));
            find_version(write.sql(), &key, version).await
        })
        .await
    }

    /// Appends a version to a kernel and creates the kernel for its first version. The active version stays the same. If
    /// a request with this mark has made a version already, returns that version instead.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`] if the display or the artifact does not exist; [`StoreError::Precondition`] if the
    /// kernel has [`VERSIONS_MAX`] versions; [`StoreError::AlreadyExists`] if the caller used the id of the request for
    /// another one.
    pub async fn add_kernel_version_once(
        &self,
        key: &KernelKey,
        version: NewKernelVersion,
        mark: &RequestMark,
        now_ms: i64,
    ) -> Result<KernelVersion> {
        let (key, mark) = (key.clone(), mark.clone());
        self.write(async move |write| {
            if let Some(number) = made_by(write.sql(), &mark).await? {
                return find_version(write.sql(), &key, number).await;
            }
            let made = append_version(write, &key, version, now_ms).await?;
            note_made(write, &mark, made.version, now_ms).await?;
            Ok(made)
        })
        .await
    }

    /// [`Self::add_kernel_version_once`] without a mark: every call appends a version.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`] if the display or the artifact does not exist; [`StoreError::Precondition`] if the
    /// kernel has [`VERSIONS_MAX`] versions.
    pub async fn add_kernel_version(
        &self,
        key: &KernelKey,
        version: NewKernelVersion,
        now_ms: i64,
    ) -> Result<KernelVersion> {
        let key = key.clone();
        self.write(async move |write| append_version(write, &key, version, now_ms).await).await
    }
}

/// Appends a version within the caller's transaction.
pub(super) async fn append_version(
    write: &mut Write,
    key: &KernelKey,
    content: NewKernelVersion,
    now_ms: i64,
) -> Result<KernelVersion> {
    require_artifact(write.sql(), &content.artifact).await?;
    let (id, latest_version) = create(write.sql(), key, now_ms).await?;
    if latest_version >= VERSIONS_MAX {
        let message =
            format!("{key} has {VERSIONS_MAX} versions, which is the limit; declare the display again with another id");
        return Err(StoreError::precondition(PreconditionReason::KernelFull, message));
    }
    let version: u32 = scalar(
        "insert into kernel_version \
         (kernel, version, model, artifact, size_bytes, metrics, lineage, create_time_ms, interpolated, datasets, job) \
         select id, latest_version + 1, $2, $3, $4, $5, $6, $7, $8, $9, $10 from kernel where id = $1 returning version",
    )
    .bind((id, to_word("kernel_version.model", &content.model)?, &content.artifact, content.size_bytes as i64))
    .bind((to_json("kernel_version.metrics", &content.metrics)?, to_json("kernel_version.lineage", &content.lineage)?))
    .bind((now_ms, content.lineage.is_interpolated(), content.lineage.datasets().len() as i64, content.lineage.job()))
    .fetch_one(write.sql())
    .await?;
    query("update kernel set latest_version = $2 where id = $1").bind((id, version)).execute(write.sql()).await?;
    write.announce(Change::Kernel(key.clone()));
    Ok(KernelVersion { key: key.clone(), version, content, create_time_ms: now_ms, active: false, deprecation: None })
}

/// Row id and latest version of the kernel, which is created if it does not exist.
async fn create(sql: &mut Connection, key: &KernelKey, now_ms: i64) -> Result<(i64, u32)> {
    require_display(sql, &key.display).await?;
    query(
        "insert into kernel (name, display, wavelength_pm, distance_nm, create_time_ms) values ($1, $2, $3, $4, $5) \
         on conflict do nothing",
    )
    .bind((key.to_string(), &key.display, key.wavelength.pm, key.distance.nm, now_ms))
    .execute(&mut *sql)
    .await?;
    let (id, kernel) = find(sql, key).await?;
    Ok((id, kernel.latest_version))
}

/// The kernel and its row id.
pub(super) async fn find(sql: &mut Connection, key: &KernelKey) -> Result<(i64, Kernel)> {
    let mut query = Builder::new(KERNELS);
    query.push(" where name = ").push_bind(key.to_string());
    let row = query.build().fetch_optional(sql).await?;
    let row = row.ok_or_else(|| StoreError::not_found(key.to_string()))?;
    Ok((row.try_get("id")?, kernel_of(&row)?))
}

/// A version of a kernel.
pub(super) async fn find_version(sql: &mut Connection, key: &KernelKey, version: u32) -> Result<KernelVersion> {
    let mut query = Builder::new(VERSIONS);
    query.push(" where k.name = ").push_bind(key.to_string());
    query.push(" and v.version = ").push_bind(version);
    let row = query.build().fetch_optional(sql).await?;
    version_of(key, &row.ok_or_else(|| StoreError::not_found(format!("{key}/versions/{version}")))?)
}

fn kernel_of(row: &Row) -> Result<Kernel> {
    let aliases: Option<String> = row.try_get("aliases")?;
    Ok(from_row!(row, Kernel {
        active_version, latest_version, interpolated, create_time_ms, rollout;
        key: key_of(row)?,
        aliases: aliases_of(&aliases.unwrap_or_default())?,
    }))
}

/// The aliases in a text such as `good=3,best=7`.
fn aliases_of(text: &str) -> Result<BTreeMap<String, u32>> {
    let pairs = text.split(',').filter(|pair| !pair.is_empty());
    let parsed = pairs.map(|pair| {
        let (alias, version) = pair.split_once('=')?;
        Some((alias.to_owned(), version.parse().ok()?))
    });
    let aliases: Option<_> = parsed.collect();
    aliases.ok_or_else(|| StoreError::corrupt("kernel_alias", "is no list of aliases"))
}

fn version_of(key: &KernelKey, row: &Row) -> Result<KernelVersion> {
    Ok(from_row!(row, KernelVersion {
        version, create_time_ms, active;
        key: key.clone(),
        content: NewKernelVersion {
            model: word(row, "kernel_version.model")?,
            artifact: row.try_get("artifact")?,
            size_bytes: row.try_get("size_bytes")?,
            metrics: json(row, "kernel_version.metrics")?,
            lineage: json(row, "kernel_version.lineage")?,
        },
        deprecation: deprecation_of(row)?,
    }))
}

fn deprecation_of(row: &Row) -> Result<Option<Deprecation>> {
    let Some(time_ms) = row.try_get("deprecation_time_ms")? else { return Ok(None) };
    let cause = Cause { caller: row.try_get("deprecation_caller")?, reason: row.try_get("deprecation_reason")? };
    Ok(Some(Deprecation { time_ms, cause }))
}
