//! A kernel that was read from a file.

use super::losses::Loss;
use crate::kernel_file::Origin;
use lightpath_domain::kernel_format::KernelFormat;
use lightpath_optics::{DisplayModel, KernelModel};

/// An imported kernel.
#[derive(Clone, Debug, PartialEq)]
pub struct Imported {
    /// The display model.
    pub model: DisplayModel,
    /// Parametrization of the model.
    pub kind: KernelModel,
    /// The file's form, or the one that is most like it.
    pub form: KernelFormat,
    /// Where the kernel comes from, as far as the file says it.
    pub origin: Origin,
    /// Whether the file is in the native form already.
    pub native: bool,
    /// What the file did not hold, and the model is without.
    pub absent: Vec<Loss>,
    /// What a person should know about the import; empty for most files.
    pub remarks: Vec<&'static str>,
}

impl Imported {
    /// A display model from a file that held all of it.
    pub(super) fn new(form: KernelFormat, model: DisplayModel) -> Self {
        Self {
            model,
            kind: KernelModel::Smooth,
            form,
            origin: Origin::default(),
            native: false,
            absent: Vec::new(),
            remarks: Vec::new(),
        }
    }

    /// What the file did not hold and what else a person should know, as one sentence; `None` for a file that held a
    /// whole model.
    #[must_use]
    pub fn note(&self) -> Option<String> {
        let absent: Vec<String> = self.absent.iter().map(Loss::to_string).collect();
        let absent = (!absent.is_empty())
            .then(|| format!("the file does not hold {}; the version is without them", absent.join(", ")));
        let parts: Vec<String> = self.remarks.iter().map(|&remark| remark.to_owned()).chain(absent).collect();
        (!parts.is_empty()).then(|| parts.join("; "))
    }
}
