//! The key that signs manifests.

use crate::error::{Result, ServiceError};
use lightpath_domain::reason::PreconditionReason;
use lightpath_manifest::{SignedKeyring, SigningKey};
use lightpath_store::Store;

/// The newest key of the keyring that counts now and whose private key this server has.
pub(super) async fn signing_key(store: &Store, now_s: i64) -> Result<SigningKey> {
    let keyring = store.keyring().await?.ok_or_else(no_key)?;
    let keyring = SignedKeyring::parse(keyring.document.as_bytes()).map_err(|_| no_key())?;
    let private = store.private_keys().await?;
    let mut listed: Vec<_> = keyring.unchecked().keys.iter().collect();
    listed.sort_by_key(|listed| std::cmp::Reverse(listed.from));
    let counts = listed.into_iter().filter(|listed| listed.from.unix_s() <= now_s && now_s < listed.until.unix_s());
    let mut found = counts.filter_map(|listed| {
        let public = listed.key.to_string();
        private.iter().find(|key| key.public == public)
    });
    found.find_map(|key| SigningKey::from_pem(&key.private).ok()).ok_or_else(no_key)
}

pub(super) fn no_key() -> ServiceError {
    ServiceError::Precondition {
        reason: PreconditionReason::NoSigningKey,
        message: "the server has no key that may sign manifests now; the operator must run `lightpathd key rotate`"
            .to_owned(),
    }
}
