//! What a learned kernel is like, for people: one HTML file with everything in it, its pictures, and its arrays.
//!
//! # Layout
//!
//! - `optics`: the kernel, its aberrations, spot and contrast, source and response. `evidence`: residuals per pair and the band
//!   that the data lit. `history`: losses while learning, and drift against earlier versions. `over_distance`: aberrations between
//!   photographed distances. `over_modulator`: a kernel that varies over the modulator.
//! - `page`: the HTML. `base64`: pictures inside it.
mod base64;
mod evidence;
mod history;
mod optics;
mod over_distance;
mod over_modulator;
mod page;

pub use evidence::{Evidence, PAIRS_SHOWN_MAX, PairEvidence};
pub use history::Earlier;

use crate::figures::Canvas;
use crate::pictures::PictureError;
use lightpath_domain::kernel::KernelVersion;
use lightpath_optics::DisplayModel;

/// Everything that a report is made of.
#[derive(Debug)]
pub struct ReportInput {
    /// What it is about.
    pub version: KernelVersion,
    /// The same as a model.
    pub model: DisplayModel,
    /// Losses while it was learned; empty where that is not known.
    pub loss_history: Vec<f64>,
    /// From the dataset; `None` for imports, and where the dataset can't be read any more.
    pub evidence: Option<Evidence>,
    /// Other versions of the same kernel, newest first.
    pub earlier: Vec<Earlier>,
    /// The model at each distance that it was learned for, ascending; empty where that is one alone.
    pub over_distance: Vec<DisplayModel>,
}

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

/// A picture of a report.
#[derive(Clone, Debug)]
pub struct Figure {
    /// File name with its extension.
    pub name: String,
    /// What it shows.
    pub title: String,
    /// PNG or SVG.
    pub bytes: Vec<u8>,
}

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A picture could not be drawn.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// The arrays could not be written.
    #[error(transparent)]
    Arrays(#[from] crate::kernel_formats::KernelFormatError),
}

/// Numbers and pictures of one chapter.
#[derive(Default)]
struct Chapter {
    title: &'static str,
    /// Paragraphs and tables, as HTML.
    body: String,
    figures: Vec<Figure>,
    arrays: Vec<NamedArray>,
}

/// A `.npy` file to be.
struct NamedArray {
    name: String,
    npy: Vec<u8>,
}

impl Chapter {
    fn png(&mut self, name: &str, title: &str, canvas: &Canvas) -> Result<(), ReportError> {
        let bytes = canvas.png().map_err(|error| PictureError::Encode(error.to_string()))?;
        self.figures.push(Figure { name: format!("{name}.png"), title: title.to_owned(), bytes });
        Ok(())
    }

    fn svg(&mut self, name: &str, title: &str, svg: String) {
        self.figures.push(Figure { name: format!("{name}.svg"), title: title.to_owned(), bytes: svg.into_bytes() });
    }

    fn array(&mut self, name: &str, shape: &[usize], values: impl IntoIterator<Item = f64>) {
        let bytes: Vec<u8> = values.into_iter().flat_map(|value| (value as f32).to_le_bytes()).collect();
        self.arrays
            .push(NamedArray { name: format!("{name}.npy"), npy: crate::kernel_formats::npy_f32(shape, &bytes) });
    }
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
