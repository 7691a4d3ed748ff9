//! The native form of a kernel: a learned display model as a safetensors file.
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
mod parts;

pub(crate) use header::Header;

use lightpath_optics::{
    Crosstalk, DisplayModel, Dust, Ghost, KernelModel, KernelShape, LightBlur, Plane, ResponseVariation, SmoothField,
    SpatialVariation,
};
use num_complex::{Complex32, Complex64};
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensorError, SafeTensors};
use serde_json::Value;
use std::collections::HashMap;

/// Name of the tensor with the dust.
pub(crate) const DUST: &str = "dust";

pub(crate) const METADATA_KEY: &str = "lightpath";
const FORMAT: &str = "lightpath-kernel";
const FORMAT_VERSION: u32 = 1;

/// Reason why a kernel file could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum KernelFileError {
    /// The file is not safetensors, or is cut short.
    #[error("the safetensors file is damaged or incomplete: {0}")]
    Safetensors(#[from] SafeTensorError),
    /// The file is safetensors without Lightpath's metadata.
    #[error("the file has no metadata entry `lightpath`: it is safetensors, but not a Lightpath kernel")]
    NoHeader,
    /// The metadata entry `lightpath` does not parse.
    #[error("the metadata entry `lightpath` is invalid: {0}")]
    Header(#[from] serde_json::Error),
    /// The file has another format or a later format version.
    #[error("the file is {format} version {version}; this server reads {FORMAT} version {FORMAT_VERSION}")]
    Format {
        /// Format in the file's metadata.
        format: String,
        /// Format version in the file's metadata.
        version: u32,
    },
    /// A tensor has another type or shape.
    #[error("tensor `{name}` must be {expected}")]
    Tensor {
        /// Name of the tensor.
        name: &'static str,
        /// Expected type and shape.
        expected: &'static str,
    },
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
///
/// # Errors
///
/// The errors of [`encode`].
pub fn encode_with(model: &DisplayModel, kind: KernelModel, origin: &Origin) -> Result<Vec<u8>, KernelFileError> {
    let tensors = tensors(model);
    let metadata = HashMap::from([(METADATA_KEY.to_owned(), header_text(model, kind, origin)?)]);
    let views = tensors
        .iter()
        .map(|tensor| Ok((tensor.name, TensorView::new(tensor.dtype, tensor.shape.clone(), &tensor.bytes)?)))
        .collect::<Result<Vec<_>, SafeTensorError>>()?;
    Ok(safetensors::serialize(views, Some(metadata))?)
}

/// A tensor of a kernel file, with little-endian numbers.
pub(crate) struct Tensor {
    pub(crate) name: &'static str,
    pub(crate) dtype: Dtype,
    pub(crate) shape: Vec<usize>,
    pub(crate) bytes: Vec<u8>,
}

/// The metadata of a kernel, as JSON.
pub(crate) fn header_text(model: &DisplayModel, kind: KernelModel, origin: &Origin) -> Result<String, KernelFileError> {
    let grid = model.setup.grid();
    Ok(serde_json::to_string(&Header {
        format: FORMAT.to_owned(),
        format_version: FORMAT_VERSION,
        model: kind,
        height_px: grid.height_px(),
        width_px: grid.width_px(),
        pixel_pitch_m: grid.pixel_pitch_m(),
        wavelength_m: model.setup.wavelength_m(),
        distance_m: model.setup.distance_m(),
        kernel_order: if let KernelShape::Smooth(errors) = &model.kernel { errors.order } else { 0 },
        source_order: model.source.order,
        beyond_order: model.beyond.order,
        variation_order: model.variation.order(),
        response_variation_order: (!model.response_variation.is_none()).then_some(model.response_variation.order),
        has_crosstalk: !model.crosstalk.is_none(),
        has_light_blur: !model.light_blur.is_none(),
        has_ghost: !model.ghost.is_none(),
        mode_orders: model.coherence.modes().iter().map(|mode| mode.errors.order).collect(),
        has_dust: !model.dust.is_none(),
        propagation: model.setup.method(),
        orders: model.setup.orders(),
        interpolated_from_m: origin.interpolated_from_m.clone(),
        display: origin.display.clone(),
        record: origin.record.clone(),
    })?)
}

/// The tensors of a kernel.
fn tensors(model: &DisplayModel) -> Vec<Tensor> {
    let mut tensors = series(model);
    if let KernelShape::Bins(bins) = &model.kernel {
        let bytes = bins.values().iter().flat_map(|h| [h.re, h.im]).flat_map(f32::to_le_bytes).collect();
        let shape = vec![bins.height_px(), bins.width_px(), 2];
        tensors.push(Tensor { name: "kernel.bins", dtype: Dtype::F32, shape, bytes });
    }
    tensors
}

/// The tensors of a kernel without `kernel.bins`. All of them are f64, except for `dust`.
pub(crate) fn series(model: &DisplayModel) -> Vec<Tensor> {
    let mut tensors = Vec::new();
    let mut add = |name, shape, values: &[f64]| {
        tensors.push(Tensor { name, dtype: Dtype::F64, shape, bytes: bytes_f64(values) });
    };
    add("photometry", vec![4], &[model.gain, model.offset, model.zero_order.re, model.zero_order.im]);
    let flat = SmoothField::flat(0);
    let kernel = match &model.kernel {
        KernelShape::Smooth(errors) => Some(errors),
        KernelShape::Ideal => Some(&flat),
        KernelShape::Bins(_) => None,
    };
    if let Some(errors) = kernel {
        add("kernel.log_amplitude", vec![errors.log_amplitude.len()], &errors.log_amplitude);
        add("kernel.phase", vec![errors.phase.len()], &errors.phase);
    }
    if model.beyond.order > 0 {
        add("beyond.log_amplitude", vec![model.beyond.log_amplitude.len()], &model.beyond.log_amplitude);
        add("beyond.phase", vec![model.beyond.phase.len()], &model.beyond.phase);
    }
    add("source.log_amplitude", vec![model.source.log_amplitude.len()], &model.source.log_amplitude);
    add("source.phase", vec![model.source.phase.len()], &model.source.phase);
    if !model.variation.is_none() {
        let mut per_power = |name, of: fn(&SmoothField) -> &[f64]| {
            let values: Vec<f64> = model.variation.fields().iter().flat_map(of).copied().collect();
            add(name, vec![SpatialVariation::POWERS, values.len() / SpatialVariation::POWERS], &values);
        };
        per_power("variation.log_amplitude", |field| &field.log_amplitude);
        per_power("variation.phase", |field| &field.phase);
    }
    add("response", vec![model.response.len(), 2], model.response.as_flattened());
    if !model.response_variation.is_none() {
        let coefficients = &model.response_variation.coefficients;
        add("response_variation", vec![coefficients.len()], coefficients);
    }
    if !model.crosstalk.is_none() {
        add("crosstalk", vec![2], &model.crosstalk.ratios());
    }
    if !model.light_blur.is_none() {
        add("light_blur", vec![2], &model.light_blur.ratios());
    }
    if !model.ghost.is_none() {
        add("ghost", vec![5], &model.ghost.numbers());
    }
    let modes = model.coherence.modes();
    if !modes.is_empty() {
        let lights: Vec<f64> = modes.iter().map(|mode| mode.light).collect();
        add("mode.light", vec![modes.len()], &lights);
        let mut of_all = |name, of: fn(&SmoothField) -> &[f64]| {
            let values: Vec<f64> = modes.iter().flat_map(|mode| of(&mode.errors)).copied().collect();
            add(name, vec![values.len()], &values);
        };
        of_all("mode.log_amplitude", |field| &field.log_amplitude);
        of_all("mode.phase", |field| &field.phase);
    }
    if let Some(steps) = model.dust.steps() {
        let bytes = steps.values().as_flattened().iter().flat_map(|step| step.to_le_bytes()).collect();
        let shape = vec![steps.height_px(), steps.width_px(), 2];
        tensors.push(Tensor { name: DUST, dtype: Dtype::I16, shape, bytes });
    }
    tensors
}

/// Reads a kernel file and checks that it describes a possible display. Returns the model and its parametrization.
///
/// # Errors
///
/// [`KernelFileError`] for a file that is damaged, of another format or version, or not a possible kernel.
pub fn decode(bytes: &[u8]) -> Result<(DisplayModel, KernelModel), KernelFileError> {
    let header = header(bytes)?;
    let tensors = SafeTensors::deserialize(bytes)?;
    let model = assemble(&header, |name| floats(&tensors, name), || bins(&tensors), || dust(&tensors))?;
    Ok((model, header.model))
}

/// Makes the model of a header from its tensors. `floats` reads a tensor by its name, `bins` reads `kernel.bins`, and
/// `dust` reads `dust`.
pub(crate) fn assemble<E: From<KernelFileError>>(
    header: &Header,
    floats: impl Fn(&'static str) -> Result<Vec<f64>, E>,
    bins: impl FnOnce() -> Result<Plane<Complex32>, E>,
    dust: impl FnOnce() -> Result<Plane<[i16; 2]>, E>,
) -> Result<DisplayModel, E> {
    let setup = header.setup()?;
    let [gain, offset, re, im] = floats("photometry")?[..] else {
        return Err(KernelFileError::Tensor { name: "photometry", expected: "four f64" }.into());
    };
    let model = DisplayModel {
        setup,
        kernel: match header.model {
            KernelModel::Paper | KernelModel::Dense => KernelShape::Bins(bins()?),
            KernelModel::Smooth | KernelModel::Display | KernelModel::Varying => KernelShape::Smooth(SmoothField {
                order: header.kernel_order,
                log_amplitude: floats("kernel.log_amplitude")?,
                phase: floats("kernel.phase")?,
            }),
        },
        beyond: match header.beyond_order {
            0 => SmoothField::flat(0),
            order => {
                SmoothField { order, log_amplitude: floats("beyond.log_amplitude")?, phase: floats("beyond.phase")? }
            }
        },
        ghost: match header.has_ghost {
            true => parts::ghost(&floats("ghost")?)?,
            false => Ghost::NONE,
        },
        variation: parts::variation(&floats, header.variation_order)?,
        coherence: parts::coherence(&floats, &header.mode_orders)?,
        source: SmoothField {
            order: header.source_order,
            log_amplitude: floats("source.log_amplitude")?,
            phase: floats("source.phase")?,
        },
        dust: if header.has_dust { Dust::new(dust()?) } else { Dust::none() },
        response: floats("response")?.as_chunks().0.to_vec(),
        response_variation: match header.response_variation_order {
            Some(order) => ResponseVariation { order, coefficients: floats("response_variation")? },
            None => ResponseVariation::none(),
        },
        crosstalk: match header.has_crosstalk {
            true => parts::crosstalk(&floats("crosstalk")?)?,
            false => Crosstalk::NONE,
        },
        light_blur: match header.has_light_blur {
            true => parts::light_blur(&floats("light_blur")?)?,
            false => LightBlur::NONE,
        },
        zero_order: Complex64::new(re, im),
        gain,
        offset,
    };
    model.validate().map_err(KernelFileError::from)?;
    Ok(model)
}

/// Reads where the kernel of a file comes from.
///
/// # Errors
///
/// [`KernelFileError`] for a file that is no kernel file.
pub fn origin(bytes: &[u8]) -> Result<Origin, KernelFileError> {
    Ok(header(bytes)?.origin())
}

fn header(bytes: &[u8]) -> Result<Header, KernelFileError> {
    let (_, metadata) = SafeTensors::read_metadata(bytes)?;
    let header = metadata.metadata().as_ref().and_then(|metadata| metadata.get(METADATA_KEY));
    Header::parse(header.ok_or(KernelFileError::NoHeader)?)
}

fn bytes_f64(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

fn floats(tensors: &SafeTensors<'_>, name: &'static str) -> Result<Vec<f64>, KernelFileError> {
    let tensor = tensors.tensor(name)?;
    if tensor.dtype() != Dtype::F64 {
        return Err(KernelFileError::Tensor { name, expected: "f64" });
    }
    Ok(tensor.data().as_chunks().0.iter().map(|&bytes| f64::from_le_bytes(bytes)).collect())
}

fn bins(tensors: &SafeTensors<'_>) -> Result<Plane<Complex32>, KernelFileError> {
    let expected = "f32 of shape [rows, columns, 2]";
    let tensor = tensors.tensor("kernel.bins")?;
    let (Dtype::F32, &[height_px, width_px, 2]) = (tensor.dtype(), tensor.shape()) else {
        return Err(KernelFileError::Tensor { name: "kernel.bins", expected });
    };
    let numbers: Vec<f32> = tensor.data().as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect();
    let values = numbers.as_chunks().0.iter().map(|&[re, im]| Complex32::new(re, im)).collect();
    Ok(Plane::try_from_vec(height_px, width_px, values)?)
}

fn dust(tensors: &SafeTensors<'_>) -> Result<Plane<[i16; 2]>, KernelFileError> {
    let tensor = tensors.tensor(DUST)?;
    let (Dtype::I16, &[height_px, width_px, 2]) = (tensor.dtype(), tensor.shape()) else {
        return Err(KernelFileError::Tensor { name: DUST, expected: "i16 of shape [rows, columns, 2]" });
    };
    Ok(Plane::try_from_vec(height_px, width_px, dust_steps(tensor.data()))?)
}

/// A and B of each pixel, from little-endian bytes.
pub(crate) fn dust_steps(bytes: &[u8]) -> Vec<[i16; 2]> {
    let numbers =
        bytes.as_chunks().0.iter().map(|&[a, b, c, d]| [i16::from_le_bytes([a, b]), i16::from_le_bytes([c, d])]);
    numbers.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_optics::OrderFilter;
    use lightpath_optics::{FurtherMode, Grid, OpticalSetup, Orders, PartialCoherence};

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
}
