//! Display models, ideal or learned, and their files.

use crate::arrays::{array, plane, planes};
use crate::error::Refused;
use crate::optics::{self, Optics, json};
use crate::threads;
use lightpath_media::budget::Budget;
use lightpath_media::kernel_formats::{self, KernelFormat, KernelFormatError};
use lightpath_optics::hologram::{ShownLight, light_of_frames};
use lightpath_optics::numerics::grid::frequency;
use lightpath_optics::second_opinion::{Effort, SecondOpinion};
use lightpath_optics::{Detector, Engine, Grid, KernelModel, OpticalSetup, Plane, ValidityReport};
use num_complex::Complex32;
use numpy::{PyArray2, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use rayon::prelude::*;
use serde_json::json as object;
use std::sync::OnceLock;

/// A model of a display.
#[pyclass(frozen, module = "lightpath._engine")]
pub(crate) struct DisplayModel {
    pub(crate) model: lightpath_optics::DisplayModel,
    /// `None`: the ideal display.
    kind: Option<KernelModel>,
    pub(crate) validity: ValidityReport,
    /// What a file did not hold, or what else a person should know of it.
    note: Option<String>,
    /// Made at its first use. It holds the transfer function.
    engine: OnceLock<Engine>,
}

impl DisplayModel {
    /// A learned model.
    pub(crate) fn learned(model: lightpath_optics::DisplayModel, kind: KernelModel, validity: ValidityReport) -> Self {
        let validity = validity.through_kernel_of(&model);
        Self { model, kind: Some(kind), validity, note: None, engine: OnceLock::new() }
    }

    /// The engine that sees the display by a detector.
    pub(crate) fn engine(&self, detector: Detector) -> Result<Engine, Refused> {
        if let Some(engine) = self.engine.get() {
            return Ok(engine.with_detector(detector));
        }
        let engine = Engine::new(&self.model, detector, None)?;
        Ok(self.engine.get_or_init(|| engine).with_detector(detector))
    }

    pub(crate) fn grid(&self) -> Grid {
        self.model.setup.grid()
    }

    /// Name of the kind of model.
    pub(crate) fn kind_name(&self) -> &'static str {
        self.kind.map_or("ideal", KernelModel::name)
    }
}

#[pymethods]
impl DisplayModel {
    /// A display without errors.
    #[staticmethod]
    fn ideal(py: Python<'_>, optics: &str) -> PyResult<Self> {
        let (setup, validity) = threads::compute(py, || Optics::parse(optics)?.convolution())??;
        let model = lightpath_optics::DisplayModel::ideal(setup);
        Ok(Self { model, kind: None, validity, note: None, engine: OnceLock::new() })
    }

    /// Reads the bytes of a kernel in any form. `optics` is for forms that do not name theirs.
    #[staticmethod]
    #[pyo3(signature = (content, optics=None))]
    fn decode(py: Python<'_>, content: &[u8], optics: Option<&str>) -> PyResult<Self> {
        Ok(threads::compute(py, || decoded(content, optics))??)
    }

    /// Bytes of the kernel in a form, and what the form does not hold.
    fn encode<'py>(&self, py: Python<'py>, file_format: &str) -> PyResult<(Bound<'py, PyBytes>, Vec<String>)> {
        let format = KernelFormat::parse(file_format).ok_or_else(|| {
            Refused::new("file_format", "INVALID_OPTION", format!("file_format \"{file_format}\" does not exist"))
        })?;
        // A display without errors is a smooth kernel whose errors are 0.
        let kind = self.kind.unwrap_or(KernelModel::Smooth);
        let exported = threads::compute(py, || kernel_formats::export(&self.model, kind, format))?;
        let exported = exported.map_err(Refused::from)?;
        Ok((PyBytes::new(py, &exported.bytes), exported.losses.iter().map(ToString::to_string).collect()))
    }

    /// Optics, kind, plan and note, as JSON.
    fn facts(&self) -> PyResult<String> {
        let setup = &self.model.setup;
        let facts = object!({
            "height_px": self.grid().height_px(),
            "width_px": self.grid().width_px(),
            "pixel_pitch_m": self.grid().pixel_pitch_m(),
            "wavelength_m": setup.wavelength_m(),
            "distance_m": setup.distance_m(),
            "kind": self.kind_name(),
            "plan": self.validity,
            "note": self.note,
        });
        Ok(json(&facts)?)
    }

    /// H at all bins of the padded spectrum, \[2 rows\]\[2 columns\], with the zero frequency at \[0\]\[0\].
    fn transfer_function<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<Complex32>>> {
        array(py, threads::compute(py, || transfer_function(&self.model))?)
    }

    /// The complex field in the image at the pixels' centres, for a phase \[rad\].
    fn field<'py>(
        &self,
        py: Python<'py>,
        phase: PyReadonlyArray2<'py, f32>,
    ) -> PyResult<Bound<'py, PyArray2<Complex32>>> {
        let phase = plane("phase", &phase)?;
        let field = threads::compute(py, || Ok::<_, Refused>(self.engine(Detector::Point)?.field(&phase)?))??;
        array(py, field)
    }

    /// Propagates a field behind the modulator to the image.
    fn propagate<'py>(
        &self,
        py: Python<'py>,
        field: PyReadonlyArray2<'py, Complex32>,
    ) -> PyResult<Bound<'py, PyArray2<Complex32>>> {
        let field = plane("field", &field)?;
        let image = threads::compute(py, || Ok::<_, Refused>(self.engine(Detector::Point)?.propagate(&field)?))??;
        array(py, image)
    }

    /// Quality for each detector of phases \[rad\] that are shown one after the other, and a second opinion on it, as
    /// JSON.
    fn quality<'py>(
        &self,
        py: Python<'py>,
        phases: PyReadonlyArray3<'py, f32>,
        target: PyReadonlyArray2<'py, f32>,
        region: Option<[usize; 4]>,
    ) -> PyResult<String> {
        let (phases, target) = (planes("phase", &phases)?, plane("target", &target)?);
        let work = || -> Result<_, Refused> {
            let region = optics::region(self.grid(), region)?;
            let shown = ShownLight::of_frames(&self.engine(Detector::Pixel)?, &phases)?;
            let (wanted, display) = ((&target, region), (&self.model, None));
            let opinion = SecondOpinion::of(display, &phases, &shown, Detector::Pixel, wanted.into(), Effort::CHEAP)?;
            json(&object!({ "quality": shown.quality((&target, region).into())?, "second_opinion": opinion }))
        };
        Ok(threads::compute(py, work)??)
    }

    /// The mean light that a detector measures of phases \[rad\] that are shown one after the other.
    fn light<'py>(
        &self,
        py: Python<'py>,
        phases: PyReadonlyArray3<'py, f32>,
        detector: &str,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let phases = planes("phase", &phases)?;
        let work = || -> Result<_, Refused> {
            let detector = serde_json::from_value(detector.into())?;
            Ok(light_of_frames(&self.engine(detector)?, &phases)?)
        };
        array(py, threads::compute(py, work)??)
    }
}

fn decoded(content: &[u8], optics: Option<&str>) -> Result<DisplayModel, Refused> {
    // Forms that name their optics are read with any setup.
    let setup = match optics {
        Some(optics) => Optics::parse(optics)?.convolution()?.0,
        None => OpticalSetup::try_new(Grid::try_new(2, 2, 8e-6)?, 515e-9, 1e-4)?,
    };
    let unknown = || {
        let message = "the file does not say for which optics it was made; give resolution, wavelength, pixel_pitch and \
                       distance";
        Refused::new("resolution", "OPTICS_UNKNOWN", message)
    };
    let budget = Budget::new(kernel_formats::importing_bytes(content));
    let imported = match kernel_formats::import(content, &setup, &budget) {
        // Such a file holds an array for the size of the display, which is not known here.
        Err(KernelFormatError::Array { .. }) if optics.is_none() => return Err(unknown()),
        Ok(file) if optics.is_none() && file.model.setup == setup => return Err(unknown()),
        imported => imported?,
    };
    let note = imported.note();
    let validity = lightpath_domain::planning::assessed(&imported.model.setup, "the kernel was learned with it");
    let validity = validity.through_kernel_of(&imported.model);
    Ok(DisplayModel { model: imported.model, kind: Some(imported.kind), validity, note, engine: OnceLock::new() })
}

fn transfer_function(model: &lightpath_optics::DisplayModel) -> Plane<Complex32> {
    let (height_px, width_px) = (model.setup.padded_height_px(), model.setup.padded_width_px());
    let (pitch_m, transfer) = (model.setup.grid().pixel_pitch_m(), model.sampled());
    let mut plane = Plane::filled(height_px, width_px, Complex32::ZERO);
    plane.values_mut().par_chunks_mut(width_px).enumerate().for_each(|(y, row)| {
        let fy = frequency(y, height_px, pitch_m);
        for (x, value) in row.iter_mut().enumerate() {
            let h = transfer(frequency(x, width_px, pitch_m), fy);
            *value = Complex32::new(h.re as f32, h.im as f32);
        }
    });
    plane
}
