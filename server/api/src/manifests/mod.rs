//! Signed manifests of kernels: which file holds the active version, vouched for by a key.
//!
//! A manifest depends only on the version (the active one, or that of a rollout), the generation of its display, the
//! keyring and the time, which is rounded to periods. So every answer within a period has the same bytes, and a device that asks again learns that
//! nothing changed. A manifest is made once for each period and kept in memory.

mod issued;
mod signer;

pub use issued::ManifestRules;
pub(crate) use issued::{Issued, Manifests};

use crate::api::Api;
use crate::call::Call;
use crate::error::ApiError;
use crate::field::Field;
use crate::names;
use crate::permissions;
use crate::time::timestamp;
use issued::IssuedKey;
use lightpath_domain::kernel::{KernelKey, KernelMoment, KernelVersion};
use lightpath_domain::reason::PreconditionReason;
use lightpath_manifest::{Manifest, Time};
use lightpath_media::kernel_formats::KernelFormat;
use lightpath_optics::{FilterShape, OrderFilter, Orders};
use lightpath_proto::v1;
use std::sync::Arc;

impl Api {
    pub(crate) async fn get_kernel_manifest(
        &self,
        call: &Call,
        request: v1::GetKernelManifestRequest,
    ) -> Result<v1::KernelManifest, ApiError> {
        let key = names::kernel_key(call, &Field::new("kernel"), &request.kernel)?;
        let format = Field::new("format").enum_value(request.format)?.unwrap_or(KernelFormat::Safetensors);
        let device = permissions::device_of(call, &request.device)?;
        let issued = self.manifest(call, &key, format, device.as_deref()).await?;
        Ok(v1::KernelManifest {
            document: issued.document.clone(),
            generation: issued.manifest.generation,
            version: issued.manifest.version,
            digest: issued.manifest.digest.clone(),
            size_bytes: issued.manifest.size_bytes,
            expire_time: Some(timestamp(issued.manifest.expires.unix_s() * 1000)),
            poll_after_s: self.manifests.poll_after_s(),
        })
    }

    pub(crate) async fn get_keyring(&self, _: &Call, _: v1::GetKeyringRequest) -> Result<v1::Keyring, ApiError> {
        let keyring = self.store.keyring().await?.ok_or_else(signer::no_key)?;
        Ok(v1::Keyring { document: keyring.document, version: keyring.version })
    }

    /// The manifest of a kernel's version for a device, in a form.
    pub(crate) async fn manifest(
        &self,
        call: &Call,
        key: &KernelKey,
        format: KernelFormat,
        device: Option<&str>,
    ) -> Result<Arc<Issued>, ApiError> {
        let moment = self.store.kernel_moment(key, device).await?;
        let now_s = self.store.now_ms().div_euclid(1000);
        let Some(version) = moment.version else {
            let message = format!("no version of {key} is active; promote one first");
            return Err(ApiError::Precondition { reason: PreconditionReason::NoActiveKernel, message });
        };
        let issued_key = IssuedKey { kernel: key.clone(), version, format };
        if let Some(issued) = self.manifests.find(&issued_key, &moment, now_s) {
            return Ok(issued);
        }
        let version = self.store.kernel_version(key, version).await?;
        let manifest = self.unsigned(call, &version, &moment, format, now_s).await?;
        let signing_key = signer::signing_key(&self.store, now_s).await?;
        let document = manifest.signed(&signing_key);
        Ok(self.manifests.insert(issued_key, Issued::new(manifest, document, moment)))
    }

    /// What the manifest of a version says.
    async fn unsigned(
        &self,
        call: &Call,
        version: &KernelVersion,
        moment: &KernelMoment,
        format: KernelFormat,
        now_s: i64,
    ) -> Result<Manifest, ApiError> {
        let (digest, size_bytes) = match format {
            KernelFormat::Safetensors => (version.content.artifact.clone(), version.content.size_bytes),
            _ => {
                let converted = self.converted(call, version, format).await?;
                (converted.digest, converted.size_bytes)
            }
        };
        let (display, _) = self.store.display(&version.key.display).await?;
        let (issued_s, expires_s) = self.manifests.rules().times_s(now_s);
        let clock = || ApiError::Precondition {
            reason: PreconditionReason::NoSigningKey,
            message: "the server's clock shows a time that no manifest can have; set the clock".to_owned(),
        };
        Ok(Manifest {
            display: version.key.display.clone(),
            wavelength_pm: version.key.wavelength.pm,
            distance_nm: version.key.distance.nm,
            generation: moment.generation,
            version: version.version,
            form: format.as_str().to_owned(),
            digest,
            size_bytes,
            width_px: display.width_px,
            height_px: display.height_px,
            pixel_pitch_pm: (display.pixel_pitch_m * 1e12).round() as u64,
            optics: optics(display.orders),
            interpolated: version.content.lineage.interpolated,
            issued: Time::from_unix_s(issued_s).ok_or_else(clock)?,
            expires: Time::from_unix_s(expires_s).ok_or_else(clock)?,
        })
    }
}

/// The diffraction orders of a display, as manifests write them.
fn optics(orders: Orders) -> String {
    match orders {
        Orders::First => "first".to_owned(),
        Orders::Filtered(OrderFilter { shape, width, height, centre_x, centre_y }) => {
            let shape = match shape {
                FilterShape::Rectangle => "rectangle",
                FilterShape::Ellipse => "ellipse",
            };
            format!("filtered {shape} {width} {height} {centre_x} {centre_y}")
        }
        Orders::All { fill_factor_x, fill_factor_y } => format!("all {fill_factor_x} {fill_factor_y}"),
    }
}
