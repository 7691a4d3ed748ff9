//! The best model that consists of a kernel alone: the true transfer function of the display.

use lightpath_bench::{SimulatedBench, SimulatedDisplay};
use lightpath_media::kernel_file;
use lightpath_optics::{DisplayModel, KernelModel, KernelShape, OpticalSetup, Plane};
use num_complex::Complex32;

/// Name of the model in tables.
pub(super) const NAME: &str = "true single kernel";

/// The simulated bench of the demo. The server takes photographs with the same bench.
pub(super) fn bench(setup: &OpticalSetup, bench: SimulatedBench) -> anyhow::Result<SimulatedDisplay> {
    Ok(SimulatedDisplay::draw(*setup, None, bench)?)
}

/// A kernel file with the true transfer function, a flat source, a linear response and no undiffracted light.
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
