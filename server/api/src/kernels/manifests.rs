//! Signed manifests of kernels, and the keyring.

use crate::api::Api;
use crate::enumerations::WireField as _;
use crate::names;
use crate::time::timestamp;
use lightpath_media::kernel_formats::KernelFormat;
use lightpath_proto::v1;
use lightpath_service::{Call, Field, Result, permissions};

impl Api {
    pub(crate) async fn get_kernel_manifest(
        &self,
        call: &Call,
        request: v1::GetKernelManifestRequest,
    ) -> Result<v1::KernelManifest> {
        let key = names::kernel_key(call, &Field::new("kernel"), &request.kernel)?;
        let format = Field::new("format").enum_value(request.format)?.unwrap_or(KernelFormat::Safetensors);
        let device = permissions::device_of(call, &request.device)?;
        let issued = self.service.manifests.manifest(call, &key, format, device.as_deref()).await?;
        Ok(v1::KernelManifest {
            document: issued.document.clone(),
            generation: issued.manifest.generation,
            version: issued.manifest.version,
            digest: issued.manifest.digest.clone(),
            size_bytes: issued.manifest.size_bytes,
            expire_time: Some(timestamp(issued.manifest.expires.unix_s() * 1000)),
            poll_after_s: self.service.manifests.poll_after_s(),
        })
    }

    pub(crate) async fn get_keyring(&self, _: &Call, _: v1::GetKeyringRequest) -> Result<v1::Keyring> {
        let keyring = self.service.manifests.keyring().await?;
        Ok(v1::Keyring { document: keyring.document, version: keyring.version })
    }
}
