//! Import of a kernel in any form.

use super::array::{self, Array};
use super::error::KernelFormatError;
use super::losses::Loss;
use super::{archive, compact, npz, torch};
use crate::kernel_file::{self, Origin};
use crate::npy;
use lightpath_optics::KernelModel;
use lightpath_optics::{DisplayModel, KernelShape, OpticalSetup, Plane};
use num_complex::Complex32;

/// An imported kernel.
#[derive(Clone, Debug, PartialEq)]
pub struct Imported {
    /// The display model.
    pub model: DisplayModel,
    /// Parametrization of the model.
    pub kind: KernelModel,
    /// Name of the file's form, for people and for the lineage.
    pub form: &'static str,
    /// Where the kernel comes from, as far as the file says it.
    pub origin: Origin,
    /// Whether the file is in the native form already.
    pub native: bool,
    /// What the file did not hold, and the model is without.
    pub absent: Vec<Loss>,
    /// What a person should know about the import; empty for most files.
    pub remarks: Vec<&'static str>,
}

impl Imported {
    /// A display model from a file that held all of it.
    pub(super) fn new(form: &'static str, model: DisplayModel) -> Self {
        Self {
            model,
            kind: KernelModel::Smooth,
            form,
            origin: Origin::default(),
            native: false,
            absent: Vec::new(),
            remarks: Vec::new(),
        }
    }

    /// What the file did not hold and what else a person should know, as one sentence; `None` for a file that held a
    /// whole model.
    #[must_use]
    pub fn note(&self) -> Option<String> {
        let absent: Vec<String> = self.absent.iter().map(Loss::to_string).collect();
        let absent = (!absent.is_empty())
            .then(|| format!("the file does not hold {}; the version is without them", absent.join(", ")));
        let parts: Vec<String> = self.remarks.iter().map(|&remark| remark.to_owned()).chain(absent).collect();
        (!parts.is_empty()).then(|| parts.join("; "))
    }
}

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

/// Reads H from an array: complex \[rows, columns\], real and imaginary parts \[rows, columns, 2\], or the paper's
/// amplitude and phase \[1, 2, rows, columns\] or \[2, rows, columns\].
pub(super) fn of_array(array: &Array, setup: &OpticalSetup, form: &'static str) -> Result<Imported, KernelFormatError> {
    let numbers = &array.numbers;
    let (rows, columns, values): (usize, usize, Vec<Complex32>) = match (array.complex, &array.shape[..]) {
        (true, &[rows, columns]) => (rows, columns, parts(numbers)),
        (false, &[rows, columns, 2]) => (rows, columns, parts(numbers)),
        (false, &[1, 2, rows, columns] | &[2, rows, columns]) => {
            let (amplitude, phase) = numbers.split_at(rows * columns);
            let polar = |(&a, &p): (&f32, &f32)| {
                let (sine, cosine) = f64::from(p).sin_cos();
                Complex32::new((f64::from(a) * cosine) as f32, (f64::from(a) * sine) as f32)
            };
            (rows, columns, amplitude.iter().zip(phase).map(polar).collect())
        }
        _ => {
            return Err(KernelFormatError::Array {
                name: array.name.clone(),
                actual: array.described(),
                expected: "real of shape [1, 2, rows, columns] (amplitude and phase), real of shape [rows, columns, \
                           2], or complex of shape [rows, columns]"
                    .to_owned(),
            });
        }
    };
    let grid = setup.grid();
    let is = |factor: usize| (rows, columns) == (factor * grid.height_px(), factor * grid.width_px());
    if !is(1) && !is(2) {
        let (height, width) = (grid.height_px(), grid.width_px());
        return Err(KernelFormatError::Array {
            name: array.name.clone(),
            actual: format!("{rows}×{columns} (rows × columns)"),
            expected: format!(
                "{height}×{width} (the display's) or {}×{} (the padded spectrum's)",
                2 * height,
                2 * width
            ),
        });
    }
    let kind = if is(1) { KernelModel::Paper } else { KernelModel::Dense };
    let kernel = KernelShape::Bins(Plane::try_from_vec(rows, columns, values)?);
    let model = DisplayModel { kernel, ..DisplayModel::ideal(*setup) };
    model.validate()?;
    let whole = [
        Loss::Source,
        Loss::Dust,
        Loss::Coherence,
        Loss::PhaseResponse,
        Loss::ResponseVariation,
        Loss::Crosstalk,
        Loss::LightBlur,
        Loss::ZeroOrder,
        Loss::GainAndOffset,
        Loss::Variation,
    ];
    let outer = (kind == KernelModel::Paper).then_some(Loss::OuterSpectrum);
    Ok(Imported { kind, absent: whole.into_iter().chain(outer).collect(), ..Imported::new(form, model) })
}

fn parts(numbers: &[f32]) -> Vec<Complex32> {
    numbers.as_chunks().0.iter().map(|&[re, im]| Complex32::new(re, im)).collect()
}
