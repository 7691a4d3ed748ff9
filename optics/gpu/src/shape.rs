//! Sizes of a problem, and the shaders that follow from them.

use crate::shaders::columns::Columns;
use crate::shaders::image_rows::ImageRows;
use crate::shaders::layout::Layout;
use crate::shaders::pixels::{self, AxisBlur};
use lightpath_optics::Detector;
use lightpath_optics::engine::photometry::Quantity;
use lightpath_optics::hologram::ProblemSize;

/// A field: a picture, a mode of its display's light, and a frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sent {
    pub(crate) picture: usize,
    pub(crate) mode: usize,
    pub(crate) frame: usize,
}

/// What the shaders of a problem depend on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Shape {
    pub(crate) size: ProblemSize,
    pub(crate) layout: Layout,
    pub(crate) detector: Detector,
    /// Numbers of places in a pixel along x and along y.
    pub(crate) places: [usize; 2],
    pub(crate) quantity: Quantity,
}

impl Shape {
    /// Number of light planes that are compared.
    pub(crate) fn light_planes(&self) -> usize {
        match self.detector {
            Detector::Point | Detector::Pixel => 1,
            Detector::Supersampled => self.places[0] * self.places[1],
        }
    }

    /// Number of values of a picture's light.
    pub(crate) fn light_len(&self) -> usize {
        self.light_planes() * self.size.frame_len()
    }

    /// First value of a half-transformed field behind others.
    pub(crate) fn lane(&self, lane: usize) -> u32 {
        (lane * self.layout.lane_len()) as u32
    }

    /// First pixel of a frame.
    pub(crate) fn frame(&self, frame: usize) -> u32 {
        (frame * self.size.frame_len()) as u32
    }

    /// The fields of a picture.
    pub(crate) fn fields_of(&self, picture: usize, modes: usize) -> impl Iterator<Item = Sent> + use<> {
        let frames = self.size.frames;
        (0..modes).flat_map(move |mode| (0..frames).map(move |frame| Sent { picture, mode, frame }))
    }

    pub(crate) fn image_rows(&self) -> ImageRows {
        ImageRows {
            layout: self.layout.clone(),
            places: self.places,
            apart: self.detector == Detector::Supersampled,
            compares_amplitudes: self.quantity == Quantity::Amplitude,
        }
    }

    pub(crate) fn columns(&self, windowed: bool) -> Columns {
        Columns { layout: self.layout.clone(), places: self.places[1], windowed }
    }

    /// A blur along x of planes of pixels.
    pub(crate) fn blur(&self, planes: usize, taps: usize) -> AxisBlur {
        let (height_px, width_px) = (self.size.height_px, self.size.width_px);
        AxisBlur { height_px, width_px, planes, taps, along_y: false }
    }

    /// Workgroups of a pass over planes of pixels.
    pub(crate) fn pixel_groups(&self, planes: usize) -> [usize; 2] {
        [pixels::groups(self.size.width_px), planes * self.size.height_px]
    }
}
