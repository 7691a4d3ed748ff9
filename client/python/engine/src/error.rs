//! Errors of the engine as exceptions of Python.

use lightpath_media::kernel_file::KernelFileError;
use lightpath_media::kernel_formats::KernelFormatError;
use lightpath_media::pictures::PictureError;
use lightpath_optics::Error;
use lightpath_optics::learning::BoxError;
use pyo3::PyErr;
use pyo3::exceptions::PyValueError;

pyo3::create_exception!(
    _engine,
    EngineError,
    PyValueError,
    "The engine refused an input. `args` are the name of the input, a stable word for programs, and a text for people."
);

/// An error of this crate, until Python gets it.
#[derive(Debug)]
pub(crate) struct Refused {
    /// Name of the input, as the engine calls it; empty if no single input is wrong.
    field: &'static str,
    reason: &'static str,
    message: String,
}

impl Refused {
    pub(crate) fn new(field: &'static str, reason: &'static str, message: impl ToString) -> Self {
        Self { field, reason, message: message.to_string() }
    }
}

impl From<Refused> for PyErr {
    fn from(Refused { field, reason, message }: Refused) -> Self {
        EngineError::new_err((field, reason, message))
    }
}

impl From<Error> for Refused {
    fn from(error: Error) -> Self {
        let (field, reason) = match &error {
            Error::OutOfRange { name, .. } => (*name, "OUT_OF_RANGE"),
            Error::SizeMismatch { name, .. } => (*name, "SIZE_MISMATCH"),
            Error::NotFinite { name, .. } => (*name, "NOT_FINITE"),
            Error::Empty { name, .. } => (*name, "EMPTY"),
            Error::Incompatible { name, .. } => (*name, "INCOMPATIBLE"),
            Error::Unsuitable { .. } => ("method", "UNSUITABLE"),
            Error::Saturated => ("captures", "SATURATED"),
            Error::Unrelated { .. } => ("captures", "UNRELATED"),
            Error::Extrapolation { .. } => ("distance_m", "EXTRAPOLATION"),
            _ => ("", "REFUSED"),
        };
        Self::new(field, reason, &error)
    }
}

impl From<PictureError> for Refused {
    fn from(error: PictureError) -> Self {
        Self::new("target", "INVALID_PICTURE", error)
    }
}

impl From<KernelFileError> for Refused {
    fn from(error: KernelFileError) -> Self {
        Self::new("path", "INVALID_KERNEL", error)
    }
}

impl From<KernelFormatError> for Refused {
    fn from(error: KernelFormatError) -> Self {
        Self::new("path", "INVALID_KERNEL", error)
    }
}

/// Options are JSON that `lightpath.local` writes: a user gives a word or a number that does not exist.
impl From<serde_json::Error> for Refused {
    fn from(error: serde_json::Error) -> Self {
        Self::new("options", "INVALID_OPTION", error)
    }
}

/// Learning returns errors of the engine, and errors of the source of pairs, which here has none.
impl From<BoxError> for Refused {
    fn from(error: BoxError) -> Self {
        match error.downcast::<Error>() {
            Ok(error) => (*error).into(),
            Err(error) => Self::new("", "LEARNING", error),
        }
    }
}
