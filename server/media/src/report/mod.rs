//! Reports about a learned kernel, for people: one self-contained HTML file, its pictures, and its arrays.
//!
//! # Layout
//!
//! - `optics`: the kernel, its aberrations, spot and contrast, and the source. `modulator`: the parts of the modulator and
//!   its response. `evidence`: residuals per pair, and the band that the holograms illuminated. `history`: losses
//!   during learning, and drift against earlier versions. `comparison`: two versions. `over_distance`: aberrations between photographed distances. `over_modulator`: a kernel that varies over the
//!   modulator.
//! - `input`: the input of a report. `chapter`: text, pictures and arrays of one chapter. `page`: the HTML page.
//!   `base64`: the encoding of pictures inside the page.

mod base64;
mod chapter;
mod comparison;
mod evidence;
mod history;
mod input;
mod modulator;
mod optics;
mod over_distance;
mod over_modulator;
mod page;

pub use chapter::{Figure, ReportError};
pub use comparison::{Comparison, comparison};
pub use evidence::{Evidence, PAIRS_SHOWN_MAX, PairEvidence};
pub use history::difference;
pub use input::{KernelDifference, OtherVersion, ReportInput};

use chapter::Chapter;

/// A report about a kernel.
#[derive(Clone, Debug)]
pub struct Report {
    /// The report as one HTML file. It needs no other file.
    pub html: String,
    /// Pictures of the report.
    pub figures: Vec<Figure>,
    /// Numbers of the report, as a `.npz` archive.
    pub arrays: Vec<u8>,
}

/// Number of steps of [`make`].
pub const STEPS: u32 = 5;

/// Makes the report of a kernel. Calls `next` before each of the [`STEPS`] with the number of steps done.
///
/// # Errors
///
/// [`ReportError`] when a picture cannot be drawn or an array cannot be written, and all errors of `next`.
pub fn make<E: From<ReportError>>(
    input: &ReportInput,
    mut next: impl FnMut(u32) -> Result<(), E>,
) -> Result<Report, E> {
    let mut chapters = vec![page::summary(input)];
    chapters.extend(history::losses(input));
    next(0)?;
    chapters.extend(optics::chapters(&input.model, input.evidence.as_ref())?);
    next(1)?;
    chapters.extend(over_modulator::chapter(&input.model)?);
    next(2)?;
    chapters.extend(over_distance::chapter(input));
    next(3)?;
    if let Some(evidence) = &input.evidence {
        chapters.extend(evidence::chapters(evidence)?);
    }
    next(4)?;
    chapters.extend(history::drift(input));
    Ok(assemble(input, chapters)?)
}

/// Assembles the report from its chapters.
fn assemble(input: &ReportInput, chapters: Vec<Chapter>) -> Result<Report, ReportError> {
    let html = page::html(input, &chapters);
    let arrays: Vec<(&str, &[u8])> = chapters
        .iter()
        .flat_map(|chapter| &chapter.arrays)
        .map(|array| (array.name.as_str(), array.npy.as_slice()))
        .collect();
    let arrays = crate::kernel_formats::npz_archive(&arrays)?;
    let figures = chapters.into_iter().flat_map(|chapter| chapter.figures).collect();
    Ok(Report { html, figures, arrays })
}
