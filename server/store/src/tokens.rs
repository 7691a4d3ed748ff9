//! API tokens.

use super::rows::{json, to_json, word};
use super::sql::{Row, from_row, query};
use super::{Result, Store, StoreError};
use lightpath_domain::access::{Caller, Role};

/// An API token, without the secret that only its bearer has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TokenRecord {
    /// Caller whom the token identifies.
    pub caller: Caller,
    /// Time when the token was created \[ms since 1970\].
    pub create_time_ms: i64,
    /// Time from which the token is refused \[ms since 1970\]; `None`: it does not expire.
    pub expire_time_ms: Option<i64>,
    /// Time when the token was revoked \[ms since 1970\].
    pub revoke_time_ms: Option<i64>,
}

impl TokenRecord {
    /// Whether the token is accepted at the time `now_ms`.
    #[must_use]
    pub fn is_valid(&self, now_ms: i64) -> bool {
        self.revoke_time_ms.is_none() && self.expire_time_ms.is_none_or(|expire_ms| now_ms < expire_ms)
    }
}

impl Store {
    /// Stores a new token with the hash of its secret.
    ///
    /// # Errors
    ///
    /// [`StoreError::AlreadyExists`] if the name is taken. Names of revoked tokens stay taken, so that a name in the
    /// audit log always means the same token.
    pub async fn create_token(
        &self,
        caller: &Caller,
        hash: &str,
        expire_time_ms: Option<i64>,
        now_ms: i64,
    ) -> Result<TokenRecord> {
        let (caller, hash) = (caller.clone(), hash.to_owned());
        self.write(async move |write| {
            let row = query(
                "insert into token (name, hash, role, displays, create_time_ms, expire_time_ms) \
                 values ($1, $2, $3, $4, $5, $6) on conflict (name) do nothing returning *",
            )
            .bind((&caller.name, hash, caller.role.as_str(), to_json("token.displays", &caller.displays)?, now_ms))
            .bind(expire_time_ms)
            .fetch_optional(write.sql())
            .await?;
            let taken =
                || StoreError::exists(format!("token \"{}\"", caller.name), "or was revoked; choose another name");
            token_of(&row.ok_or_else(taken)?)
        })
        .await
    }

    /// The token whose secret has this hash.
    pub async fn token_by_hash(&self, hash: &str) -> Result<Option<TokenRecord>> {
        let row = query("select * from token where hash = $1").bind(hash).fetch_optional(self.readers()).await?;
        row.as_ref().map(token_of).transpose()
    }

    /// Lists all tokens in the order of their names.
    pub async fn tokens(&self) -> Result<Vec<TokenRecord>> {
        let rows = query("select * from token order by name").fetch_all(self.readers()).await?;
        rows.iter().map(token_of).collect()
    }

    /// Revokes a token for ever.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`].
    pub async fn revoke_token(&self, name: &str, now_ms: i64) -> Result<TokenRecord> {
        let name = name.to_owned();
        self.write(async move |write| {
            let sql = "update token set revoke_time_ms = coalesce(revoke_time_ms, $2) where name = $1 returning *";
            let row = query(sql).bind((&name, now_ms)).fetch_optional(write.sql()).await?;
            token_of(&row.ok_or_else(|| StoreError::not_found(format!("token \"{name}\"")))?)
        })
        .await
    }
}

fn token_of(row: &Row) -> Result<TokenRecord> {
    let role: Role = word(row, "token.role")?;
    let displays = json(row, "token.displays")?;
    Ok(from_row!(row, TokenRecord {
        create_time_ms, expire_time_ms, revoke_time_ms;
        caller: Caller { name: row.try_get("name")?, role, displays },
    }))
}
