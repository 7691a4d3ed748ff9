//! The parts of a report's chapter: text, pictures and arrays.

use crate::figures::Canvas;
use crate::pictures::PictureError;

/// A picture of a report.
#[derive(Clone, Debug)]
pub struct Figure {
    /// File name with its extension.
    pub name: String,
    /// Title of the picture.
    pub title: String,
    /// Contents of the PNG or SVG file.
    pub bytes: Vec<u8>,
}

/// Reason why a report could not be made.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A picture could not be drawn.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// The arrays could not be written.
    #[error(transparent)]
    Arrays(#[from] crate::kernel_formats::KernelFormatError),
}

/// One chapter of a report, with its numbers and pictures.
#[derive(Default)]
pub(super) struct Chapter {
    pub(super) title: &'static str,
    /// Paragraphs and tables, as HTML.
    pub(super) body: String,
    pub(super) figures: Vec<Figure>,
    pub(super) arrays: Vec<NamedArray>,
}

/// An array that the report stores as a `.npy` file.
pub(super) struct NamedArray {
    pub(super) name: String,
    pub(super) npy: Vec<u8>,
}

impl Chapter {
    pub(super) fn png(&mut self, name: &str, title: &str, canvas: &Canvas) -> Result<(), ReportError> {
        let bytes = canvas.png().map_err(|error| PictureError::Encode(error.to_string()))?;
        self.figures.push(Figure { name: format!("{name}.png"), title: title.to_owned(), bytes });
        Ok(())
    }

    pub(super) fn svg(&mut self, name: &str, title: &str, svg: String) {
        self.figures.push(Figure { name: format!("{name}.svg"), title: title.to_owned(), bytes: svg.into_bytes() });
    }

    pub(super) fn array(&mut self, name: &str, shape: &[usize], values: impl IntoIterator<Item = f64>) {
        let bytes: Vec<u8> = values.into_iter().flat_map(|value| (value as f32).to_le_bytes()).collect();
        self.arrays
            .push(NamedArray { name: format!("{name}.npy"), npy: crate::kernel_formats::npy_f32(shape, &bytes) });
    }
}
