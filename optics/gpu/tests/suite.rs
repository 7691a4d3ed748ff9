//! The suite of all backends, on the first card of this machine. Without a card a driver that computes on the processor
//! serves (Mesa's llvmpipe: `apt-get install mesa-vulkan-drivers`).
#![allow(clippy::unwrap_used)]

use lightpath_gpu::{Card, CardOrProcessor, GpuBackend};
use lightpath_optics::engine::{EngineCache, Prepared};
use lightpath_optics::hologram::conformance::CHECKS;
use lightpath_optics::hologram::{Loss, Picture};
use lightpath_optics::{Detector, DisplayModel, Grid, HologramProblem, OpticalSetup, Plane, RegionOfInterest};
use std::sync::Arc;

const NEEDED: &str = "a Vulkan driver is needed, such as Debian's mesa-vulkan-drivers";

/// One test, since each test is a process of its own: the shaders are compiled once.
#[test]
fn card_passes_the_suite_of_all_backends() {
    let card = Card::open(0).expect(NEEDED);
    let processor = Arc::new(EngineCache::new(1 << 20));
    for (name, check) in CHECKS {
        let backend = CardOrProcessor(GpuBackend::new(Arc::clone(&card), Arc::clone(&processor)));
        check(&backend);
        // Nothing else is left to the processor, and nothing failed.
        let because = backend.0.computed().processor_because;
        assert!(because.is_none_or(|because| because.contains("total variation")), "{name}");
    }
    assert_eq!(card.fault(), None);
}

/// Sizes with every radix, several stages, and columns of several widths. A problem compares its shaders with the
/// processor when it is made.
#[test]
fn sizes_with_every_radix_agree_with_the_processor() {
    let card = Card::open(0).expect(NEEDED);
    let processor = Arc::new(EngineCache::new(1 << 20));
    let sizes = [
        (90, 160, Detector::Point),
        (98, 77, Detector::Pixel),
        (169, 48, Detector::Supersampled),
        // Its columns exchange real and imaginary parts one after the other where a workgroup has 32 KiB.
        (1080, 16, Detector::Point),
    ];
    for (height_px, width_px, detector) in sizes {
        let grid = Grid::try_new(height_px, width_px, 8e-6).unwrap();
        let model = DisplayModel::ideal(OpticalSetup::try_new(grid, 515e-9, 5e-3).unwrap());
        let target = Plane::from_fn(height_px, width_px, |y, x| 0.5 + 0.4 * ((3 * y + 5 * x) as f32).sin());
        let backend = GpuBackend::new(Arc::clone(&card), Arc::clone(&processor));
        let display = Prepared::new(&model, detector, None).unwrap();
        let picture = Picture { display, target, weight: None, share: 1.0 };
        let region = RegionOfInterest::middle(&grid);
        HologramProblem::on(&backend, vec![picture], 1, region, Loss::default()).unwrap();
        assert_eq!(backend.computed().processor_because, None, "{height_px}×{width_px}");
    }
}
