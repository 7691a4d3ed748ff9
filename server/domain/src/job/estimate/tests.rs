//! Tests of the estimates.

use super::*;
use crate::dataset::Encoding;
use crate::job::kinds::optimize_hologram::{self, HologramInputs};
use crate::job::{Area, Fit, ImagePlane, Judging, OptimizeHologram};
use crate::units::{Distance, Wavelength};
use lightpath_optics::hologram::{HologramMethod, InitialPhase, Loss};
use lightpath_optics::{Detector, DisplayModel, Grid, OpticalSetup, RegionOfInterest};

const MIB: u64 = 1 << 20;

fn spec(side_px: usize, planes: usize) -> OptimizeHologram {
    let plane =
        |i: usize| ImagePlane { distance: Distance { nm: 50_000_000 + i as i64 }, target: String::new(), weight: 1.0 };
    OptimizeHologram {
        display: "lab".to_owned(),
        wavelengths: vec![Wavelength { pm: 515_000 }],
        planes: (0..planes).map(plane).collect(),
        depth_map: None,
        target_encoding: Encoding::Srgb,
        target_fit: Fit::Contain,
        target_area: Area::Region,
        kernel_versions: vec![vec![None; planes]],
        judging_versions: vec![vec![None; planes]],
        propagation: None,
        method: HologramMethod::Lbfgs,
        iterations: 200,
        subframes: 1,
        initial_phase: InitialPhase::Random { range_rad: 1.0 },
        seed: 0,
        loss: Loss::default(),
        detector: Detector::Pixel,
        region_of_interest: RegionOfInterest::middle(&Grid::try_new(side_px, side_px, 8e-6).unwrap()),
        weight_mask: None,
        quantization_aware: false,
        judge: Judging::Full,
    }
}

fn need(side_px: usize, spec: &OptimizeHologram, decoding_bytes: u64) -> Need {
    need_judged_by(&[], side_px, spec, decoding_bytes)
}

fn need_judged_by(judging: &[KernelSize], side_px: usize, spec: &OptimizeHologram, decoding_bytes: u64) -> Need {
    let kernels = vec![vec![ideal(side_px, spec.detector); spec.planes.len()]; spec.wavelengths.len()];
    let judging_kernels = vec![judging.to_vec(); spec.wavelengths.len()];
    optimize_hologram::need(spec, &HologramInputs { cache_bytes_max: 0, kernels, judging_kernels, decoding_bytes })
}

fn ideal(side_px: usize, detector: Detector) -> KernelSize {
    let engine = EngineSize::ideal(side_px, side_px, detector, 2);
    KernelSize { engine, order: 0, blocks: Blocks::NONE, has_bins: false, file_bytes: 0 }
}

#[test]
fn largest_display_needs_what_was_measured() {
    // 15 GiB were measured before there were estimates.
    let gib = need(8192, &spec(8192, 1), 0).memory_bytes >> 30;
    assert!((15..=18).contains(&gib), "{gib} GiB");
}

#[test]
fn need_grows_with_everything_that_takes_memory() {
    let one = spec(1024, 1);
    let base = need(1024, &one, 0);
    let grown = [
        need(1024, &spec(1024, 3), 0),
        need(1024, &OptimizeHologram { subframes: 4, ..one.clone() }, 0),
        need(1024, &OptimizeHologram { weight_mask: Some(String::new()), ..one.clone() }, 0),
        need(1024, &one, 2000 * MIB),
        need(1200, &one, 0),
    ];
    for (i, grown) in grown.iter().enumerate() {
        assert!(grown.memory_bytes > base.memory_bytes, "{i}: {grown:?} {base:?}");
    }
    // Wavelengths are optimized one after the other.
    let colours = vec![Wavelength { pm: 450_000 }, Wavelength { pm: 515_000 }];
    let colours = need(1024, &OptimizeHologram { wavelengths: colours, ..one.clone() }, 0);
    assert_eq!(colours.memory_bytes, base.memory_bytes);
    assert!((1.9..=2.0).contains(&(colours.work / base.work)), "{colours:?} {base:?}");
    let adam = OptimizeHologram { method: HologramMethod::Adam { learning_rate: 0.1 }, ..one };
    assert!(10 * need(1024, &adam, 0).memory_bytes < 9 * base.memory_bytes);
}

#[test]
fn judging_by_another_kernel_takes_time_and_its_own_memory() {
    let (one, kernel) = (spec(1024, 1), ideal(1024, Detector::Pixel));
    let base = need(1024, &one, 0);
    let judged = need_judged_by(&[kernel], 1024, &one, 0);
    assert!(judged.work > base.work && judged.memory_bytes >= base.memory_bytes, "{judged:?} {base:?}");
    // A kernel with many local kernels needs more than the hologram.
    let engine = EngineSize { kernels_per_side: 5, ..kernel.engine };
    let large = need_judged_by(&[KernelSize { engine, ..kernel }], 1024, &one, 0);
    assert!(large.memory_bytes > base.memory_bytes, "{large:?} {base:?}");
}

#[test]
fn less_judging_takes_less_time() {
    let kernel = KernelSize { engine: sampled(1024), ..ideal(1024, Detector::Pixel) };
    let need = |judge| {
        let (spec, kernels) = (OptimizeHologram { judge, iterations: 1, ..spec(1024, 1) }, vec![vec![kernel]]);
        let judging_kernels = vec![Vec::new()];
        optimize_hologram::need(
            &spec,
            &HologramInputs { cache_bytes_max: 0, kernels, judging_kernels, decoding_bytes: 0 },
        )
    };
    let [none, quick, full] = [Judging::None, Judging::Quick, Judging::Full].map(need);
    assert!(1.3 * none.work < quick.work && 1.2 * quick.work < full.work, "{none:?} {quick:?} {full:?}");
    assert!(none.memory_bytes <= quick.memory_bytes && quick.memory_bytes <= full.memory_bytes);
}

/// The engine of an ideal display at 50 mm, with its exact transfer functions and the second opinion.
fn sampled(side_px: usize) -> EngineSize {
    let setup = OpticalSetup::try_new(Grid::try_new(side_px, side_px, 8e-6).unwrap(), 515e-9, 50e-3).unwrap();
    EngineSize::of(&DisplayModel::ideal(setup.planned().unwrap().0), Detector::Pixel, 2)
}

#[test]
fn work_is_proportional_to_the_steps() {
    let work = |iterations| need(1024, &OptimizeHologram { iterations, ..spec(1024, 1) }, 0).work;
    let per_step = (work(1000) - work(500)) / 500.0;
    assert!((work(2000) - work(1000) - 1000.0 * per_step).abs() < 1e-6 * work(1000));
    let estimate = Need { memory_bytes: 7, work: 100.0, waiting_s: 0.0 }.on(20.0);
    assert_eq!(estimate, Estimate { memory_bytes: 7, time_s: 5.0 });
}

#[test]
fn kept_pairs_stay_within_their_limits() {
    let splits = [1000, 2, 0];
    let pairs = PairsSize { splits, all: 1002, is_stale: false, photo_px: 1 << 20, decoding_bytes: 0 };
    let [training, validation, test] = pairs.kept_bytes(1 << 20, 1);
    assert_eq!((training, validation, test), (256 * MIB, 16 * MIB, 0));
    assert_eq!(pairs.kept_bytes(1 << 20, 4)[0], 64 * MIB);
}
