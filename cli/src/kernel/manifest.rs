//! The command `lightpath kernel manifest`.

use crate::failure::Failure;
use crate::kernel_choice::KernelChoice;
use crate::keyring::now;
use crate::session::Session;
use crate::words::WordParser;
use clap::Args;
use lightpath::v1;
use lightpath_manifest::{PublicKey, SignedManifest, Trust, Wanted};

/// Print the signed manifest of a kernel's active version: what a device reads before it fetches the file.
///
/// With --root the signatures are checked as a device does it: the keyring against the root key, the manifest against
/// the keyring.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  lightpath kernel manifest --display lab-2 --distance 150mm --format compact
  lightpath kernel manifest --display lab-2 --distance 150mm --root PUBLIC-KEY

A device without gRPC reads it with
  curl -H \"authorization: Bearer $TOKEN\" \\
      $SERVER/v1/displays/lab-2/kernels/ID/manifest?format=compact
where ID stands at the end of the name that lightpath kernel show prints.")]
pub(crate) struct Manifest {
    #[command(flatten)]
    kernel: KernelChoice,

    /// Choose the format of the file that the manifest names
    #[arg(long, default_value = "safetensors", value_parser = WordParser::<v1::KernelFormat>::new())]
    format: v1::KernelFormat,

    /// Ask for the device with this id: during a rollout devices get different versions [default: no device]
    #[arg(long, value_name = "ID", default_value = "", hide_default_value = true)]
    device: String,

    /// Check the signatures with this root key, 64 hexadecimal digits, as lightpathd key list prints it
    #[arg(long, value_name = "PUBLIC")]
    root: Option<PublicKey>,
}

impl Manifest {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let kernel = self.kernel.name(session).await?;
        let request = v1::GetKernelManifestRequest { kernel, format: self.format.into(), device: self.device };
        let manifest = session.client.kernel_manifest(request).await?;
        if let Some(root) = self.root {
            let keyring = session.client.get_keyring(v1::GetKeyringRequest {}).await?;
            check(&manifest.document, &keyring.document, root).map_err(Failure::Refused)?;
        }
        session.print(&manifest, |manifest| manifest.document.trim_end().to_owned())
    }
}

/// Checks the signatures, the times, and that the document is about what was asked for.
pub(super) fn check(document: &str, keyring: &str, root: PublicKey) -> Result<(), String> {
    let refused = |error: lightpath_manifest::Distrust| format!("a device would refuse this: {error}");
    let keyring = Trust::Roots(vec![root]).renew(keyring.as_bytes(), now()).map_err(refused)?;
    let said = SignedManifest::parse(document.as_bytes()).map_err(|error| refused(error.into()))?;
    let said = said.unchecked();
    let wanted = Wanted {
        display: said.display.clone(),
        optics: said.optics.clone(),
        format: said.format.clone(),
        generation: 0,
    };
    Trust::Keyring(keyring).manifest(document.as_bytes(), &wanted, now()).map_err(refused)?;
    Ok(())
}
