//! Notes about the converted files on disk, so that a server that starts again need not make them again.
//!
//! The notes are those of one version of the program: another one may write other bytes. Bundles are not noted. They have
//! the record of their version, which may be another one after a restore, and are made in a moment.

use super::converted::{ConversionKey, Converted};
use lightpath_media::kernel_formats::{KernelFormat, Loss};
use serde::{Deserialize, Serialize};

/// The files, the one that was used last at the end.
#[derive(Debug, Serialize, Deserialize)]
struct Notes {
    program: String,
    files: Vec<Note>,
}

#[derive(Debug, Serialize, Deserialize)]
struct Note {
    version: String,
    artifact: String,
    form: String,
    digest: String,
    size_bytes: u64,
    relative_error: f64,
    losses: Vec<String>,
}

const PROGRAM: &str = env!("CARGO_PKG_VERSION");

/// The notes about converted files, as JSON.
pub(super) fn notes<'a>(files: impl Iterator<Item = &'a (ConversionKey, Converted)>) -> Vec<u8> {
    let files = files.filter(|(key, _)| key.format != KernelFormat::Bundle).map(|(key, converted)| Note {
        version: key.version.clone(),
        artifact: key.artifact.clone(),
        form: key.format.as_str().to_owned(),
        digest: converted.digest.clone(),
        size_bytes: converted.size_bytes,
        relative_error: converted.relative_error,
        losses: converted.losses.iter().map(|loss| loss.name().to_owned()).collect(),
    });
    // Texts and numbers always have a JSON form.
    serde_json::to_vec(&Notes { program: PROGRAM.to_owned(), files: files.collect() }).unwrap_or_default()
}

/// The files of notes; none if another program wrote them.
pub(super) fn noted(notes: &[u8]) -> Vec<(ConversionKey, Converted)> {
    let notes: Option<Notes> = serde_json::from_slice(notes).ok();
    let files = notes.filter(|notes| notes.program == PROGRAM).map_or_else(Vec::new, |notes| notes.files);
    files.into_iter().filter_map(Note::read).collect()
}

impl Note {
    fn read(self) -> Option<(ConversionKey, Converted)> {
        let Self { version, artifact, form, digest, size_bytes, relative_error, losses } = self;
        let losses = losses.iter().map(|name| Loss::parse(name)).collect::<Option<_>>()?;
        let key = ConversionKey { version, artifact, format: KernelFormat::parse(&form)? };
        Some((key, Converted { digest, size_bytes, relative_error, losses }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_media::kernel_formats::Loss::{OuterSpectrum, Precision};

    fn file(format: KernelFormat) -> (ConversionKey, Converted) {
        let key =
            ConversionKey { version: "displays/a/kernels/k/versions/1".to_owned(), artifact: "a".to_owned(), format };
        let losses = vec![OuterSpectrum, Precision];
        (key, Converted { digest: "d".to_owned(), size_bytes: 7, relative_error: 0.25, losses })
    }

    #[test]
    fn notes_are_read_back_by_the_program_that_wrote_them() {
        let [pt, bundle] = [KernelFormat::Pt, KernelFormat::Bundle].map(file);
        let written = notes([&pt, &bundle].into_iter());
        assert_eq!(noted(&written), [pt]);
        let other = String::from_utf8(written).unwrap().replace(PROGRAM, "another");
        assert_eq!(noted(other.as_bytes()), []);
        assert_eq!(noted(b"{"), []);
    }
}
