//! Reading planes from NumPy files.

use lightpath_optics::Plane;
use std::error::Error;
use std::fs::File;
use std::io::BufReader;

/// Reads an array of f32 of the shape `[height, width]`.
///
/// # Errors
///
/// The file is missing, or is no such array.
pub(crate) fn read(path: &str) -> Result<Plane<f32>, Box<dyn Error>> {
    let file = npyz::NpyFile::new(BufReader::new(File::open(path).map_err(|error| format!("{path}: {error}"))?))?;
    let &[height, width] = file.shape() else {
        return Err(format!("{path} must have the shape [height, width]").into());
    };
    let (height_px, width_px) = (usize::try_from(height)?, usize::try_from(width)?);
    Ok(Plane::try_from_vec(height_px, width_px, file.into_vec::<f32>()?)?)
}
