//! The same bytes on any number of threads, and after interruptions.

use super::orders::bench_of_all_orders;
use super::{learned, options, pairs, simulated_display};
use lightpath_optics::learning::{KernelModel, LearnOptions, Learner, LearningPairs};
use lightpath_optics::simulated_display::SimulatedBench;
use rayon::ThreadPoolBuilder;

#[test]
fn learning_does_not_depend_on_threads_or_pauses() {
    let flaws =
        SimulatedBench { crosstalk_px: 0.4, surface_waves: 1.0, response_variation: 0.1, ..SimulatedBench::FAIR };
    let first = simulated_display(
        6e-3,
        SimulatedBench { seed: 10, dust_contrast: 0.2, ghost_share: 0.04, blur_px: 0.6, ..flaws },
    );
    let all = bench_of_all_orders(10);
    for (bench, model, refinement_evaluations) in
        [(&first, KernelModel::Display, 8), (&first, KernelModel::Varying, 4), (&all, KernelModel::Display, 3)]
    {
        let (training, validation) = (pairs(bench, 5, 100), pairs(bench, 2, 400));
        let learning_pairs = LearningPairs { training: &training, validation: &validation };
        let options = LearnOptions { model, refinement_evaluations, epochs: 2, ..options(bench, None) };
        let on = |threads: usize| {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| learned(bench, options.clone(), learning_pairs).model())
        };
        let one = on(1);
        assert_eq!(one, on(2));
        assert_eq!(one, on(8));

        let mut learner = Learner::start(bench.setup(), options.clone(), &training).unwrap();
        while learner.step(learning_pairs).unwrap().is_some() {
            learner = Learner::resume(bench.setup(), options.clone(), learner.state().into_owned()).unwrap();
        }
        assert_eq!(one, learner.model());
    }
}
