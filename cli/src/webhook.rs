//! The commands `lightpath webhook …`.

use super::arguments::Limit;
use super::failure::Failure;
use super::pages::pages;
use super::session::Session;
use super::show;
use super::table::Table;
use clap::{Args, Subcommand};
use lightpath::{names, v1};
use pbjson_types::FieldMask;
use std::time::Duration;
use tokio::time::{Instant, sleep};

/// How long `webhook test` waits for the answer of the receiver: longer than the server does.
const ANSWERED_WITHIN: Duration = Duration::from_secs(15);
/// Time between two questions of `webhook test`.
const ASKED_EVERY: Duration = Duration::from_millis(100);

/// Commands for webhooks: addresses that the server tells what happened.
#[derive(Debug, Subcommand)]
pub(crate) enum WebhookCommand {
    Create(Create),
    /// List webhooks
    List,
    Show(Show),
    Update(Update),
    Test(Named),
    /// Delete a webhook, with what it has not received yet
    Delete(Named),
}

/// Create a webhook, and print the secret that signs what it gets.
///
/// The server sends a signed HTTP POST for each event, and repeats it for three days until the receiver answers with a
/// status from 200 to 299. The setting webhook_origins of the server must allow the origin of the address.
/// docs/webhooks.md has a receiver.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  lightpath webhook create ci https://hooks.example/lightpath \\
      --event job.failed --event job.succeeded
  lightpath webhook create line-3 https://hooks.example/kernels \\
      --event kernel.activated --display lab-2

Events: job.succeeded, job.failed, job.cancelled, kernel.version_created, kernel.activated, rollout.completed, \
rollout.halted.")]
pub(crate) struct Create {
    /// Id of the new webhook: a-z, 0-9 and '-'
    #[arg(value_name = "ID")]
    id: String,

    /// Address that gets the events
    #[arg(value_name = "URL")]
    url: String,

    /// Send only this event; repeat the option for several [default: all]
    #[arg(long = "event", value_name = "EVENT")]
    events: Vec<String>,

    /// Send only the events of the display with this id [default: all]
    #[arg(long, value_name = "ID")]
    display: Option<String>,
}

/// Change the address, the events or the display of a webhook.
///
/// Its secret stays. What it has not received yet goes to the new address.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  lightpath webhook update ci --url https://hooks.example/new
  lightpath webhook update ci --event job.failed --all-displays")]
pub(crate) struct Update {
    /// Id of the webhook
    #[arg(value_name = "ID")]
    id: String,

    /// Send the events to this address
    #[arg(long)]
    url: Option<String>,

    /// Send only this event; repeat the option for several
    #[arg(long = "event", value_name = "EVENT", conflicts_with = "all_events")]
    events: Vec<String>,

    /// Send all events
    #[arg(long)]
    all_events: bool,

    /// Send only the events of the display with this id
    #[arg(long, value_name = "ID", conflicts_with = "all_displays")]
    display: Option<String>,

    /// Send the events of all displays
    #[arg(long)]
    all_displays: bool,

    /// Change it only if it has this revision, as `webhook show --output json` says it [default: any]
    #[arg(long, value_name = "N")]
    expected_revision: Option<u32>,
}

/// Show a webhook, with what it is to learn and what it has learned lately.
#[derive(Debug, Args)]
pub(crate) struct Show {
    #[command(flatten)]
    webhook: Named,

    #[command(flatten)]
    limit: Limit,
}

/// Send an event that only tries a webhook, and print the answer of its receiver.
#[derive(Debug, Args)]
pub(crate) struct Named {
    /// Id of the webhook
    #[arg(value_name = "ID")]
    id: String,
}

impl WebhookCommand {
    pub(crate) async fn run(self, session: &Session) -> Result<(), Failure> {
        let client = &session.client;
        match self {
            Self::Create(create) => create.run(session).await,
            Self::List => {
                let list = client.list_webhooks(v1::ListWebhooksRequest {}).await?;
                session.print_list(
                    &list,
                    |list| &list.webhooks,
                    |list| table(&list.webhooks).text_or("no webhooks; see lightpath webhook create"),
                )
            }
            Self::Show(show) => show.run(session).await,
            Self::Update(update) => update.run(session).await,
            Self::Test(named) => named.test(session).await,
            Self::Delete(Named { id }) => {
                let request = v1::DeleteWebhookRequest { name: names::webhook(&id) };
                session.print(&client.delete_webhook(request).await?, |_| format!("deleted {id}\n"))
            }
        }
    }
}

impl Create {
    async fn run(self, session: &Session) -> Result<(), Failure> {
        let display = self.display.as_deref().map(names::display).unwrap_or_default();
        let request = v1::CreateWebhookRequest { id: self.id, url: self.url, events: self.events, display };
        let webhook = session.client.create_webhook(request).await?;
        session.print(&webhook, |webhook| {
            let id = names::id(&webhook.name);
            format!(
                "created {id}\nsecret: {}\nThe server never shows the secret again: give it to the receiver now.\n\
                 Try the webhook: lightpath webhook test {id}\n",
                webhook.secret
            )
        })
    }
}

impl Update {
    async fn run(self, session: &Session) -> Result<(), Failure> {
        let changes = [
            ("url", self.url.is_some()),
            ("events", self.all_events || !self.events.is_empty()),
            ("display", self.all_displays || self.display.is_some()),
        ];
        let paths: Vec<String> =
            changes.iter().filter(|(_, changes)| *changes).map(|(name, _)| (*name).to_owned()).collect();
        if paths.is_empty() {
            return Err(Failure::Usage(
                "give what changes: --url, --event, --all-events, --display or --all-displays".to_owned(),
            ));
        }
        let webhook = v1::Webhook {
            name: names::webhook(&self.id),
            url: self.url.unwrap_or_default(),
            events: self.events,
            display: self.display.as_deref().map(names::display).unwrap_or_default(),
            ..Default::default()
        };
        let request = v1::UpdateWebhookRequest {
            webhook: Some(webhook),
            update_mask: Some(FieldMask { paths }),
            expected_revision: self.expected_revision,
        };
        let webhook = session.client.update_webhook(request).await?;
        session.print(&webhook, |webhook| table(std::slice::from_ref(webhook)).text())
    }
}

impl Show {
    async fn run(self, session: &Session) -> Result<(), Failure> {
        let name = names::webhook(&self.webhook.id);
        let webhook = session.client.get_webhook(v1::GetWebhookRequest { name: name.clone() }).await?;
        let list = pages(self.limit.limit, async |page_size, page_token| {
            let request = v1::ListWebhookDeliveriesRequest { webhook: name.clone(), page_size, page_token };
            session.client.list_webhook_deliveries(request).await
        })
        .await?;
        session.print_pages(list, |deliveries| {
            let webhooks = table(std::slice::from_ref(&webhook)).text();
            format!("{webhooks}\n{}", delivery_table(deliveries).text_or("nothing happened yet"))
        })
    }
}

impl Named {
    async fn test(self, session: &Session) -> Result<(), Failure> {
        let name = names::webhook(&self.id);
        let sent = session.client.test_webhook(v1::TestWebhookRequest { name: name.clone() }).await?;
        let asked = Instant::now();
        loop {
            let request =
                v1::ListWebhookDeliveriesRequest { webhook: name.clone(), page_size: 1000, ..Default::default() };
            let found = session.client.list_webhook_deliveries(request).await?.deliveries;
            let delivery = found.into_iter().find(|delivery| delivery.id == sent.id).unwrap_or_else(|| sent.clone());
            if delivery.attempts > 0 || asked.elapsed() > ANSWERED_WITHIN {
                return session.print(&delivery, tested);
            }
            sleep(ASKED_EVERY).await;
        }
    }
}

fn tested(delivery: &v1::WebhookDelivery) -> String {
    match (delivery.delivered, delivery.attempts) {
        (true, _) => format!("accepted: {}\n", delivery.answer),
        (false, 0) => "not sent yet; earlier deliveries may wait for the receiver\n".to_owned(),
        (false, _) => format!("not accepted: {}\nThe server tries again.\n", delivery.answer),
    }
}

fn table(webhooks: &[v1::Webhook]) -> Table {
    let mut table = Table::new("webhook|address_|events_?|display??|created???");
    for webhook in webhooks {
        let events = if webhook.events.is_empty() { "all".to_owned() } else { webhook.events.join(", ") };
        let display = if webhook.display.is_empty() { "all" } else { names::id(&webhook.display) };
        table.row([
            names::id(&webhook.name).to_owned(),
            webhook.url.clone(),
            events,
            display.to_owned(),
            webhook.create_time.as_ref().map_or_else(|| "–".to_owned(), show::age),
        ]);
    }
    table
}

fn delivery_table(deliveries: &[v1::WebhookDelivery]) -> Table {
    let mut table = Table::new("event|happened??|>attempts?|state|answer~|id???");
    for delivery in deliveries {
        let state = match (delivery.delivered, &delivery.next_attempt_time) {
            (true, _) => "accepted",
            (false, Some(_)) => "waits",
            (false, None) => "given up",
        };
        table.row([
            delivery.event.clone(),
            delivery.event_time.as_ref().map_or_else(|| "–".to_owned(), show::age),
            delivery.attempts.to_string(),
            state.to_owned(),
            show::or_dash(&delivery.answer),
            delivery.id.clone(),
        ]);
    }
    table
}
