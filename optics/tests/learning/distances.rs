//! One display at several distances.

use super::{held_out_loss, learned, options, pairs, simulated_display};
use lightpath_bench::{SimulatedBench, SimulatedDisplay};
use lightpath_optics::learning::{
    Block, Blocks, BoxError, KernelModel, LearnOptions, Learner, LearningPairs, Pair, PairSource, interpolated,
};
use lightpath_optics::{DisplayModel, OpticalSetup};
use rayon::ThreadPoolBuilder;

/// A simulated display whose image moves by some pixels and whose aberrations grow with the distance.
fn bench_on_a_rail(distance_m: f64) -> SimulatedDisplay {
    let rail = SimulatedBench {
        seed: 11,
        rail_tilt_rad: 0.06_f64.to_radians(),
        aberrations_at_m: 6e-3,
        ..SimulatedBench::FAIR
    };
    simulated_display(distance_m, rail)
}

/// Pairs at several distances, one list for each distance.
struct PairsOnRail(Vec<Vec<Pair>>);

impl PairSource for PairsOnRail {
    fn len(&self) -> usize {
        self.0.iter().map(Vec::len).sum()
    }

    fn plane(&self, index: usize) -> usize {
        index / self.0[0].len()
    }

    fn pair(&self, index: usize) -> Result<Pair, BoxError> {
        Ok(self.0[self.plane(index)][index % self.0[0].len()].clone())
    }
}

const RAIL_M: [f64; 3] = [5e-3, 6e-3, 7e-3];

fn pairs_on_rail(count: u64, seed: u64) -> PairsOnRail {
    let at = |(plane, &distance_m): (usize, &f64)| pairs(&bench_on_a_rail(distance_m), count, seed + 50 * plane as u64);
    PairsOnRail(RAIL_M.iter().enumerate().map(at).collect())
}

fn learned_on_rail(options: LearnOptions, learning_pairs: LearningPairs<'_>) -> Vec<DisplayModel> {
    let setups = RAIL_M.map(|distance_m| bench_on_a_rail(distance_m).setup());
    let mut learner = Learner::start_joint(&setups, options, learning_pairs.training).unwrap();
    while learner.step(learning_pairs).unwrap().is_some() {}
    learner.models()
}

#[test]
fn interpolated_display_is_nearly_as_good_as_learned_display() {
    let training = pairs_on_rail(6, 100);
    let models = learned_on_rail(options(&bench_on_a_rail(6e-3), Some(5)), LearningPairs::training_only(&training));
    for distance_m in [5.4e-3, 6.6e-3] {
        let bench = bench_on_a_rail(distance_m);
        let own_pairs = pairs(&bench, 6, 100);
        let learned_there = held_out_loss(
            &bench,
            &learned(&bench, options(&bench, Some(5)), LearningPairs::training_only(&own_pairs)).model(),
        );
        let between = held_out_loss(&bench, &interpolated(&models, bench.setup()).unwrap());
        let ideal = held_out_loss(&bench, &DisplayModel::ideal(bench.setup()));
        // The kernel learned at the nearest photographed distance, less than half a millimetre away.
        let nearest = models.iter().min_by(|a, b| {
            let distance = |model: &DisplayModel| (model.setup.distance_m() - distance_m).abs();
            distance(a).total_cmp(&distance(b))
        });
        let nearest = held_out_loss(&bench, &DisplayModel { setup: bench.setup(), ..nearest.unwrap().clone() });
        assert!(between < 1.2 * learned_there && between < 0.03 * ideal && between < 0.5 * nearest, "{between}");
    }
}

#[test]
fn display_at_several_distances_gets_its_blocks() {
    let at = |distance_m: f64| {
        simulated_display(distance_m, SimulatedBench { seed: 11, crosstalk_px: 0.45, ..SimulatedBench::FAIR })
    };
    let taken = |count: u64, seed: u64| {
        let planes = RAIL_M.iter().enumerate();
        PairsOnRail(planes.map(|(plane, &z_m)| pairs(&at(z_m), count, seed + 50 * plane as u64)).collect())
    };
    let (training, validation) = (taken(4, 100), taken(1, 400));
    let learning_pairs = LearningPairs { training: &training, validation: &validation };
    let models = learned_on_rail(options(&at(6e-3), Some(5)), learning_pairs);
    for model in &models {
        assert_eq!(Blocks::of(model), Blocks::NONE.with(Block::Crosstalk));
        assert!((model.crosstalk.sigma_px()[0] / 0.45 - 1.0).abs() < 0.1, "{:?}", model.crosstalk);
    }
    assert_eq!(interpolated(&models, at(5.5e-3).setup()).unwrap().crosstalk, models[0].crosstalk);
}

#[test]
fn joint_learning_does_not_depend_on_threads_or_pauses() {
    let (training, validation) = (pairs_on_rail(3, 100), pairs_on_rail(1, 400));
    let learning_pairs = LearningPairs { training: &training, validation: &validation };
    let setups = RAIL_M.map(|distance_m| bench_on_a_rail(distance_m).setup());
    let short = || LearnOptions { refinement_evaluations: 6, epochs: 1, ..options(&bench_on_a_rail(6e-3), None) };
    let pool = |threads: usize| ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let one = pool(1).install(|| learned_on_rail(short(), learning_pairs));
    let paused = pool(3).install(|| {
        let mut learner = Learner::start_joint(&setups, short(), &training).unwrap();
        while learner.step(learning_pairs).unwrap().is_some() {
            learner = Learner::resume_joint(&setups, short(), learner.state().into_owned()).unwrap();
        }
        learner.models()
    });
    assert_eq!(one, paused);
}

#[test]
fn joint_learning_refuses_setups_that_differ_in_more_than_distance() {
    let training = pairs_on_rail(1, 100);
    let [near, middle, far] = RAIL_M.map(|distance_m| bench_on_a_rail(distance_m).setup());
    let refused = |setups: &[OpticalSetup], model| {
        let options = LearnOptions { model, ..options(&bench_on_a_rail(6e-3), Some(5)) };
        Learner::start_joint(setups, options, &training).unwrap_err().to_string()
    };
    let display = KernelModel::Display;
    assert!(refused(&[near, middle, near], display).contains("each distance may occur only once"));
    let red = OpticalSetup::try_new(near.grid(), 640e-9, 8e-3).unwrap();
    assert!(refused(&[near, middle, red], display).contains("grid and wavelength must be the same"));
    assert!(refused(&[near, middle, far], KernelModel::Dense).contains("only the models smooth and display"));
    let more = OpticalSetup::try_new(near.grid(), 515e-9, 8e-3).unwrap();
    assert!(refused(&[near, middle, far, more], display).contains("pairs is empty"));
}
