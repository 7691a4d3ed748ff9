//! Which kernels a list has.

use lightpath_domain::units::{Distance, Wavelength};

/// Selection of the kernels in a list.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct KernelFilter {
    /// Only kernels of the display with this id; `None`: all displays.
    pub display: Option<String>,
    /// Only kernels of this wavelength; `None`: all wavelengths.
    pub wavelength: Option<Wavelength>,
    /// Only kernels of this distance; `None`: all distances.
    pub distance: Option<Distance>,
}
