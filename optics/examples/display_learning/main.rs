//! Measures the quality of learned displays: simulates displays, photographs holograms on each, learns models from the
//! photographs, and measures each model by photographs of new holograms optimized through it.
//!
//! ```sh
//! cargo run --release -p lightpath-optics --example display_learning -- --size 640x360 --seeds 1,2,3,4,5
//! cargo run --release -p lightpath-optics --example display_learning -- --pairs 4 --models display
//! cargo run --release -p lightpath-optics --example display_learning -- --bench field_aberration_rad=2 --models display,varying
//! cargo run --release -p lightpath-optics --example display_learning -- --size 640x360 --bench surface_waves=1.5 --yardstick yes
//! cargo run --release -p lightpath-optics --example display_learning -- --distance 0.02 --orders all --fill-factor 0.9
//! cargo run --release -p lightpath-optics --example display_learning -- --bench camera_nonlinearity=0.1 --judge light
//! cargo run --release -p lightpath-optics --example display_learning -- --wrong 1 --saturated 0.02 --rotation-deg 0.02
//! ```
//!
//! The example prints one line for each model: its held-out error; that error relative to the error of the display's
//! true transfer function (the lower bound for any single kernel); the PSNR of photographs of new targets; their gain
//! over the ideal kernel, target by target; and the cost of learning. With `--yardstick yes`, `bench 1` and `bench 2π`
//! are holograms that are optimized through the bench itself, from a random phase of that range \[rad\]: no model can
//! be better. With `--judge light`, the PSNR is that of the light on the camera instead of that of its photograph; the
//! camera's response bends photographs only. With `--align yes`, a second line has the PSNR after the affine move that
//! aligns each photograph with its target: what moves, turns or stretches the image costs nothing there. With
//! `--calibrate yes`, a photograph of a grid of dots tells the camera's map with its lens's distortion, and eight more
//! photographs move it, as `lightpath dataset align` does. All photographs of models are corrected by it before they are
//! learned from or judged.
//!
//! With `--orders all`, the displays show all orders of their pixels. No single transfer function describes them, so
//! the line of the true one is left out.
#![allow(clippy::print_stdout)] // an example prints its results

mod camera_mistakes;
mod evaluation;
mod lab;
mod memory;
mod options;
mod photographed;

use evaluation::{ModelEvaluation, ModelScore};
use lab::Lab;
use lightpath_optics::learning::{
    KernelModel, LearnOptions, LearnStage, Learner, LearningPairs, PairSource as _, PartStrength,
};
use lightpath_optics::{DisplayModel, KernelShape};
use options::{Failure, Options};
use photographed::PhotographedPairs;
use std::f64::consts::TAU;
use std::time::Instant;

fn main() -> Result<(), Failure> {
    let options = Options::parse(std::env::args().skip(1))?;
    rayon::ThreadPoolBuilder::new().num_threads(options.threads).build_global()?;
    println!("seed model      test MSE   /true  captured PSNR [dB]         gain [dB]                   seconds  MB");
    for &seed in &options.seeds {
        show_display(&options, seed)?;
    }
    Ok(())
}

fn show_display(options: &Options, seed: u64) -> Result<(), Failure> {
    let lab = Lab::draw(options, seed)?;
    let training = lab.photograph(options.pairs, 0)?;
    let validation = lab.photograph(options.validation, 1)?;
    let test = lab.clean().photograph(options.test, 2)?;
    let evaluation = ModelEvaluation::new(&lab, &test, options)?;

    let lower_bound = lab.true_kernel().map(|model| evaluation.score(&model)).transpose()?;
    let bound_loss = lower_bound.as_ref().map_or(f64::NAN, |bound| bound.test_loss);
    let ideal = evaluation.score(&DisplayModel::ideal(lab.setup()))?;
    let show = |name: &str, score: &ModelScore, cost: &str| {
        let gains: Vec<f64> = score.captured_db.iter().zip(&ideal.captured_db).map(|(a, b)| a - b).collect();
        let list = |values: &[f64]| values.iter().map(|value| format!("{value:5.1}")).collect::<Vec<_>>().join(" ");
        println!(
            "{seed:4} {name:8} {:11.6} {:7.3}  {:26} {:26} {cost}",
            score.test_loss,
            score.test_loss / bound_loss,
            list(&score.captured_db),
            list(&gains)
        );
        if !score.aligned_db.is_empty() {
            println!("     aligned                       {:26}", list(&score.aligned_db));
        }
    };
    show("ideal", &ideal, "");
    if let Some(lower_bound) = &lower_bound {
        show("true", lower_bound, "");
    }
    if options.yardstick {
        for (name, range_rad) in [("bench 1", 1.0), ("bench 2π", TAU)] {
            show(name, &evaluation.best_score(range_rad)?, "");
        }
    }
    for &model in &options.models {
        let (learned, cost) = learn(options, &lab, model, seed, &training, &validation)?;
        show(options::name(model), &evaluation.score(&learned)?, &cost);
    }
    Ok(())
}

fn learn(
    options: &Options,
    lab: &Lab,
    model: KernelModel,
    seed: u64,
    training: &PhotographedPairs,
    validation: &PhotographedPairs,
) -> Result<(DisplayModel, String), Failure> {
    let defaults = LearnOptions::new(model, lab.region());
    let learn_options = LearnOptions {
        seed,
        degree: options.degree,
        epochs: options.epochs.unwrap_or(defaults.epochs),
        refinement_evaluations: options.evaluations.unwrap_or(defaults.refinement_evaluations),
        ..defaults
    };
    let learning_pairs = LearningPairs { training, validation };
    memory::reset_peak();
    let began = Instant::now();
    let mut learner = Learner::start(lab.setup(), learn_options, training)?;
    let mut adam_s = 0.0;
    while let Some(step) = learner.step(learning_pairs)? {
        if options.verbose {
            eprintln!("  {:6.1} s  {step:?}", began.elapsed().as_secs_f64());
        }
        if step.stage == LearnStage::Adam {
            adam_s = began.elapsed().as_secs_f64();
        }
    }
    let (kept_pairs, degree) = (learner.kept_pairs(training.len()).len(), degree(&learner.model()));
    let total_s = began.elapsed().as_secs_f64();
    let memory = memory::peak_mb().map_or_else(String::new, |mb| format!("{mb:5.0}"));
    let parts = PartStrength::all_of(&learner.model());
    let kept = parts.iter().filter(|strength| strength.kept);
    let parts: String = kept.map(|strength| format!(", {} ({})", strength.part.name(), strength.text(0))).collect();
    let how = format!("({adam_s:.1} s of Adam, degree {degree}{parts}, {kept_pairs} pairs)");
    Ok((learner.model(), format!("{total_s:7.1} {memory}  {how}")))
}

fn degree(model: &DisplayModel) -> usize {
    match &model.kernel {
        KernelShape::Smooth(field) => field.order,
        KernelShape::Ideal | KernelShape::Bins(_) => 0,
    }
}
