//! The command `lightpath kernel mirror`.

use super::manifest;
use crate::destination::create_folder;
use crate::failure::Failure;
use crate::kernel_choice::KernelChoice;
use crate::session::Session;
use crate::show;
use crate::table::Facts;
use crate::words::WordParser;
use clap::Args;
use lightpath::{digest_of, replace_file, v1};
use lightpath_manifest::{Manifest, PublicKey, SignedManifest};
use std::path::{Path, PathBuf};

/// Write the files from which devices get a kernel into a folder, for any web server that serves files.
///
/// Three files are all that a device needs: the keyring, the signed manifest of the active version, and the kernel. They
/// are written to the paths at which a Lightpath server has them, so that lightpath-agent works with the mirror as its
/// --server. The mirror needs no key: devices check the signatures of the server.
///
/// The web server must support ranges, with which devices continue a download. It ignores what follows the ? of an
/// address. So a mirror has one format of each kernel, gives all devices the active version, also during a staged rollout,
/// and learns from no report which version they use.
///
/// A manifest counts for about a week. Run the command again after each promotion, and at least once a day, for example by
/// cron. It fetches the kernel only if the folder does not have it, replaces each file in one step, and the manifest last.
/// Files of earlier versions stay; delete them when no device needs them.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Example:
  lightpath kernel mirror --display lab-2 --distance 150mm --format compact \\
      -o /srv/mirror
  lightpath-agent --server https://mirror.example --display lab-2 \\
      --wavelength 515nm --distance 150mm --kernel ID --format compact \\
      --device bench-7 --root PUBLIC-KEY --directory /var/lib/lightpath

The command prints the kernel's name, which ends with the ID. A mirror has no list of kernels in
which an agent could look it up.

Several kernels can be mirrored into one folder.")]
pub(crate) struct Mirror {
    #[command(flatten)]
    kernel: KernelChoice,

    /// Choose the format of the kernel's file: the --format of the agents
    #[arg(long, default_value = "safetensors", value_parser = WordParser::<v1::KernelFormat>::new())]
    format: v1::KernelFormat,

    /// Write the files into this folder, which is created if it is missing: the root of the web server
    #[arg(short = 'o', value_name = "FOLDER")]
    folder: PathBuf,

    /// Check the signatures with this root key before anything is written, 64 hexadecimal digits, as lightpathd key list
    /// prints it
    #[arg(long, value_name = "PUBLIC")]
    root: Option<PublicKey>,
}

impl Mirror {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let client = &session.client;
        let kernel = self.kernel.name(session).await?;
        let device = String::new();
        let request = v1::GetKernelManifestRequest { kernel: kernel.clone(), format: self.format.into(), device };
        let message = client.kernel_manifest(request).await?;
        let active = client.get_kernel(v1::GetKernelRequest { name: kernel.clone() }).await?.active_version;
        if Some(message.version) != active {
            let active = show::version_or_dash(active);
            return Err(Failure::Refused(format!(
                "a rollout gives this token version {}, but a mirror has the active version, {active}, for all devices; use \
                 a token whose name the rollout does not choose, or wait for the rollout's end",
                message.version
            )));
        }
        let keyring = client.get_keyring(v1::GetKeyringRequest {}).await?;
        if let Some(root) = self.root {
            manifest::check(&message.document, &keyring.document, root).map_err(Failure::Refused)?;
        }
        // The parsed document has no other characters in its names than those that belong there.
        let refused = |error| Failure::Refused(format!("the manifest of the server is damaged: {error}"));
        let document = SignedManifest::parse(message.document.as_bytes()).map_err(refused)?;
        let folder = self.folder.join("v1").join(&kernel);
        let file = write_file(session, &kernel, self.format, document.unchecked(), &folder).await?;
        write(&self.folder.join("v1/keyring"), keyring.document.as_bytes())?;
        // Last, because it names the others.
        write(&folder.join("manifest"), message.document.as_bytes())?;
        session.print(&message, |message| {
            let mut facts = Facts::default();
            facts.add("kernel", &kernel);
            facts.add("version", message.version.to_string());
            facts.add("file", file.display().to_string());
            facts.add("size", show::bytes(message.size_bytes));
            facts.add("counts until", show::clock_or_dash(message.expire_time.as_ref()));
            facts.text()
        })
    }
}

/// Writes the file that a manifest names below the folder of its kernel, unless it is there. Returns its path.
async fn write_file(
    session: &Session,
    kernel: &str,
    format: v1::KernelFormat,
    manifest: &Manifest,
    folder: &Path,
) -> Result<PathBuf, Failure> {
    let Manifest { version, format: word, digest, .. } = manifest;
    let file = folder.join(format!("versions/{version}/{word}/{digest}"));
    if std::fs::read(&file).is_ok_and(|bytes| digest_of(&bytes) == *digest) {
        return Ok(file);
    }
    let (_, _, bytes) = session.client.fetch_kernel_as(kernel, Some(*version), format).await?;
    let found = digest_of(&bytes);
    if found != *digest {
        return Err(Failure::Refused(format!("the manifest names {digest}, but the server sent {found}; try again")));
    }
    write(&file, &bytes)?;
    Ok(file)
}

/// Writes or replaces a file, and creates its folder if that is missing.
fn write(file: &Path, bytes: &[u8]) -> Result<(), Failure> {
    if let Some(folder) = file.parent() {
        create_folder("-o", folder)?;
    }
    Ok(replace_file(file, bytes)?)
}
