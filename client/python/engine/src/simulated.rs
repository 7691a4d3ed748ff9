//! Simulated displays with imperfections, photographed by a simulated camera.

use crate::arrays::{array, plane};
use crate::error::Refused;
use crate::optics::Optics;
use crate::threads;
use lightpath_bench::{SimulatedBench, SimulatedDisplay as Simulated};
use lightpath_optics::Carrier;
use numpy::{PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;

/// A display and a camera that exist only in the engine.
#[pyclass(frozen, module = "lightpath._engine")]
pub(crate) struct SimulatedDisplay(Simulated);

#[pymethods]
impl SimulatedDisplay {
    /// `bench` is a JSON object with the properties of the bench.
    #[new]
    fn new(py: Python<'_>, optics: &str, bench: &str) -> PyResult<Self> {
        let draw = || -> Result<_, Refused> {
            let bench: SimulatedBench = serde_json::from_str(bench)?;
            Ok(Simulated::draw(Optics::parse(optics)?.convolution()?.0, None::<Carrier>, bench)?)
        };
        Ok(Self(threads::compute(py, draw)??))
    }

    /// The grey levels of a photograph, of 256, for a displayed phase \[rad\].
    fn photograph<'py>(
        &self,
        py: Python<'py>,
        phase: PyReadonlyArray2<'py, f32>,
        noise_seed: u64,
    ) -> PyResult<Bound<'py, PyArray2<u8>>> {
        let phase = plane("phase", &phase)?;
        array(py, threads::compute(py, || self.0.capture(&phase, noise_seed))?.map_err(Refused::from)?)
    }
}
