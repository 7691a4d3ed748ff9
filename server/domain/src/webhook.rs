//! Webhooks: addresses that the server tells when jobs end, and when kernels and rollouts change.

mod address;
mod secret;

pub use address::{WebhookUrl, WebhookUrlError};
pub use secret::WebhookSecret;

crate::reasons! {
    /// What a webhook can learn of.
    pub enum WebhookEvent {
        /// A job has its result.
        JobSucceeded = "job.succeeded",
        /// A job has failed for good.
        JobFailed = "job.failed",
        /// A job was cancelled.
        JobCancelled = "job.cancelled",
        /// A kernel has a new version.
        KernelVersionCreated = "kernel.version_created",
        /// Another version of a kernel became active.
        KernelActivated = "kernel.activated",
        /// A rollout was completed.
        RolloutCompleted = "rollout.completed",
        /// A rollout was halted, by a user or because devices failed.
        RolloutHalted = "rollout.halted",
        /// A user tries the webhook.
        Test = "webhook.test",
    }
}

impl WebhookEvent {
    /// The events that a webhook can ask for.
    pub const CHOICES: [Self; 7] = [
        Self::JobSucceeded,
        Self::JobFailed,
        Self::JobCancelled,
        Self::KernelVersionCreated,
        Self::KernelActivated,
        Self::RolloutCompleted,
        Self::RolloutHalted,
    ];

    /// The event with this code, if a webhook can ask for it.
    #[must_use]
    pub fn parse(code: &str) -> Option<Self> {
        Self::CHOICES.into_iter().find(|event| event.as_str() == code)
    }
}

/// An address that learns of events.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Webhook {
    /// Id of the webhook.
    pub id: String,
    /// The address.
    pub url: WebhookUrl,
    /// The events that it learns of; empty: all.
    pub events: Vec<WebhookEvent>,
    /// Id of the display whose events it learns of; `None`: all displays.
    pub display: Option<String>,
    /// Name of the token of its creator.
    pub caller: String,
    /// Time of its creation \[ms since 1970\].
    pub create_time_ms: i64,
    /// Number of changes so far and 1.
    pub revision: u32,
}

/// Something that a webhook is to learn.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Delivery {
    /// Number in the order of the events.
    pub sequence: i64,
    /// Id, the same for every attempt.
    pub id: String,
    /// Id of the webhook.
    pub webhook: String,
    /// What happened.
    pub event: WebhookEvent,
    /// What it is about, as JSON.
    pub subject: String,
    /// Time of the event \[ms since 1970\].
    pub time_ms: i64,
    /// Attempts so far.
    pub attempts: u32,
    /// Time of the next attempt \[ms since 1970\]; `None`: the delivery has ended.
    pub next_time_ms: Option<i64>,
    /// Whether the receiver has accepted it.
    pub delivered: bool,
    /// Answer of the receiver or the network to the latest attempt.
    pub answer: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_have_their_codes() {
        assert_eq!(WebhookEvent::parse("kernel.activated"), Some(WebhookEvent::KernelActivated));
        assert_eq!(WebhookEvent::parse("webhook.test"), None, "nobody asks for a test");
        assert_eq!(serde_json::to_string(&WebhookEvent::JobFailed).unwrap(), "\"job.failed\"");
    }
}
