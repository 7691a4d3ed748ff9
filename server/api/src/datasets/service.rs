//! The dataset service.

use super::{from_wire, to_wire};
use crate::api::Api;
use crate::call::answers;
use crate::enumerations::WireField as _;
use crate::names;
use crate::optics::from_wire::distance;
use crate::pages::Page;
use lightpath_domain::dataset::{Dataset, Encoding};
use lightpath_proto::v1;
use lightpath_proto::v1::dataset_service_server::DatasetService;
use lightpath_service::{CalibrationTarget, Call, Field, Result, check_all};

answers! {
    DatasetService {
        create_dataset(v1::CreateDatasetRequest) -> v1::Dataset;
        get_dataset(v1::GetDatasetRequest) -> v1::Dataset;
        list_datasets(v1::ListDatasetsRequest) -> v1::ListDatasetsResponse;
        add_pair(v1::AddPairRequest) -> v1::Dataset;
        delete_dataset(v1::DeleteDatasetRequest) -> v1::DeleteDatasetResponse;
        create_calibration_target(v1::CreateCalibrationTargetRequest) -> v1::CalibrationTarget;
    }
}

impl Api {
    async fn create_dataset(&self, call: &Call, request: v1::CreateDatasetRequest) -> Result<v1::Dataset> {
        let field = Field::new("dataset");
        let message = field.required(request.dataset)?;
        let dataset = self.new_dataset(call, &message, &field).await?;
        call.concerns(format!("datasets/{}", dataset.id));
        Ok(to_wire::dataset(self.service.datasets.create(&dataset).await?))
    }

    async fn get_dataset(&self, call: &Call, request: v1::GetDatasetRequest) -> Result<v1::Dataset> {
        let id = names::dataset_id(&Field::new("name"), &request.name)?;
        Ok(to_wire::dataset(self.service.datasets.visible(call, &id).await?))
    }

    async fn list_datasets(&self, call: &Call, request: v1::ListDatasetsRequest) -> Result<v1::ListDatasetsResponse> {
        let display = names::display_filter(call, &Field::new("display"), &request.display)?;
        let page = Page::new(&["datasets", &request.display], request.page_size, &request.page_token)?;
        let datasets = self.store.datasets(display.as_deref(), page.after.as_deref(), page.limit()).await?;
        let (datasets, next_page_token) = page.fill(datasets, |dataset| dataset.id.clone(), to_wire::dataset);
        Ok(v1::ListDatasetsResponse { datasets, next_page_token })
    }

    /// Adds a pair to a dataset, with its measurements and findings.
    async fn add_pair(&self, call: &Call, request: v1::AddPairRequest) -> Result<v1::Dataset> {
        let id = names::dataset_id(&Field::new("dataset"), &request.dataset)?;
        call.concerns(format!("datasets/{id}"));
        let field = Field::new("pair");
        let pair = from_wire::pair(&field.required(request.pair)?, &field)?;
        Ok(to_wire::dataset(self.service.datasets.add_pair(call, &id, pair).await?))
    }

    async fn create_calibration_target(
        &self,
        call: &Call,
        request: v1::CreateCalibrationTargetRequest,
    ) -> Result<v1::CalibrationTarget> {
        let display = self.display_named(call, &Field::new("display"), &request.display).await?;
        let CalibrationTarget { target, columns, rows } =
            self.service.datasets.calibration_target(call, &display).await?;
        Ok(v1::CalibrationTarget { target, columns: columns as u32, rows: rows as u32 })
    }

    async fn delete_dataset(
        &self,
        call: &Call,
        request: v1::DeleteDatasetRequest,
    ) -> Result<v1::DeleteDatasetResponse> {
        let id = names::dataset_id(&Field::new("name"), &request.name)?;
        call.concerns(format!("datasets/{id}"));
        self.service.datasets.delete(call, &id).await?;
        Ok(v1::DeleteDatasetResponse {})
    }

    async fn new_dataset(&self, call: &Call, message: &v1::Dataset, field: &Field) -> Result<Dataset> {
        let display = self.display_named(call, &field.at("display"), &message.display).await;
        check_all! {
            id = names::dataset_id(&field.at("name"), &message.name);
            optics = display.and_then(|display| {
                Ok((field.at("wavelength_m").wavelength_of(message.wavelength_m, &display)?, display.id))
            });
            distance = distance(&field.at("place"), message.place.as_ref());
            encoding = field.at("photo_encoding").enum_value(message.photo_encoding);
            photo_bit_depth = photo_bit_depth(&field.at("photo_bit_depth"), message.photo_bit_depth);
        }
        let (wavelength, display) = optics;
        let encoding = encoding.unwrap_or(Encoding::Linear);
        Ok(Dataset { photo_bit_depth, ..Dataset::empty(id, display, wavelength, distance, encoding) })
    }
}

/// Checks the bits of the camera; 0: those of the files.
fn photo_bit_depth(field: &Field, bits: Option<u32>) -> Result<u32> {
    let checked = field.if_set(bits, "the bits of the files", |bits| field.integer(bits, 8..=16))?;
    Ok(checked.unwrap_or(0))
}
