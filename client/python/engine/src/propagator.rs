//! Propagation of fields in single or double precision.

use crate::arrays::{array, plane};
use crate::error::Refused;
use crate::optics::{Optics, json};
use crate::threads;
use lightpath_optics::engine::{PropagatorCore, Real};
use lightpath_optics::{OpticalSetup, Plane, ValidityReport};
use num_complex::Complex;
use numpy::{Element, PyReadonlyArray2};
use pyo3::prelude::*;

/// A prepared propagation with its adjoint.
#[pyclass(frozen, module = "lightpath._engine")]
pub(crate) struct Propagator {
    core: Precision,
    /// The planner's report, as JSON.
    #[pyo3(get)]
    plan: String,
}

enum Precision {
    Single(PropagatorCore<f32>),
    Double(PropagatorCore<f64>),
}

#[pymethods]
impl Propagator {
    #[new]
    fn new(py: Python<'_>, optics: &str, double: bool) -> PyResult<Self> {
        let prepare = || -> Result<_, Refused> {
            let optics = Optics::parse(optics)?;
            let (setup, validity) = (optics.setup()?, optics.validity()?);
            let core = match double {
                false => Precision::Single(prepared(&optics, &setup, &validity)?),
                true => Precision::Double(prepared(&optics, &setup, &validity)?),
            };
            Ok(Self { core, plan: json(&validity)? })
        };
        Ok(threads::compute(py, prepare)??)
    }

    /// Propagates a field: complex64, or complex128 in double precision.
    fn forward<'py>(&self, py: Python<'py>, field: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        match &self.core {
            Precision::Single(core) => applied::<f32>(py, core, field, PropagatorCore::forward),
            Precision::Double(core) => applied::<f64>(py, core, field, PropagatorCore::forward),
        }
    }

    /// Applies the adjoint to a field in the image.
    fn adjoint<'py>(&self, py: Python<'py>, field: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        match &self.core {
            Precision::Single(core) => applied::<f32>(py, core, field, PropagatorCore::adjoint),
            Precision::Double(core) => applied::<f64>(py, core, field, PropagatorCore::adjoint),
        }
    }
}

fn prepared<T: Real>(
    optics: &Optics,
    setup: &OpticalSetup,
    validity: &ValidityReport,
) -> lightpath_optics::Result<PropagatorCore<T>> {
    match optics.regardless {
        true => PropagatorCore::regardless(setup, validity.method),
        false => PropagatorCore::new(setup, validity.method),
    }
}

type Pass<T> = fn(&PropagatorCore<T>, &Plane<Complex<T>>) -> lightpath_optics::Result<Plane<Complex<T>>>;

fn applied<'py, T: Real>(
    py: Python<'py>,
    core: &PropagatorCore<T>,
    field: &Bound<'py, PyAny>,
    pass: Pass<T>,
) -> PyResult<Bound<'py, PyAny>>
where
    Complex<T>: Element,
{
    let field = plane("field", &field.extract::<PyReadonlyArray2<'py, Complex<T>>>()?)?;
    let image = threads::compute(py, || pass(core, &field))?.map_err(Refused::from)?;
    Ok(array(py, image)?.into_any())
}
