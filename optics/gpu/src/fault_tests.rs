//! What must come of faults in a card: the processor's numbers.

use crate::{Card, Computed, Fault, GpuBackend};
use lightpath_optics::engine::{EngineCache, Prepared};
use lightpath_optics::hologram::{AdamState, Backend, Loss, Picture, Project};
use lightpath_optics::metrics::Gain;
use lightpath_optics::{Detector, DisplayModel, Grid, OpticalSetup, Plane, RegionOfInterest};
use std::sync::Arc;
use std::sync::atomic::Ordering;

const SIDE_PX: usize = 32;

pub(crate) fn card() -> Arc<Card> {
    Card::open(0).expect("a Vulkan driver is needed, such as Debian's mesa-vulkan-drivers")
}

pub(crate) fn problem(backend: &dyn Backend) -> Box<dyn Project> {
    let grid = Grid::try_new(SIDE_PX, SIDE_PX, 8e-6).unwrap();
    let model = DisplayModel::ideal(OpticalSetup::try_new(grid, 515e-9, 3e-3).unwrap());
    let target = Plane::from_fn(SIDE_PX, SIDE_PX, |y, x| 0.5 + 0.4 * ((3 * y + 5 * x) as f32).sin());
    let display = Prepared::new(&model, Detector::Point, None).unwrap();
    let picture = Picture { display, target, weight: None, share: 1.0 };
    backend.hologram(vec![picture], 1, RegionOfInterest::full(&grid), Loss::default()).unwrap()
}

/// A problem on a card with the backend that made it, and the same on the processor.
fn on_both(card: &Arc<Card>) -> (GpuBackend, Box<dyn Project>, Box<dyn Project>) {
    let processor = Arc::new(EngineCache::new(1 << 20));
    let backend = GpuBackend::new(Arc::clone(card), Arc::clone(&processor));
    let on_card = problem(&backend);
    (backend, on_card, problem(&*processor))
}

/// Whether all calls have the same bits: the processor answered.
fn have_same_bits(first: &mut dyn Project, second: &mut dyn Project) -> bool {
    let phase: Vec<f32> = (0..SIDE_PX * SIDE_PX).map(|i| (0.7 * i as f32).sin()).collect();
    let all = |body: &mut dyn Project| {
        let mut gradient = vec![0.0; phase.len()];
        let evaluation = body.evaluate(&phase, Gain::Fitted, &mut gradient);
        let (mut next, mut wanted) = (phase.clone(), body.target_amplitudes());
        let round = body.project(&mut next, &mut wanted, true);
        let field = body.back_propagated(&phase);
        let mut adam = AdamState::new(phase.clone(), 1.0);
        body.adam_steps(&mut adam, 0.1, 3, &mut gradient.clone(), &mut |_| {});
        (evaluation, gradient, body.measure(&phase, 1.0), body.light(&phase), (round, next, wanted, field, adam))
    };
    all(first) == all(second)
}

fn because(computed: &Computed) -> &str {
    computed.processor_because.as_deref().unwrap_or("nothing")
}

#[test]
fn shader_that_is_wrong_in_one_bin_is_found_before_its_first_use() {
    let card = card();
    let wrong = "    inverse(lt, cc);\n    if (half == 1u) { if (group.x == 3u && lid == 5u) { z[0] *= 1.01f; } }\n";
    *card.planted.wrong.lock().unwrap() = Some(("columns there", "    inverse(lt, cc);\n", wrong));
    let (backend, mut on_card, mut on_processor) = on_both(&card);
    assert!(because(&backend.computed()).contains("is off by"), "{}", backend.computed());
    assert!(matches!(card.fault(), Some(Fault::Wrong(_))), "{:?}", card.fault());
    assert!(have_same_bits(&mut *on_card, &mut *on_processor));
}

#[test]
fn job_goes_on_on_the_processor_when_its_card_returns_zeros_or_is_lost() {
    let faults: [fn(&Card); 2] = [|card| card.planted.zeros.store(true, Ordering::Relaxed), Card::lose];
    for fault in faults {
        let card = card();
        let (backend, mut on_card, mut on_processor) = on_both(&card);
        assert_eq!(because(&backend.computed()), "nothing");
        assert!(!have_same_bits(&mut *on_card, &mut *on_processor), "the card rounds in another order");
        fault(&card);
        assert!(have_same_bits(&mut *on_card, &mut *on_processor));
        assert_ne!(because(&backend.computed()), "nothing");
        assert!(backend.computed().card.is_some() && card.fault().is_some());
        // The next problem does not try the card again.
        let mut next = problem(&backend);
        assert!(have_same_bits(&mut *next, &mut *on_processor));
    }
}

#[test]
fn every_allocation_may_be_refused() {
    let card = card();
    let mut refused = 0;
    for allocation in 0.. {
        card.planted.allocations.store(allocation, Ordering::Relaxed);
        let (backend, mut on_card, mut on_processor) = on_both(&card);
        let agree = have_same_bits(&mut *on_card, &mut *on_processor);
        if card.planted.allocations.load(Ordering::Relaxed) >= 0 {
            break;
        }
        assert!(because(&backend.computed()).contains("planted"), "{allocation}: {}", backend.computed());
        assert_eq!(card.fault(), None, "a full card serves others");
        refused += usize::from(agree);
    }
    assert!(refused > 10, "{refused}");
}
