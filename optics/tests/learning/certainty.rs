//! How certain learned models are, and which holograms would make them more certain.

use super::{HEIGHT_PX, WIDTH_PX, bench, held_out_loss, learned, options, pairs, simulated_display};
use lightpath_bench::{SimulatedBench, SimulatedDisplay};
use lightpath_optics::hologram::initial_phase;
use lightpath_optics::learning::{
    HologramChoice, LearnOptions, LearningPairs, Measure, ModelPart, ModelUncertainty, Pair, PartStrength,
};
use lightpath_optics::{Detector, DisplayModel, RegionOfInterest};

#[test]
fn predicted_response_uncertainty_matches_scatter() {
    let bench = bench(12);
    let region = RegionOfInterest::middle(&bench.setup().grid());
    let phases: Vec<f64> = (0..16).map(|i| f64::from(i) * std::f64::consts::TAU / 16.0).collect();
    let error = |model: &DisplayModel, phase: f64| -> f64 {
        let harmonic = |(k, [a, b]): (f64, &[f64; 2])| a * (k * phase).sin() + b * (k * phase).cos();
        [1.0, 2.0, 3.0].into_iter().zip(&model.response).map(harmonic).sum()
    };
    // Learns the same display several times, from photographs of different holograms.
    let (mut curves, mut predicted) = (Vec::new(), Vec::new());
    for set in 0..5 {
        let training = pairs(&bench, 8, 1000 * (set + 1));
        let model = learned(&bench, options(&bench, Some(5)), LearningPairs::training_only(&training)).model();
        let mut uncertainty = ModelUncertainty::of(&model, Detector::Pixel, None, region).unwrap().unwrap();
        assert_eq!(uncertainty.response(), None, "without pairs there is no covariance");
        training.iter().for_each(|pair| uncertainty.add(pair).unwrap());
        let covariance = uncertainty.response().unwrap();
        predicted.push(phases.iter().map(|&phase| covariance.deviation_rad(phase).powi(2)).sum::<f64>());
        curves.push(phases.iter().map(|&phase| error(&model, phase)).collect::<Vec<f64>>());
    }
    let spread = |i: usize| {
        let mean = curves.iter().map(|curve| curve[i]).sum::<f64>() / curves.len() as f64;
        curves.iter().map(|curve| (curve[i] - mean).powi(2)).sum::<f64>() / (curves.len() - 1) as f64
    };
    let observed = (0..phases.len()).map(spread).sum::<f64>();
    let predicted = predicted.iter().sum::<f64>() / predicted.len() as f64;
    assert!((0.4..2.5).contains(&(predicted / observed).sqrt()), "{predicted} against {observed}");
    assert!(
        ModelUncertainty::of(&DisplayModel::ideal(bench.setup()), Detector::Pixel, None, region).unwrap().is_none()
    );
}

/// The uncertainty of a model, from the pairs that it was learned from.
fn uncertainty(model: &DisplayModel, training: &[Pair]) -> ModelUncertainty {
    let region = RegionOfInterest::middle(&model.setup.grid());
    let mut uncertainty = ModelUncertainty::of(model, Detector::Pixel, None, region).unwrap().unwrap();
    training.iter().for_each(|pair| uncertainty.add(pair).unwrap());
    uncertainty
}

/// Of each measure of a part, one of its numbers.
fn numbers(strengths: &[PartStrength], part: ModelPart, of: impl Fn(&Measure) -> Option<f64>) -> Vec<Option<f64>> {
    let strength = strengths.iter().find(|strength| strength.part == part).unwrap();
    strength.measures.iter().map(of).collect()
}

/// Both numbers of a part.
fn both(numbers: Vec<Option<f64>>) -> [f64; 2] {
    numbers.into_iter().flatten().collect::<Vec<_>>().try_into().unwrap()
}

#[test]
fn uncertainty_of_strengths_matches_scatter() {
    let flawed = SimulatedBench { seed: 12, crosstalk_px: 0.4, crosstalk_y_px: 0.3, ..SimulatedBench::FAIR };
    let bench = simulated_display(6e-3, flawed);
    let (mut found, mut predicted) = (Vec::new(), [0.0; 2]);
    let sets = 3;
    for set in 0..sets {
        let training = pairs(&bench, 8, 1000 * (set + 1));
        let validation = pairs(&bench, 2, 9000 + 1000 * set);
        let learning_pairs = LearningPairs { training: &training, validation: &validation };
        let model = learned(&bench, options(&bench, Some(5)), learning_pairs).model();
        let strengths = uncertainty(&model, &training).strengths().unwrap();
        let crosstalk = |of: fn(&Measure) -> Option<f64>| numbers(&strengths, ModelPart::Crosstalk, of);
        found.push(both(crosstalk(|measure| measure.value)));
        let deviations = both(crosstalk(|measure| measure.std));
        (0..2).for_each(|axis| predicted[axis] += deviations[axis].powi(2) / sets as f64);
        assert_eq!(crosstalk(|measure| measure.hidden), [None; 2], "cross-talk that was found is not hidden");
        assert_eq!(numbers(&strengths, ModelPart::Ghost, |measure| measure.std.or(measure.value)), [None; 3]);
    }
    for axis in 0..2 {
        let mean = found.iter().map(|sigma| sigma[axis]).sum::<f64>() / found.len() as f64;
        let scatter = found.iter().map(|sigma| (sigma[axis] - mean).powi(2)).sum::<f64>() / (found.len() - 1) as f64;
        let ratio = (predicted[axis] / scatter).sqrt();
        assert!((0.25..4.0).contains(&ratio), "{} and {} px along axis {axis}", predicted[axis].sqrt(), scatter.sqrt());
    }
}

#[test]
fn less_cross_talk_can_hide_among_more_photographs() {
    let bench = bench(12);
    let training = pairs(&bench, 16, 100);
    let model = learned(&bench, options(&bench, Some(5)), LearningPairs::training_only(&training)).model();
    let hidden_px = |count: usize| {
        let strengths = uncertainty(&model, &training[..count]).strengths().unwrap();
        let hidden = |part| numbers(&strengths, part, |measure| measure.hidden);
        assert_eq!(numbers(&strengths, ModelPart::Crosstalk, |measure| measure.std.or(measure.value)), [None; 2]);
        assert!(hidden(ModelPart::UnevenResponse)[0].unwrap() < 0.05, "{strengths:?}");
        both(hidden(ModelPart::Crosstalk))
    };
    let ([x4, y4], [x16, y16]) = (hidden_px(4), hidden_px(16));
    assert!(x16 < x4 && y16 < y4 && x4 < 0.6 && x16 > 0.0, "{x4} and {y4} px, then {x16} and {y16} px");
    assert!(uncertainty(&model, &training[..2]).strengths().is_none(), "two photographs say nothing of the scatter");
}

/// Pairs of holograms that start from random phases in one range.
fn pairs_in_range(bench: &SimulatedDisplay, range_rad: f64, count: u64, seed: u64) -> Vec<Pair> {
    let one = |i: u64| {
        let phase = initial_phase(HEIGHT_PX, WIDTH_PX, range_rad, seed + i).unwrap();
        let photo = bench.capture(&phase, seed + i).unwrap().map(|level| f32::from(level) / 255.0);
        Pair { phase, photo }
    };
    (0..count).map(one).collect()
}

#[test]
fn suggested_holograms_teach_more_than_others() {
    let bench = bench(14);
    let narrow = pairs_in_range(&bench, 0.6, 6, 100);
    let short = || LearnOptions { epochs: 2, ..options(&bench, Some(5)) };
    let model = learned(&bench, short(), LearningPairs::training_only(&narrow)).model();
    let region = RegionOfInterest::middle(&bench.setup().grid());
    let mut choice = HologramChoice::of(&model, Detector::Pixel, None, region).unwrap().unwrap();
    assert_eq!(choice.best(6, 2), [], "without holograms there is no choice");
    for pair in &narrow {
        choice.add_photographed(pair.phase.clone()).unwrap();
    }
    let more = [pairs_in_range(&bench, 0.6, 3, 300), pairs_in_range(&bench, 6.0, 3, 400)].concat();
    for pair in &more {
        choice.add_candidate(pair.phase.clone()).unwrap();
    }
    let suggestions = choice.best(6, 2);
    let chosen: Vec<usize> = suggestions.iter().map(|suggestion| suggestion.candidate).collect();
    assert!(chosen.len() == 2 && chosen.iter().all(|&candidate| candidate >= 3), "{suggestions:?}");
    let [first, second] = [suggestions[0], suggestions[1]];
    assert!(second.error_db < first.error_db && first.error_db < -3.0 && first.part_db < 0.0, "{suggestions:?}");
    assert_eq!(choice.best(6, 10).len(), 6, "there are only six candidates");
    let with = |chosen: &[usize]| {
        let training: Vec<Pair> = narrow.iter().chain(chosen.iter().map(|&i| &more[i])).cloned().collect();
        held_out_loss(&bench, &learned(&bench, short(), LearningPairs::training_only(&training)).model())
    };
    let (suggested, other) = (with(&chosen), with(&[0, 1]));
    assert!(suggested < 0.5 * other, "{suggested:e} with suggested holograms, {other:e} with others like the first");
}
