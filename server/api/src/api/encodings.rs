//! Enumerations that several messages use.

use super::error::ApiError;
use super::field::Field;
use lightpath_domain::dataset::{Encoding, Split};
use lightpath_domain::job::{Detector, Region};
use lightpath_domain::kernel::KernelModel;
use lightpath_media::kernel_formats::KernelFormat;
use lightpath_optics::{Grid, RegionOfInterest};
use lightpath_proto::v1;

pub(super) fn encoding(field: &Field, value: i32, default: Encoding) -> Result<Encoding, ApiError> {
    field.known(value, |value| match v1::Encoding::try_from(value).ok()? {
        v1::Encoding::Unspecified => Some(default),
        v1::Encoding::Linear => Some(Encoding::Linear),
        v1::Encoding::Srgb => Some(Encoding::Srgb),
    })
}

pub(super) fn encoding_to_wire(encoding: Encoding) -> i32 {
    match encoding {
        Encoding::Linear => v1::Encoding::Linear.into(),
        Encoding::Srgb => v1::Encoding::Srgb.into(),
    }
}

pub(super) fn split(field: &Field, value: i32) -> Result<Option<Split>, ApiError> {
    field.known(value, |value| match v1::Split::try_from(value).ok()? {
        v1::Split::Unspecified => Some(None),
        v1::Split::Train => Some(Some(Split::Train)),
        v1::Split::Validation => Some(Some(Split::Validation)),
        v1::Split::Test => Some(Some(Split::Test)),
        // What finalizing finds, nobody asks for.
        v1::Split::Excluded => None,
    })
}

pub(super) fn split_to_wire(split: Option<Split>) -> i32 {
    match split {
        None => v1::Split::Unspecified.into(),
        Some(Split::Train) => v1::Split::Train.into(),
        Some(Split::Validation) => v1::Split::Validation.into(),
        Some(Split::Test) => v1::Split::Test.into(),
    }
}

pub(super) fn detector(field: &Field, value: i32) -> Result<Detector, ApiError> {
    field.known(value, |value| match v1::Detector::try_from(value).ok()? {
        v1::Detector::Unspecified | v1::Detector::Pixel => Some(Detector::Pixel),
        v1::Detector::Point => Some(Detector::Point),
        v1::Detector::Supersampled => Some(Detector::Supersampled),
    })
}

pub(super) fn detector_to_wire(detector: Detector) -> i32 {
    match detector {
        Detector::Point => v1::Detector::Point.into(),
        Detector::Pixel => v1::Detector::Pixel.into(),
        Detector::Supersampled => v1::Detector::Supersampled.into(),
    }
}

pub(super) fn kernel_format(field: &Field, value: i32) -> Result<KernelFormat, ApiError> {
    field.known(value, |value| match v1::KernelFormat::try_from(value).ok()? {
        v1::KernelFormat::Unspecified | v1::KernelFormat::Safetensors => Some(KernelFormat::Safetensors),
        v1::KernelFormat::Compact => Some(KernelFormat::Compact),
        v1::KernelFormat::Pt => Some(KernelFormat::Pt),
        v1::KernelFormat::Npy => Some(KernelFormat::Npy),
        v1::KernelFormat::Npz => Some(KernelFormat::Npz),
        v1::KernelFormat::Complex64 => Some(KernelFormat::Complex64),
        v1::KernelFormat::F16 => Some(KernelFormat::F16),
    })
}

pub(super) fn kernel_format_to_wire(format: KernelFormat) -> i32 {
    let format = match format {
        KernelFormat::Safetensors => v1::KernelFormat::Safetensors,
        KernelFormat::Compact => v1::KernelFormat::Compact,
        KernelFormat::Pt => v1::KernelFormat::Pt,
        KernelFormat::Npy => v1::KernelFormat::Npy,
        KernelFormat::Npz => v1::KernelFormat::Npz,
        KernelFormat::Complex64 => v1::KernelFormat::Complex64,
        KernelFormat::F16 => v1::KernelFormat::F16,
    };
    format.into()
}

pub(super) fn model(field: &Field, value: i32) -> Result<KernelModel, ApiError> {
    field.known(value, |value| match v1::KernelModel::try_from(value).ok()? {
        v1::KernelModel::Unspecified | v1::KernelModel::Display => Some(KernelModel::Display),
        v1::KernelModel::Paper => Some(KernelModel::Paper),
        v1::KernelModel::Dense => Some(KernelModel::Dense),
        v1::KernelModel::Smooth => Some(KernelModel::Smooth),
        v1::KernelModel::Varying => Some(KernelModel::Varying),
    })
}

pub(super) fn model_to_wire(model: KernelModel) -> i32 {
    match model {
        KernelModel::Paper => v1::KernelModel::Paper.into(),
        KernelModel::Dense => v1::KernelModel::Dense.into(),
        KernelModel::Smooth => v1::KernelModel::Smooth.into(),
        KernelModel::Display => v1::KernelModel::Display.into(),
        KernelModel::Varying => v1::KernelModel::Varying.into(),
    }
}

/// A rectangle inside the display; unset, the middle 80 % of each axis.
pub(super) fn region(
    field: &Field,
    region: Option<v1::RegionOfInterest>,
    display: &lightpath_domain::display::Display,
) -> Result<Region, ApiError> {
    let (width_px, height_px) = (display.width_px, display.height_px);
    let Some(region) = region else {
        let grid = Grid::try_new(height_px as usize, width_px as usize, display.pixel_pitch_m);
        let middle = RegionOfInterest::middle(&grid.map_err(|error| field.invalid(error))?);
        return Ok(Region {
            x_px: middle.x_px() as u32,
            y_px: middle.y_px() as u32,
            width_px: middle.width_px() as u32,
            height_px: middle.height_px() as u32,
        });
    };
    let v1::RegionOfInterest { x_px, y_px, width_px: columns, height_px: rows } = region;
    let inside =
        |start: u32, length: u32, side: u32| length > 0 && start.checked_add(length).is_some_and(|end| end <= side);
    if !inside(x_px, columns, width_px) || !inside(y_px, rows, height_px) {
        let given = format!("is {columns}×{rows} px at ({x_px}, {y_px})");
        let display = format!("displays/{}, {width_px}×{height_px} px", display.id);
        return Err(field.invalid(format!("{given}, but must be at least 1×1 px and inside {display}")));
    }
    Ok(Region { x_px, y_px, width_px: columns, height_px: rows })
}

pub(super) fn region_to_wire(region: Region) -> v1::RegionOfInterest {
    let Region { x_px, y_px, width_px, height_px } = region;
    v1::RegionOfInterest { x_px, y_px, width_px, height_px }
}
