//! The loss of a phase and its gradient, for optimizations of one's own.

use crate::arrays::{array, plane};
use crate::display::DisplayModel;
use crate::error::Refused;
use crate::optics;
use crate::threads;
use lightpath_optics::hologram::{ImagePlane, Loss};
use lightpath_optics::{Detector, HologramProblem, Plane, RegionOfInterest};
use numpy::{PyArray2, PyReadonlyArray2};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use serde::Deserialize;
use std::sync::Mutex;

/// What is compared with the target, and where.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Compared {
    pub(crate) loss: Loss,
    pub(crate) detector: Detector,
    /// x, y, width, height \[px\]. `None`: the middle 80 % of each axis.
    region: Option<[usize; 4]>,
}

impl Compared {
    pub(crate) fn region(&self, display: &DisplayModel) -> Result<RegionOfInterest, Refused> {
        optics::region(display.grid(), self.region)
    }

    pub(crate) fn problem(
        &self,
        display: &DisplayModel,
        target: Plane<f32>,
        weight: Option<Plane<f32>>,
    ) -> Result<HologramProblem, Refused> {
        let engine = display.engine(self.detector)?;
        let plane = ImagePlane { weight, ..ImagePlane::new(engine, target) };
        Ok(HologramProblem::with_planes(vec![plane], 1, self.region(display)?, self.loss)?)
    }
}

/// The loss of phases for one target.
#[pyclass(frozen, module = "lightpath._engine")]
pub(crate) struct HologramLoss {
    sides_px: [usize; 2],
    problem: Mutex<HologramProblem>,
}

/// Loss, the gain that fits best, and the gradient ∂L/∂φ.
type Evaluated<'py> = (f64, f64, Bound<'py, PyArray2<f32>>);

#[pymethods]
impl HologramLoss {
    #[new]
    #[pyo3(signature = (display, target, options, weight=None))]
    fn new(
        py: Python<'_>,
        display: &DisplayModel,
        target: PyReadonlyArray2<'_, f32>,
        options: &str,
        weight: Option<PyReadonlyArray2<'_, f32>>,
    ) -> PyResult<Self> {
        let target = plane("target", &target)?;
        let weight = weight.map(|weight| plane("weight", &weight)).transpose()?;
        let prepare = || -> Result<_, Refused> {
            let compared: Compared = serde_json::from_str(options)?;
            compared.problem(display, target, weight)
        };
        let problem = Mutex::new(threads::compute(py, prepare)??);
        Ok(Self { sides_px: [display.grid().height_px(), display.grid().width_px()], problem })
    }

    /// Evaluates loss and gradient at a gain, or at the gain that fits best.
    #[pyo3(signature = (phase, gain=None))]
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        phase: PyReadonlyArray2<'py, f32>,
        gain: Option<f64>,
    ) -> PyResult<Evaluated<'py>> {
        let phase = plane("phase", &phase)?;
        let [height_px, width_px] = self.sides_px;
        phase.expect_size("phase", height_px, width_px).map_err(Refused::from)?;
        let mut gradient = Plane::filled(height_px, width_px, 0.0);
        let evaluation = threads::compute(py, || {
            let mut problem = self.problem.lock().map_err(|_| PyRuntimeError::new_err("an evaluation panicked"))?;
            Ok::<_, PyErr>(match gain {
                Some(gain) => problem.evaluate(phase.values(), gain, gradient.values_mut()),
                None => problem.evaluate_fitted(phase.values(), gradient.values_mut()),
            })
        })??;
        Ok((evaluation.loss, evaluation.best_gain, array(py, gradient)?))
    }
}
