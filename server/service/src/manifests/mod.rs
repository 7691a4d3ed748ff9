//! Signed manifests of kernels: which file holds the active version, vouched for by a key.
//!
//! A manifest depends only on the version (the active one, or that of a rollout), the generation of its display, the
//! keyring and the time, which is rounded to periods. So every answer within a period has the same bytes, and a device that asks again learns that
//! nothing changed. A manifest is made once for each period and kept in memory.

mod issued;
mod signer;

use crate::call::Call;
use crate::error::{Result, ServiceError};
use crate::kernels::{Kernels, for_device};
pub use issued::{Issued, ManifestRules};

use issued::{IssuedKey, Kept};
use lightpath_domain::kernel::{KernelKey, KernelMoment, KernelVersion};
use lightpath_domain::reason::PreconditionReason;
use lightpath_manifest::{Manifest, Optics, Time};
use lightpath_media::kernel_formats::KernelFormat;
use lightpath_optics::{FilterShape, OrderFilter, Orders};
use lightpath_store::{Store, StoredKeyring};
use std::sync::Arc;

/// The manifests of this server. Clones share them.
#[derive(Clone, Debug)]
pub struct Manifests {
    store: Store,
    kernels: Kernels,
    kept: Kept,
}

impl Manifests {
    pub(crate) fn new(store: Store, kernels: Kernels, rules: ManifestRules) -> Self {
        Self { store, kernels, kept: Kept::new(rules) }
    }

    /// Seconds after which a device should ask again.
    #[must_use]
    pub fn poll_after_s(&self) -> u32 {
        self.kept.poll_after_s()
    }

    /// The keyring, which says whose signatures count.
    pub async fn keyring(&self) -> Result<StoredKeyring> {
        self.store.keyring().await?.ok_or_else(signer::no_key)
    }

    /// The manifest of a kernel's version for a device, in a format.
    pub async fn manifest(
        &self,
        call: &Call,
        key: &KernelKey,
        format: KernelFormat,
        device: Option<&str>,
    ) -> Result<Arc<Issued>> {
        let moment = self.store.kernel_moment(key, device).await?;
        let now_s = self.store.now_ms().div_euclid(1000);
        let Some(version) = moment.version else {
            let message = format!("no version of {key} is active; promote one first");
            return Err(ServiceError::Precondition { reason: PreconditionReason::NoActiveKernel, message });
        };
        let issued_key = IssuedKey { kernel: key.clone(), version, format };
        if let Some(issued) = self.kept.find(&issued_key, &moment, now_s) {
            return Ok(issued);
        }
        let version = self.store.kernel_version(key, version).await?;
        let manifest = self.unsigned(call, &version, &moment, format, now_s).await?;
        let signing_key = signer::signing_key(&self.store, now_s).await?;
        let document = manifest.signed(&signing_key);
        Ok(self.kept.insert(issued_key, Issued::new(manifest, document, moment)))
    }

    /// What the manifest of a version says.
    async fn unsigned(
        &self,
        call: &Call,
        version: &KernelVersion,
        moment: &KernelMoment,
        format: KernelFormat,
        now_s: i64,
    ) -> Result<Manifest> {
        let file = for_device(self.kernels.file(call, version.clone(), format)).await?;
        let (display, _) = self.store.display(&version.key.display).await?;
        let (issued_s, expires_s) = self.kept.rules().times_s(now_s);
        let clock = || ServiceError::Precondition {
            reason: PreconditionReason::NoSigningKey,
            message: "the server's clock shows a time that no manifest can have; set the clock".to_owned(),
        };
        Ok(Manifest {
            display: version.key.display.clone(),
            optics: Optics::at_distance(version.key.wavelength.pm, version.key.distance.nm),
            generation: moment.generation,
            version: version.version,
            format: format.as_str().to_owned(),
            digest: file.digest,
            size_bytes: file.size_bytes,
            width_px: display.width_px,
            height_px: display.height_px,
            pixel_pitch_pm: (display.pixel_pitch_m * 1e12).round() as u64,
            orders: orders(display.orders),
            interpolated: version.content.lineage.is_interpolated(),
            issued: Time::from_unix_s(issued_s).ok_or_else(clock)?,
            expires: Time::from_unix_s(expires_s).ok_or_else(clock)?,
        })
    }
}

/// The diffraction orders of a display, as manifests write them.
fn orders(orders: Orders) -> String {
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
