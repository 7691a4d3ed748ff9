//! Export of a model to any form, with the error that the form causes.

use super::dense::{Sampled, Transfer, f32_bytes, parts};
use super::error::KernelFormatError;
use super::import::{import, importing_bytes};
use super::losses::{Loss, losses};
use super::{array, compact, half, npz, torch};
use crate::budget::Budget;
use crate::kernel_file::{self, Origin};
use lightpath_domain::kernel_format::KernelFormat;
use lightpath_optics::KernelModel;
use lightpath_optics::display::parts::spatial_variation::local_kernels;
use lightpath_optics::memory::sampling_bytes;
use lightpath_optics::numerics::grid::frequency;
use lightpath_optics::{ConvolutionMethod, DisplayModel, KernelShape, OpticalSetup};
use rayon::prelude::*;
use std::borrow::Cow;

/// An exported kernel.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported {
    /// Contents of the file.
    pub bytes: Vec<u8>,
    /// Relative error ‖H' − H‖/‖H‖ over the band, with H' read back from the file. 1: H is lost. For a kernel that
    /// varies over the SLM the norm also covers positions on the SLM; forms with one transfer function keep that of the
    /// axis.
    pub relative_error: f64,
    /// What the form does not hold of the model, in the order of [`Loss`].
    pub losses: Vec<Loss>,
}

/// Bytes of a transfer function for each pixel of its display: a complex64 for each of four frequencies.
const TRANSFER_BYTES_PER_PX: u64 = 32;

/// Memory for converting a kernel file of `file_bytes` in the native form to another form \[bytes\].
///
/// A form with the numbers of the model alone takes what reading and writing the file takes. The others also take the
/// transfer function at all frequencies, its numbers, the other file, the model read back from it, and the sampling of
/// free space. A dense kernel of 1080p was measured to need 128 bytes a pixel besides its file.
#[must_use]
pub fn exporting_bytes(format: KernelFormat, file_bytes: u64, setup: &OpticalSetup) -> u64 {
    let reading_bytes = kernel_file::decoding_bytes(file_bytes);
    if matches!(format, KernelFormat::Safetensors | KernelFormat::Bundle | KernelFormat::Compact) {
        return reading_bytes;
    }
    // The file names the method. These need most.
    let most = if setup.orders().are_all() { ConvolutionMethod::AllOrders } else { ConvolutionMethod::BandResponse };
    let px = setup.grid().height_px() as u64 * setup.grid().width_px() as u64;
    reading_bytes + 4 * TRANSFER_BYTES_PER_PX * px + sampling_bytes(&setup.with_method_regardless(most))
}

/// Number of frequencies along each axis at which the error is measured. It suffices for smooth and for rough kernels.
const FREQUENCIES: usize = 96;
/// Number of positions along each side of the SLM at which the error of a varying kernel is measured.
const POSITIONS: usize = 3;

/// Writes the model in a form, and reads it back to measure the error.
///
/// # Errors
///
/// [`KernelFormatError::NoSuchForm`] for a model that the form cannot hold.
pub fn export(model: &DisplayModel, kind: KernelModel, format: KernelFormat) -> Result<Exported, KernelFormatError> {
    export_with(model, kind, &Origin::default(), format)
}

/// [`export`] with the origin of the kernel. Forms that hold a whole model hold its origin as well, but only bundles
/// have its record.
pub fn export_with(
    model: &DisplayModel,
    kind: KernelModel,
    origin: &Origin,
    format: KernelFormat,
) -> Result<Exported, KernelFormatError> {
    let is_native = matches!(format, KernelFormat::Safetensors | KernelFormat::Bundle);
    if !is_native && model.setup.orders().are_all() {
        let message = "a kernel of a display that shows all diffraction orders has a transfer function for each sub-sample, and \
                       no other form than safetensors";
        return Err(KernelFormatError::NoSuchForm(message.to_owned()));
    }
    // Forms without modes hold all light in one mode.
    let held = match format {
        _ if is_native || format == KernelFormat::Npz => Cow::Borrowed(model),
        _ => Cow::Owned(model.in_one_mode()),
    };
    let (whole, model) = (model, &*held);
    let transfer = Transfer::of(model);
    let bytes = match format {
        KernelFormat::Bundle => kernel_file::encode_with(model, kind, origin)?,
        KernelFormat::Safetensors => kernel_file::encode_with(model, kind, &Origin { record: None, ..origin.clone() })?,
        KernelFormat::Compact => compact::encode(model, kind)?,
        KernelFormat::Pt => {
            let (shape, numbers) = as_published(&transfer);
            torch::write(&shape, &numbers)?
        }
        KernelFormat::Npy => {
            let (shape, numbers) = as_published(&transfer);
            array::npy("<f4", &shape, &f32_bytes(&numbers))
        }
        KernelFormat::Complex64 => {
            let padded = transfer.padded();
            array::npy("<c8", &[padded.height_px(), padded.width_px()], &f32_bytes(&parts(&padded)))
        }
        KernelFormat::F16 => {
            let padded = transfer.padded();
            let numbers = parts(&padded);
            let bytes: Vec<u8> = numbers.iter().flat_map(|&number| half::from_f32(number).to_le_bytes()).collect();
            array::npy("<f2", &[padded.height_px(), padded.width_px(), 2], &bytes)
        }
        KernelFormat::Npz => npz::write(&transfer, kind, &Origin { record: None, ..origin.clone() })?,
    };
    let back = import(&bytes, &model.setup, &Budget::new(importing_bytes(&bytes)))?;
    let relative_error = difference(&transfer, &back.model);
    let mut losses = losses(whole, &back.model, relative_error);
    if origin.interpolated_from_m != back.origin.interpolated_from_m {
        losses.push(Loss::Interpolation);
        losses.sort_unstable();
    }
    Ok(Exported { bytes, relative_error, losses })
}

/// Amplitude and phase of the inner half of the spectrum, in the shape of the paper's code: \[1, 2, rows, columns\].
fn as_published(transfer: &Transfer<'_>) -> (Vec<usize>, Vec<f32>) {
    let grid = transfer.model.setup.grid();
    let inner = transfer.middle(grid.height_px(), grid.width_px());
    let amplitude = inner.values().iter().map(|h| h.norm());
    let phase = inner.values().iter().map(|h| h.arg());
    (vec![1, 2, grid.height_px(), grid.width_px()], amplitude.chain(phase).collect())
}

/// ‖H' − H‖/‖H‖ over frequencies spread evenly over the band, on bins of the padded spectrum.
fn difference(transfer: &Transfer<'_>, back: &DisplayModel) -> f64 {
    let model = transfer.model;
    if let (KernelShape::Smooth(a), KernelShape::Smooth(b)) = (&model.kernel, &back.kernel)
        && a == b
        && model.variation == back.variation
        && model.setup == back.setup
    {
        return 0.0;
    }
    match share_ideal(model, back) {
        true => relative_error([model, back], [&errors(model), &errors(back)]),
        false => {
            let other: Sampled<'_> = Box::new(back.sampled());
            relative_error([model, back], [transfer.sampled(), &other])
        }
    }
}

/// ‖H' − H‖/‖H‖ of two models, with H on the axis of each.
fn relative_error([model, back]: [&DisplayModel; 2], [h, other]: [&Sampled<'_>; 2]) -> f64 {
    // If one of the models varies over the SLM, a few positions represent all others.
    let positions = match model.variation.is_none() && back.variation.is_none() {
        true => vec![(0.0, 0.0)],
        false => local_kernels::nodes(POSITIONS).collect(),
    };
    let bins = [model.setup.padded_height_px(), model.setup.padded_width_px()];
    let pitch_m = model.setup.grid().pixel_pitch_m();
    let (count_y, count_x) = (FREQUENCIES.min(bins[0]), FREQUENCIES.min(bins[1]));
    let rows = (0..count_y).into_par_iter().map(|j| {
        let fy = frequency(j * bins[0] / count_y, bins[0], pitch_m);
        (0..count_x).fold((0.0, 0.0), |sum, i| {
            let fx = frequency(i * bins[1] / count_x, bins[1], pitch_m);
            let (value, again) = (h(fx, fy), other(fx, fy));
            positions.iter().fold(sum, |(off, all), &(x, y)| {
                let local =
                    |model: &DisplayModel| model.variation.exponent(x, y, 2.0 * pitch_m * fx, 2.0 * pitch_m * fy);
                let value = value * local(model).exp();
                (off + (again * local(back).exp() - value).norm_sqr(), all + value.norm_sqr())
            })
        })
    });
    // The rows are collected first, so that the sum has a fixed order.
    let rows: Vec<(f64, f64)> = rows.collect();
    let (off, all) = rows.iter().fold((0.0, 0.0), |sum, row| (sum.0 + row.0, sum.1 + row.1));
    if all > 0.0 { (off / all).sqrt() } else { 0.0 }
}

/// Whether H of both models has the same factor H_ideal.
fn share_ideal(model: &DisplayModel, back: &DisplayModel) -> bool {
    let has_ideal = |model: &DisplayModel| !matches!(model.kernel, KernelShape::Bins(_));
    has_ideal(model) && has_ideal(back) && model.setup == back.setup
}

/// H with the angular spectrum for H_ideal, which needs no tables. Two models that share H_ideal differ by the same ratio
/// whatever it is: its amplitude, 1 within the band, is only a weight. A filter takes away what it does not pass.
fn errors(model: &DisplayModel) -> Sampled<'static> {
    let (setup, pitch_m) = (model.setup, model.setup.grid().pixel_pitch_m());
    let ideal = DisplayModel::ideal(setup.with_method_regardless(ConvolutionMethod::AngularSpectrum));
    let model = DisplayModel { kernel: model.kernel.clone(), ghost: model.ghost, ..ideal };
    Box::new(move |fx, fy| {
        let passed = setup.orders().filter().map_or(1.0, |filter| filter.passed(pitch_m * fx, pitch_m * fy));
        model.transfer(fx, fy) * passed
    })
}

#[cfg(test)]
mod tests {
    use super::super::tests::import;
    use super::*;
    use lightpath_optics::{Grid, OpticalSetup, Orders, SmoothField};
    use num_complex::Complex64;
    use safetensors::Dtype;
    use safetensors::tensor::TensorView;

    fn model() -> DisplayModel {
        let setup = OpticalSetup::try_new(Grid::try_new(32, 48, 8e-6).unwrap(), 515e-9, 3e-3).unwrap();
        let mut errors = SmoothField::flat(3);
        errors.phase.iter_mut().enumerate().for_each(|(i, c)| *c = (i as f64).sin());
        errors.log_amplitude[2] = -0.3;
        DisplayModel {
            kernel: KernelShape::Smooth(errors),
            response: vec![[0.1, -0.05]],
            zero_order: Complex64::new(0.03, 0.01),
            gain: 0.5,
            ..DisplayModel::ideal(setup)
        }
    }

    #[test]
    fn safetensors_that_start_like_a_pickle_are_read() {
        let numbers = vec![1; 4 * 2 * 64 * 96];
        // One of 32 header lengths begins with the first byte of a pickle.
        let files = (1..300).map(|letters| {
            let tensor = TensorView::new(Dtype::F32, vec![64, 96, 2], &numbers).unwrap();
            safetensors::serialize([("x".repeat(letters), tensor)], None).unwrap()
        });
        let similar: Vec<Vec<u8>> = files.filter(|file| file[0] == 0x80).collect();
        assert!(!similar.is_empty());
        assert!(similar.iter().all(|file| import(file, &model().setup).unwrap().form == KernelFormat::Safetensors));
    }

    #[test]
    fn every_form_is_read_back_within_its_error_bound() {
        let model = model();
        let bounds = [
            (KernelFormat::Safetensors, 0.0),
            // 24 bits for phases up to a few radians.
            (KernelFormat::Compact, 1e-6),
            (KernelFormat::Complex64, 1e-7),
            (KernelFormat::Npz, 0.0),
            // 11 bits of precision.
            (KernelFormat::F16, 5e-4),
        ];
        for (format, bound) in bounds {
            let exported = export(&model, KernelModel::Display, format).unwrap();
            assert!(exported.relative_error <= bound, "{format:?}: {}", exported.relative_error);
        }
    }

    #[test]
    fn kernels_of_displays_with_all_orders_have_only_the_native_form() {
        let model = model();
        let model = DisplayModel { setup: model.setup.with_orders(Orders::SQUARE).unwrap(), ..model };
        assert_eq!(export(&model, KernelModel::Display, KernelFormat::Safetensors).unwrap().relative_error, 0.0);
        for format in [KernelFormat::Compact, KernelFormat::Pt, KernelFormat::Npz, KernelFormat::F16] {
            let refused = export(&model, KernelModel::Display, format).unwrap_err();
            assert!(refused.to_string().contains("no other form than safetensors"), "{refused}");
        }
    }

    #[test]
    fn published_forms_keep_the_inner_half() {
        let model = model();
        let inner = |dense: &DisplayModel| Transfer::of(dense).middle(32, 48);
        for format in [KernelFormat::Pt, KernelFormat::Npy] {
            let exported = export(&model, KernelModel::Smooth, format).unwrap();
            let back = import(&exported.bytes, &model.setup).unwrap();
            assert_eq!(back.kind, KernelModel::Paper);
            let off = inner(&back.model)
                .values()
                .iter()
                .zip(inner(&model).values())
                .map(|(a, b)| (a - b).norm())
                .fold(0.0, f32::max);
            assert!(off < 1e-6, "{format:?}: {off}");
            // Three quarters of the spectrum are lost, and the relative error shows it.
            assert!((0.6..1.0).contains(&exported.relative_error), "{}", exported.relative_error);
        }
    }

    #[test]
    fn kernels_of_another_size_and_foreign_files_are_refused() {
        let file = array::npy("<c8", &[30, 48], &[0; 30 * 48 * 8]);
        let error = import(&file, &model().setup).unwrap_err().to_string();
        assert!(error.contains("30×48") && error.contains("32×48") && error.contains("64×96"), "{error}");
        let error = import(b"no kernel at all", &model().setup).unwrap_err().to_string();
        assert!(error.contains("not a readable kernel"), "{error}");
        let error = import(b"\x80\x02}q\x00.", &model().setup).unwrap_err().to_string();
        assert!(error.contains("before 1.6"), "{error}");
        let dark = array::npy("<c8", &[32, 48], &[0; 32 * 48 * 8]);
        let error = import(&dark, &model().setup).unwrap_err().to_string();
        assert!(error.contains("no light passes"), "{error}");
    }
}
