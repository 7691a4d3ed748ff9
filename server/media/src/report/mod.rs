//! What a learned kernel is like, for people: one HTML file with everything in it, its pictures, and its arrays.
//!
//! # Layout
//!
//! - `optics`: the kernel, its aberrations, spot and contrast, source and response. `evidence`: residuals per pair and the band
//!   that the data lit. `history`: losses while learning, and drift against earlier versions. `over_distance`: aberrations between
//!   photographed distances. `over_modulator`: a kernel that varies over the modulator.
//! - `input`: what a report is made of. `chapter`: text, pictures and arrays of one chapter. `page`: the HTML. `base64`: pictures inside it.
mod base64;
mod chapter;
mod evidence;
mod history;
mod input;
mod optics;
mod over_distance;
mod over_modulator;
mod page;

pub use chapter::{Figure, ReportError};
pub use evidence::{Evidence, PAIRS_SHOWN_MAX, PairEvidence};
pub use input::{Earlier, ReportInput};

/// A report.
#[derive(Clone, Debug)]
pub struct Report {
    /// One file, nothing outside it is needed.
    pub html: String,
    /// Its pictures.
    pub figures: Vec<Figure>,
    /// Its numbers, `.npz`.
    pub arrays: Vec<u8>,
}

/// Makes the report.
///
/// # Errors
///
/// [`ReportError`].
pub fn make(input: &ReportInput) -> Result<Report, ReportError> {
    let mut chapters = vec![page::summary(input)];
    chapters.extend(history::losses(input));
    let certainty = input.evidence.as_ref().and_then(|evidence| evidence.response.as_ref());
    chapters.extend(optics::chapters(&input.model, certainty)?);
    chapters.extend(over_modulator::chapter(&input.model)?);
    chapters.extend(over_distance::chapter(input));
    if let Some(evidence) = &input.evidence {
        chapters.extend(evidence::chapters(evidence)?);
    }
    chapters.extend(history::drift(input));
    let html = page::html(input, &chapters);
    let arrays: Vec<(&str, &[u8])> = chapters
        .iter()
        .flat_map(|chapter| &chapter.arrays)
        .map(|array| (array.name.as_str(), array.npy.as_slice()))
        .collect();
    let arrays = crate::kernel_formats::npz(&arrays)?;
    let figures = chapters.into_iter().flat_map(|chapter| chapter.figures).collect();
    Ok(Report { html, figures, arrays })
}
