//! The commands `lightpath kernel fetch`, `export` and `import`.

use super::show::version_facts;
use crate::arguments::Optics;
use crate::destination::{self, Destination};
use crate::failure::Failure;
use crate::kernel_choice::KernelChoice;
use crate::session::{Session, print_note};
use crate::show;
use crate::table::Facts;
use crate::words::WordParser;
use clap::Args;
use lightpath::{Words as _, names, v1};
use serde::Serialize;
use std::path::PathBuf;

/// Download a kernel to a file, checked against its SHA-256 digest; by default the active version.
///
/// The formats safetensors, npz and bundle hold the whole kernel, compact holds a whole smooth one. A bundle also holds
/// the measurements and the lineage of the version, for another server. The other formats hold only the transfer
/// function. A warning on stderr names what is lost, before the file is written.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  lightpath kernel fetch --display lab-2 --distance 150mm -o kernel.safetensors
  lightpath kernel fetch --display lab-2 --distance 150mm -o kernel.lpk
  lightpath kernel fetch --display lab-2 --distance 150mm --format complex64 \\
      -o transfer.npy
  lightpath kernel fetch --display lab-2 --distance 150mm --dry-run -o k.npz

The extension says the format: .safetensors, .lpk (compact), .npz, .npy, .pt, .bundle. With --format the file may have \
another extension, as long as it is not that of another format.")]
pub(crate) struct Fetch {
    #[command(flatten)]
    kernel: KernelChoice,

    /// Download this version [default: the active version]
    #[arg(long, value_name = "N")]
    version: Option<u32>,

    #[command(flatten)]
    file: KernelFile,

    /// Print the version, digest, size and name of the file that the command would write, and write nothing
    #[arg(long)]
    dry_run: bool,
}

/// Download a given version of a kernel to a file, checked against its SHA-256 digest.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Example:
  lightpath kernel export --display lab-2 --distance 150mm --version 3 \\
      -o kernel.npz")]
pub(crate) struct Export {
    #[command(flatten)]
    kernel: KernelChoice,

    /// Download this version
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    version: u32,

    #[command(flatten)]
    file: KernelFile,
}

/// Format and path of a downloaded kernel.
#[derive(Debug, Args)]
struct KernelFile {
    /// Choose the format of the file [default: the format of the extension]
    #[arg(long, value_parser = WordParser::<v1::KernelFormat>::new())]
    format: Option<v1::KernelFormat>,

    /// Write the kernel to this file; - writes it to standard output, as safetensors without --format
    #[arg(short = 'o', value_name = "FILE")]
    path: PathBuf,
}

/// Store a file as a kernel's next version.
///
/// The file may be one that kernel fetch wrote in any format, or a bare transfer function as .pt, .npy, .npz or
/// safetensors. A bare transfer function is one of: amplitude and phase, 1 x 2 x rows x columns, as in the paper; real
/// and imaginary parts, rows x columns x 2; complex numbers, rows x columns. Zero frequency is in the middle. Rows and
/// columns are those of the display or of the padded spectrum. Nothing in a .pt file is executed. The new version is
/// without what the file does not hold, and its note names that. If the array transfer of an .npz file was changed, the
/// transfer function is taken from it.
#[derive(Debug, Args)]
#[command(override_usage = "lightpath kernel import [OPTIONS] --display <ID>\n           --distance <LENGTH> <FILE>")]
#[command(after_long_help = "\
Examples:
  lightpath kernel import --display lab-2 --distance 150mm kernel.safetensors
  lightpath kernel import --display lab-2 --distance 150mm papers/kernel.pt")]
pub(crate) struct Import {
    #[command(flatten)]
    optics: Optics,

    /// Import this file
    #[arg(value_name = "FILE")]
    path: PathBuf,

    /// Accept a file that names another display
    #[arg(long)]
    from_another_display: bool,
}

impl Fetch {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        match self.dry_run {
            true => describe(session, &self.kernel, self.version, &self.file).await,
            false => write(session, &self.kernel, self.version, &self.file).await,
        }
    }
}

impl Export {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        write(session, &self.kernel, Some(self.version), &self.file).await
    }
}

impl Import {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let request = v1::ImportKernelRequest {
            display: names::display(&self.optics.display),
            wavelength_m: self.optics.wavelength_m(),
            place: Some(v1::Place::at_m(self.optics.distance)),
            artifact: session.upload(&self.path).await?,
            from_another_display: self.from_another_display,
            ..Default::default()
        };
        session.print(&session.client.import_kernel(request).await?, version_facts)
    }
}

/// A downloaded version. In JSON it is the version's message with one more field, `file`.
#[derive(Debug, Serialize)]
struct Fetched {
    #[serde(flatten)]
    version: v1::KernelVersion,
    /// The file in a format other than safetensors.
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<v1::KernelFile>,
}

/// Extensions of kernel files with their formats.
const EXTENSIONS: [(&str, &[v1::KernelFormat]); 6] = [
    ("safetensors", &[v1::KernelFormat::Safetensors]),
    ("lpk", &[v1::KernelFormat::Compact]),
    ("npz", &[v1::KernelFormat::Npz]),
    ("npy", &[v1::KernelFormat::Npy, v1::KernelFormat::Complex64, v1::KernelFormat::F16]),
    ("pt", &[v1::KernelFormat::Pt]),
    ("bundle", &[v1::KernelFormat::Bundle]),
];
const FILE: Destination = Destination { option: "-o", suffix: "", formats: &[] };

impl KernelFile {
    /// The format: the given one, or that of the extension. Refuses an extension that contradicts or says nothing.
    fn format(&self) -> Result<v1::KernelFormat, Failure> {
        let extension = self.path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let path = self.path.display();
        let of_extension = EXTENSIONS.iter().find(|(known, _)| *known == extension).map(|(_, formats)| *formats);
        match (self.format, of_extension) {
            (Some(format), Some(formats)) if !formats.contains(&format) => Err(Failure::Usage(format!(
                "-o {path} has the extension of the format {}, but --format is {}: change one of them",
                formats[0].word(),
                format.word()
            ))),
            (Some(format), _) => Ok(format),
            (None, Some(formats)) => Ok(formats[0]),
            (None, None) if destination::is_stdout(&self.path) => Ok(v1::KernelFormat::Safetensors),
            (None, None) => {
                let known: Vec<String> = EXTENSIONS.iter().map(|(known, _)| format!(".{known}")).collect();
                Err(Failure::Usage(format!(
                    "-o {path}: the extension must say the format: {}; or choose it with --format",
                    known.join(", ")
                )))
            }
        }
    }
}

/// Downloads a kernel version to a file and prints its size and deviation. Prints what the format loses before the file
/// is put in place. Without a version it is the active one.
async fn write(
    session: &Session,
    kernel: &KernelChoice,
    version: Option<u32>,
    file: &KernelFile,
) -> Result<(), Failure> {
    let (format, path) = (file.format()?, FILE.file(&session.stdout, &file.path)?);
    let name = kernel.name(session).await?;
    let warn = |file: &v1::KernelFile| {
        if let Some(warning) = warning(file) {
            print_note(&warning);
        }
    };
    let (version, file) = if destination::is_stdout(&path) {
        let (version, file, bytes) = session.client.fetch_kernel_as(&name, version, format).await?;
        file.iter().for_each(warn);
        destination::write(&bytes, &path)?;
        (version, file)
    } else {
        session.client.fetch_kernel_to_as(&name, version, format, &path, warn).await?
    };
    session.print(&Fetched { version, file }, |Fetched { version, file }| {
        let size = show::bytes(file.as_ref().map_or(version.size_bytes, |file| file.size_bytes));
        let deviation = file.as_ref().map_or_else(String::new, |file| match file.relative_error {
            0.0 => "; the transfer function is exactly that of the version".to_owned(),
            error => format!(
                "; the transfer function differs from that of the version by {error:.1e} (relative, over the band)"
            ),
        });
        format!("wrote {}, {size}, to {}{deviation}", version.name, destination::shown(&path))
    })
}

/// Prints what [`write`] would write.
async fn describe(
    session: &Session,
    kernel: &KernelChoice,
    version: Option<u32>,
    file: &KernelFile,
) -> Result<(), Failure> {
    let (format, path) = (file.format()?, FILE.file(&session.stdout, &file.path)?);
    let name = kernel.name(session).await?;
    let (version, file) = session.client.describe_kernel(&name, version, format).await?;
    if let Some(warning) = file.as_ref().and_then(warning) {
        print_note(&warning);
    }
    session.print(&Fetched { version, file }, |Fetched { version, file }| {
        let digest = file.as_ref().map_or(&version.artifact, |file| &file.digest);
        let mut facts = Facts::default();
        facts.add("version", &version.name);
        facts.add("active", if version.active { "yes" } else { "no" });
        facts.add("format", format.word());
        facts.add("digest", digest);
        facts.add("size", show::bytes(file.as_ref().map_or(version.size_bytes, |file| file.size_bytes)));
        facts.add("file", format!("{} (not written: --dry-run)", destination::shown(&path)));
        facts.text()
    })
}

/// A warning for a file that lacks parts of the kernel; `None` if only digits are lost.
fn warning(file: &v1::KernelFile) -> Option<String> {
    let lost = file.losses.iter().filter(|loss| loss.name != "precision");
    let lost: Vec<&str> = lost.map(|loss| loss.title.as_str()).collect();
    let change = match file.relative_error {
        0.0 => "H stays the same".to_owned(),
        error if error < 0.01 => format!("H changes by {error:.1e}"),
        error => format!("H changes by {:.0} %", 100.0 * error),
    };
    let format = file.format().word();
    (!lost.is_empty())
        .then(|| format!("warning: {format} does not hold the whole kernel; lost: {}; {change}", lost.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(format: v1::KernelFormat, losses: &[&str], relative_error: f64) -> v1::KernelFile {
        let loss =
            |name: &&str| v1::Part { name: (*name).to_owned(), title: name.replace('_', " "), ..v1::Part::default() };
        let losses = losses.iter().map(loss).collect();
        v1::KernelFile { format: format.into(), losses, relative_error, ..Default::default() }
    }

    #[test]
    fn lost_parts_are_named_in_a_warning_but_lost_digits_are_not() {
        let pt = file(v1::KernelFormat::Pt, &["source", "phase_response", "outer_spectrum", "precision"], 0.8123);
        assert_eq!(
            warning(&pt).unwrap(),
            "warning: pt does not hold the whole kernel; lost: source, phase response, outer spectrum; H changes by 81 %"
        );
        let bare = file(v1::KernelFormat::Complex64, &["source"], 2e-8);
        assert!(warning(&bare).unwrap().ends_with("lost: source; H changes by 2.0e-8"));
        assert_eq!(warning(&file(v1::KernelFormat::Compact, &["precision"], 1e-7)), None);
        assert_eq!(warning(&file(v1::KernelFormat::Npz, &[], 0.0)), None);
    }

    #[test]
    fn extension_says_the_format() {
        let format = |path: &str, format| KernelFile { format, path: path.into() }.format();
        assert_eq!(format("k.lpk", None).unwrap(), v1::KernelFormat::Compact);
        assert_eq!(format("k.NPZ", None).unwrap(), v1::KernelFormat::Npz);
        assert_eq!(format("-", None).unwrap(), v1::KernelFormat::Safetensors);
        assert_eq!(format("k.npy", Some(v1::KernelFormat::F16)).unwrap(), v1::KernelFormat::F16);
        assert_eq!(format("k.bin", Some(v1::KernelFormat::Compact)).unwrap(), v1::KernelFormat::Compact);
        let refused = |path, given| match format(path, given) {
            Err(Failure::Usage(text)) => text,
            other => panic!("{other:?}"),
        };
        let unknown = refused("k.onnx", None);
        assert!(unknown.contains(".safetensors, .lpk, .npz, .npy, .pt, .bundle; or choose it with --format"));
        assert!(refused("k.pt", Some(v1::KernelFormat::Npz)).contains("of the format pt, but --format is npz"));
    }

    #[test]
    fn json_is_the_version_with_its_file() {
        let version = v1::KernelVersion { version: 3, ..Default::default() };
        let json = |file| serde_json::to_value(Fetched { version: version.clone(), file }).unwrap();
        let whole = json(Some(file(v1::KernelFormat::Pt, &["source"], 0.5)));
        assert_eq!((&whole["version"], &whole["file"]["losses"][0]["name"]), (&3.into(), &"source".into()));
        assert!(json(None).get("file").is_none());
    }
}
