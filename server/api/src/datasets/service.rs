//! The dataset service.

use super::to_wire;
use crate::api::Api;
use crate::call::Call;
use crate::error::ApiError;
use crate::field::Field;
use crate::names;
use crate::pages::Page;
use crate::wrong_fields::check_all;
use lightpath_domain::dataset::{Dataset, Encoding};
use lightpath_proto::v1;
use lightpath_proto::v1::dataset_service_server::DatasetService;
use tonic::{Request, Response, Status};

#[tonic::async_trait]
impl DatasetService for Api {
    async fn create_dataset(
        &self,
        request: Request<v1::CreateDatasetRequest>,
    ) -> Result<Response<v1::Dataset>, Status> {
        self.answer(request, Self::create_dataset).await
    }

    async fn get_dataset(&self, request: Request<v1::GetDatasetRequest>) -> Result<Response<v1::Dataset>, Status> {
        self.answer(request, Self::get_dataset).await
    }

    async fn list_datasets(
        &self,
        request: Request<v1::ListDatasetsRequest>,
    ) -> Result<Response<v1::ListDatasetsResponse>, Status> {
        self.answer(request, Self::list_datasets).await
    }

    async fn add_pair(&self, request: Request<v1::AddPairRequest>) -> Result<Response<v1::Dataset>, Status> {
        self.answer(request, Self::add_pair).await
    }

    async fn delete_dataset(
        &self,
        request: Request<v1::DeleteDatasetRequest>,
    ) -> Result<Response<v1::DeleteDatasetResponse>, Status> {
        self.answer(request, Self::delete_dataset).await
    }

    async fn create_calibration_target(
        &self,
        request: Request<v1::CreateCalibrationTargetRequest>,
    ) -> Result<Response<v1::CalibrationTarget>, Status> {
        self.answer(request, Self::create_calibration_target).await
    }
}

impl Api {
    async fn create_dataset(&self, call: &Call, request: v1::CreateDatasetRequest) -> Result<v1::Dataset, ApiError> {
        let field = Field::new("dataset");
        let message = field.required(request.dataset)?;
        let dataset = self.new_dataset(call, &message, &field).await?;
        call.concerns(format!("datasets/{}", dataset.id));
        Ok(to_wire::dataset(self.store.create_dataset(&dataset, self.store.now_ms()).await?))
    }

    async fn get_dataset(&self, call: &Call, request: v1::GetDatasetRequest) -> Result<v1::Dataset, ApiError> {
        let id = names::dataset_id(&Field::new("name"), &request.name)?;
        Ok(to_wire::dataset(self.visible_dataset(call, &id).await?))
    }

    async fn list_datasets(
        &self,
        call: &Call,
        request: v1::ListDatasetsRequest,
    ) -> Result<v1::ListDatasetsResponse, ApiError> {
        let display = names::display_filter(call, &Field::new("display"), &request.display)?;
        let page = Page::new(&["datasets", &request.display], request.page_size, &request.page_token)?;
        let datasets = self.store.datasets(display.as_deref(), page.after.as_deref(), page.limit()).await?;
        let (datasets, next_page_token) = page.fill(datasets, |dataset| dataset.id.clone(), to_wire::dataset);
        Ok(v1::ListDatasetsResponse { datasets, next_page_token })
    }

    async fn delete_dataset(
        &self,
        call: &Call,
        request: v1::DeleteDatasetRequest,
    ) -> Result<v1::DeleteDatasetResponse, ApiError> {
        let id = names::dataset_id(&Field::new("name"), &request.name)?;
        call.concerns(format!("datasets/{id}"));
        self.visible_dataset(call, &id).await?;
        self.store.delete_dataset(&id, self.store.now_ms()).await?;
        Ok(v1::DeleteDatasetResponse {})
    }

    async fn new_dataset(&self, call: &Call, message: &v1::Dataset, field: &Field) -> Result<Dataset, ApiError> {
        let display = self.display_named(call, &field.at("display"), &message.display).await;
        check_all! {
            id = names::dataset_id(&field.at("name"), &message.name);
            optics = display.and_then(|display| {
                Ok((field.at("wavelength_m").wavelength_of(message.wavelength_m, &display)?, display.id))
            });
            distance = field.at("distance_m").distance(message.distance_m);
            encoding = field.at("photo_encoding").enum_value(message.photo_encoding);
            photo_bit_depth = field.at("photo_bit_depth").integer_or(message.photo_bit_depth, 0, 8..=16);
        }
        let (wavelength, display) = optics;
        let encoding = encoding.unwrap_or(Encoding::Linear);
        Ok(Dataset { photo_bit_depth, ..Dataset::empty(id, display, wavelength, distance, encoding) })
    }
}
