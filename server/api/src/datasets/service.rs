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
use lightpath_store::{PairFilter, PairsOf};

answers! {
    DatasetService {
        create_dataset(v1::CreateDatasetRequest) -> v1::Dataset;
        get_dataset(v1::GetDatasetRequest) -> v1::Dataset;
        list_datasets(v1::ListDatasetsRequest) -> v1::ListDatasetsResponse;
        list_pairs(v1::ListPairsRequest) -> v1::ListPairsResponse;
        add_pairs(v1::AddPairsRequest) -> v1::AddPairsResponse;
        delete_dataset(v1::DeleteDatasetRequest) -> v1::DeleteDatasetResponse;
        create_calibration_target(v1::CreateCalibrationTargetRequest) -> v1::CalibrationTarget;
    }
}

/// Largest number of a test picture.
const PICTURE_MAX: u32 = 999;

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
        Ok(to_wire::dataset(self.service.datasets.alone(call, &id).await?))
    }

    async fn list_datasets(&self, call: &Call, request: v1::ListDatasetsRequest) -> Result<v1::ListDatasetsResponse> {
        let display = names::display_filter(call, &Field::new("display"), &request.display)?;
        let page = Page::new(&["datasets", &request.display], request.page_size, &request.page_token)?;
        let datasets = self.store.datasets(display.as_deref(), page.after.as_deref(), page.limit()).await?;
        let (datasets, next_page_token) = page.fill(datasets, |dataset| dataset.id.clone(), to_wire::dataset);
        Ok(v1::ListDatasetsResponse { datasets, next_page_token })
    }

    async fn list_pairs(&self, call: &Call, request: v1::ListPairsRequest) -> Result<v1::ListPairsResponse> {
        let id = names::dataset_id(&Field::new("dataset"), &request.dataset)?;
        let (filter, word) = match request.with_findings {
            true => (PairFilter::WithFindings, "with findings"),
            false => (PairFilter::All, "all"),
        };
        let page = Page::new(&["pairs", &id, word], request.page_size, &request.page_token)?;
        let PairsOf { dataset, pairs } =
            self.service.datasets.pairs(call, &id, filter, page.after.as_deref(), page.limit()).await?;
        let to_wire = |pair| to_wire::pair(pair, &dataset);
        let (pairs, next_page_token) = page.fill(pairs, |(pair, _)| pair.id.clone(), to_wire);
        Ok(v1::ListPairsResponse { pairs, next_page_token })
    }

    /// Adds pairs to a dataset, with their measurements and findings.
    async fn add_pairs(&self, call: &Call, request: v1::AddPairsRequest) -> Result<v1::AddPairsResponse> {
        let id = names::dataset_id(&Field::new("dataset"), &request.dataset)?;
        call.concerns(format!("datasets/{id}"));
        let pairs = from_wire::pairs(&request.pairs, &Field::new("pairs"))?;
        let PairsOf { dataset, pairs } = self.service.datasets.add_pairs(call, &id, pairs).await?;
        let pairs = pairs.into_iter().map(|pair| to_wire::pair(pair, &dataset)).collect();
        Ok(v1::AddPairsResponse { dataset: Some(to_wire::dataset(dataset)), pairs })
    }

    async fn create_calibration_target(
        &self,
        call: &Call,
        request: v1::CreateCalibrationTargetRequest,
    ) -> Result<v1::CalibrationTarget> {
        let display = self.display_named(call, &Field::new("display"), &request.display).await?;
        let CalibrationTarget { target, dots } = match request.picture {
            None => self.service.datasets.calibration_target(call, &display).await?,
            Some(number) => {
                let number = Field::new("picture").integer(number, 0..=PICTURE_MAX)?;
                self.service.datasets.test_picture(call, &display, number).await?
            }
        };
        let (columns, rows) = dots.map(|(columns, rows)| (columns as u32, rows as u32)).unzip();
        Ok(v1::CalibrationTarget { target, columns, rows })
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
