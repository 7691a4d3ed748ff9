//! Lists over several pages.

use super::failure::Failure;
use super::session::{Output, Session};
use lightpath::v1;
use serde::Serialize;

/// Largest page that a command requests from the server.
const PAGE_SIZE_MAX: usize = 1000;

/// An answer with a page of a list.
pub(crate) trait Page: Serialize {
    type Item: Serialize;

    /// The items, and the token of the next page.
    fn parts(&mut self) -> (&mut Vec<Self::Item>, &mut String);
}

macro_rules! answers {
    ($($answer:ident { $items:ident: $item:ident })*) => {
        $(impl Page for v1::$answer {
            type Item = v1::$item;

            fn parts(&mut self) -> (&mut Vec<v1::$item>, &mut String) {
                (&mut self.$items, &mut self.next_page_token)
            }
        })*
    };
}

answers! {
    ListDatasetsResponse { datasets: Dataset }
    ListDevicesResponse { devices: Device }
    ListDisplaysResponse { displays: Display }
    ListJobEventsResponse { events: JobEvent }
    ListJobsResponse { jobs: Job }
    ListKernelMovesResponse { moves: KernelMove }
    ListKernelVersionsResponse { versions: KernelVersion }
    ListKernelsResponse { kernels: Kernel }
    ListPairsResponse { pairs: Pair }
    ListRolloutsResponse { rollouts: Rollout }
    ListWebhookDeliveriesResponse { deliveries: WebhookDelivery }
}

/// Requests pages until there are `limit` items, or all items if `limit` is 0. Returns all as one page.
pub(crate) async fn pages<P: Page>(
    limit: u32,
    mut page: impl AsyncFnMut(u32, String) -> lightpath::Result<P>,
) -> Result<P, Failure> {
    let limit = if limit == 0 { usize::MAX } else { limit as usize };
    let mut all = page(limit.min(PAGE_SIZE_MAX) as u32, String::new()).await?;
    loop {
        let (items, token) = all.parts();
        if token.is_empty() || items.len() >= limit {
            return Ok(all);
        }
        let wanted = (limit - items.len()).min(PAGE_SIZE_MAX) as u32;
        let mut next = page(wanted, std::mem::take(token)).await?;
        let (more, next_token) = next.parts();
        items.append(more);
        std::mem::swap(token, next_token);
    }
}

impl Session {
    /// Prints a list: as one document, as a line for each of its items, or as text that says if there are more.
    pub(crate) fn print_pages<P: Page>(
        &self,
        mut list: P,
        text: impl FnOnce(&[P::Item]) -> String,
    ) -> Result<(), Failure> {
        match self.output {
            Output::Jsonl => list.parts().0.iter().try_for_each(|item| self.print_line(item)),
            Output::Json => self.print(&list, |_| String::new()),
            Output::Table => {
                let (items, token) = list.parts();
                self.print_text(&(text(items) + more_hint(token)))
            }
        }
    }
}

/// The line below a list that was cut at its limit. Empty for a complete list.
pub(crate) fn more_hint(next_page_token: &str) -> &'static str {
    if next_page_token.is_empty() { "" } else { "(more entries exist: --limit 0 shows all)\n" }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn pages_are_joined_up_to_the_limit() {
        let all: Vec<v1::JobEvent> =
            (0..2500).map(|attempt| v1::JobEvent { attempt: Some(attempt), ..Default::default() }).collect();
        let ask = async |limit| {
            let list = pages(limit, async |size, token: String| {
                let start: usize = token.parse().unwrap_or(0);
                let end = (start + size as usize).min(all.len());
                let next_page_token = if end < all.len() { end.to_string() } else { String::new() };
                Ok(v1::ListJobEventsResponse { events: all[start..end].to_vec(), next_page_token })
            });
            let list = list.await.unwrap();
            (list.events, list.next_page_token)
        };
        assert_eq!(ask(0).await, (all.clone(), String::new()));
        assert_eq!(ask(1500).await, (all[..1500].to_vec(), "1500".to_owned()));
        assert_eq!(ask(3).await, (all[..3].to_vec(), "3".to_owned()));
    }
}
