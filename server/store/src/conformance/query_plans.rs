//! Queries about many jobs find them in an index: they neither read other jobs nor sort.

use super::*;
use crate::JobFilter;
use crate::job_lists::list_query;
use crate::queue::BATCH;
use crate::sql::Builder;
use lightpath_domain::job::JobState;

/// How SQLite runs a query, one line for each step.
async fn plan(store: &Store, sql: &str) -> Vec<String> {
    let rows = Builder::new(format!("explain query plan {sql}")).build().fetch_all(store.readers()).await.unwrap();
    rows.iter().map(|row| row.try_get("detail").unwrap()).collect()
}

#[tokio::test]
async fn every_filter_of_a_list_has_an_index_in_the_order_of_the_list() {
    let (store, _folder) = sqlite_store().await;
    for case in 0..32 {
        let filter = JobFilter {
            state: (case & 1 > 0).then_some(JobState::Queued),
            display: (case & 2 > 0).then(|| "lab".to_owned()),
            batch: (case & 4 > 0).then(|| "night".to_owned()),
            oldest_first: case & 8 > 0,
            since_ms: (case & 16 > 0).then_some(1),
            ..JobFilter::default()
        };
        let filters = [
            ("state=?", filter.state.is_some()),
            ("display=?", filter.display.is_some()),
            ("batch=?", filter.batch.is_some()),
        ];
        for after in [None, Some("0193")] {
            let query = list_query(store.readers(), "*", &filter, after, 50).unwrap();
            let steps = plan(&store, query.text()).await;
            assert_eq!(steps.len(), 1, "{filter:?}: {steps:?}");
            for (term, is_given) in filters {
                assert_eq!(steps[0].contains(term), is_given, "{filter:?}: {steps:?}");
            }
            let (before, from) = match filter.oldest_first {
                false => (after.is_some(), filter.since_ms.is_some()),
                true => (false, after.is_some() || filter.since_ms.is_some()),
            };
            assert_eq!(steps[0].contains("id<?"), before, "{filter:?}: {steps:?}");
            assert_eq!(steps[0].contains("id>?"), from, "{filter:?}: {steps:?}");
        }
    }
}

#[tokio::test]
async fn searches_read_one_narrow_index_in_the_order_of_the_list() {
    let (store, _folder) = sqlite_store().await;
    let word = || Some("word".to_owned());
    for filter in [
        JobFilter { kind: word(), ..JobFilter::default() },
        JobFilter { owner: word(), state: Some(JobState::Queued), oldest_first: true, ..JobFilter::default() },
        JobFilter { text: word(), display: word(), batch: word(), since_ms: Some(1), ..JobFilter::default() },
    ] {
        let query = list_query(store.readers(), "*", &filter, Some("0193"), 50).unwrap();
        let steps = plan(&store, query.text()).await;
        let searched = steps.iter().any(|step| step.contains("USING COVERING INDEX job_to_search (id"));
        assert!(searched, "{filter:?}: {steps:?}");
        assert!(steps.iter().any(|step| step == "SEARCH job USING PRIMARY KEY (id=?)"), "{filter:?}: {steps:?}");
    }
}

#[tokio::test]
async fn jobs_of_a_batch_are_counted_in_an_index() {
    let (store, _folder) = sqlite_store().await;
    let steps = plan(&store, BATCH).await;
    let counting = "SEARCH job USING COVERING INDEX job_by_batch_state (batch=?)";
    assert!(steps.iter().any(|step| step == counting), "{steps:?}");
    assert!(!steps.iter().any(|step| step.contains("TEMP B-TREE")), "{steps:?}");
    let reading = "SEARCH job USING INDEX job_by_batch_state (batch=? AND state=?)";
    assert!(steps.iter().any(|step| step == reading), "{steps:?}");
}
