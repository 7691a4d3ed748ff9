//! Memory \[bytes\] and work of a simulated bench, counted before it is drawn.
//!
//! The functions mirror the buffers of the files beside this one. The test `tests/memory.rs` compares them with counted
//! allocations, so a change of a buffer must change its function here.
//!
//! ```
//! use lightpath_bench::{BenchSize, SimulatedBench};
//! use lightpath_optics::{Detector, memory::EngineSize};
//!
//! let display = EngineSize::ideal(1080, 1920, Detector::Pixel, 2);
//! let mib = BenchSize::new(display, SimulatedBench::FAIR).simulation_bytes() >> 20;
//! assert!((750..900).contains(&mib), "{mib} MiB");
//! ```

use super::all_orders::{AxisSize, sizes};
use super::bench::SimulatedBench;
use super::field_aberration::POSITIONS;
use lightpath_optics::memory::EngineSize;

/// Memory of a bench while it exists, for each pixel of its display \[bytes\]: source, speckle, and tables of free
/// space.
const BENCH_BYTES_PER_PX: u64 = 32;
/// Memory of each mode of a bench's source, for each pixel of its display \[bytes\]: a transfer function in
/// f64.
const MODE_BYTES_PER_PX: u64 = 64;
/// Memory for drawing a bench or taking a photograph with it, besides the bench, for each pixel of its display
/// \[bytes\]: padded fields and spectra in f64, and their transposed copies.
const EXPOSURE_BYTES_PER_PX: u64 = 324;
/// Memory of a field and of an image in f64, for each pixel \[bytes\].
const FIELD_BYTES_PER_PX: u64 = 48;
/// Memory of a complex number in f64 \[bytes\].
const COMPLEX_BYTES: u64 = 16;
/// Time of a value of the transfer function of all orders, in radix-2 stages of a value.
const TRANSFER_STAGES: f64 = 8.0;
/// Time of a transform of single rows in f64, relative to the engine's in f32.
const F64_FACTOR: f64 = 4.0;

/// Size of a simulated bench.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BenchSize {
    /// Engine of the display. If that shows all orders, its size has the display's setup.
    pub engine: EngineSize,
    /// Properties of the bench.
    pub bench: SimulatedBench,
}

impl BenchSize {
    /// Size of a bench of a display.
    #[must_use]
    pub fn new(engine: EngineSize, bench: SimulatedBench) -> Self {
        Self { engine, bench }
    }

    /// Memory of the bench.
    #[must_use]
    pub fn bench_bytes(&self) -> u64 {
        let Self { engine, bench } = self;
        // The dust is complex.
        let flaws = [bench.surface_waves, bench.response_variation, bench.dust_contrast, bench.dust_contrast];
        let planes = flaws.iter().filter(|&&flaw| flaw > 0.0).count() as u64;
        let transfers = match engine.orders_setup {
            Some(setup) => sizes(&setup, bench).iter().map(passage_bytes).sum(),
            None => bench.modes() as u64 * MODE_BYTES_PER_PX * engine.pixels(),
        };
        (BENCH_BYTES_PER_PX + 8 * planes) * engine.pixels() + transfers
    }

    /// Memory for drawing the bench and for its exposures, with the bench.
    #[must_use]
    pub fn simulation_bytes(&self) -> u64 {
        let Self { engine, bench } = self;
        let exposure = EXPOSURE_BYTES_PER_PX * engine.pixels();
        let orders = engine.orders_setup.map_or(0, |setup| {
            let of_mode = |[x, y]: &[AxisSize; 2]| {
                let parts = if bench.field_aberration_rad > 0.0 { POSITIONS as u64 } else { 1 };
                let columns = (y.places as u64 * frequencies(x) + parts * x.padded_px as u64) * engine.height_px as u64;
                // Of each thread: the transfer function and the spectrum at a frequency along x, before and behind it.
                let scratch = 3 * frequencies(y) + (2 * parts * parts + 1) * y.padded_px as u64;
                (columns + engine.threads as u64 * scratch) * COMPLEX_BYTES
            };
            sizes(&setup, bench).iter().map(of_mode).max().unwrap_or(0)
        });
        self.bench_bytes() + exposure.max(orders + FIELD_BYTES_PER_PX * engine.pixels())
    }

    /// Work of one photograph, in values times radix-2 stages: sixteen images in f64 for each mode of the source.
    #[must_use]
    pub fn simulation_work(&self) -> f64 {
        let Self { engine, bench } = self;
        let (w, h) = (engine.width_px as f64, engine.height_px as f64);
        let images = bench.modes() as f64 * if bench.flicker > 0.0 { 2.0 } else { 1.0 };
        let kernels = if bench.field_aberration_rad > 0.0 { 49.0 } else { 1.0 };
        if let Some(setup) = engine.orders_setup {
            let of_mode = |size: &[AxisSize; 2]| orders_work(size, h, kernels);
            let work: f64 = sizes(&setup, bench).iter().map(of_mode).sum();
            return F64_FACTOR * images / bench.modes() as f64 * work;
        }
        let transforms = 4.0 * w * h * ((16.0 + 4.0) * w.log2() + (8.0 + 2.0 * kernels) * h.log2());
        F64_FACTOR * images * transforms
    }
}

/// What the light of one mode passes, of a bench that shows all orders: errors of the optics, and tables of each axis.
fn passage_bytes([x, y]: &[AxisSize; 2]) -> u64 {
    let tables = |size: &AxisSize| (size.places as u64 + 1) * frequencies(size);
    ((x.padded_px as u64 + 1) * (y.padded_px as u64 + 1) + tables(x) + tables(y)) * COMPLEX_BYTES
}

/// Number of frequencies along an axis.
fn frequencies(size: &AxisSize) -> u64 {
    (size.orders() * size.padded_px) as u64
}

/// Work of an image of one mode, of a bench that shows all orders, whose aberrations take `kernels` transfer functions.
fn orders_work([x, y]: &[AxisSize; 2], height_px: f64, kernels: f64) -> f64 {
    let stages = |size: &AxisSize| size.padded_px as f64 * (size.padded_px as f64).log2();
    let (orders_x, orders_y, places_x, places_y) =
        (x.orders() as f64, y.orders() as f64, x.places as f64, y.places as f64);
    let columns = x.padded_px as f64 * (kernels + orders_x * places_y) * stages(y);
    let rows = height_px * places_x * places_y * stages(x);
    let values = orders_x * orders_y * (x.padded_px * y.padded_px) as f64;
    columns + rows + values * (TRANSFER_STAGES + 2.0 * places_y + 3.0 * kernels)
}
