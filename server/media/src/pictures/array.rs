//! Phases in NumPy's array files.

use super::{FILE_BYTES_MAX, PictureError};
use crate::npy;
use lightpath_optics::Plane;
use npyz::{DType, NpyFile, Order};

/// Reads the phases \[rad\] in a .npy file: float32, C order, shape [`height_px`, `width_px`].
///
/// # Errors
///
/// [`PictureError::NotAnArray`] for a file of another kind or an array of another shape, and
/// [`PictureError::FileTooLarge`].
pub fn phase_npy(bytes: &[u8], height_px: usize, width_px: usize) -> Result<Plane<f32>, PictureError> {
    if bytes.len() > FILE_BYTES_MAX {
        return Err(PictureError::FileTooLarge { bytes: bytes.len() });
    }
    let refused = |actual: String| PictureError::NotAnArray { height_px, width_px, actual };
    npy::require_plain_header(bytes).map_err(refused)?;
    let file = NpyFile::new(bytes).map_err(|error| refused(format!("not a .npy file ({error})")))?;
    let actual = format!("{} of shape {:?}", file.dtype().descr(), file.shape());
    let is_f32 = matches!(file.dtype(), DType::Plain(kind) if kind.to_string().ends_with("f4"));
    if file.shape() != [height_px as u64, width_px as u64] || !is_f32 || file.order() != Order::C {
        return Err(refused(actual));
    }
    let values = file.into_vec::<f32>().map_err(|error| refused(format!("a damaged file ({error})")))?;
    if values.iter().any(|value| !value.is_finite()) {
        return Err(refused("an array with values that are not finite".to_owned()));
    }
    Plane::try_from_vec(height_px, width_px, values).map_err(|error| refused(error.to_string()))
}
