//! Imports of kernels from files.

use super::to_wire;
use crate::api::Api;
use crate::error::ApiError;
use crate::field::Field;
use crate::time::now_ms;
use lightpath_domain::access::Caller;
use lightpath_domain::display::Display;
use lightpath_domain::kernel::{KernelKey, KernelLineage, KernelMetrics, LearnedDataset, NewKernelVersion};
use lightpath_domain::planning;
use lightpath_domain::units::{Distance, Wavelength};
use lightpath_media::kernel_file;
use lightpath_media::kernel_formats;
use lightpath_optics::OpticalSetup;
use lightpath_proto::v1;

impl Api {
    /// Stores an uploaded kernel file as the next version. Refuses a kernel of another display, wavelength or distance.
    pub(crate) async fn import_kernel(
        &self,
        caller: &Caller,
        request: v1::ImportKernelRequest,
    ) -> Result<v1::KernelVersion, ApiError> {
        let display = self.display_named(caller, &Field::new("display"), &request.display).await?;
        let wavelength = Field::new("wavelength_m").wavelength_of(request.wavelength_m, &display)?;
        let distance = Field::new("distance_m").distance(request.distance_m)?;
        let field = Field::new("artifact");
        let digest = field.digest(&request.artifact)?;
        let Some(record) = self.artifact_for_caller(caller, &digest).await? else {
            return Err(field.missing(format!("artifact {digest}"), "upload it first"));
        };
        let bytes = self.artifacts.read_all(&digest).await?;
        let setup = planning::setup(&display, wavelength, distance)
            .map_err(|error| Field::new("distance_m").invalid(format!("is not possible: {error}")))?;
        // A kernel is accepted even if no propagation method is valid for it.
        let setup = planning::planned(setup, None).map_or(setup, |(planned, _)| planned);
        // Files in other formats do not contain these distances.
        let interpolated_from_m = kernel_file::interpolated_from_m(&bytes).unwrap_or_default();
        let decoded = self.checking.run(move || kernel_formats::import(&bytes, &setup)).await?;
        let imported = decoded.map_err(|error| field.invalid(format!("({digest}): {error}")))?;
        let (learned, model) = (imported.model, imported.kind);
        let key = KernelKey { display: display.id.clone(), wavelength, distance };
        require_setup(&field, &learned.setup, &display, &key)?;
        let (digest, size_bytes, parameters_json) = if imported.native {
            (digest, record.size_bytes, "{}".to_owned())
        } else {
            // The kernel is stored in the native format, which all other code reads.
            let file =
                kernel_file::encode(&learned, model).map_err(|error| field.invalid(format!("({digest}): {error}")))?;
            let parameters = serde_json::json!({ "imported_from": imported.form, "artifact": digest });
            (self.store_artifact(caller, file.clone()).await?, file.len() as u64, parameters.to_string())
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
        let version = NewKernelVersion { model, artifact: digest, size_bytes, metrics, lineage };
        Ok(to_wire::version(self.store.add_kernel_version(&key, version, now_ms()).await?))
    }
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
        return Ok(());
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
