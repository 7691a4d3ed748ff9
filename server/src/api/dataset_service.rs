//! The dataset service.

use super::caller::require_display;
use super::encodings::encoding;
use super::error::ApiError;
use super::field::Field;
use super::pages::Page;
use super::time::now_ms;
use super::{Api, datasets, names, required};
use crate::dataset::{self, Dataset, Encoding, Pair};
use crate::store::StoreError;
use lightpath_proto::v1;
use lightpath_proto::v1::dataset_service_server::DatasetService;
use tonic::{Request, Response, Status};

/// Largest fraction of the pairs that may be held out: something must be left to learn from.
const HELD_OUT_FRACTION_MAX: f64 = 0.8;
/// Pairs held out for the test unless said otherwise.
const TEST_FRACTION_DEFAULT: f64 = 0.2;

#[tonic::async_trait]
impl DatasetService for Api {
    async fn create_dataset(
        &self,
        request: Request<v1::CreateDatasetRequest>,
    ) -> Result<Response<v1::Dataset>, Status> {
        let field = Field::new("dataset");
        let message = required(&field, request.into_inner().dataset)?;
        let dataset = self.new_dataset(&message, &field).await?;
        Ok(Response::new(datasets::to_wire(self.store.create_dataset(&dataset, now_ms()).await?)))
    }

    async fn get_dataset(&self, request: Request<v1::GetDatasetRequest>) -> Result<Response<v1::Dataset>, Status> {
        let id = names::dataset_id(&Field::new("name"), &request.into_inner().name)?;
        let dataset = self.store.dataset(&id).await?;
        require_display(&dataset.display)?;
        Ok(Response::new(datasets::to_wire(dataset)))
    }

    async fn list_datasets(
        &self,
        request: Request<v1::ListDatasetsRequest>,
    ) -> Result<Response<v1::ListDatasetsResponse>, Status> {
        let request = request.into_inner();
        let display = names::display_filter(&Field::new("display"), &request.display)?;
        let page = Page::new(&["datasets", &request.display], request.page_size, &request.page_token)?;
        let datasets = self.store.datasets(display.as_deref(), page.after.as_deref(), page.limit()).await?;
        let (datasets, next_page_token) = page.fill(datasets, |dataset| dataset.id.clone(), datasets::to_wire);
        Ok(Response::new(v1::ListDatasetsResponse { datasets, next_page_token }))
    }

    async fn add_pair(&self, request: Request<v1::AddPairRequest>) -> Result<Response<v1::Dataset>, Status> {
        let request = request.into_inner();
        let dataset_field = Field::new("dataset");
        let id = names::dataset_id(&dataset_field, &request.dataset)?;
        let field = Field::new("pair");
        let pair = datasets::pair_from_wire(&required(&field, request.pair)?, &field)?;
        let dataset = self.dataset_named(&dataset_field, &id).await?;
        self.check_pair(&dataset, &pair, &field).await?;
        Ok(Response::new(datasets::to_wire(self.store.add_pair(&id, &pair).await?)))
    }

    async fn finalize_dataset(
        &self,
        request: Request<v1::FinalizeDatasetRequest>,
    ) -> Result<Response<v1::Dataset>, Status> {
        let request = request.into_inner();
        let id = names::dataset_id(&Field::new("name"), &request.name)?;
        let allowed = 0.0..=HELD_OUT_FRACTION_MAX;
        let validation = Field::new("validation_fraction").number(request.validation_fraction, allowed.clone())?;
        let test = Field::new("test_fraction").number_or(request.test_fraction, TEST_FRACTION_DEFAULT, allowed)?;
        if validation + test > HELD_OUT_FRACTION_MAX {
            let problem = format!("and test_fraction are {validation} and {test}, but must sum to at most 0.8");
            return Err(Field::new("validation_fraction").invalid(problem).into());
        }
        let mut dataset = self.store.dataset(&id).await?;
        require_display(&dataset.display)?;
        let splits = dataset::draw_split(&dataset.pairs, validation, test, request.seed);
        for (pair, (_, split)) in dataset.pairs.iter_mut().zip(&splits) {
            pair.split = Some(*split);
        }
        let digest = dataset::digest(&dataset);
        Ok(Response::new(datasets::to_wire(self.store.finalize_dataset(&id, &splits, &digest, now_ms()).await?)))
    }
}

impl Api {
    async fn new_dataset(&self, message: &v1::Dataset, field: &Field) -> Result<Dataset, ApiError> {
        let id = names::dataset_id(&field.at("name"), &message.name)?;
        let display = self.display_named(&field.at("display"), &message.display).await?;
        let wavelength = field.at("wavelength_m").wavelength_of(message.wavelength_m, &display)?;
        let distance = field.at("distance_m").distance(message.distance_m)?;
        let encoding = encoding(&field.at("photo_encoding"), message.photo_encoding, Encoding::Linear)?;
        Ok(Dataset::empty(id, display.id, wavelength, distance, encoding))
    }

    /// Both pictures must be there, readable, and of the display's size: learning would find out much later.
    async fn check_pair(&self, dataset: &Dataset, pair: &Pair, field: &Field) -> Result<(), ApiError> {
        let (display, _) = self.store.display(&dataset.display).await?;
        self.check_levels(&field.at("phase"), &pair.phase, &display).await?;
        self.check_photo(&field.at("photo"), &pair.photo, dataset.photo_encoding, &display).await
    }

    /// The dataset that a field names.
    pub(super) async fn dataset_named(&self, field: &Field, id: &str) -> Result<Dataset, ApiError> {
        match self.store.dataset(id).await {
            Err(StoreError::NotFound { what }) => Err(field.missing(what, "create it first")),
            other => {
                let dataset = other?;
                require_display(&dataset.display)?;
                Ok(dataset)
            }
        }
    }
}
