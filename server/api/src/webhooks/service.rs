//! The webhook service.

use super::to_wire;
use crate::api::Api;
use crate::call::answers;
use crate::mask::Changes;
use crate::names;
use crate::pages::Page;
use lightpath_domain::webhook::{Delivery, Webhook, WebhookEvent, WebhookUrl};
use lightpath_proto::v1;
use lightpath_proto::v1::webhook_service_server::WebhookService;
use lightpath_service::{Call, Field, NewWebhook, Result, check_all, collect_all, shortened};
use lightpath_store::WebhookChange;

answers! {
    WebhookService {
        create_webhook(v1::CreateWebhookRequest) -> v1::Webhook;
        get_webhook(v1::GetWebhookRequest) -> v1::Webhook;
        list_webhooks(v1::ListWebhooksRequest) -> v1::ListWebhooksResponse;
        update_webhook(v1::UpdateWebhookRequest) -> v1::Webhook;
        test_webhook(v1::TestWebhookRequest) -> v1::WebhookDelivery;
        list_webhook_deliveries(v1::ListWebhookDeliveriesRequest) -> v1::ListWebhookDeliveriesResponse;
        delete_webhook(v1::DeleteWebhookRequest) -> v1::DeleteWebhookResponse;
    }
}

impl Api {
    async fn create_webhook(&self, call: &Call, request: v1::CreateWebhookRequest) -> Result<v1::Webhook> {
        let id = names::label(&Field::new("id"), &request.id)?.to_owned();
        call.concerns(format!("webhooks/{id}"));
        check_all! {
            url = url(&Field::new("url"), &request.url);
            events = events(&Field::new("events"), &request.events);
            display = names::display_filter(call, &Field::new("display"), &request.display);
        }
        let new = NewWebhook { id, url, events, display };
        let (webhook, secret) = self.service.webhooks.create(call, new).await?;
        Ok(v1::Webhook { secret: secret.reveal().to_owned(), ..to_wire::webhook(webhook) })
    }

    async fn get_webhook(&self, call: &Call, request: v1::GetWebhookRequest) -> Result<v1::Webhook> {
        Ok(to_wire::webhook(self.webhook(call, &Field::new("name"), &request.name).await?))
    }

    async fn list_webhooks(&self, call: &Call, _: v1::ListWebhooksRequest) -> Result<v1::ListWebhooksResponse> {
        let visible = self.service.webhooks.visible(call).await?;
        Ok(v1::ListWebhooksResponse { webhooks: visible.into_iter().map(to_wire::webhook).collect() })
    }

    async fn test_webhook(&self, call: &Call, request: v1::TestWebhookRequest) -> Result<v1::WebhookDelivery> {
        let webhook = self.webhook(call, &Field::new("name"), &request.name).await?;
        call.concerns(&request.name);
        Ok(to_wire::delivery(self.service.webhooks.test(call, &webhook).await?))
    }

    async fn list_webhook_deliveries(
        &self,
        call: &Call,
        request: v1::ListWebhookDeliveriesRequest,
    ) -> Result<v1::ListWebhookDeliveriesResponse> {
        let webhook = self.webhook(call, &Field::new("webhook"), &request.webhook).await?;
        let page = Page::new(&["deliveries", &request.webhook], request.page_size, &request.page_token)?;
        let deliveries = self.store.deliveries(&webhook.id, page.after_number()?, page.limit()).await?;
        let key = |delivery: &Delivery| delivery.sequence.to_string();
        let (deliveries, next_page_token) = page.fill(deliveries, key, to_wire::delivery);
        Ok(v1::ListWebhookDeliveriesResponse { deliveries, next_page_token })
    }

    async fn update_webhook(&self, call: &Call, request: v1::UpdateWebhookRequest) -> Result<v1::Webhook> {
        let field = Field::new("webhook");
        let message = field.required(request.webhook)?;
        let webhook = self.webhook(call, &field.at("name"), &message.name).await?;
        call.concerns(&message.name);
        let fields = [
            ("url", !message.url.is_empty()),
            ("events", !message.events.is_empty()),
            ("display", !message.display.is_empty()),
        ];
        let output = ["name", "caller", "create_time", "secret", "revision"];
        let changes =
            Changes::of(request.update_mask.map(|mask| mask.paths), &fields, &output, "url, events, display or *")?;
        let at = |name| changes.has(name).then(|| field.at(name));
        check_all! {
            url = at("url").map(|field| url(&field, &message.url)).transpose();
            events = at("events").map(|field| events(&field, &message.events)).transpose();
            display = at("display").map(|field| names::display_filter(call, &field, &message.display)).transpose();
        }
        let change = WebhookChange { url, events, display };
        Ok(to_wire::webhook(self.service.webhooks.update(&webhook, change, request.expected_revision).await?))
    }

    async fn delete_webhook(
        &self,
        call: &Call,
        request: v1::DeleteWebhookRequest,
    ) -> Result<v1::DeleteWebhookResponse> {
        let webhook = self.webhook(call, &Field::new("name"), &request.name).await?;
        call.concerns(&request.name);
        self.service.webhooks.delete(&webhook).await?;
        Ok(v1::DeleteWebhookResponse {})
    }

    /// The webhook with this name. One that the caller may not use does not exist for the caller.
    async fn webhook(&self, call: &Call, field: &Field, name: &str) -> Result<Webhook> {
        self.service.webhooks.existing(call, &names::webhook_id(field, name)?).await
    }
}

fn url(field: &Field, given: &str) -> Result<WebhookUrl> {
    WebhookUrl::parse(given)
        .map_err(|error| field.invalid(error, "give an address such as https://ci.example/lightpath"))
}

fn events(field: &Field, codes: &[String]) -> Result<Vec<WebhookEvent>> {
    collect_all(codes.iter().enumerate().map(|(i, code)| event(&field.index(i), code)))
}

fn event(field: &Field, code: &str) -> Result<WebhookEvent> {
    WebhookEvent::parse(code).ok_or_else(|| {
        let codes = WebhookEvent::CHOICES.map(WebhookEvent::as_str).join(", ");
        field.but(format!("is {:?}", shortened(code)), format!("must be one of {codes}"))
    })
}
