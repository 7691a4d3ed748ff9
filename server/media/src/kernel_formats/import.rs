//! Import of a kernel in any form.

use super::array::{self, Array};
use super::dense::of_array;
use super::error::KernelFormatError;
use super::imported::Imported;
use super::{archive, compact, npz, torch};
use crate::kernel_file;
use crate::npy;
use lightpath_optics::OpticalSetup;

/// Reads a kernel in any form. Forms that do not name their optics are read as kernels for `setup`.
///
/// # Errors
///
/// [`KernelFormatError`] for a file that is damaged, of an unknown form, or not a possible kernel.
pub fn import(bytes: &[u8], setup: &OpticalSetup) -> Result<Imported, KernelFormatError> {
    if compact::is_compact(bytes) {
        let (model, kind) = compact::decode(bytes)?;
        return Ok(Imported { kind, ..Imported::new("compact", model) });
    }
    if npy::is_npy(bytes) {
        return of_array(&Array::read_npy("the array", bytes)?, setup, "npy");
    }
    if archive::is_archive(bytes) {
        let files = archive::read(bytes)?;
        if files.iter().any(|(name, _)| name.ends_with(".npy")) {
            return npz::read(&files, setup);
        }
        return of_array(&torch::read(&files)?, setup, "pt");
    }
    // Safetensors start with the length of a JSON header, whose first byte may equal the first byte of a pickle.
    let is_safetensors = bytes.get(8) == Some(&b'{');
    if bytes.first() == Some(&0x80) && !is_safetensors {
        let message =
            "it is a bare pickle of PyTorch before 1.6; load it with torch.load and save it again with torch.save";
        return Err(KernelFormatError::Archive(message.to_owned()));
    }
    if !is_safetensors {
        let start = bytes[..bytes.len().min(8)].escape_ascii().to_string();
        return Err(KernelFormatError::Unknown { start });
    }
    match kernel_file::decode(bytes) {
        Ok((model, kind)) => {
            let origin = kernel_file::origin(bytes)?;
            Ok(Imported { kind, origin, native: true, ..Imported::new("safetensors", model) })
        }
        Err(kernel_file::KernelFileError::NoHeader) => of_foreign_safetensors(bytes, setup),
        Err(error) => Err(error.into()),
    }
}

/// Reads foreign safetensors: one tensor, which is the kernel.
fn of_foreign_safetensors(bytes: &[u8], setup: &OpticalSetup) -> Result<Imported, KernelFormatError> {
    let damaged = |error: safetensors::SafeTensorError| KernelFormatError::Native(error.into());
    let tensors = safetensors::SafeTensors::deserialize(bytes).map_err(damaged)?;
    let names = tensors.names();
    let [name] = names[..] else {
        return Err(KernelFormatError::Array {
            name: "the safetensors file".to_owned(),
            actual: format!("a set of {} tensors without Lightpath's metadata", names.len()),
            expected: "a Lightpath kernel, or a single tensor that is the kernel".to_owned(),
        });
    };
    let tensor = tensors.tensor(name).map_err(damaged)?;
    let kind = match tensor.dtype() {
        safetensors::Dtype::F16 => array::Kind::F16,
        safetensors::Dtype::F32 => array::Kind::F32,
        safetensors::Dtype::F64 => array::Kind::F64,
        safetensors::Dtype::C64 => array::Kind::C64,
        other => {
            return Err(KernelFormatError::Array {
                name: format!("tensor `{name}`"),
                actual: format!("{other:?}"),
                expected: "F16, F32, F64 or C64".to_owned(),
            });
        }
    };
    of_array(
        &Array::new(&format!("tensor `{name}`"), tensor.shape().to_vec(), kind, tensor.data())?,
        setup,
        "safetensors",
    )
}
