//! Hologram jobs: optimized phases that show pictures.

mod checks;
mod pictures;

use super::Kind;
use crate::call::Call;
use crate::error::Result;
use crate::field::Field;
use crate::jobs::Jobs;
use crate::kernels::KernelChoice;
use crate::wrong_fields::collect_all;
use lightpath_domain::display::Display;
use lightpath_domain::job::estimate::{KernelSize, Need};
use lightpath_domain::job::kinds::optimize_hologram::{self, HologramInputs};
use lightpath_domain::job::{Job, JobSpec, Judging, OptimizeHologram};
use lightpath_domain::kernel::KernelKey;
use pictures::PictureChecks;

impl Kind for OptimizeHologram {
    const ADVICE: &'static str = "use fewer subframes, planes or iterations, a smaller display, or the method adam, which needs half the memory of lbfgs";

    async fn need(&self, jobs: &Jobs, decoding_bytes: u64) -> Result<Need> {
        let kernels = kernels_of(jobs, self).await?;
        let judging_kernels = judging_kernels_of(jobs, self).await?;
        let cache_bytes_max = jobs.limits.cache_bytes;
        Ok(optimize_hologram::need(self, &HologramInputs { cache_bytes_max, kernels, judging_kernels, decoding_bytes }))
    }
}

/// Kernels of a hologram job: for each wavelength one for each plane.
pub(super) async fn kernels_of(jobs: &Jobs, spec: &OptimizeHologram) -> Result<Vec<Vec<KernelSize>>> {
    let (display, _) = jobs.store.display(&spec.display).await?;
    let mut kernels = Vec::with_capacity(spec.wavelengths.len());
    for (keys, versions) in keys(spec).iter().zip(&spec.kernel_versions) {
        let mut of_planes = Vec::with_capacity(spec.planes.len());
        for (key, &version) in keys.iter().zip(versions) {
            of_planes.push(jobs.kernel_size(&display, key, version, spec.detector, spec.propagation).await?);
        }
        kernels.push(of_planes);
    }
    Ok(kernels)
}

/// Kernels that judge the holograms of other kernels: for each wavelength one for each plane that has one.
async fn judging_kernels_of(jobs: &Jobs, spec: &OptimizeHologram) -> Result<Vec<Vec<KernelSize>>> {
    let (display, _) = jobs.store.display(&spec.display).await?;
    let mut kernels = Vec::with_capacity(spec.wavelengths.len());
    for (w, keys) in keys(spec).iter().enumerate() {
        let mut of_planes = Vec::new();
        for (p, key) in keys.iter().enumerate() {
            let Some(version) = spec.judging_version(w, p) else { continue };
            of_planes.push(jobs.kernel_size(&display, key, Some(version), spec.detector, spec.propagation).await?);
        }
        kernels.push(of_planes);
    }
    Ok(kernels)
}

/// Keys of the kernels: for each wavelength one for each plane.
fn keys(spec: &OptimizeHologram) -> Vec<Vec<KernelKey>> {
    let key = |wavelength, distance| KernelKey { display: spec.display.clone(), wavelength, distance };
    let of_planes = |&wavelength| spec.planes.iter().map(|plane| key(wavelength, plane.distance)).collect();
    spec.wavelengths.iter().map(of_planes).collect()
}

/// The job of an earlier submission of the request, if it has the same kernels.
fn earlier<'a>(before: Option<&'a Job>, spec: &OptimizeHologram) -> Option<&'a OptimizeHologram> {
    match before.map(|job| &job.spec) {
        Some(JobSpec::OptimizeHologram(job)) if keys(job) == keys(spec) => Some(job),
        _ => None,
    }
}

impl Jobs {
    /// Chooses the kernel versions of a request, and refuses what its display or its pictures do not allow. `choice` says
    /// which versions. Returns also the largest memory for decoding one of its pictures \[bytes\]. `before` is the job of
    /// an earlier submission of the same request.
    pub async fn complete_hologram(
        &self,
        call: &Call,
        field: &Field,
        (mut spec, display): (OptimizeHologram, &Display),
        choice: &KernelChoice,
        before: Option<&Job>,
    ) -> Result<(OptimizeHologram, u64)> {
        collect_all([checks::method(field, &spec), checks::size(field, &spec, display)])?;
        let at_kernel = field.at("kernel");
        spec.kernel_versions = self.chosen_kernels(&at_kernel, choice, &spec, before).await?;
        spec.judging_versions = self.judging_versions(&at_kernel, &spec, before).await?;
        checks::propagation(field, &spec, display)?;
        let decoding_bytes = PictureChecks { jobs: self, call, spec: &spec, display }.check(field).await?;
        Ok((spec, decoding_bytes))
    }

    /// The active versions that judge the holograms of other kernels, for each wavelength one for each plane.
    async fn judging_versions(
        &self,
        field: &Field,
        spec: &OptimizeHologram,
        before: Option<&Job>,
    ) -> Result<Vec<Vec<Option<u32>>>> {
        // A repeated request is judged as the first time, even if `active` has moved.
        if let Some(job) = earlier(before, spec) {
            return Ok(job.judging_versions.clone());
        }
        if spec.judge == Judging::None {
            return Ok(vec![vec![None; spec.planes.len()]; spec.wavelengths.len()]);
        }
        let mut judging = Vec::new();
        for (keys, versions) in keys(spec).iter().zip(&spec.kernel_versions) {
            let mut of_planes = Vec::new();
            for (key, &version) in keys.iter().zip(versions) {
                let active = self.kernels.chosen(field, &KernelChoice::ActiveOrIdeal, key).await?;
                of_planes.push(active.filter(|_| active != version));
            }
            judging.push(of_planes);
        }
        Ok(judging)
    }

    /// The kernel versions, for each wavelength one for each plane.
    async fn chosen_kernels(
        &self,
        field: &Field,
        choice: &KernelChoice,
        spec: &OptimizeHologram,
        before: Option<&Job>,
    ) -> Result<Vec<Vec<Option<u32>>>> {
        let several = spec.wavelengths.len() * spec.planes.len() > 1;
        if several && let KernelChoice::Version(key, version) = choice {
            let fix = "choose ideal, active or an alias: each of several wavelengths and planes has its own kernel";
            return Err(field.at("version").but(format!("is \"{key}/versions/{version}\""), fix));
        }
        // A repeated request has the same versions as the first time, even if `active` has moved.
        if let Some(job) = earlier(before, spec)
            && choice.follows_active()
        {
            return Ok(job.kernel_versions.clone());
        }
        let mut versions = Vec::new();
        for keys in keys(spec) {
            let mut of_planes = Vec::new();
            for key in &keys {
                of_planes.push(self.kernels.chosen(field, choice, key).await?);
            }
            versions.push(of_planes);
        }
        Ok(versions)
    }
}
