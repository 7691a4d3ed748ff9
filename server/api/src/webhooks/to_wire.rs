//! Conversion of webhooks and deliveries into messages.

use crate::time::timestamp;
use lightpath_domain::webhook::{Delivery, Webhook};
use lightpath_proto::v1;

/// Converts a webhook into its message, without the secret.
pub(super) fn webhook(webhook: Webhook) -> v1::Webhook {
    v1::Webhook {
        name: format!("webhooks/{}", webhook.id),
        url: webhook.url.as_str().to_owned(),
        events: webhook.events.iter().map(|event| event.as_str().to_owned()).collect(),
        display: webhook.display.map(|id| format!("displays/{id}")).unwrap_or_default(),
        caller: webhook.caller,
        create_time: Some(timestamp(webhook.create_time_ms)),
        secret: String::new(),
        revision: webhook.revision,
    }
}

/// Converts a delivery into its message.
pub(super) fn delivery(delivery: Delivery) -> v1::WebhookDelivery {
    v1::WebhookDelivery {
        id: delivery.id,
        event: delivery.event.as_str().to_owned(),
        data_json: delivery.subject,
        event_time: Some(timestamp(delivery.time_ms)),
        attempts: delivery.attempts,
        delivered: delivery.delivered,
        next_attempt_time: delivery.next_time_ms.map(timestamp),
        answer: delivery.answer,
    }
}
