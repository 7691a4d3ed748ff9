//! Webhooks: addresses that learn of events.

use crate::call::Call;
use crate::error::{Result, ServiceError};
use lightpath_domain::origin::Origins;
use lightpath_domain::reason::PreconditionReason;
use lightpath_domain::webhook::{Delivery, Webhook, WebhookEvent, WebhookSecret, WebhookUrl};
use lightpath_store::{Store, StoreError, WebhookChange};

/// Webhooks, which may go to some origins.
#[derive(Clone, Debug)]
pub struct Webhooks {
    store: Store,
    origins: Origins,
}

/// A webhook to be created.
#[derive(Clone, Debug)]
pub struct NewWebhook {
    /// Id.
    pub id: String,
    /// Where it goes.
    pub url: WebhookUrl,
    /// The events of which it tells; empty: all.
    pub events: Vec<WebhookEvent>,
    /// Display whose events it gets; `None`: all.
    pub display: Option<String>,
}

impl Webhooks {
    pub(crate) fn new(store: Store, origins: Origins) -> Self {
        Self { store, origins }
    }

    /// Refuses an address that the operator does not allow.
    fn require_origin(&self, url: &WebhookUrl) -> Result<()> {
        if self.origins.contains(url.origin()) {
            return Ok(());
        }
        let allowed = match self.origins.list() {
            Some(list) => format!("webhooks may go to {list} only"),
            None => "no webhooks may go anywhere".to_owned(),
        };
        let origin = url.origin();
        let message = format!(
            "url has the origin {origin}, but {allowed}; ask the operator to add it to the server's setting webhook_origins"
        );
        Err(ServiceError::Precondition { reason: PreconditionReason::WebhookOriginNotAllowed, message })
    }

    /// Creates a webhook, whose secret only this answer tells. Refuses an address that the operator does not allow.
    pub async fn create(&self, call: &Call, new: NewWebhook) -> Result<(Webhook, WebhookSecret)> {
        let NewWebhook { id, url, events, display } = new;
        self.require_origin(&url)?;
        let (caller, create_time_ms) = (call.caller.name.clone(), self.store.now_ms());
        let webhook = Webhook { id, url, events, display, caller, create_time_ms, revision: 1 };
        let secret = WebhookSecret::generate().map_err(|_| ServiceError::NoRandomness)?;
        self.store.create_webhook(&webhook, &secret).await?;
        Ok((webhook, secret))
    }

    /// The webhooks that the caller may use.
    pub async fn visible(&self, call: &Call) -> Result<Vec<Webhook>> {
        let webhooks = self.store.webhooks().await?.into_iter();
        Ok(webhooks.filter(|webhook| may_use(call, webhook)).collect())
    }

    /// The webhook with this id. One that the caller may not use does not exist for the caller.
    pub async fn existing(&self, call: &Call, id: &str) -> Result<Webhook> {
        let webhook = self.store.webhook(id).await?;
        match may_use(call, &webhook) {
            true => Ok(webhook),
            false => Err(StoreError::NotFound { resource: format!("webhooks/{id}") }.into()),
        }
    }

    /// Changes a webhook that the caller has been shown. Refuses an address that the operator does not allow, and a
    /// webhook that has another revision than it had then, or than `expected`: it may have become one of other displays.
    pub async fn update(&self, webhook: &Webhook, change: WebhookChange, expected: Option<u32>) -> Result<Webhook> {
        if let Some(url) = &change.url {
            self.require_origin(url)?;
        }
        Ok(self.store.update_webhook(&webhook.id, change, expected.unwrap_or(webhook.revision)).await?)
    }

    /// Sends a test event.
    pub async fn test(&self, call: &Call, webhook: &Webhook) -> Result<Delivery> {
        Ok(self.store.test_webhook(&webhook.id, &call.caller.name, self.store.now_ms()).await?)
    }

    /// Removes a webhook.
    pub async fn delete(&self, webhook: &Webhook) -> Result<()> {
        Ok(self.store.delete_webhook(&webhook.id).await?)
    }
}

/// Whether the caller's token is for all displays whose events the webhook gets.
fn may_use(call: &Call, webhook: &Webhook) -> bool {
    match &webhook.display {
        Some(display) => call.caller.may_use(display),
        None => call.caller.displays.is_empty(),
    }
}
