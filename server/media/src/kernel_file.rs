//! The native form of a kernel: a learned display model as a safetensors file.
//!
//! Each part of a display says itself which entries and tensors it has (`optics/src/display/parts/`); the tables below
//! list all of them.
//!
//! The file's metadata has one entry, `lightpath`, whose value is a JSON object. It has only one entry, because
//! safetensors keeps several entries in no particular order, and equal kernels must have equal bytes. The keys of the
//! object:
//!
//! | key | meaning |
//! |---|---|
//! | `format`, `format_version` | `lightpath-kernel`, 1 |
//! | `model` | `paper`, `dense`, `smooth`, `display` or `varying` |
//! | `height_px`, `width_px`, `pixel_pitch_m`, `wavelength_m`, `distance_m` | the optical setup of the kernel |
//! | `kernel_order`, `source_order` | highest total degrees of the Chebyshev series |
//! | `beyond_order` | highest total degree of the errors beyond the band, on a display that shows all orders; missing: 0 |
//! | `variation_order` | highest total degree of the kernel's variation over the SLM; missing: 0 |
//! | `response_variation_order` | highest total degree of the response's variation over the SLM; missing: the response is the same everywhere |
//! | `has_crosstalk` | whether neighbouring pixels have cross-talk; missing: no |
//! | `has_light_blur` | whether the light blurs; missing: no |
//! | `has_ghost` | whether the kernel has a ghost; missing: no |
//! | `mode_orders` | highest total degree of each further mode's transfer function relative to the kernel; missing: the light is coherent |
//! | `has_dust` | whether there is dust in the light on the SLM; missing: no |
//! | `propagation` | the method of H_ideal; missing: `band_limited` |
//! | `orders` | `first`, `filtered` with the filter, or `all` with the fill factors of the pixels: the diffraction orders with which the kernel was learned; missing: `first` |
//! | `display` | id of the display; missing: unknown |
//! | `record` | number, measurements and lineage of the version (`server/api`, only in bundles) |
//! | `interpolated_from_m` | photographed distances \[m\], ascending, that an interpolated kernel was made from; missing: the kernel was not interpolated |
//!
//! | tensor | type, shape | meaning |
//! |---|---|---|
//! | `kernel.log_amplitude`, `kernel.phase` | f64, \[terms\] | α and ψ of H = H_ideal · exp(α + iψ) (`smooth`, `display`, `varying`); of a display that shows all orders, f is the frequency of the light, limited to the band of the first order |
//! | `beyond.log_amplitude`, `beyond.phase` | f64, \[terms\] | the errors beyond the band, series of what a frequency exceeds it by (`smooth`, `display` and `varying` of all orders) |
//! | `variation.log_amplitude`, `variation.phase` | f64, \[5, terms\] | α_m and ψ_m, factors of x, y, x², xy and y² (`varying`) |
//! | `kernel.bins` | f32, \[rows, columns, 2\] | H, real and imaginary, zero frequency in the middle (`paper`, `dense`) |
//! | `source.log_amplitude`, `source.phase` | f64, \[terms\] | the source profile (`display`, `varying`) |
//! | `response` | f64, \[harmonics, 2\] | r(ψ) = (1 + v) ψ + Σ a_k sin kψ + b_k cos kψ \[rad\] (`display`, `varying`) |
//! | `response_variation` | f64, \[1 + terms\] | v: its constant, then its series (where the response varies) |
//! | `crosstalk` | f64, \[2\] | q along x and along y (with cross-talk) |
//! | `light_blur` | f64, \[2\] | q of the blur of the light along x and along y (with such a blur) |
//! | `ghost` | f64, \[5\] | real and imaginary part of the amplitude, shift along x and y \[px\], defocus \[rad\] (with a ghost) |
//! | `mode.light` | f64, \[modes\] | light of each further mode relative to the first one (partially coherent light) |
//! | `mode.log_amplitude`, `mode.phase` | f64, \[terms of all modes\] | α_m and ψ_m of each further mode's transfer function H · exp(α_m + iψ_m), mode after mode (partially coherent light) |
//! | `dust` | i16, \[rows, columns, 2\] | A and B of each pixel's factor exp(10⁻⁴ (A + iB)) of the source (with dust) |
//! | `photometry` | f64, \[4\] | gain, offset, zero order (real, imaginary) |
//!
//! Coefficients are in the order of `lightpath_optics::numerics::chebyshev::ChebyshevBasis::degrees`.

mod header;
mod small_json;

pub(crate) use header::Header;

use crate::budget::{Budget, OverBudget};
use crate::shortened::shortened;
use lightpath_optics::display::parts::stored::{Entry, Numbers, Stored, StoredArray, StoredError, StoredParts};
use lightpath_optics::{DisplayModel, KernelModel, Plane};
use num_complex::Complex32;
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensorError, SafeTensors};
use serde_json::Value;
use std::collections::HashMap;

pub(crate) const METADATA_KEY: &str = "lightpath";
const FORMAT: &str = "lightpath-kernel";
const FORMAT_VERSION: u32 = 1;
/// Largest header of a safetensors file, and largest metadata \[bytes\]. Those of a kernel have some kilobytes with the
/// record of its version.
const HEADER_BYTES_MAX: usize = 1 << 20;
/// Memory for headers and metadata within these limits \[bytes\].
const OTHER_BYTES: u64 = 16 << 20;
/// Files, arrays and models of a kernel that are in memory at once, in sizes of its file.
const COPIES: u64 = 8;

/// Reason why a kernel file could not be read or written; the messages say what each means.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum KernelFileError {
    #[error("the safetensors file is damaged or incomplete: {}", shortened(.0))]
    Safetensors(#[from] SafeTensorError),
    #[error("the file has no metadata entry `lightpath`: it is safetensors, but not a Lightpath kernel")]
    NoHeader,
    #[error("the header of the safetensors file has {bytes} bytes, but at most {HEADER_BYTES_MAX} are read")]
    LargeHeader { bytes: u64 },
    #[error("the header of the safetensors file is invalid: {}", shortened(.0))]
    Tensors(serde_json::Error),
    #[error("the metadata entry `lightpath` has {bytes} bytes, but at most {HEADER_BYTES_MAX} are read")]
    LargeMetadata { bytes: usize },
    #[error("the metadata entry `lightpath` is invalid: {}", shortened(.0))]
    Header(#[from] serde_json::Error),
    #[error("the file is {format} version {version}; this server reads {FORMAT} version {FORMAT_VERSION}")]
    Format { format: String, version: u32 },
    #[error(transparent)]
    Memory(#[from] OverBudget),
    /// An entry of the header or a tensor is not as the format has it.
    #[error(transparent)]
    Stored(#[from] StoredError),
    /// The numbers do not describe a possible display.
    #[error("the kernel is impossible: {0}")]
    Model(#[from] lightpath_optics::Error),
}

/// Encodes a kernel. The same model gives the same bytes.
///
/// # Errors
///
/// [`KernelFileError::Safetensors`] when the model is too large for the format.
pub fn encode(model: &DisplayModel, kind: KernelModel) -> Result<Vec<u8>, KernelFileError> {
    encode_with(model, kind, &Origin::default())
}

/// Where a kernel comes from, besides its model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Origin {
    /// Id of the display; `None`: unknown.
    pub display: Option<String>,
    /// Photographed distances \[m\] between which the kernel was interpolated, ascending. Empty: it was not.
    pub interpolated_from_m: Vec<f64>,
    /// What a server knew of the version, in bundles.
    pub record: Option<Value>,
}

/// [`encode`] with the origin of the kernel.
pub fn encode_with(model: &DisplayModel, kind: KernelModel, origin: &Origin) -> Result<Vec<u8>, KernelFileError> {
    let stored = Stored::of(model);
    let metadata = HashMap::from([(METADATA_KEY.to_owned(), header_text(model, kind, &stored, origin)?)]);
    let tensor = |StoredArray { name, shape, numbers }| (name, shape, dtype(&numbers), bytes(&numbers));
    let tensors: Vec<_> = stored.into_arrays().into_iter().map(tensor).collect();
    let views = tensors
        .iter()
        .map(|(name, shape, dtype, bytes)| Ok((*name, TensorView::new(*dtype, shape.clone(), bytes)?)))
        .collect::<Result<Vec<_>, SafeTensorError>>()?;
    Ok(safetensors::serialize(views, Some(metadata))?)
}

fn dtype(numbers: &Numbers) -> Dtype {
    match numbers {
        Numbers::F64(_) => Dtype::F64,
        Numbers::F32(_) => Dtype::F32,
        Numbers::I16(_) => Dtype::I16,
    }
}

/// The numbers, little-endian.
pub(crate) fn bytes(numbers: &Numbers) -> Vec<u8> {
    match numbers {
        Numbers::F64(numbers) => numbers.iter().flat_map(|number| number.to_le_bytes()).collect(),
        Numbers::F32(numbers) => numbers.iter().flat_map(|number| number.to_le_bytes()).collect(),
        Numbers::I16(numbers) => numbers.iter().flat_map(|number| number.to_le_bytes()).collect(),
    }
}

/// The metadata of a kernel, as JSON.
pub(crate) fn header_text(
    model: &DisplayModel,
    kind: KernelModel,
    stored: &Stored,
    origin: &Origin,
) -> Result<String, KernelFileError> {
    Ok(serde_json::to_string(&Header::of(model, kind, stored, origin))?)
}

/// Memory that reading a kernel file of `file_bytes` may take, and also writing its kernel again afterwards \[bytes\].
#[must_use]
pub fn decoding_bytes(file_bytes: u64) -> u64 {
    COPIES.saturating_mul(file_bytes).saturating_add(OTHER_BYTES)
}

/// Reads a kernel file and checks that it describes a possible display. Returns the model and its parametrization. Takes no
/// more memory than [`decoding_bytes`].
///
/// # Errors
///
/// [`KernelFileError`] for a file that is damaged, of another format or version, or not a possible kernel.
pub fn decode(bytes: &[u8]) -> Result<(DisplayModel, KernelModel), KernelFileError> {
    let (model, kind, _) = decode_within(bytes, &Budget::new(decoding_bytes(bytes.len() as u64)))?;
    Ok((model, kind))
}

/// [`decode`] and [`origin`] with a budget.
pub(crate) fn decode_within(
    bytes: &[u8],
    budget: &Budget,
) -> Result<(DisplayModel, KernelModel, Origin), KernelFileError> {
    let tensors = tensors(bytes)?;
    let header = header(bytes)?;
    let model = assemble(&header, &File { header: &header, tensors, budget })?;
    Ok((model, header.model, header.into_origin()))
}

/// Reads the header of a safetensors file after a check of its size, so that it takes a few megabytes at most.
pub(crate) fn tensors(bytes: &[u8]) -> Result<SafeTensors<'_>, KernelFileError> {
    if let Some((length, rest)) = bytes.split_first_chunk() {
        let header_bytes = u64::from_le_bytes(*length);
        if header_bytes > HEADER_BYTES_MAX as u64 {
            return Err(KernelFileError::LargeHeader { bytes: header_bytes });
        }
        // A file that ends in its header is refused below.
        rest.get(..header_bytes as usize)
            .map_or(Ok(()), small_json::require_small)
            .map_err(KernelFileError::Tensors)?;
    }
    Ok(SafeTensors::deserialize(bytes)?)
}

/// Refuses metadata of which much memory would be made.
fn require_small(metadata: &str) -> Result<(), KernelFileError> {
    if metadata.len() > HEADER_BYTES_MAX {
        return Err(KernelFileError::LargeMetadata { bytes: metadata.len() });
    }
    Ok(small_json::require_small(metadata.as_bytes())?)
}

/// Makes the model of a header from the arrays of a file.
pub(crate) fn assemble(header: &Header, file: &dyn StoredParts) -> Result<DisplayModel, KernelFileError> {
    let model = file.model(header.setup()?)?;
    model.validate()?;
    Ok(model)
}

/// Reads where the kernel of a file comes from.
///
/// # Errors
///
/// [`KernelFileError`] for a file that is no kernel file.
pub fn origin(bytes: &[u8]) -> Result<Origin, KernelFileError> {
    tensors(bytes)?;
    Ok(header(bytes)?.into_origin())
}

/// The metadata of a file whose header [`tensors`] has read.
fn header(bytes: &[u8]) -> Result<Header, KernelFileError> {
    let (_, metadata) = SafeTensors::read_metadata(bytes)?;
    let header = metadata.metadata().as_ref().and_then(|metadata| metadata.get(METADATA_KEY));
    Header::parse(header.ok_or(KernelFileError::NoHeader)?)
}

/// A kernel file.
struct File<'a> {
    header: &'a Header,
    tensors: SafeTensors<'a>,
    budget: &'a Budget,
}

impl File<'_> {
    fn tensor(&self, name: &'static str) -> Result<TensorView<'_>, StoredError> {
        self.tensors.tensor(name).map_err(|error| StoredError::Form(Box::new(KernelFileError::from(error))))
    }

    /// Counts the numbers of a tensor of `bytes` before they are copied, `copies` times.
    fn count(&self, bytes: &[u8], copies: u64) -> Result<(), StoredError> {
        let counted = self.budget.take(copies * bytes.len() as u64);
        counted.map_err(|error| StoredError::Form(Box::new(KernelFileError::from(error))))
    }

    /// Rows, columns and bytes of a tensor of pairs.
    fn pairs(
        &self,
        name: &'static str,
        dtype: Dtype,
        expected: &'static str,
    ) -> Result<(usize, usize, &[u8]), StoredError> {
        let tensor = self.tensor(name)?;
        match (tensor.dtype() == dtype, tensor.shape()) {
            (true, &[height_px, width_px, 2]) => Ok((height_px, width_px, tensor.data())),
            _ => Err(StoredError::Array { name, expected }),
        }
    }
}

impl StoredParts for File<'_> {
    fn has_bins(&self) -> bool {
        !self.header.model.is_smooth()
    }

    fn entry(&self, key: &'static str) -> Result<Option<Entry>, StoredError> {
        self.header.entry(key)
    }

    fn f64s(&self, name: &'static str) -> Result<Vec<f64>, StoredError> {
        let tensor = self.tensor(name)?;
        self.count(tensor.data(), 1)?;
        match tensor.dtype() {
            Dtype::F64 => Ok(tensor.data().as_chunks().0.iter().map(|&bytes| f64::from_le_bytes(bytes)).collect()),
            _ => Err(StoredError::Array { name, expected: "f64" }),
        }
    }

    fn complex32s(&self, name: &'static str) -> Result<Plane<Complex32>, StoredError> {
        let expected = "f32 of shape [rows, columns, 2]";
        let (height_px, width_px, bytes) = self.pairs(name, Dtype::F32, expected)?;
        self.count(bytes, 2)?;
        let numbers: Vec<f32> = bytes.as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect();
        let values = numbers.as_chunks().0.iter().map(|&[re, im]| Complex32::new(re, im)).collect();
        Plane::try_from_vec(height_px, width_px, values).map_err(|_| StoredError::Array { name, expected })
    }

    fn i16_pairs(&self, name: &'static str) -> Result<Plane<[i16; 2]>, StoredError> {
        let expected = "i16 of shape [rows, columns, 2]";
        let (height_px, width_px, bytes) = self.pairs(name, Dtype::I16, expected)?;
        self.count(bytes, 1)?;
        Plane::try_from_vec(height_px, width_px, i16_pairs(bytes)).map_err(|_| StoredError::Array { name, expected })
    }
}

/// Pairs of numbers from little-endian bytes.
pub(crate) fn i16_pairs(bytes: &[u8]) -> Vec<[i16; 2]> {
    let numbers =
        bytes.as_chunks().0.iter().map(|&[a, b, c, d]| [i16::from_le_bytes([a, b]), i16::from_le_bytes([c, d])]);
    numbers.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_optics::{
        Crosstalk, Dust, FurtherMode, Ghost, Grid, KernelShape, LightBlur, OpticalSetup, OrderFilter, Orders,
        PartialCoherence, ResponseVariation, SmoothField, SpatialVariation,
    };
    use num_complex::Complex64;

    fn model(kernel: KernelShape) -> DisplayModel {
        let grid = Grid::try_new(32, 48, 8e-6).unwrap();
        let setup = OpticalSetup::try_new(grid, 632.8e-9, 0.0701).unwrap();
        let mut source = SmoothField::flat(2);
        source.log_amplitude[1] = -0.1;
        DisplayModel {
            kernel,
            source,
            response: vec![[0.1, -0.2], [1e-9, 0.3]],
            zero_order: Complex64::new(0.03, -0.01),
            gain: 0.1 + 0.2,
            offset: 0.01,
            ..DisplayModel::ideal(setup)
        }
    }

    #[test]
    fn kernel_is_read_back_exactly_and_always_has_the_same_bytes() {
        let mut errors = SmoothField::flat(3);
        errors.phase.iter_mut().enumerate().for_each(|(i, c)| *c = 1.0 / (i as f64 + 3.0));
        let bins = Plane::from_fn(64, 96, |y, x| Complex32::new(y as f32, -(x as f32) / 7.0));
        let smooth = KernelShape::Smooth(errors);
        for (kernel, kind) in [
            (smooth.clone(), KernelModel::Display),
            (smooth, KernelModel::Varying),
            (KernelShape::Bins(bins), KernelModel::Dense),
        ] {
            let mut model = model(kernel);
            if kind == KernelModel::Varying {
                model.variation = SpatialVariation::new([1.0, 2.0, 3.0, 4.0, 5.0].map(|size| {
                    let mut field = SmoothField::flat(2);
                    (field.log_amplitude[1], field.phase[3]) = (-0.1 * size, 0.3 * size);
                    field
                }));
            }
            if kind == KernelModel::Display {
                model.crosstalk = Crosstalk { ratio_x: 1.0 / 12.0, ratio_y: 0.0 };
                model.light_blur = LightBlur { ratio_x: 0.0, ratio_y: 1.0 / 7.0 };
                model.response_variation = ResponseVariation { order: 1, coefficients: vec![0.1 / 3.0, 0.0, -0.07] };
                let (height_px, width_px) = (model.setup.grid().height_px(), model.setup.grid().width_px());
                model.ghost = Ghost::of_numbers([0.1 / 3.0, -0.02, 11.3, -7.0 / 3.0, 4.5]);
                model.dust = Dust::new(Plane::from_fn(height_px, width_px, |y, x| [y as i16 - 3, -7 * x as i16]));
                let mode = |light, order, size: f64| {
                    let mut errors = SmoothField::flat(order);
                    (errors.log_amplitude[0], errors.phase[1]) = (-0.1 * size, 0.3 * size);
                    FurtherMode { light, errors }
                };
                model.coherence = PartialCoherence::new(vec![mode(0.7, 2, 1.0 / 3.0), mode(0.1, 1, -1.0)]);
            }
            if kind == KernelModel::Varying {
                let gaps = Orders::All { fill_factor_x: 0.93, fill_factor_y: 0.9 };
                model.setup = model.setup.with_orders(gaps).unwrap();
                model.beyond = SmoothField::flat(2);
                (model.beyond.log_amplitude[0], model.beyond.phase[4]) = (-0.1 / 3.0, 7.1);
            }
            if kind == KernelModel::Dense {
                let half = OrderFilter { centre_y: 0.2, ..OrderFilter::rectangle(0.9, 0.5) };
                model.setup = model.setup.with_orders(Orders::Filtered(half)).unwrap();
            }
            model.setup = model.setup.planned().unwrap().0;
            let stored = Stored::of(&model);
            let keys = stored.entries().map(|(key, _)| *key);
            for name in keys.chain(stored.clone().into_arrays().iter().map(|array| array.name)) {
                let is_described = |line: &str| line.starts_with("//! |") && line.contains(&format!("`{name}`"));
                assert!(include_str!("kernel_file.rs").lines().any(is_described), "no row describes `{name}`");
            }
            let bytes = encode(&model, kind).unwrap();
            assert_eq!(bytes, encode(&model, kind).unwrap());
            assert_eq!(origin(&bytes).unwrap(), Origin::default());
            let photographed = Origin { interpolated_from_m: vec![0.07, 0.0702], ..Origin::default() };
            let interpolated = encode_with(&model, kind, &photographed).unwrap();
            assert_eq!(origin(&interpolated).unwrap(), photographed);
            assert_eq!(decode(&interpolated).unwrap(), (model.clone(), kind));
            assert_eq!(decode(&bytes).unwrap(), (model, kind));
        }
    }

    #[test]
    fn damaged_and_foreign_files_are_refused() {
        let bytes = encode(&model(KernelShape::Smooth(SmoothField::flat(3))), KernelModel::Smooth).unwrap();
        for end in [0, 7, 100, bytes.len() - 1] {
            assert!(decode(&bytes[..end]).is_err(), "cut at {end}");
        }
        let mut broken = model(KernelShape::Smooth(SmoothField::flat(3)));
        broken.gain = f64::NAN;
        let broken = encode(&broken, KernelModel::Smooth).unwrap();
        assert!(matches!(decode(&broken), Err(KernelFileError::Model(_))));
        let foreign = safetensors::serialize(Vec::<(&str, TensorView<'_>)>::new(), None).unwrap();
        assert!(matches!(decode(&foreign), Err(KernelFileError::NoHeader)));
    }

    #[test]
    fn entry_that_stands_twice_is_refused() {
        let model = model(KernelShape::Smooth(SmoothField::flat(3)));
        let text = header_text(&model, KernelModel::Smooth, &Stored::of(&model), &Origin::default()).unwrap();
        assert!(Header::parse(&text).is_ok());
        for key in ["height_px", "kernel_order"] {
            let twice = text.replacen('{', &format!("{{\"{key}\":3,"), 1);
            let entry = |header: Header| Ok(header.entry(key)?);
            let refusal = Header::parse(&twice).and_then(entry).unwrap_err().to_string();
            assert!(refusal.contains(&format!("duplicate field `{key}`")), "{refusal}");
        }
        let wrong = Header::parse(&text.replace("\"kernel_order\":3", "\"kernel_order\":\"3\"")).unwrap();
        let refusal = wrong.entry("kernel_order").unwrap_err().to_string();
        assert!(refusal.contains("`kernel_order`: invalid type: string \"3\""), "{refusal}");
    }
}
