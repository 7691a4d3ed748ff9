//! Interpolation of kernels for distances between photographed ones.

use super::Kernels;
use crate::call::Call;
use crate::error::{Result, ServiceError};
use crate::field::Field;
use crate::propagation::distance_refusal;
use lightpath_domain::display::Display;
use lightpath_domain::kernel::{Kernel, KernelKey, KernelMetrics, KernelVersion, NewKernelVersion};
use lightpath_domain::lineage::{KernelLineage, KernelOrigin, LearnedDataset, Learning};
use lightpath_domain::planning;
use lightpath_domain::reason::PreconditionReason;
use lightpath_domain::units::{Distance, Wavelength};
use lightpath_media::kernel_file::{self, KernelFileError, Origin};
use lightpath_optics::learning::interpolated;
use lightpath_store::RequestMark;

/// Limit on the versions that are searched for a joint fit, the newest first.
const VERSIONS_MAX: u32 = 1000;

impl Kernels {
    /// Interpolates a kernel for a distance between those of a joint fit, and stores it as the next version.
    pub async fn interpolate(
        &self,
        call: &Call,
        display: Display,
        wavelength: Wavelength,
        distance: Distance,
        mark: Option<RequestMark>,
    ) -> Result<KernelVersion> {
        let field = Field::new("place").at("distance_m");
        let planned = planning::setup(&display, wavelength, distance).and_then(|setup| planning::planned(setup, None));
        let (setup, _) = planned.map_err(|error| distance_refusal(&field, distance, &error))?;
        let key = KernelKey { display: display.id.clone(), wavelength, distance };
        call.concerns(key.to_string());
        if let Some(made) = self.version_made_by(&key, mark.as_ref()).await? {
            return Ok(made);
        }
        let versions = self.store.joint_versions(&key.display, wavelength, VERSIONS_MAX).await?;
        let fit = fit_around(&field, &key, &versions)?;
        let mut models = Vec::with_capacity(fit.versions.len());
        for version in fit.versions {
            models.push(self.model_of(call, version).await?);
        }
        let from_m: Vec<f64> = fit.distances.iter().map(|distance| distance.m()).collect();
        let content = &fit.versions[0].content;
        let (kind, size_bytes) = (content.model, fit.versions.iter().map(|version| version.content.size_bytes).sum());
        let interpolate = move || -> Result<Vec<u8>, KernelFileError> {
            let origin = Origin { display: Some(display.id), interpolated_from_m: from_m, record: None };
            kernel_file::encode_with(&interpolated(&models, setup)?, kind, &origin)
        };
        let file = self.computing.run(call, kernel_file::decoding_bytes(size_bytes), interpolate).await?;
        let file = file.map_err(|error| field.invalid(format!("is {distance}: {error}"), "give another distance"))?;
        let version = NewKernelVersion {
            model: content.model,
            size_bytes: file.len() as u64,
            artifact: self.files.store(call, file).await?,
            // The version is not measured, because no photographs of the distance exist.
            metrics: KernelMetrics::default(),
            lineage: KernelLineage::of(KernelOrigin::Interpolated(Learning {
                datasets: fit.versions.iter().filter_map(own_dataset).collect(),
                ..content.lineage.learning().cloned().unwrap_or_default()
            })),
        };
        self.add_version(&key, version, mark.as_ref()).await
    }

    /// The kernels at the nearest distances, and whether [`Self::interpolate`] could make this one.
    pub async fn nearest(&self, key: &KernelKey) -> Result<(Vec<Kernel>, bool)> {
        let nearest = self.store.nearest_kernels(key).await?;
        let versions = self.store.joint_versions(&key.display, key.wavelength, VERSIONS_MAX).await?;
        Ok((nearest, fit_around(&Field::new("place").at("distance_m"), key, &versions).is_ok()))
    }
}

/// The dataset of the version's own distance.
fn own_dataset(version: &KernelVersion) -> Option<LearnedDataset> {
    version.content.lineage.own_dataset().cloned()
}

/// A joint fit: one model of several distances.
#[derive(Clone)]
struct Fit<'a> {
    /// Versions by ascending distance.
    versions: &'a [KernelVersion],
    distances: Vec<Distance>,
}

/// The newest fit whose distances include the distance of the kernel between them.
fn fit_around<'a>(field: &Field, key: &KernelKey, versions: &'a [KernelVersion]) -> Result<Fit<'a>> {
    let same_job = |a: &KernelVersion, b: &KernelVersion| a.content.lineage.job() == b.content.lineage.job();
    let fits: Vec<Fit<'_>> = versions
        .chunk_by(same_job)
        .filter_map(|versions| Some(Fit { versions, distances: versions[0].content.lineage.joint_distances()? }))
        .filter(|fit| fit.versions.len() == fit.distances.len())
        .collect();
    let (display, wavelength, distance) = (&key.display, key.wavelength, key.distance);
    if fits.is_empty() {
        let message = format!(
            "{field}: no kernels of displays/{display} at {wavelength} were learned together for several distances; learn \
             them first: lightpath kernel learn --dataset NEAR --dataset FAR"
        );
        return Err(ServiceError::Precondition { reason: PreconditionReason::NoJointFit, message });
    }
    let range = |fit: &Fit<'_>| fit.distances.first().copied().zip(fit.distances.last().copied());
    let around = |fit: &&Fit<'_>| range(fit).is_some_and(|(near, far)| (near..=far).contains(&distance));
    let Some(fit) = fits.iter().find(around) else {
        let ranges: Vec<String> = fits.iter().filter_map(range).map(|(near, far)| format!("{near} to {far}")).collect();
        let rule = format!(
            "displays/{display} was photographed at {wavelength} from {} only: kernels are interpolated only between \
             photographed distances",
            ranges.join(", or from ")
        );
        return Err(field.but(format!("is {distance}"), rule));
    };
    match fit.versions.iter().find(|version| version.key.distance == distance) {
        Some(KernelVersion { version, .. }) => {
            Err(field
                .invalid(format!("is {distance}, which was photographed"), format!("use {key}/versions/{version}")))
        }
        None => Ok(fit.clone()),
    }
}
