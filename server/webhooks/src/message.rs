//! The body of a delivery, and its signature.
//!
//! ```text
//! webhook-signature = "v1," Base64(HMAC-SHA256(key, webhook-id "." webhook-timestamp "." body))
//! ```
//!
//! This is the symmetric signature of the [Standard Webhooks](https://www.standardwebhooks.com) specification.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use chrono::{DateTime, SecondsFormat};
use lightpath_domain::webhook::{Delivery, WebhookSecret};
use ring::hmac;

/// What one attempt sends.
#[derive(Debug)]
pub(crate) struct Message {
    pub(crate) id: String,
    /// Time of the attempt \[s since 1970\].
    pub(crate) timestamp: String,
    pub(crate) signature: String,
    pub(crate) body: String,
}

impl Message {
    /// The message of an attempt at the time `now_ms`. Its id and body are the same at every attempt.
    pub(crate) fn of(delivery: &Delivery, secret: &WebhookSecret, now_ms: i64) -> Self {
        let (id, timestamp) = (delivery.id.clone(), now_ms.div_euclid(1000).to_string());
        let body = body(delivery);
        let key = hmac::Key::new(hmac::HMAC_SHA256, &secret.key());
        let signed = hmac::sign(&key, format!("{id}.{timestamp}.{body}").as_bytes());
        Self { signature: format!("v1,{}", STANDARD.encode(signed)), id, timestamp, body }
    }
}

fn body(delivery: &Delivery) -> String {
    let time = DateTime::from_timestamp_millis(delivery.time_ms).unwrap_or_default();
    let time = time.to_rfc3339_opts(SecondsFormat::Millis, true);
    // The code of an event has no characters that JSON escapes, and the subject is JSON.
    format!(r#"{{"type":"{}","timestamp":"{time}","data":{}}}"#, delivery.event.as_str(), delivery.subject)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_domain::webhook::WebhookEvent;
    use serde_json::{Value, json};

    fn delivery() -> Delivery {
        Delivery {
            sequence: 1,
            id: "00112233445566778899aabbccddeeff".to_owned(),
            webhook: "ci".to_owned(),
            event: WebhookEvent::JobFailed,
            subject: r#"{"job":"jobs/a","error":"a \"quoted\" name"}"#.to_owned(),
            time_ms: 1_764_000_000_123,
            attempts: 3,
            next_time_ms: Some(0),
            delivered: false,
            answer: String::new(),
        }
    }

    #[test]
    fn body_says_what_happened_and_when() {
        let body: Value = serde_json::from_str(&body(&delivery())).unwrap();
        let data = json!({ "job": "jobs/a", "error": "a \"quoted\" name" });
        assert_eq!(body, json!({ "type": "job.failed", "timestamp": "2025-11-24T16:00:00.123Z", "data": data }));
    }

    /// The expected signature comes from OpenSSL: `printf … | openssl dgst -sha256 -mac HMAC -macopt hexkey:00…00`.
    #[test]
    fn signature_is_that_of_another_implementation() {
        let secret = WebhookSecret::parse(&format!("whsec_{}", STANDARD.encode([0; 32]))).unwrap();
        let message = Message::of(&delivery(), &secret, 1_764_000_005_999);
        assert_eq!(message.timestamp, "1764000005");
        assert_eq!(message.signature, "v1,ZaIBDmosDuN4Gt41tH25GUjm6MhnVUHv1NakKS45GSU=");
        let later = Message::of(&delivery(), &secret, 1_764_000_006_000);
        assert_eq!((&later.id, &later.body), (&message.id, &message.body));
        assert_ne!(later.signature, message.signature);
    }
}
