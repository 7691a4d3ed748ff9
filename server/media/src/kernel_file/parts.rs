//! Reads the parts of a display model from the numbers of their tensors.

use super::KernelFileError;
use lightpath_optics::numerics::chebyshev::ChebyshevBasis;
use lightpath_optics::{Crosstalk, FurtherMode, Ghost, LightBlur, PartialCoherence, SmoothField, SpatialVariation};

pub(super) fn crosstalk(ratios: &[f64]) -> Result<Crosstalk, KernelFileError> {
    match *ratios {
        [ratio_x, ratio_y] => Ok(Crosstalk { ratio_x, ratio_y }),
        _ => Err(KernelFileError::Tensor { name: "crosstalk", expected: "two f64" }),
    }
}

pub(super) fn light_blur(ratios: &[f64]) -> Result<LightBlur, KernelFileError> {
    match *ratios {
        [ratio_x, ratio_y] => Ok(LightBlur { ratio_x, ratio_y }),
        _ => Err(KernelFileError::Tensor { name: "light_blur", expected: "two f64" }),
    }
}

pub(super) fn ghost(numbers: &[f64]) -> Result<Ghost, KernelFileError> {
    let numbers = numbers.try_into().map_err(|_| KernelFileError::Tensor { name: "ghost", expected: "five f64" })?;
    Ok(Ghost::of_numbers(numbers))
}

pub(super) fn coherence<E: From<KernelFileError>>(
    floats: impl Fn(&'static str) -> Result<Vec<f64>, E>,
    orders: &[usize],
) -> Result<PartialCoherence, E> {
    if orders.is_empty() {
        return Ok(PartialCoherence::none());
    }
    let fields = orders.iter().map(|&order| {
        // A field of such an order would be refused only after its coefficients were made.
        let is_possible = order <= ChebyshevBasis::ORDER_MAX;
        if is_possible { Ok(SmoothField::flat(order)) } else { Err(mode_shape("mode.phase")) }
    });
    let mut fields = fields.collect::<Result<Vec<_>, _>>()?;
    let lights = floats("mode.light")?;
    let terms: usize = fields.iter().map(|field| field.phase.len()).sum();
    let (log_amplitudes, phases) = (floats("mode.log_amplitude")?, floats("mode.phase")?);
    for (name, found, expected) in [
        ("mode.light", lights.len(), orders.len()),
        ("mode.log_amplitude", log_amplitudes.len(), terms),
        ("mode.phase", phases.len(), terms),
    ] {
        if found != expected {
            return Err(mode_shape(name).into());
        }
    }
    let coefficients = fields.iter_mut().flat_map(|field| field.log_amplitude.iter_mut().zip(&mut field.phase));
    for ((a, b), (log_amplitude, phase)) in coefficients.zip(log_amplitudes.into_iter().zip(phases)) {
        (*a, *b) = (log_amplitude, phase);
    }
    let modes = lights.into_iter().zip(fields).map(|(light, errors)| FurtherMode { light, errors });
    Ok(PartialCoherence::new(modes.collect()))
}

fn mode_shape(name: &'static str) -> KernelFileError {
    KernelFileError::Tensor { name, expected: "f64 with the numbers of all modes in `mode_orders`" }
}

pub(super) fn variation<E: From<KernelFileError>>(
    floats: impl Fn(&'static str) -> Result<Vec<f64>, E>,
    order: usize,
) -> Result<SpatialVariation, E> {
    if order == 0 {
        return Ok(SpatialVariation::none());
    }
    let per_power = |name| -> Result<Vec<Vec<f64>>, E> {
        let values = floats(name)?;
        let terms = values.len() / SpatialVariation::POWERS;
        if terms == 0 || values.len() % SpatialVariation::POWERS != 0 {
            return Err(KernelFileError::Tensor { name, expected: "f64 of shape [5, terms]" }.into());
        }
        Ok(values.chunks_exact(terms).map(<[f64]>::to_vec).collect())
    };
    let (mut log_amplitudes, mut phases) =
        (per_power("variation.log_amplitude")?.into_iter(), per_power("variation.phase")?.into_iter());
    Ok(SpatialVariation::new([(); SpatialVariation::POWERS].map(|()| SmoothField {
        order,
        log_amplitude: log_amplitudes.next().unwrap_or_default(),
        phase: phases.next().unwrap_or_default(),
    })))
}
