//! Imports of kernels from files.

use super::Kernels;
use super::bundle::Record;
use crate::call::Call;
use crate::error::{Result, ServiceError};
use crate::field::Field;
use lightpath_artifacts::ArtifactError;
use lightpath_domain::display::Display;
use lightpath_domain::kernel::{KernelKey, KernelMetrics, KernelVersion, NewKernelVersion};
use lightpath_domain::kernel_format::KernelFormat;
use lightpath_domain::lineage::{Import, KernelLineage, KernelOrigin, LearnedDataset, Learning, Made};
use lightpath_domain::planning;
use lightpath_domain::units::{Distance, Wavelength};
use lightpath_media::budget::Budget;
use lightpath_media::kernel_file::{self, Origin};
use lightpath_media::kernel_formats::{self, Imported, KernelFormatError};
use lightpath_optics::{KernelModel, OpticalSetup};
use lightpath_store::RequestMark;

/// Memory for the directory of an archive \[bytes\], besides its file.
const DIRECTORY_BYTES: u64 = 4 << 20;

/// A kernel file to be imported, and where it belongs.
#[derive(Clone, Debug)]
pub struct KernelImport {
    /// The display.
    pub display: Display,
    /// The wavelength.
    pub wavelength: Wavelength,
    /// The distance.
    pub distance: Distance,
    /// Artifact digest of the file.
    pub digest: String,
    /// Whether the file may name another display.
    pub from_another_display: bool,
}

impl Kernels {
    /// Stores an uploaded kernel file as the next version. Refuses a kernel of another display, wavelength or distance. A
    /// repeated request with a mark returns the version that the first one stored.
    pub async fn import(&self, call: &Call, import: KernelImport, mark: Option<RequestMark>) -> Result<KernelVersion> {
        let (wavelength, distance) = (import.wavelength, import.distance);
        let key = KernelKey { display: import.display.id.clone(), wavelength, distance };
        call.concerns(key.to_string());
        if let Some(made) = self.version_made_by(&key, mark.as_ref()).await? {
            return Ok(made);
        }
        let version = self.read_version(call, &key, import).await?;
        self.add_version(&key, version, mark.as_ref()).await
    }

    /// Reads an uploaded kernel file, and stores it in the native form.
    async fn read_version(&self, call: &Call, key: &KernelKey, import: KernelImport) -> Result<NewKernelVersion> {
        let KernelImport { display, wavelength, distance, digest, from_another_display } = import;
        let field = Field::new("artifact");
        let Some(record) = self.files.readable(call, &digest).await? else {
            return Err(field.missing(format!("artifact {digest}"), "upload it first"));
        };
        let setup = planning::setup(&display, wavelength, distance).map_err(|error| {
            Field::new("place").at("distance_m").invalid(format!("is not possible: {error}"), "give another distance")
        })?;
        // A kernel is accepted even if no propagation method is valid for it.
        let setup = planning::planned(setup, None).map_or(setup, |(planned, _)| planned);
        let need_bytes = self.importing_bytes(call, &digest, record.size_bytes).await?;
        let (artifacts, name) = (self.artifacts.clone(), digest.clone());
        let destination =
            Destination { field: field.clone(), display, key: key.clone(), any_display: from_another_display };
        let read = move || -> Result<_, ArtifactError> {
            let file = artifacts.read_blocking(&name)?;
            Ok(imported(&file, &setup, &destination, &Budget::new(need_bytes)))
        };
        let Read { kind, form, native_file, origin, note } =
            self.computing.run(call, need_bytes, read).await??.map_err(|error| match error {
                ImportError::Format(error) => {
                    field.invalid(format!("({digest}): {error}"), "upload a kernel file in a form that is imported")
                }
                ImportError::Refused(error) => error,
            })?;
        let import = Import { note, ..Import::of(form, digest.clone()) };
        // The kernel is stored in the native format, which all other code reads.
        let (artifact, size_bytes) = match native_file {
            None => (digest, record.size_bytes),
            Some(file) => {
                let size_bytes = file.len() as u64;
                (self.files.store(call, file).await?, size_bytes)
            }
        };
        let (metrics, lineage) = match origin.record {
            Some(record) => {
                let record: Record = serde_json::from_value(record).map_err(|error| {
                    field.invalid(format!("is a bundle with a damaged record: {error}"), "export it again")
                })?;
                // Photographs of another display say nothing about this one.
                let is_own = record.is_of(&key.display);
                if !is_own && !from_another_display {
                    let problem = format!("is a bundle of {}", record.version);
                    return Err(field.invalid(problem, "set from_another_display if it fits"));
                }
                let metrics = if is_own { record.metrics.clone() } else { KernelMetrics::default() };
                (metrics, record.imported_lineage(import))
            }
            // Without a record the version is not measured.
            None => (KernelMetrics::default(), lineage(import, origin.interpolated_from_m)),
        };
        Ok(NewKernelVersion { model: kind, artifact, size_bytes, metrics, lineage })
    }

    /// The version that an earlier request with this mark stored.
    pub(super) async fn version_made_by(
        &self,
        key: &KernelKey,
        mark: Option<&RequestMark>,
    ) -> Result<Option<KernelVersion>> {
        let Some(mark) = mark else { return Ok(None) };
        let Some(number) = self.store.made_by(mark).await? else { return Ok(None) };
        Ok(Some(self.store.kernel_version(key, number).await?))
    }

    /// Stores a version, of a request with a mark only once.
    pub(super) async fn add_version(
        &self,
        key: &KernelKey,
        version: NewKernelVersion,
        mark: Option<&RequestMark>,
    ) -> Result<KernelVersion> {
        let now_ms = self.store.now_ms();
        Ok(match mark {
            Some(mark) => self.store.add_kernel_version_once(key, version, mark, now_ms).await?,
            None => self.store.add_kernel_version(key, version, now_ms).await?,
        })
    }

    /// Memory for reading an uploaded kernel file and writing its kernel \[bytes\]. An archive is much larger when it is
    /// unpacked, so its directory is read first.
    async fn importing_bytes(&self, call: &Call, digest: &str, size_bytes: u64) -> Result<u64> {
        let (artifacts, digest) = (self.artifacts.clone(), digest.to_owned());
        let read = move || Ok::<_, ArtifactError>(kernel_formats::importing_bytes(&artifacts.read_blocking(&digest)?));
        Ok(self.computing.run(call, size_bytes + DIRECTORY_BYTES, read).await??)
    }
}

/// The lineage of a version that was imported without its record.
fn lineage(import: Import, interpolated_from_m: Vec<f64>) -> KernelLineage {
    let datasets: Vec<LearnedDataset> = interpolated_from_m.into_iter().filter_map(imported_dataset).collect();
    let made = (!datasets.is_empty()).then(|| Made::Interpolated(Learning { datasets, ..Learning::default() }));
    KernelLineage::of(KernelOrigin::Imported(Import { made, ..import }))
}

/// Where an imported kernel belongs.
struct Destination {
    /// Field of the request that names the file.
    field: Field,
    display: Display,
    key: KernelKey,
    /// Whether the file may name another display.
    any_display: bool,
}

/// A kernel read from a file.
struct Read {
    kind: KernelModel,
    form: KernelFormat,
    /// The kernel in the native format, if the file has another format, or says something else about its origin.
    native_file: Option<Vec<u8>>,
    /// What the file says about the origin.
    origin: Origin,
    /// What the file did not hold, for people; `None` if it held a whole model.
    note: Option<String>,
}

/// Why a file is not accepted.
enum ImportError {
    Format(KernelFormatError),
    Refused(ServiceError),
}

/// Reads a kernel from a file, and converts it to the native format if the file has another one.
fn imported(
    file: &[u8],
    setup: &OpticalSetup,
    destination: &Destination,
    budget: &Budget,
) -> Result<Read, ImportError> {
    let imported = kernel_formats::import(file, setup, budget).map_err(ImportError::Format)?;
    require_setup(&destination.field, &imported.model.setup, &destination.display, &destination.key)
        .map_err(ImportError::Refused)?;
    require_display(destination, &imported.origin).map_err(ImportError::Refused)?;
    let note = imported.note();
    let Imported { model, kind, form, native, origin, .. } = imported;
    let kept = Origin {
        display: origin.display.as_ref().map(|_| destination.key.display.clone()),
        interpolated_from_m: origin.interpolated_from_m.clone(),
        record: None,
    };
    let encode = || kernel_file::encode_with(&model, kind, &kept).map_err(|error| ImportError::Format(error.into()));
    let native_file = (!native || kept != origin).then(encode).transpose()?;
    Ok(Read { kind, form, native_file, origin, note })
}

/// Refuses the kernel of another display, unless the caller accepts it.
fn require_display(destination: &Destination, origin: &Origin) -> Result<()> {
    let Destination { field, key, any_display, .. } = destination;
    match &origin.display {
        Some(other) if *other != key.display && !any_display => Err(field.invalid(
            format!("is a kernel of displays/{other}, but must be one of displays/{}", key.display),
            "set from_another_display if it fits this display as well",
        )),
        _ => Ok(()),
    }
}

/// A dataset of which only the distance is known. `None` if the distance is not valid.
fn imported_dataset(distance_m: f64) -> Option<LearnedDataset> {
    let distance = Distance::from_m(distance_m)?;
    Some(LearnedDataset { distance, id: String::new(), digest: String::new() })
}

/// Refuses a setup that does not match the display, wavelength and distance.
fn require_setup(field: &Field, setup: &OpticalSetup, display: &Display, key: &KernelKey) -> Result<()> {
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
        let problem = format!("is a kernel of a display that shows {learned}");
        return Err(field.but(problem, format!("displays/{} shows {shown}", display.id)));
    }
    // A file may contain lengths that a key cannot represent.
    let wavelength = wavelength.map_or_else(|| format!("{:e} m", setup.wavelength_m()), |exact| exact.to_string());
    let distance = distance.map_or_else(|| format!("{:e} m", setup.distance_m()), |exact| exact.to_string());
    let made_for = format!("{}×{} px of {:e} m", grid.width_px(), grid.height_px(), grid.pixel_pitch_m());
    let needed = format!("{}×{} px of {:e} m", display.width_px, display.height_px, display.pixel_pitch_m);
    Err(field.but(
        format!("is a kernel for {made_for} at {wavelength} and {distance}"),
        format!("must be one for {needed} at {} and {}", key.wavelength, key.distance),
    ))
}
