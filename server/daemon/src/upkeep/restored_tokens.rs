//! Which tokens a restored database accepts. A backup cannot know which of its tokens were revoked after it.

use super::{Result, UpkeepError};
use lightpath_store::Store;

/// Most names of tokens in a message.
const NAMED_MAX: usize = 20;

/// What becomes of the tokens that a restored database accepts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RestoredTokens {
    /// Nobody has said it. Then nothing is restored, unless the database accepts no token.
    Undecided,
    /// All are accepted as before: none was revoked after the backup.
    Keep,
    /// These are revoked, and the others are accepted as before.
    Revoke(Vec<String>),
    /// All are revoked.
    RevokeAll,
}

impl RestoredTokens {
    /// Revokes what is to be revoked.
    ///
    /// # Errors
    ///
    /// [`UpkeepError::TokensUndecided`]; [`UpkeepError::UnknownTokens`] if the database does not have a name, because it may
    /// be misspelt. Then no token was revoked.
    pub(super) async fn settle(&self, store: &Store, now_ms: i64) -> Result<()> {
        let tokens = store.tokens().await?;
        let accepted = || tokens.iter().filter(|token| token.is_valid(now_ms)).map(|token| &token.caller.name);
        let revoked: Vec<&String> = match self {
            Self::Undecided if accepted().next().is_some() => {
                return Err(UpkeepError::TokensUndecided { names: listed(accepted()) });
            }
            Self::Undecided | Self::Keep => Vec::new(),
            Self::Revoke(names) => {
                let mut unknown =
                    names.iter().filter(|name| tokens.iter().all(|token| token.caller.name != **name)).peekable();
                if unknown.peek().is_some() {
                    return Err(UpkeepError::UnknownTokens { names: listed(unknown), accepted: listed(accepted()) });
                }
                names.iter().collect()
            }
            // Also those that have expired: the clock of the new machine may be wrong.
            Self::RevokeAll => tokens.iter().map(|token| &token.caller.name).collect(),
        };
        for name in revoked {
            store.revoke_token(name, now_ms).await?;
        }
        Ok(())
    }
}

/// The names as a text, or the first of many.
fn listed<'a>(names: impl Iterator<Item = &'a String>) -> String {
    let names: Vec<&str> = names.map(String::as_str).collect();
    match names.len().saturating_sub(NAMED_MAX) {
        0 => names.join(", "),
        more => format!("{} and {more} more", names[..NAMED_MAX].join(", ")),
    }
}
