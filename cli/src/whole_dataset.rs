//! Datasets with their pairs.

use super::dataset_text::facts_with_pairs;
use super::failure::Failure;
use super::pages::pages;
use super::session::Session;
use lightpath::v1::{self, Dataset};
use serde::Serialize;

/// A dataset with its pairs, as one document.
#[derive(Debug, Serialize)]
struct WholeDataset {
    #[serde(flatten)]
    dataset: Dataset,
    pairs: Vec<v1::Pair>,
}

/// Prints a dataset with its pairs.
pub(crate) async fn print_whole_dataset(session: &Session, dataset: &str) -> Result<(), Failure> {
    let stored = session.client.get_dataset(v1::GetDatasetRequest { name: dataset.to_owned() }).await?;
    let list = pages(0, async |page_size, page_token| {
        let request = v1::ListPairsRequest { dataset: dataset.to_owned(), page_size, page_token, ..Default::default() };
        session.client.list_pairs(request).await
    });
    let whole = WholeDataset { dataset: stored, pairs: list.await?.pairs };
    session.print(&whole, |whole| facts_with_pairs(&whole.dataset, &whole.pairs))
}
