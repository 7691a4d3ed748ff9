//! The keys of a server: made at its first start, renewed in time, rotated and revoked by its operator.
//!
//! While the server has the root key, it makes each new keyring itself: [`tend`] renews the keyring before it expires,
//! and lists a new manifest key before the present one ends. An operator who keeps the root key elsewhere signs
//! keyrings there and installs them.

use super::UpkeepError;
use lightpath_manifest::{Distrust, KeyError, Keyring, ListedKey, PublicKey, SignedKeyring, SigningKey, Time, Trust};
use lightpath_store::{PrivateKey, Store, StoreError, StoredKeyring};
use serde::Serialize;

/// Time for which a keyring counts \[s\]: 90 days. For as long, a device that receives nothing new may trust a key that
/// was revoked.
const KEYRING_LIFE_S: i64 = 90 * DAY_S;
/// Time for which a manifest key counts \[s\]: 400 days.
const KEY_LIFE_S: i64 = 400 * DAY_S;
/// A keyring and a manifest key are renewed when less than this part of their life is left.
const RENEWED_AT: f64 = 0.5;
/// A new keyring and a new key count from so long ago \[s\], for devices whose clocks are late.
const EARLY_S: i64 = DAY_S;
const DAY_S: i64 = 24 * 3600;

/// Why keys could not be changed; the messages say what each means.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum KeysError {
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error(transparent)]
    Key(#[from] KeyError),
    #[error("the server has no keys yet; `lightpathd serve` makes them at its first start")]
    NoKeyring,
    #[error("the stored keyring cannot be read: {0}")]
    Damaged(String),
    #[error(
        "the root key {root} is not on this server; make the new keyring with `lightpathd key draft`, sign it where the \
         root key is (`lightpath keyring sign`), and give it to `lightpathd key install`"
    )]
    RootElsewhere { root: String },
    #[error("the keyring lists no key {id}; `lightpathd key list` shows all")]
    NoSuchKey { id: String },
    /// Devices have a newer keyring.
    #[error("the number {version} is too low: the next keyring has at least {least}")]
    OldVersion { version: u32, least: u32 },
    #[error("devices would refuse this keyring: {0}")]
    Refused(#[from] Distrust),
    #[error("the clock shows {0} s after 1970, which no document can have; set the clock")]
    Clock(i64),
}

/// The state of a server's keys.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct KeyState {
    /// Number of the keyring.
    pub keyring: u32,
    /// Time from which the keyring counts no more.
    pub keyring_expires: String,
    /// The keys.
    pub keys: Vec<KeyLine>,
}

/// A key of a server.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct KeyLine {
    /// Short name of the key.
    pub id: String,
    /// The public key.
    pub public: String,
    /// `root`, `manifest` or `revoked`.
    #[serde(rename = "use")]
    pub use_: &'static str,
    /// First time of a manifest key.
    pub from: Option<String>,
    /// Last time of a manifest key.
    pub until: Option<String>,
    /// Whether this server has the private key.
    pub is_here: bool,
}

/// A change of the keyring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KeyChange {
    /// The same keys for a new time.
    Renew,
    /// A new manifest key. The present one stays valid for the manifests that it signed.
    Rotate,
    /// The key with this public key is no longer valid, and a new one takes its place.
    Revoke(PublicKey),
}

/// Makes the keys of a server that has none, and renews what would expire soon. Without the root key it only warns.
pub async fn tend(store: &Store, now_ms: i64) -> Result<(), KeysError> {
    let now_s = now_ms.div_euclid(1000);
    let Some(keyring) = store.keyring().await? else { return create(store, now_ms).await };
    let keyring = read(&keyring)?;
    let left = |until: Time, life_s: i64| (until.unix_s() - now_s) as f64 / life_s as f64;
    let newest = keyring.keys.iter().map(|listed| listed.until).max();
    let change = match newest {
        Some(until) if left(until, KEY_LIFE_S) >= RENEWED_AT => {
            if left(keyring.expires, KEYRING_LIFE_S) >= RENEWED_AT {
                return Ok(());
            }
            KeyChange::Renew
        }
        _ => KeyChange::Rotate,
    };
    match change_keyring(store, change, now_ms).await {
        Ok(version) => tracing::info!(version, "renewed the keyring"),
        Err(KeysError::RootElsewhere { .. }) => {
            let expires = keyring.expires.to_string();
            tracing::warn!(expires, "the keyring expires soon: sign a new one with the root key, and install it");
        }
        Err(error) => return Err(error),
    }
    Ok(())
}

async fn create(store: &Store, now_ms: i64) -> Result<(), KeysError> {
    let (root, key) = (SigningKey::generate()?, SigningKey::generate()?);
    let now_s = now_ms.div_euclid(1000);
    let keyring = Keyring {
        version: 1,
        issued: time(now_s - EARLY_S)?,
        expires: time(now_s + KEYRING_LIFE_S)?,
        roots: vec![root.public()],
        keys: vec![listed(&key, now_s)?],
        revoked: Vec::new(),
    };
    let stored = StoredKeyring { version: 1, document: keyring.signed(&[&root]) };
    store.add_keyring(stored, vec![private(&root), private(&key)], Vec::new(), now_ms).await?;
    tracing::info!(root = root.public().id(), "made the keys that sign manifests of kernels");
    Ok(())
}

/// Changes the keyring with the root key of this server, and returns the new keyring's number.
///
/// # Errors
///
/// [`KeysError::RootElsewhere`], [`KeysError::NoSuchKey`].
pub async fn change_keyring(store: &Store, change: KeyChange, now_ms: i64) -> Result<u32, KeysError> {
    let (keyring, new) = drafted(store, change, None, now_ms).await?;
    let forgotten = match change {
        KeyChange::Revoke(key) => vec![key.to_string()],
        KeyChange::Renew | KeyChange::Rotate => Vec::new(),
    };
    sign_and_add(store, &keyring, &new, forgotten, now_ms).await?;
    Ok(keyring.version)
}

/// Signs a keyring with the root keys of this server, and stores it with new private keys.
async fn sign_and_add(
    store: &Store,
    keyring: &Keyring,
    new: &[SigningKey],
    forgotten: Vec<String>,
    now_ms: i64,
) -> Result<(), KeysError> {
    let roots = private_roots(store, keyring).await?;
    if roots.is_empty() {
        let root = keyring.roots.first().map(PublicKey::id).unwrap_or_default();
        return Err(KeysError::RootElsewhere { root });
    }
    let document = keyring.signed(&roots.iter().collect::<Vec<_>>());
    let stored = StoredKeyring { version: keyring.version, document };
    Ok(store.add_keyring(stored, new.iter().map(private).collect(), forgotten, now_ms).await?)
}

/// The next keyring, with the root key replaced if a new one is given, and the private keys that it needs.
async fn drafted(
    store: &Store,
    change: KeyChange,
    new_root: Option<PublicKey>,
    now_ms: i64,
) -> Result<(Keyring, Vec<SigningKey>), KeysError> {
    let now_s = now_ms.div_euclid(1000);
    let present = store.keyring().await?.ok_or(KeysError::NoKeyring)?;
    let mut keyring = read(&present)?;
    keyring.version += 1;
    (keyring.issued, keyring.expires) = (time(now_s - EARLY_S)?, time(now_s + KEYRING_LIFE_S)?);
    if let Some(root) = new_root {
        keyring.roots = vec![root];
    }
    keyring.keys.retain(|listed| listed.until.unix_s() > now_s);
    let mut new = Vec::new();
    if let KeyChange::Revoke(key) = change {
        let before = keyring.keys.len();
        keyring.keys.retain(|listed| listed.key != key);
        if keyring.keys.len() == before {
            return Err(KeysError::NoSuchKey { id: key.id() });
        }
        keyring.revoked.push(key);
        // A key that counts no more needs no line: the oldest ones make room.
        let extra = keyring.revoked.len().saturating_sub(Keyring::KEYS_MAX);
        keyring.revoked.drain(..extra);
    }
    if change != KeyChange::Renew {
        let key = SigningKey::generate()?;
        keyring.keys.push(listed(&key, now_s)?);
        let extra = keyring.keys.len().saturating_sub(Keyring::KEYS_MAX);
        keyring.keys.drain(..extra);
        new.push(key);
    }
    Ok((keyring, new))
}

/// The text of the next keyring, signed with the root keys of this server, if it has any. It has the given number, or
/// the next one. A new manifest key in it is kept here.
pub(super) async fn draft(
    store: &Store,
    change: KeyChange,
    new_root: Option<PublicKey>,
    version: Option<u32>,
    now_ms: i64,
) -> Result<String, KeysError> {
    let (mut keyring, new) = drafted(store, change, new_root, now_ms).await?;
    let least = keyring.version;
    keyring.version = version.unwrap_or(least);
    if keyring.version < least {
        return Err(KeysError::OldVersion { version: keyring.version, least });
    }
    // Private keys that no keyring lists sign nothing.
    store.add_private_keys(new.iter().map(private).collect(), now_ms).await?;
    let roots = private_roots(store, &keyring).await?;
    Ok(keyring.signed(&roots.iter().collect::<Vec<_>>()))
}

/// Stores a keyring that was signed elsewhere, if devices would accept it.
///
/// # Errors
///
/// [`KeysError::Refused`].
pub async fn install(store: &Store, document: &str, now_ms: i64) -> Result<u32, KeysError> {
    let present = store.keyring().await?.ok_or(KeysError::NoKeyring)?;
    let now_s = now_ms.div_euclid(1000);
    let keyring = Trust::Keyring(read(&present)?).renew(document.as_bytes(), time(now_s)?)?;
    let stored = StoredKeyring { version: keyring.version, document: document.to_owned() };
    let revoked = keyring.revoked.iter().map(PublicKey::to_string).collect();
    store.add_keyring(stored, Vec::new(), revoked, now_ms).await?;
    Ok(keyring.version)
}

/// Raises what devices compare, after a restore: the database lacks the moves and keyrings since the backup, and
/// devices refuse a lower generation or keyring than they have seen. The seconds since 1970 are more than any of both.
pub(super) async fn raise_after_restore(store: &Store, now_ms: i64) -> Result<(), KeysError> {
    let now_s = now_ms.div_euclid(1000);
    store.halt_all_rollouts("halted: the server was restored from a backup", now_s * 1000).await?;
    store.raise_generations(now_s.unsigned_abs()).await?;
    if store.keyring().await?.is_none() {
        return Ok(());
    }
    let (mut keyring, _) = drafted(store, KeyChange::Renew, None, now_ms).await?;
    keyring.version = keyring.version.max(u32::try_from(now_s).unwrap_or(u32::MAX));
    match sign_and_add(store, &keyring, &[], Vec::new(), now_ms).await {
        Err(KeysError::RootElsewhere { .. }) => {
            let version = keyring.version;
            tracing::warn!(
                version,
                "devices may have a newer keyring than the restored one: make one with `lightpathd key draft --version`, \
                 sign it where the root key is, and install it"
            );
            Ok(())
        }
        added => added,
    }
}

/// The state of a server's keys.
///
/// # Errors
///
/// [`KeysError::NoKeyring`].
pub async fn state(store: &Store) -> Result<KeyState, KeysError> {
    let keyring = read(&store.keyring().await?.ok_or(KeysError::NoKeyring)?)?;
    let private = store.private_keys().await?;
    let line = |key: &PublicKey, use_, times: Option<(Time, Time)>| {
        let public = key.to_string();
        KeyLine {
            id: key.id(),
            is_here: private.iter().any(|private| private.public == public),
            public,
            use_,
            from: times.map(|(from, _)| from.to_string()),
            until: times.map(|(_, until)| until.to_string()),
        }
    };
    let roots = keyring.roots.iter().map(|key| line(key, "root", None));
    let keys = keyring.keys.iter().map(|listed| line(&listed.key, "manifest", Some((listed.from, listed.until))));
    let revoked = keyring.revoked.iter().map(|key| line(key, "revoked", None));
    Ok(KeyState {
        keyring: keyring.version,
        keyring_expires: keyring.expires.to_string(),
        keys: roots.chain(keys).chain(revoked).collect(),
    })
}

/// Private root keys of this server.
async fn private_roots(store: &Store, keyring: &Keyring) -> Result<Vec<SigningKey>, KeysError> {
    // The roots of the present keyring sign the next one. A new root signs, too, so that nobody installs a key that he
    // does not have.
    let present = read(&store.keyring().await?.ok_or(KeysError::NoKeyring)?)?;
    let roots: Vec<String> = present.roots.iter().chain(&keyring.roots).map(PublicKey::to_string).collect();
    let private = store.private_keys().await?;
    let found = private.iter().filter(|key| roots.contains(&key.public));
    Ok(found.map(|key| SigningKey::from_pem(&key.private)).collect::<Result<_, _>>()?)
}

fn read(keyring: &StoredKeyring) -> Result<Keyring, KeysError> {
    let signed = SignedKeyring::parse(keyring.document.as_bytes());
    Ok(signed.map_err(|error| KeysError::Damaged(error.to_string()))?.unchecked().clone())
}

fn listed(key: &SigningKey, now_s: i64) -> Result<ListedKey, KeysError> {
    Ok(ListedKey { key: key.public(), from: time(now_s - EARLY_S)?, until: time(now_s + KEY_LIFE_S)? })
}

fn private(key: &SigningKey) -> PrivateKey {
    PrivateKey { public: key.public().to_string(), private: key.to_pem() }
}

fn time(unix_s: i64) -> Result<Time, KeysError> {
    Time::from_unix_s(unix_s).ok_or(KeysError::Clock(unix_s))
}

impl From<KeysError> for UpkeepError {
    fn from(error: KeysError) -> Self {
        Self::Keys(Box::new(error))
    }
}
