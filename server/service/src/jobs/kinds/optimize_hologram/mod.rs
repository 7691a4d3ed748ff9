//! Hologram jobs: optimized phases that show pictures.

mod checks;
mod pictures;

use super::Kind;
use crate::call::Call;
use crate::error::Result;
use crate::field::{Field, shortened};
use crate::jobs::Jobs;
use crate::wrong_fields::collect_all;
use lightpath_domain::display::Display;
use lightpath_domain::job::estimate::{KernelSize, Need};
use lightpath_domain::job::kinds::optimize_hologram::{self, HologramInputs};
use lightpath_domain::job::{Job, JobSpec, OptimizeHologram};
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
    for (&wavelength, versions) in spec.wavelengths.iter().zip(&spec.kernel_versions) {
        let mut of_planes = Vec::with_capacity(spec.planes.len());
        for (plane, &version) in spec.planes.iter().zip(versions) {
            let key = KernelKey { display: display.id.clone(), wavelength, distance: plane.distance };
            of_planes.push(jobs.kernel_size(&display, &key, version, spec.detector, spec.propagation).await?);
        }
        kernels.push(of_planes);
    }
    Ok(kernels)
}

/// Kernels that judge the holograms of other kernels: for each wavelength one for each plane that has one.
async fn judging_kernels_of(jobs: &Jobs, spec: &OptimizeHologram) -> Result<Vec<Vec<KernelSize>>> {
    let (display, _) = jobs.store.display(&spec.display).await?;
    let mut kernels = Vec::with_capacity(spec.wavelengths.len());
    for (w, &wavelength) in spec.wavelengths.iter().enumerate() {
        let mut of_planes = Vec::new();
        for (p, plane) in spec.planes.iter().enumerate() {
            let Some(version) = spec.judging_version(w, p) else { continue };
            let key = KernelKey { display: display.id.clone(), wavelength, distance: plane.distance };
            of_planes.push(jobs.kernel_size(&display, &key, Some(version), spec.detector, None).await?);
        }
        kernels.push(of_planes);
    }
    Ok(kernels)
}

impl Jobs {
    /// Chooses the kernel versions of a request, and refuses what its display or its pictures do not allow. `kernel` says
    /// which versions. Returns also the largest memory for decoding one of its pictures \[bytes\]. `before` is the job of
    /// an earlier submission of the same request.
    pub async fn complete_hologram(
        &self,
        call: &Call,
        field: &Field,
        (mut spec, display): (OptimizeHologram, &Display),
        kernel: &str,
        before: Option<&Job>,
    ) -> Result<(OptimizeHologram, u64)> {
        collect_all([checks::method(field, &spec), checks::size(field, &spec, display)])?;
        let at_kernel = field.at("kernel");
        spec.kernel_versions = self.chosen_kernels(&at_kernel, kernel, &spec, before).await?;
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
        if let Some(JobSpec::OptimizeHologram(job)) = before.map(|job| &job.spec)
            && (&job.wavelengths, job.planes.len()) == (&spec.wavelengths, spec.planes.len())
        {
            return Ok(job.judging_versions.clone());
        }
        let mut judging = Vec::new();
        for (&wavelength, versions) in spec.wavelengths.iter().zip(&spec.kernel_versions) {
            let mut of_planes = Vec::new();
            for (plane, &version) in spec.planes.iter().zip(versions) {
                let key = KernelKey { display: spec.display.clone(), wavelength, distance: plane.distance };
                let active = self.kernels.chosen(field, "", &key, false).await?;
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
        kernel: &str,
        spec: &OptimizeHologram,
        before: Option<&Job>,
    ) -> Result<Vec<Vec<Option<u32>>>> {
        let several = spec.wavelengths.len() * spec.planes.len() > 1;
        if several && !["", "active", "ideal"].contains(&kernel) {
            let fix = "must be empty, active or ideal: each of several wavelengths and planes has its own kernel";
            return Err(field.but(format!("is {:?}", shortened(kernel)), fix));
        }
        // A repeated request has the same versions as the first time, even if `active` has moved.
        if let Some(JobSpec::OptimizeHologram(job)) = before.map(|job| &job.spec)
            && ["", "active"].contains(&kernel)
            && (&job.wavelengths, job.planes.len()) == (&spec.wavelengths, spec.planes.len())
        {
            return Ok(job.kernel_versions.clone());
        }
        let mut versions = Vec::new();
        for &wavelength in &spec.wavelengths {
            let mut wavelength_versions = Vec::new();
            for plane in &spec.planes {
                let key = KernelKey { display: spec.display.clone(), wavelength, distance: plane.distance };
                wavelength_versions.push(self.kernels.chosen(field, kernel, &key, false).await?);
            }
            versions.push(wavelength_versions);
        }
        Ok(versions)
    }
}
