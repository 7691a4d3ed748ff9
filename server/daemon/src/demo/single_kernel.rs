//! The mark for models of a kernel alone: the display's true transfer function, and nothing else of it.

use lightpath_media::kernel_file;
use lightpath_optics::simulated_display::SimulatedDisplay;
use lightpath_optics::{DisplayModel, KernelModel, KernelShape, OpticalSetup, Plane, SimulatedBench};
use num_complex::Complex32;

/// What tables call it.
pub(super) const NAME: &str = "true single kernel";

/// The demo's bench: the same that the server photographs on.
pub(super) fn bench(setup: &OpticalSetup, bench: SimulatedBench) -> anyhow::Result<SimulatedDisplay> {
    Ok(SimulatedDisplay::draw(*setup, None, bench)?)
}

/// Its true transfer function with a flat source, a linear response and no undiffracted light, as a kernel file.
pub(super) fn file(bench: &SimulatedDisplay) -> anyhow::Result<Vec<u8>> {
    let setup = bench.setup();
    let (rows, columns) = (setup.padded_height_px(), setup.padded_width_px());
    let pitch_m = setup.grid().pixel_pitch_m();
    let centred = |i: usize, n: usize| (i as f64 - (n / 2) as f64) / (n as f64 * pitch_m);
    let bins = Plane::from_fn(rows, columns, |y, x| {
        let value = bench.true_transfer(centred(x, columns), centred(y, rows));
        Complex32::new(value.re as f32, value.im as f32)
    });
    let model = DisplayModel { kernel: KernelShape::Bins(bins), ..DisplayModel::ideal(setup) };
    Ok(kernel_file::encode(&model, KernelModel::Dense)?)
}
