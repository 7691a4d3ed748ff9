//! Import of a kernel in any form.

use super::archive::Archive;
use super::array::{self, Array};
use super::dense::of_array;
use super::error::KernelFormatError;
use super::imported::Imported;
use super::{archive, compact, npz, torch};
use crate::budget::Budget;
use crate::kernel_file;
use crate::npy;
use crate::shortened::shortened;
use lightpath_domain::kernel_format::KernelFormat;
use lightpath_optics::OpticalSetup;

/// Memory that reading a kernel file may take \[bytes\], and also writing its kernel in the native form afterwards: the
/// file as it is unpacked, the numbers of one array, the model, and its file with a copy of the numbers. Those of 16-bit
/// files take twice the space. Of an archive, the directory says the size; other files are as large as they are.
#[must_use]
pub fn importing_bytes(bytes: &[u8]) -> u64 {
    let unpacked = archive::is_archive(bytes).then(|| Archive::open(bytes).ok()).flatten();
    let unpacked_bytes = unpacked.map_or(0, |archive| archive.unpacked_bytes());
    kernel_file::decoding_bytes(unpacked_bytes.max(bytes.len() as u64))
}

/// Reads a kernel in any form. Forms that do not name their optics are read as kernels for `setup`. Reading takes no more
/// memory than `budget` has; [`importing_bytes`] suffices for every kernel.
///
/// # Errors
///
/// [`KernelFormatError`] for a file that is damaged, of an unknown form, beyond the budget, or not a possible kernel.
pub fn import(bytes: &[u8], setup: &OpticalSetup, budget: &Budget) -> Result<Imported, KernelFormatError> {
    if compact::is_compact(bytes) {
        let (model, kind) = compact::decode(bytes)?;
        return Ok(Imported { kind, ..Imported::new(KernelFormat::Compact, model) });
    }
    if npy::is_npy(bytes) {
        let array = Array::read_npy("the array", bytes, budget)?;
        return of_array(&array, setup, form_of(&array), budget);
    }
    if archive::is_archive(bytes) {
        let archive = Archive::open(bytes)?;
        if archive.names().any(|name| name.ends_with(".npy")) {
            return npz::read(&archive, setup, budget);
        }
        return of_array(&torch::read(&archive, budget)?, setup, KernelFormat::Pt, budget);
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
    match kernel_file::decode_within(bytes, budget) {
        Ok((model, kind, origin)) => {
            let form = if origin.record.is_some() { KernelFormat::Bundle } else { KernelFormat::Safetensors };
            Ok(Imported { kind, origin, native: true, ..Imported::new(form, model) })
        }
        Err(kernel_file::KernelFileError::NoHeader) => of_foreign_safetensors(bytes, setup, budget),
        Err(error) => Err(error.into()),
    }
}

/// The form of a `.npy` file.
fn form_of(array: &Array<'_>) -> KernelFormat {
    match (array.complex, &array.shape[..]) {
        (true, _) => KernelFormat::Complex64,
        (false, &[_, _, 2]) => KernelFormat::F16,
        (false, _) => KernelFormat::Npy,
    }
}

/// Reads foreign safetensors: one tensor, which is the kernel.
fn of_foreign_safetensors(bytes: &[u8], setup: &OpticalSetup, budget: &Budget) -> Result<Imported, KernelFormatError> {
    let damaged = |error: safetensors::SafeTensorError| KernelFormatError::Native(error.into());
    let tensors = kernel_file::tensors(bytes)?;
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
                name: format!("tensor `{}`", shortened(name)),
                actual: format!("{other:?}"),
                expected: "F16, F32, F64 or C64".to_owned(),
            });
        }
    };
    let name = format!("tensor `{}`", shortened(name));
    let array = Array::new(&name, tensor.shape().to_vec(), kind, tensor.data(), budget)?;
    of_array(&array, setup, KernelFormat::Safetensors, budget)
}
