//! The dataset service.

use super::caller::require_display;
use super::encodings::encoding;
use super::error::ApiError;
use super::field::Field;
use super::pages::Page;
use super::time::now_ms;
use super::{Api, datasets, names, required};
use lightpath_domain::dataset::{self, Alignment, Dataset, Encoding};
use lightpath_media::captures;
use lightpath_media::pictures;
use lightpath_optics::alignment::DotGrid;
use lightpath_proto::v1;
use lightpath_proto::v1::align_dataset_request::Source;
use lightpath_proto::v1::dataset_service_server::DatasetService;
use lightpath_store::StoreError;
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
        Ok(Response::new(datasets::to_wire(
            self.store.create_dataset(&dataset, now_ms()).await.map_err(ApiError::from)?,
        )))
    }

    async fn get_dataset(&self, request: Request<v1::GetDatasetRequest>) -> Result<Response<v1::Dataset>, Status> {
        let id = names::dataset_id(&Field::new("name"), &request.into_inner().name)?;
        let dataset = self.store.dataset(&id).await.map_err(ApiError::from)?;
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
        let datasets = self
            .store
            .datasets(display.as_deref(), page.after.as_deref(), page.limit())
            .await
            .map_err(ApiError::from)?;
        let (datasets, next_page_token) = page.fill(datasets, |dataset| dataset.id.clone(), datasets::to_wire);
        Ok(Response::new(v1::ListDatasetsResponse { datasets, next_page_token }))
    }

    async fn add_pair(&self, request: Request<v1::AddPairRequest>) -> Result<Response<v1::Dataset>, Status> {
        let request = request.into_inner();
        let dataset_field = Field::new("dataset");
        let id = names::dataset_id(&dataset_field, &request.dataset)?;
        let field = Field::new("pair");
        let mut pair = datasets::pair_from_wire(&required(&field, request.pair)?, &field)?;
        let dataset = self.dataset_named(&dataset_field, &id).await?;
        // Learning would find out much later what is wrong.
        pair.checks = Some(self.checked(&dataset, &pair, &field).await?);
        let answer = self.store.add_pair(&id, &pair).await.map_err(ApiError::from)?;
        // A pair is judged beside all others.
        let findings = captures::findings_of(&self.store.dataset(&id).await.map_err(ApiError::from)?, &pair.id);
        let findings = findings.into_iter().map(datasets::finding_to_wire).collect();
        Ok(Response::new(v1::Dataset { findings, ..datasets::to_wire(answer) }))
    }

    async fn create_calibration_target(
        &self,
        request: Request<v1::CreateCalibrationTargetRequest>,
    ) -> Result<Response<v1::CalibrationTarget>, Status> {
        let field = Field::new("display");
        let display = self.display_named(&field, &request.into_inner().display).await?;
        let grid = DotGrid::of_display(display.height_px as usize, display.width_px as usize);
        let grid = grid.map_err(|error| field.invalid(format!("({}): {error}", display.id)))?;
        let file = pictures::grey_png_srgb(&grid.target()).map_err(|error| field.invalid(error))?;
        let (columns, rows) = grid.size();
        let target = self.kept(file).await?;
        Ok(Response::new(v1::CalibrationTarget { target, columns: columns as u32, rows: rows as u32 }))
    }

    async fn align_dataset(&self, request: Request<v1::AlignDatasetRequest>) -> Result<Response<v1::Dataset>, Status> {
        let request = request.into_inner();
        let id = names::dataset_id(&Field::new("name"), &request.name)?;
        let mut dataset = self.dataset_named(&Field::new("name"), &id).await?;
        require_open(&dataset)?;
        let alignment = match required(&Field::new("source"), request.source)? {
            Source::Points(points) => Some(self.align_by_points(&dataset, points).await?),
            Source::DotsPhoto(photo) => Some(self.align_by_dots(&dataset, &photo).await?),
            Source::Pairs(true) => {
                self.check_again(&mut dataset).await?;
                Some(self.align_by_pairs(&dataset).await?.ok_or_else(|| not_alignable(&id))?)
            }
            Source::None(true) => None,
            Source::Pairs(false) => return Err(Field::new("pairs").invalid("is false, but must be true").into()),
            Source::None(false) => return Err(Field::new("none").invalid("is false, but must be true").into()),
        };
        self.expect_sizes(&dataset, alignment.as_ref()).await?;
        let mut dataset = self.store.align_dataset(&id, alignment.as_ref()).await.map_err(ApiError::from)?;
        self.check_again(&mut dataset).await?;
        Ok(Response::new(datasets::to_wire(dataset)))
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
        let mut dataset = self.store.dataset(&id).await.map_err(ApiError::from)?;
        require_display(&dataset.display)?;
        if dataset.digest.is_none() {
            self.make_ready(&mut dataset, request.keep_alignment).await?;
        }
        let splits = self.splits(&dataset, validation, test, request.seed)?;
        for (pair, (_, split)) in dataset.pairs.iter_mut().zip(&splits) {
            pair.split = *split;
        }
        let digest = dataset::digest(&dataset);
        Ok(Response::new(datasets::to_wire(
            self.store.finalize_dataset(&id, &splits, &digest, now_ms()).await.map_err(ApiError::from)?,
        )))
    }
}

impl Api {
    async fn new_dataset(&self, message: &v1::Dataset, field: &Field) -> Result<Dataset, ApiError> {
        let id = names::dataset_id(&field.at("name"), &message.name)?;
        let display = self.display_named(&field.at("display"), &message.display).await?;
        let wavelength = field.at("wavelength_m").wavelength_of(message.wavelength_m, &display)?;
        let distance = field.at("distance_m").distance(message.distance_m)?;
        let encoding = encoding(&field.at("photo_encoding"), message.photo_encoding, Encoding::Linear)?;
        let photo_bit_depth = field.at("photo_bit_depth").integer_or(message.photo_bit_depth, 0, 8..=16)?;
        Ok(Dataset { photo_bit_depth, ..Dataset::empty(id, display.id, wavelength, distance, encoding) })
    }

    /// Measures what is not measured yet, and aligns the photographs where they need it and it helps.
    async fn make_ready(&self, dataset: &mut Dataset, keep_alignment: bool) -> Result<(), ApiError> {
        self.check_again(dataset).await?;
        if keep_alignment || !captures::needs_alignment(dataset) {
            return Ok(());
        }
        let Some(alignment) = self.align_by_pairs(dataset).await? else { return Ok(()) };
        tracing::info!(dataset = dataset.id, corrected_px = alignment.corrected_px, "aligned the photographs");
        *dataset = self.store.align_dataset(&dataset.id, Some(&alignment)).await?;
        self.check_again(dataset).await
    }

    /// What each pair is for: those that can't be learned from have no split.
    fn splits(
        &self,
        dataset: &Dataset,
        validation: f64,
        test: f64,
        seed: u64,
    ) -> Result<Vec<(String, Option<dataset::Split>)>, ApiError> {
        let findings = captures::findings(dataset);
        if let Some(message) = captures::refusal(dataset, &findings) {
            return Err(ApiError::Precondition { reason: "DATASET_UNUSABLE", message });
        }
        let is_good = |id: &str| !findings.iter().any(|finding| finding.excludes && finding.pair == id);
        let good: Vec<_> = dataset.pairs.iter().filter(|pair| is_good(&pair.id)).cloned().collect();
        let mut splits: Vec<_> = dataset::draw_split(&good, validation, test, seed)
            .into_iter()
            .map(|(id, split)| (id, Some(split)))
            .chain(dataset.pairs.iter().filter(|pair| !is_good(&pair.id)).map(|pair| (pair.id.clone(), None)))
            .collect();
        splits.sort_by(|a, b| a.0.cmp(&b.0));
        Ok(splits)
    }

    /// The photographs that are there must fit the new alignment.
    async fn expect_sizes(&self, dataset: &Dataset, alignment: Option<&Alignment>) -> Result<(), ApiError> {
        let (display, _) = self.store.display(&dataset.display).await?;
        let expected = match alignment {
            Some(alignment) => [alignment.photo_width_px, alignment.photo_height_px],
            None => [display.width_px, display.height_px],
        };
        let photo_px = |pair: &dataset::Pair| pair.checks.as_ref().map(|checks| checks.photo_px);
        match dataset.pairs.iter().find(|pair| photo_px(pair).is_some_and(|size| size != expected)) {
            None => Ok(()),
            Some(pair) => {
                let [width, height] = photo_px(pair).unwrap_or_default();
                let message = format!(
                    "pair \"{}\" has a photograph of {width}×{height} px, but the alignment is for {}×{} px; align with \
                     photographs of the size that the dataset has",
                    pair.id, expected[0], expected[1]
                );
                Err(ApiError::Precondition { reason: "ALIGNMENT_SIZE", message })
            }
        }
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

fn require_open(dataset: &Dataset) -> Result<(), ApiError> {
    if dataset.digest.is_none() {
        return Ok(());
    }
    let message = format!("datasets/{} is finalized, and its alignment with it; create another dataset", dataset.id);
    Err(ApiError::Precondition { reason: "DATASET_FINALIZED", message })
}

fn not_alignable(id: &str) -> ApiError {
    let message = format!(
        "the pairs of datasets/{id} say too little about their alignment: add some with fine structure, or photograph the \
         displayed dots (lightpath dataset calibration --help)"
    );
    ApiError::Precondition { reason: "NOT_ALIGNABLE", message }
}
