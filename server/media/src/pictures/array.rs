//! Phases in NumPy's array files.

use super::{FILE_BYTES_MAX, PictureError};
use crate::npy;
use lightpath_optics::Plane;

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
    let array = npy::Array::open(bytes).map_err(refused)?;
    let of_value = match array.kind.as_str() {
        "<f4" => f32::from_le_bytes,
        ">f4" => f32::from_be_bytes,
        _ => return Err(refused(array.described())),
    };
    if array.shape != [height_px as u64, width_px as u64] || !array.is_c_order {
        return Err(refused(array.described()));
    }
    let values = array.values(height_px * width_px, of_value);
    let values = values.ok_or_else(|| refused(format!("{} that ends early", array.described())))?;
    if values.iter().any(|value| !value.is_finite()) {
        return Err(refused("an array with values that are not finite".to_owned()));
    }
    Plane::try_from_vec(height_px, width_px, values).map_err(|error| refused(error.to_string()))
}
