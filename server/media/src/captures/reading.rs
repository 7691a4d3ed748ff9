//! A dataset's pairs as learning sees them.
//!
//! ```text
//! photo(p) = min(t g) / (t g) · warp( (v / full scale − b) / (1 − b), H )(p)
//! ```
//!
//! v the camera's values, b its black level, t exposure, g amplification, H the dataset's alignment: photographs of
//! different exposures become comparable, and none of them exceeds 1. What the camera saturated, or does not show, is 1, and
//! so left out of learning.

use crate::npy;
use crate::pictures::{self, PhotoReading, PictureError, SATURATED};
use lightpath_domain::dataset::{Dataset, Encoding, Pair};
use lightpath_domain::display::Display;
use lightpath_domain::planning;
use lightpath_domain::slm;
use lightpath_optics::alignment::{AlignmentError, Homography, warp};
use lightpath_optics::phase_response::PhaseResponse;
use lightpath_optics::{Carrier, OpticalSetup, Plane};

/// Light at or above this is saturated: unsaturated light ends below it.
pub(super) const LEFT_OUT: f32 = pictures::SATURATION;

/// Why a pair could not be read.
#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    /// A file is no picture, or not the right one.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// The display's optics are not possible.
    #[error(transparent)]
    Optics(#[from] lightpath_optics::Error),
    /// The alignment is not possible.
    #[error(transparent)]
    Alignment(#[from] AlignmentError),
    /// Another size than the display or the dataset's other photographs have.
    #[error(
        "the photograph has {actual_width_px}×{actual_height_px} px, but must have {width_px}×{height_px} px: {why}"
    )]
    Size {
        /// Columns it should have.
        width_px: usize,
        /// Rows it should have.
        height_px: usize,
        /// Columns it has.
        actual_width_px: usize,
        /// Rows it has.
        actual_height_px: usize,
        /// Why, and what to do.
        why: &'static str,
    },
}

/// Reads the pairs of one dataset.
#[derive(Clone, Debug)]
pub struct Captures {
    setup: OpticalSetup,
    response: PhaseResponse,
    carrier: Option<Carrier>,
    bit_depth: u32,
    encoding: Encoding,
    photo_bit_depth: u32,
    alignment: Option<Alignment>,
    sensitivity_min: f64,
}

#[derive(Clone, Copy, Debug)]
struct Alignment {
    homography: Homography,
    height_px: usize,
    width_px: usize,
}

impl Captures {
    /// # Errors
    ///
    /// [`CaptureError`] for a display or an alignment that is not possible; stored ones are.
    pub fn of(display: &Display, dataset: &Dataset) -> Result<Self, CaptureError> {
        let alignment = match &dataset.alignment {
            None => None,
            Some(alignment) => Some(Alignment {
                homography: Homography::try_new(alignment.homography)?,
                height_px: alignment.photo_height_px as usize,
                width_px: alignment.photo_width_px as usize,
            }),
        };
        let sensitivities = dataset.pairs.iter().map(|pair| pair.exposure.sensitivity());
        let sensitivity_min = sensitivities.fold(f64::INFINITY, f64::min);
        Ok(Self {
            setup: planning::setup(display, dataset.wavelength, dataset.distance)?,
            response: slm::response(display)?,
            carrier: display.carrier,
            bit_depth: display.bit_depth,
            encoding: dataset.photo_encoding,
            photo_bit_depth: dataset.photo_bit_depth,
            alignment,
            sensitivity_min,
        })
    }

    /// Rows \[px\].
    #[must_use]
    pub fn height_px(&self) -> usize {
        self.setup.grid().height_px()
    }

    /// Columns \[px\].
    #[must_use]
    pub fn width_px(&self) -> usize {
        self.setup.grid().width_px()
    }

    /// What the photographs were taken behind.
    #[must_use]
    pub fn setup(&self) -> OpticalSetup {
        self.setup
    }

    /// The display's grating.
    #[must_use]
    pub fn carrier(&self) -> Option<Carrier> {
        self.carrier
    }

    /// From the display's pixels to the photographs'.
    #[must_use]
    pub fn homography(&self) -> Option<Homography> {
        self.alignment.map(|alignment| alignment.homography)
    }

    /// The same with another alignment of the same photographs.
    #[must_use]
    pub fn realigned(&self, homography: Homography, height_px: usize, width_px: usize) -> Self {
        Self { alignment: Some(Alignment { homography, height_px, width_px }), ..self.clone() }
    }

    /// A hologram's phase \[rad\] before the carrier, from a grey PNG of levels (carrier included, as displayed), or from a
    /// `.npy` file of radians without it.
    ///
    /// # Errors
    ///
    /// [`CaptureError`] for another size, or what is no hologram.
    pub fn phase(&self, file: &[u8]) -> Result<Plane<f32>, CaptureError> {
        if npy::is_npy(file) {
            return Ok(pictures::phase_npy(file, self.height_px(), self.width_px())?);
        }
        let levels = pictures::levels(file, self.bit_depth, self.height_px(), self.width_px())?;
        let displayed = self.response.dequantize(&levels)?;
        Ok(match self.carrier {
            // Adding half a turn twice takes it away.
            Some(carrier) => carrier.applied_to(&displayed),
            None => displayed,
        })
    }

    /// The light that the camera saw, in the photograph's own size.
    ///
    /// # Errors
    ///
    /// [`CaptureError`] for what is no photograph.
    pub fn camera(&self, pair: &Pair, file: &[u8]) -> Result<Plane<f32>, CaptureError> {
        let reading = PhotoReading {
            encoding: self.encoding,
            bit_depth: self.photo_bit_depth,
            black_level: pair.exposure.black_level,
        };
        Ok(pictures::photo_light(file, &reading)?)
    }

    /// The photograph on the display's grid, exposures made equal; 1 where it does not count.
    ///
    /// # Errors
    ///
    /// [`CaptureError`] for what is no photograph, or one of another size.
    pub fn photo(&self, pair: &Pair, file: &[u8]) -> Result<Plane<f32>, CaptureError> {
        let on_grid = self.on_grid(self.camera(pair, file)?)?;
        let scale = (self.sensitivity_min / pair.exposure.sensitivity()) as f32;
        if !scale.is_finite() || scale >= 1.0 {
            return Ok(on_grid);
        }
        Ok(on_grid.map(|light| if light >= LEFT_OUT { SATURATED } else { scale * light }))
    }

    /// A photograph's light, brought to the display's grid.
    ///
    /// # Errors
    ///
    /// [`CaptureError::Size`].
    pub fn on_grid(&self, light: Plane<f32>) -> Result<Plane<f32>, CaptureError> {
        let (height_px, width_px) = (self.height_px(), self.width_px());
        let actual = (light.height_px(), light.width_px());
        let Some(alignment) = self.alignment else {
            if actual == (height_px, width_px) {
                return Ok(light);
            }
            let why = "one camera pixel stands for one of the display until the dataset is aligned \
                       (lightpath dataset align --help)";
            return Err(size_error((height_px, width_px), actual, why));
        };
        if actual != (alignment.height_px, alignment.width_px) {
            let expected = (alignment.height_px, alignment.width_px);
            return Err(size_error(expected, actual, "the dataset was aligned with photographs of that size"));
        }
        Ok(warp(&light, &alignment.homography, height_px, width_px, LEFT_OUT, SATURATED))
    }
}

fn size_error(expected: (usize, usize), actual: (usize, usize), why: &'static str) -> CaptureError {
    CaptureError::Size {
        width_px: expected.1,
        height_px: expected.0,
        actual_width_px: actual.1,
        actual_height_px: actual.0,
        why,
    }
}
