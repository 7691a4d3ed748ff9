//! Measurements of the demo: tables for people and JSON for programs.

use super::args::DemoArgs;
use super::demo_client::Losses;
use super::figures;
use super::held_out::Evaluated;
use super::learned::Learned;
use super::single_kernel;
use super::targets::Targets;
use lightpath::names;
use serde::Serialize;
use std::fmt::Write as _;

/// A kernel, with the report of its learning.
pub(super) struct ModelRow<'a> {
    pub(super) evaluated: &'a Evaluated,
    pub(super) learned: Option<&'a Learned>,
}

/// All measurements, as in `report.json`.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    code_version: &'static str,
    seed: u64,
    width_px: u32,
    height_px: u32,
    pixel_pitch_m: f64,
    wavelength_m: f64,
    distance_m: f64,
    training_pairs: usize,
    test_pairs: usize,
    iterations: u32,
    training_iterations: u32,
    /// Names of the held-out targets, in the order of all other lists of targets.
    targets: Vec<String>,
    models: Vec<Model>,
    /// Held-out loss of the display's true transfer function alone.
    single_kernel_floor: f64,
    /// Smallest gain of the learned kernel over the ideal one, among all targets \[dB\].
    smallest_gain_db: f64,
    steps: Vec<StepTime>,
    total_s: f64,
}

#[derive(Debug, Serialize)]
struct Model {
    name: &'static str,
    /// Resource name of the version; `None`: the ideal kernel.
    kernel_version: Option<String>,
    held_out_loss: f64,
    losses: Losses,
    train_loss: Option<f64>,
    learn_s: Option<f64>,
    loss_history: Vec<f64>,
    simulated_psnr_db: Vec<f64>,
    captured_psnr_db: Vec<f64>,
    /// Gain in the PSNR of the captures over those through the ideal kernel, for each target \[dB\].
    gain_db: Vec<f64>,
    mean_simulated_psnr_db: f64,
    mean_captured_psnr_db: f64,
    mean_gain_db: f64,
}

#[derive(Debug, Serialize)]
struct StepTime {
    title: String,
    took_s: f64,
}

impl Report {
    /// Creates the report. `evaluated` starts with the ideal kernel and the active one.
    pub(super) fn new(
        args: &DemoArgs,
        targets: &Targets,
        learned: &[Learned],
        evaluated: &[Evaluated],
        steps: Vec<(String, f64)>,
    ) -> Self {
        let models: Vec<Model> =
            evaluated.iter().map(|kernel| Model::new(&row_of(kernel, learned), &evaluated[0])).collect();
        let floor = models.iter().find(|model| model.name == single_kernel::NAME);
        Self {
            code_version: env!("CARGO_PKG_VERSION"),
            seed: args.seed,
            width_px: args.resolution().0,
            height_px: args.resolution().1,
            pixel_pitch_m: args.pixel_pitch,
            wavelength_m: args.wavelength,
            distance_m: args.distance_m(),
            training_pairs: targets.training.len(),
            test_pairs: targets.test.len(),
            iterations: args.iterations,
            training_iterations: args.training_iterations,
            targets: targets.held_out.iter().map(|target| target.name.clone()).collect(),
            single_kernel_floor: floor.map_or(f64::NAN, |model| model.held_out_loss),
            smallest_gain_db: models[1].gain_db.iter().copied().fold(f64::INFINITY, f64::min),
            models,
            total_s: steps.iter().map(|(_, took_s)| took_s).sum(),
            steps: steps.into_iter().map(|(title, took_s)| StepTime { title, took_s }).collect(),
        }
    }

    /// A table in the form of the paper: errors of predicted photographs, through the ideal kernel and through learned
    /// ones.
    pub(super) fn paper_table(&self) -> String {
        let mut text = format!(
            "Mean squared error (L2) of predicted photographs\n\n{:<20}{:>12}{:>12}{:>12}{:>12}{:>12}\n{:<20}{:>24}{:>24}\n",
            "", "train", "test", "train", "test", "learned in", "kernel", "middle 80 %", "full frame"
        );
        for model in &self.models {
            let Losses { train, test } = model.losses;
            let took = model.learn_s.map_or_else(String::new, |took_s| format!("{took_s:.0} s"));
            let _ = writeln!(
                text,
                "{:<20}{:>12.6}{:>12.6}{:>12.6}{:>12.6}{took:>12}",
                model.name, train.region, test.region, train.full_frame, test.full_frame
            );
        }
        text
    }

    pub(super) fn json(&self) -> serde_json::Result<String> {
        serde_json::to_string_pretty(self)
    }

    /// Two tables: the models, and their captures of each target.
    pub(super) fn table(&self) -> String {
        let mut text = format!(
            "{:<20}{:>8}{:>15}{:>16}{:>15}{:>11}\n",
            "model", "version", "held-out loss", "simulated PSNR", "captured PSNR", "gain"
        );
        for model in &self.models {
            let version = model.kernel_version.as_deref().map_or("–", names::id);
            let _ = writeln!(
                text,
                "{:<20}{version:>8}{:>15.6}{:>13.1} dB{:>12.1} dB{:>11}",
                model.name,
                model.held_out_loss,
                model.mean_simulated_psnr_db,
                model.mean_captured_psnr_db,
                gain(model, model.mean_gain_db),
            );
        }
        let _ = write!(text, "\n{:<20}", "captured");
        for target in &self.targets {
            let _ = write!(text, "{target:>20}");
        }
        for model in &self.models {
            let _ = write!(text, "\n{:<20}", model.name);
            for (psnr_db, gain_db) in model.captured_psnr_db.iter().zip(&model.gain_db) {
                let _ = write!(text, "{:>20}", format!("{psnr_db:.1} dB {:>9}", gain(model, *gain_db)));
            }
        }
        let learned = &self.models[1];
        let _ = write!(
            text,
            "\n\nWith the learned kernel every held-out target gains {} or more. The held-out loss is {:.0} % of the loss of \
             the\ndisplay's true transfer function alone ({:.6}). Losses exclude saturated pixels. Captured PSNR is what counts:\nsimulated PSNR is what each model says of its own holograms.",
            figures::signed_db(self.smallest_gain_db),
            100.0 * learned.held_out_loss / self.single_kernel_floor,
            self.single_kernel_floor
        );
        text
    }
}

fn gain(model: &Model, gain_db: f64) -> String {
    if model.kernel_version.is_none() { String::new() } else { figures::signed_db(gain_db) }
}

impl Model {
    fn new(row: &ModelRow<'_>, ideal: &Evaluated) -> Self {
        let ModelRow { evaluated, learned } = row;
        let captured_psnr_db: Vec<f64> = evaluated.shown.iter().map(|shown| shown.captured_psnr_db).collect();
        let gains = captured_psnr_db.iter().zip(&ideal.shown).map(|(psnr_db, ideal)| psnr_db - ideal.captured_psnr_db);
        Self {
            name: evaluated.candidate.name,
            kernel_version: evaluated.candidate.version.clone(),
            held_out_loss: evaluated.losses.test.region,
            losses: evaluated.losses,
            train_loss: learned.map(|learned| learned.metrics.train_loss),
            learn_s: learned.map(|learned| learned.seconds),
            loss_history: learned.map(|learned| learned.loss_history.clone()).unwrap_or_default(),
            simulated_psnr_db: evaluated.shown.iter().map(|shown| shown.simulated_psnr_db).collect(),
            gain_db: gains.collect(),
            captured_psnr_db,
            mean_simulated_psnr_db: evaluated.mean_simulated_psnr_db(),
            mean_captured_psnr_db: evaluated.mean_captured_psnr_db(),
            mean_gain_db: evaluated.mean_captured_psnr_db() - ideal.mean_captured_psnr_db(),
        }
    }
}

/// A kernel with the report of its learning, if it was learned.
fn row_of<'a>(evaluated: &'a Evaluated, learned: &'a [Learned]) -> ModelRow<'a> {
    let is_it = |learned: &&Learned| evaluated.candidate.version.as_ref() == Some(&learned.version);
    ModelRow { evaluated, learned: learned.iter().find(is_it) }
}
