//! Imports of kernels from files.

use super::model_file::importing_bytes;
use super::to_wire;
use crate::api::Api;
use crate::call::Call;
use crate::error::ApiError;
use crate::field::Field;
use crate::time::now_ms;
use lightpath_artifacts::ArtifactError;
use lightpath_domain::display::Display;
use lightpath_domain::kernel::{KernelKey, KernelLineage, KernelMetrics, LearnedDataset, NewKernelVersion};
use lightpath_domain::planning;
use lightpath_domain::units::{Distance, Wavelength};
use lightpath_media::kernel_file;
use lightpath_media::kernel_formats::{self, Imported, KernelFormatError};
use lightpath_optics::{KernelModel, OpticalSetup};
use lightpath_proto::v1;

impl Api {
    /// Stores an uploaded kernel file as the next version. Refuses a kernel of another display, wavelength or distance.
    pub(crate) async fn import_kernel(
        &self,
        call: &Call,
        request: v1::ImportKernelRequest,
    ) -> Result<v1::KernelVersion, ApiError> {
        let display = self.display_named(call, &Field::new("display"), &request.display).await?;
        let wavelength = Field::new("wavelength_m").wavelength_of(request.wavelength_m, &display)?;
        let distance = Field::new("distance_m").distance(request.distance_m)?;
        let key = KernelKey { display: display.id.clone(), wavelength, distance };
        let field = Field::new("artifact");
        let digest = field.digest(&request.artifact)?;
        let Some(record) = self.artifact_for_caller(call, &digest).await? else {
            return Err(field.missing(format!("artifact {digest}"), "upload it first"));
        };
        call.concerns(key.to_string());
        let setup = planning::setup(&display, wavelength, distance)
            .map_err(|error| Field::new("distance_m").invalid(format!("is not possible: {error}")))?;
        // A kernel is accepted even if no propagation method is valid for it.
        let setup = planning::planned(setup, None).map_or(setup, |(planned, _)| planned);
        let need_bytes = importing_bytes(record.size_bytes);
        let (artifacts, name, refused) = (self.artifacts.clone(), digest.clone(), field.clone());
        let read = move || -> Result<_, ArtifactError> {
            let file = artifacts.read_blocking(&name)?;
            Ok(imported(&file, &setup, |setup| require_setup(&refused, setup, &display, &key).map(|()| key)))
        };
        let Import { key, kind, form, native_file, interpolated_from_m, note } =
            self.accounts.compute(call, need_bytes, read).await??.map_err(|error| match error {
                ImportError::Format(error) => field.invalid(format!("({digest}): {error}")),
                ImportError::Setup(error) => error,
            })?;
        let (digest, size_bytes, parameters_json) = match native_file {
            None => (digest, record.size_bytes, "{}".to_owned()),
            // The kernel is stored in the native format, which all other code reads.
            Some(file) => {
                let mut parameters = serde_json::json!({ "imported_from": form, "artifact": digest });
                if let Some(note) = note {
                    parameters["note"] = note.into();
                }
                let size_bytes = file.len() as u64;
                (self.store_artifact(call, file).await?, size_bytes, parameters.to_string())
            }
        };
        let lineage = KernelLineage {
            parameters_json,
            code_version: env!("CARGO_PKG_VERSION").to_owned(),
            interpolated: !interpolated_from_m.is_empty(),
            datasets: interpolated_from_m.into_iter().filter_map(imported_dataset).collect(),
            ..KernelLineage::default()
        };
        // The version is not measured, because an import has no held-out pairs.
        let metrics = KernelMetrics::default();
        let version = NewKernelVersion { model: kind, artifact: digest, size_bytes, metrics, lineage };
        Ok(to_wire::version(self.store.add_kernel_version(&key, version, now_ms()).await?))
    }
}

/// A kernel read from a file.
struct Import {
    key: KernelKey,
    kind: KernelModel,
    form: &'static str,
    /// The kernel in the native format, if the file has another format.
    native_file: Option<Vec<u8>>,
    interpolated_from_m: Vec<f64>,
    /// What the file did not hold, for people; `None` if it held a whole model.
    note: Option<String>,
}

/// Why a file is not accepted.
enum ImportError {
    Format(KernelFormatError),
    Setup(ApiError),
}

/// Reads a kernel from a file, and converts it to the native format if the file has another one. `key_of` checks the
/// setup of the kernel.
fn imported(
    file: &[u8],
    setup: &OpticalSetup,
    key_of: impl FnOnce(&OpticalSetup) -> Result<KernelKey, ApiError>,
) -> Result<Import, ImportError> {
    let imported = kernel_formats::import(file, setup).map_err(ImportError::Format)?;
    let note = imported.note();
    let Imported { model, kind, form, native, .. } = imported;
    let key = key_of(&model.setup).map_err(ImportError::Setup)?;
    let encode = || kernel_file::encode(&model, kind).map_err(|error| ImportError::Format(error.into()));
    let native_file = (!native).then(encode).transpose()?;
    // Files in other formats do not contain these distances.
    let interpolated_from_m = kernel_file::interpolated_from_m(file).unwrap_or_default();
    Ok(Import { key, kind, form, native_file, interpolated_from_m, note })
}

/// A dataset of which only the distance is known. `None` if the distance is not valid.
fn imported_dataset(distance_m: f64) -> Option<LearnedDataset> {
    let distance = Distance::from_m(distance_m)?;
    Some(LearnedDataset { distance, id: String::new(), digest: String::new() })
}

/// Refuses a setup that does not match the display, wavelength and distance.
fn require_setup(field: &Field, setup: &OpticalSetup, display: &Display, key: &KernelKey) -> Result<(), ApiError> {
    let grid = setup.grid();
    let is_size = (grid.width_px(), grid.height_px()) == (display.width_px as usize, display.height_px as usize);
    // Both were converted from decimal numbers, so they may differ in their last bits.
    let is_pitch = (grid.pixel_pitch_m() / display.pixel_pitch_m - 1.0).abs() < 1e-9;
    let (wavelength, distance) = (Wavelength::from_m(setup.wavelength_m()), Distance::from_m(setup.distance_m()));
    if is_size && is_pitch && wavelength == Some(key.wavelength) && distance == Some(key.distance) {
        if setup.orders() == display.orders {
            return Ok(());
        }
        let (learned, shown) = (setup.orders(), display.orders);
        return Err(field.invalid(format!(
            "is a kernel of a display that shows {learned}, but displays/{} shows {shown}",
            display.id
        )));
    }
    // A file may contain lengths that a key cannot represent.
    let wavelength = wavelength.map_or_else(|| format!("{:e} m", setup.wavelength_m()), |exact| exact.to_string());
    let distance = distance.map_or_else(|| format!("{:e} m", setup.distance_m()), |exact| exact.to_string());
    Err(field.invalid(format!(
        "is a kernel for {}×{} px of {:e} m at {wavelength} and {distance}, but must be one for {}×{} px of {:e} m at {} \
         and {}",
        grid.width_px(),
        grid.height_px(),
        grid.pixel_pitch_m(),
        display.width_px,
        display.height_px,
        display.pixel_pitch_m,
        key.wavelength,
        key.distance,
    )))
}
