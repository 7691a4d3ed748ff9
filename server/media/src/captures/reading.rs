//! Reads the pairs of a dataset as phase and light for learning.
//!
//! ```text
//! photo(p) = min(t g) / (t g) · warp( (v / full scale − b) / (1 − b), H )(p)
//! ```
//!
//! p pixel of the display, v value of the camera, b its black level, t exposure time, g gain of the camera, H alignment
//! of the dataset. The factor makes photographs of different exposures comparable and keeps their light at or below 1.
//! Pixels that are saturated or outside the photograph get the value 1, and learning ignores them.

use crate::pictures::{self, Hologram, Photo, PhotoReading, PictureError, SATURATED, SATURATION};
use lightpath_camera::alignment::{AlignmentError, CameraMap, Homography, warp};
use lightpath_domain::dataset::{self, Dataset, Encoding, Pair};
use lightpath_domain::display::Display;
use lightpath_domain::planning;
use lightpath_domain::slm;
use lightpath_optics::display::phase_response::PhaseResponse;
use lightpath_optics::{Carrier, OpticalSetup, Plane};

/// Reason why a pair could not be read.
#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    /// A file is not a readable picture, or the picture is not the required one.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// The optics engine refused the display or the hologram.
    #[error(transparent)]
    Optics(#[from] lightpath_optics::Error),
    /// The alignment is impossible or could not be found.
    #[error(transparent)]
    Alignment(#[from] AlignmentError),
    /// The photograph has the wrong size.
    #[error(
        "the photograph has {actual_width_px}×{actual_height_px} px, but must have {width_px}×{height_px} px: {why}"
    )]
    Size {
        /// Required number of columns.
        width_px: usize,
        /// Required number of rows.
        height_px: usize,
        /// Actual number of columns.
        actual_width_px: usize,
        /// Actual number of rows.
        actual_height_px: usize,
        /// Reason for the required size, and what to do.
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
    map: CameraMap,
    /// The map as the dataset has it, bit by bit.
    stored: dataset::CameraMap,
    height_px: usize,
    width_px: usize,
}

impl Captures {
    /// Prepares the reading of a dataset's pairs.
    ///
    /// # Errors
    ///
    /// [`CaptureError`] for an impossible display or alignment. Stored ones are possible.
    pub fn of(display: &Display, dataset: &Dataset) -> Result<Self, CaptureError> {
        let alignment = match &dataset.alignment {
            None => None,
            Some(alignment) => {
                let [height_px, width_px] = [alignment.photo_height_px as usize, alignment.photo_width_px as usize];
                let display_px = [display.height_px as usize, display.width_px as usize];
                let homography = Homography::try_new(alignment.map.homography)?;
                let map = CameraMap::try_new(&homography, alignment.map.distortion, display_px, [height_px, width_px])?;
                Some(Alignment { map, stored: alignment.map, height_px, width_px })
            }
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

    /// Rows of the display \[px\].
    #[must_use]
    pub fn height_px(&self) -> usize {
        self.setup.grid().height_px()
    }

    /// Columns of the display \[px\].
    #[must_use]
    pub fn width_px(&self) -> usize {
        self.setup.grid().width_px()
    }

    /// Optical setup of the photographs.
    #[must_use]
    pub fn setup(&self) -> OpticalSetup {
        self.setup
    }

    /// Carrier of the display, if it has one.
    #[must_use]
    pub fn carrier(&self) -> Option<Carrier> {
        self.carrier
    }

    /// Map from pixels of the display to pixels of the photographs; `None`: they are the same.
    #[must_use]
    pub fn map(&self) -> Option<CameraMap> {
        self.alignment.map(|alignment| alignment.map)
    }

    /// The same map as the dataset has it.
    #[must_use]
    pub fn stored_map(&self) -> Option<dataset::CameraMap> {
        self.alignment.map(|alignment| alignment.stored)
    }

    /// Reads the phase \[rad\] of a hologram, without the carrier.
    ///
    /// # Errors
    ///
    /// [`CaptureError`] for a file that is no hologram or has another size than the display.
    pub fn phase(&self, file: &[u8]) -> Result<Plane<f32>, CaptureError> {
        let levels = match pictures::hologram(file, self.bit_depth, self.height_px(), self.width_px())? {
            Hologram::Phase(phase) => return Ok(phase),
            Hologram::Levels(levels) => levels,
        };
        let displayed = self.response.dequantize(&levels)?;
        Ok(match self.carrier {
            // The carrier is half a turn, so adding it a second time removes it.
            Some(carrier) => carrier.applied_to(&displayed),
            None => displayed,
        })
    }

    /// Reads a photograph, in its own size.
    ///
    /// # Errors
    ///
    /// [`CaptureError`] for a file that is no photograph.
    pub fn camera(&self, pair: &Pair, file: &[u8]) -> Result<Photo, CaptureError> {
        let reading = PhotoReading {
            encoding: self.encoding,
            bit_depth: self.photo_bit_depth,
            black_level: pair.exposure.black_level,
        };
        Ok(pictures::photo(file, &reading)?)
    }

    /// Reads the light of a photograph, mapped to the display's grid and scaled to the smallest exposure of the
    /// dataset. Pixels that learning must ignore are 1.
    ///
    /// # Errors
    ///
    /// [`CaptureError`] for a file that is no photograph or has the wrong size.
    pub fn photo(&self, pair: &Pair, file: &[u8]) -> Result<Plane<f32>, CaptureError> {
        let on_grid = self.on_grid(self.camera(pair, file)?.light)?;
        let scale = (self.sensitivity_min / pair.exposure.sensitivity()) as f32;
        if !scale.is_finite() || scale >= 1.0 {
            return Ok(on_grid);
        }
        Ok(on_grid.map(|light| if light >= SATURATION { SATURATED } else { scale * light }))
    }

    /// Maps the light of a photograph to the display's grid.
    ///
    /// # Errors
    ///
    /// [`CaptureError::Size`] for a photograph of the wrong size.
    pub fn on_grid(&self, light: Plane<f32>) -> Result<Plane<f32>, CaptureError> {
        let (height_px, width_px) = (self.height_px(), self.width_px());
        let actual = (light.height_px(), light.width_px());
        let Some(alignment) = self.alignment else {
            if actual == (height_px, width_px) {
                return Ok(light);
            }
            let why = "without an alignment, each camera pixel is one pixel of the display; to use other sizes, align \
                       the dataset first (lightpath dataset align --help)";
            return Err(size_error((height_px, width_px), actual, why));
        };
        if actual != (alignment.height_px, alignment.width_px) {
            let expected = (alignment.height_px, alignment.width_px);
            return Err(size_error(expected, actual, "the dataset was aligned with photographs of this size"));
        }
        Ok(warp(&light, &alignment.map, height_px, width_px, SATURATION, SATURATED))
    }
}

pub(super) fn size_error(expected: (usize, usize), actual: (usize, usize), why: &'static str) -> CaptureError {
    CaptureError::Size {
        width_px: expected.1,
        height_px: expected.0,
        actual_width_px: actual.1,
        actual_height_px: actual.0,
        why,
    }
}
