//! Lightpath's engine as an extension of Python, the compiled part of the Python module `lightpath.local`.
//!
//! Functions take numbers in SI units, options as JSON, and C-contiguous arrays `[y][x]` of the element type that they
//! name. `lightpath.local` checks and converts what users give. Compute runs without Python's global lock.
//!
//! # Layout
//!
//! - `optics`: the optical setup, from JSON. `arrays`: arrays of NumPy and planes of the engine. `error`: errors.
//! - `threads`: the threads that compute, progress, and Ctrl-C.
//! - `propagator`: propagation of fields. `display`: display models and their files. `simulated`: simulated displays.
//! - `hologram`: optimization. `loss`: the loss of a phase and its gradient. `learning`: display models from
//!   photographs.
//!
//! No code here is unsafe. The unsafe code that Python's interface needs is in PyO3.

mod arrays;
mod display;
mod error;
mod hologram;
mod learning;
mod loss;
mod optics;
mod pictures;
mod propagator;
mod simulated;
mod threads;

/// The extension module `lightpath._engine`.
#[pyo3::pymodule]
mod _engine {
    #[pymodule_export]
    use super::display::DisplayModel;
    #[pymodule_export]
    use super::error::EngineError;
    #[pymodule_export]
    use super::hologram::optimize;
    #[pymodule_export]
    use super::learning::{learn, losses};
    #[pymodule_export]
    use super::loss::HologramLoss;
    #[pymodule_export]
    use super::optics::plan;
    #[pymodule_export]
    use super::pictures::{colour, levels, target};
    #[pymodule_export]
    use super::propagator::Propagator;
    #[pymodule_export]
    use super::simulated::SimulatedDisplay;

    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
