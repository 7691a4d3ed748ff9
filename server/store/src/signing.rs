//! Keyrings, and the private keys of this server.

use super::sql::{Row, from_row, query, scalar};
use super::write::Write;
use super::{AbortReason, Result, Store, StoreError};
use lightpath_domain::kernel::{KernelKey, KernelMoment};
use lightpath_domain::rollout::is_in_share;

/// A signed keyring.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StoredKeyring {
    /// Number of the keyring, from 1.
    pub version: u32,
    /// The signed document.
    pub document: String,
}

/// A private key of this server.
#[derive(Clone, PartialEq, Eq)]
pub struct PrivateKey {
    /// The public key, as 64 hexadecimal digits.
    pub public: String,
    /// The private key, as PKCS#8 in PEM form.
    pub private: String,
}

impl std::fmt::Debug for PrivateKey {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PrivateKey").field("public", &self.public).finish_non_exhaustive()
    }
}

impl Store {
    /// The newest keyring.
    pub async fn keyring(&self) -> Result<Option<StoredKeyring>> {
        let row = query("select version, document from keyring order by version desc limit 1")
            .fetch_optional(self.readers())
            .await?;
        let keyring =
            row.map(|row| Ok(StoredKeyring { version: row.try_get("version")?, document: row.try_get("document")? }));
        keyring.transpose()
    }

    /// Adds a keyring, together with new private keys, and forgets private keys.
    ///
    /// # Errors
    ///
    /// [`StoreError::Aborted`] if the keyring's number is not above all others: another keyring was added meanwhile.
    pub async fn add_keyring(
        &self,
        keyring: StoredKeyring,
        new: Vec<PrivateKey>,
        forgotten: Vec<String>,
        now_ms: i64,
    ) -> Result<()> {
        self.write(async move |write| add(write, keyring, new, forgotten, now_ms).await).await
    }

    /// Adds private keys, for a keyring that is signed elsewhere and added later.
    pub async fn add_private_keys(&self, new: Vec<PrivateKey>, now_ms: i64) -> Result<()> {
        self.write(async move |write| add_private(write, new, now_ms).await).await
    }

    /// Private keys of this server.
    pub async fn private_keys(&self) -> Result<Vec<PrivateKey>> {
        let rows = query("select public, private from signing_key order by public").fetch_all(self.readers()).await?;
        let key = |row: &Row| Ok(PrivateKey { public: row.try_get("public")?, private: row.try_get("private")? });
        rows.iter().map(key).collect()
    }

    /// Forgets a private key. False if this server does not have it.
    pub async fn forget_private_key(&self, public: &str) -> Result<bool> {
        let public = public.to_owned();
        self.write(async move |write| {
            let deleted = query("delete from signing_key where public = $1").bind(public).execute(write.sql()).await?;
            Ok(deleted > 0)
        })
        .await
    }

    /// What decides the manifests of a kernel for a device, read at one moment.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`] if the kernel does not exist.
    pub async fn kernel_moment(&self, key: &KernelKey, device: Option<&str>) -> Result<KernelMoment> {
        let row = query(
            "select k.active_version, d.generation, d.generation_time_ms, \
             (select max(version) from keyring) as keyring_version, \
             r.number as rollout, r.version as rollout_version, r.share, \
             r.group_name <> '' and r.group_name = e.group_name as is_in_group \
             from kernel k join display d on d.id = k.display \
             left join rollout r on r.kernel = k.id and r.state = 'running' \
             left join device e on e.display = k.display and e.id = $2 where k.name = $1",
        )
        .bind((key.to_string(), device))
        .fetch_optional(self.readers())
        .await?;
        let row = row.ok_or_else(|| StoreError::not_found(key.to_string()))?;
        Ok(from_row!(row, KernelMoment {
            generation, generation_time_ms, keyring_version;
            version: version_for(&row, key, device)?,
        }))
    }
}

/// The version for a device: that of the rollout, or the active one. Unknown devices get the new version when all do.
fn version_for(row: &Row, key: &KernelKey, device: Option<&str>) -> Result<Option<u32>> {
    let active = row.try_get("active_version")?;
    let Some(rollout) = row.try_get("rollout")? else { return Ok(active) };
    let share: f64 = row.try_get("share")?;
    let is_in_group: Option<bool> = row.try_get("is_in_group")?;
    let is_first =
        is_in_group == Some(true) || device.map_or(share >= 1.0, |device| is_in_share(key, rollout, device, share));
    Ok(if is_first { row.try_get("rollout_version")? } else { active })
}

async fn add(
    write: &mut Write,
    keyring: StoredKeyring,
    new: Vec<PrivateKey>,
    forgotten: Vec<String>,
    now_ms: i64,
) -> Result<()> {
    let newest: Option<u32> = scalar("select max(version) from keyring").fetch_one(write.sql()).await?;
    let newest = newest.unwrap_or(0);
    if keyring.version <= newest {
        let message = format!(
            "the keyring has version {}, but one with version {newest} exists; make it again with a higher version",
            keyring.version
        );
        return Err(StoreError::Aborted { reason: AbortReason::KeyringChanged, message });
    }
    query("insert into keyring values ($1, $2, $3)")
        .bind((keyring.version, keyring.document, now_ms))
        .execute(write.sql())
        .await?;
    add_private(write, new, now_ms).await?;
    for public in forgotten {
        query("delete from signing_key where public = $1").bind(public).execute(write.sql()).await?;
    }
    Ok(())
}

async fn add_private(write: &mut Write, new: Vec<PrivateKey>, now_ms: i64) -> Result<()> {
    for PrivateKey { public, private } in new {
        query("insert into signing_key values ($1, $2, $3) on conflict do nothing")
            .bind((public, private, now_ms))
            .execute(write.sql())
            .await?;
    }
    Ok(())
}
