//! Conversions of kernels to other forms: they take no more memory than is counted for them.

use super::{alone, message, require_counted};
use lightpath_media::kernel_file;
use lightpath_media::kernel_formats::{KernelFormat, export, exporting_bytes};
use lightpath_optics::{DisplayModel, Grid, KernelModel, KernelShape, OpticalSetup, SmoothField};

fn smooth([height_px, width_px]: [usize; 2]) -> DisplayModel {
    let setup = OpticalSetup::try_new(Grid::try_new(height_px, width_px, 3.74e-6).unwrap(), 515e-9, 0.05).unwrap();
    let errors = SmoothField { order: 1, log_amplitude: vec![0.1, 0.2], phase: vec![0.3, -0.1] };
    DisplayModel { kernel: KernelShape::Smooth(errors), ..DisplayModel::ideal(setup) }
}

/// Converts a kernel file, for which the file itself is counted but allocated before.
fn export_within(model: &DisplayModel, format: KernelFormat) -> u64 {
    let file = kernel_file::encode(model, KernelModel::Smooth).unwrap();
    let counted_bytes = exporting_bytes(format, file.len() as u64, &model.setup);
    let name = format!("{} of {} px", format.as_str(), model.setup.grid().width_px());
    let refusal = require_counted(&name, counted_bytes - file.len() as u64, || {
        let (model, kind) = kernel_file::decode(&file).unwrap();
        message(export(&model, kind, format))
    });
    assert_eq!(refusal, "", "{name}");
    counted_bytes
}

#[test]
fn every_form_takes_what_is_counted() {
    let _alone = alone();
    for format in KernelFormat::ALL {
        export_within(&smooth([72, 128]), format);
    }
    // The form that takes most.
    export_within(&smooth([200, 356]), KernelFormat::Npz);
}

#[test]
fn forms_with_parameters_alone_take_little_at_any_size() {
    let _alone = alone();
    for format in [KernelFormat::Compact, KernelFormat::Bundle] {
        let counted_bytes = export_within(&smooth([4320, 7680]), format);
        assert!(counted_bytes < 20 << 20, "{}: {counted_bytes} bytes are counted", format.as_str());
    }
}
