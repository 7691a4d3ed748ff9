//! A server with two displays that have everything, and people with tokens for one of them.

use super::examples::UPLOADED;
use super::person::Person;
use super::world::{WEBHOOK_ORIGIN, World, add_jobs_that_wait_for, build};
use crate::access::{Guarded, create_token};
use lightpath_artifacts::digest_of;
use lightpath_domain::access::Role;

/// A server with two displays, and the roles of tokens that are for one of them.
pub(super) struct TwoWorlds {
    pub(super) guarded: Guarded,
    pub(super) own: World,
    pub(super) foreign: World,
    tokens: Vec<(&'static str, String)>,
}

impl TwoWorlds {
    pub(super) async fn build() -> Self {
        let guarded = Guarded::start_with(|config| {
            config.calls_per_s_max = 0;
            config.webhook_origins = WEBHOOK_ORIGIN.to_owned();
        })
        .await;
        let (mut own, mut foreign) = (build(&guarded, "lab", 1).await, build(&guarded, "faraway", 2).await);
        add_jobs_that_wait_for(&guarded, &mut own, &mut foreign).await;
        own.set("new_dataset", "datasets/lab-new");
        own.set("new_webhook", "webhooks/lab-new");
        own.set("new_webhook_id", "lab-new");
        own.set("uploaded", digest_of(UPLOADED));
        foreign.set("uploaded", foreign.text("$target").to_owned());
        let store = guarded.store().await;
        let (scope, mut tokens) = (["lab".to_owned(), "lab-spare".to_owned()], Vec::new());
        for role in Role::ALL {
            let name = format!("lab-{}", role.as_str());
            tokens.push((role.as_str(), create_token(&store, &name, role, &scope, None).await));
        }
        Self { guarded, own, foreign, tokens }
    }

    /// The bearers of the tokens for the displays of `own`.
    pub(super) fn people(&self) -> Vec<Person<'_>> {
        let person = |(role, token): &(&str, String)| Person {
            serving: &self.guarded.serving,
            name: format!("lab-{role}"),
            token: token.clone(),
        };
        self.tokens.iter().map(person).collect()
    }

    /// A bearer of a token for all displays.
    pub(super) fn admin(&self) -> Person<'_> {
        let token = self.guarded.tokens["admin"].clone();
        Person { serving: &self.guarded.serving, name: "admin".into(), token }
    }

    /// The own world as this person refers to it: the owner of a person's jobs is the person.
    pub(super) fn own_of(&self, person: &Person<'_>) -> World {
        let mut own = self.own.clone();
        own.set("owner", person.name.clone());
        own
    }
}
