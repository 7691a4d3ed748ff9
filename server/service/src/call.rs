//! Who asks, for whom the answer is counted, and whether somebody still waits for it.

use crate::client::Client;
use lightpath_domain::access::Caller;
use std::net::IpAddr;
use std::sync::{Arc, OnceLock};
use tokio_util::sync::CancellationToken;

/// A call whose caller is known and may make it. Clones are the same call.
#[derive(Clone, Debug)]
pub struct Call {
    /// Who calls, and what the caller may do.
    pub caller: Caller,
    /// For whom the call is counted.
    pub client: Client,
    /// Cancelled when the client no longer waits for the answer.
    pub cancelled: CancellationToken,
    /// The resource that the call changes, for the audit log.
    object: Arc<OnceLock<String>>,
}

impl Call {
    /// A call from a caller at an address.
    #[must_use]
    pub fn new(caller: Caller, address: Option<IpAddr>) -> Self {
        let client = Client::of(&caller, address);
        Self { caller, client, cancelled: CancellationToken::new(), object: Arc::default() }
    }

    /// A call without a token, from an unknown address, as tests make it.
    #[must_use]
    pub fn without_token() -> Self {
        Self::new(Caller::without_token(), None)
    }

    /// The same call for work that goes on when its client leaves, until the server stops.
    pub(crate) fn on_its_own(&self, stopping: &CancellationToken) -> Self {
        Self { cancelled: stopping.child_token(), ..self.clone() }
    }

    /// Notes the resource that the call changes. The first note counts.
    pub fn concerns(&self, object: impl Into<String>) {
        // A second note is about a part of the first.
        let _ = self.object.set(object.into());
    }

    /// The resource that the call changes; empty if none was noted.
    #[must_use]
    pub fn object(&self) -> &str {
        self.object.get().map_or("", String::as_str)
    }
}
