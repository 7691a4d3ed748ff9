//! The same bytes on any number of threads, and after interruptions.

use super::orders::bench_of_all_orders;
use super::{learned, options, pairs, simulated_display};
use lightpath_bench::{SimulatedBench, SimulatedDisplay};
use lightpath_optics::learning::{KernelModel, LearnOptions, Learner, LearningPairs};
use rayon::ThreadPoolBuilder;

#[test]
fn learning_does_not_depend_on_threads_or_pauses() {
    is_repeatable(&flawed(), (KernelModel::Display, None), 8, [5, 2]);
}

#[test]
fn learning_a_varying_kernel_does_not_depend_on_threads_or_pauses() {
    is_repeatable(&flawed(), (KernelModel::Varying, None), 4, [5, 2]);
}

#[test]
fn learning_all_orders_does_not_depend_on_threads_or_pauses() {
    // One degree of the kernel and few pairs: each takes five times as long as on a display that shows one order.
    is_repeatable(&bench_of_all_orders([48, 64], 10), (KernelModel::Display, Some(5)), 2, [2, 1]);
}

/// A display that needs every part of the model.
fn flawed() -> SimulatedDisplay {
    let flaws =
        SimulatedBench { crosstalk_px: 0.4, surface_waves: 1.0, response_variation: 0.1, ..SimulatedBench::FAIR };
    simulated_display(6e-3, SimulatedBench { seed: 10, dust_contrast: 0.2, ghost_share: 0.04, blur_px: 0.6, ..flaws })
}

/// Learns the same display from some pairs for training and for validation on one thread, and on eight with a pause after
/// each step.
fn is_repeatable(
    bench: &SimulatedDisplay,
    (model, order): (KernelModel, Option<usize>),
    refinement_evaluations: u32,
    [training, validation]: [u64; 2],
) {
    let (training, validation) = (pairs(bench, training, 100), pairs(bench, validation, 400));
    let learning_pairs = LearningPairs { training: &training, validation: &validation };
    let options = LearnOptions { model, refinement_evaluations, epochs: 2, ..options(bench, order) };
    let pool = |threads: usize| ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let at_once = pool(1).install(|| learned(bench, options.clone(), learning_pairs).model());
    let paused = pool(8).install(|| {
        let mut learner = Learner::start(bench.setup(), options.clone(), &training).unwrap();
        while learner.step(learning_pairs).unwrap().is_some() {
            learner = Learner::resume(bench.setup(), options.clone(), learner.state().into_owned()).unwrap();
        }
        learner.model()
    });
    assert_eq!(at_once, paused);
}
