//! How long the rest of the demo takes, from its work and from the time that the work so far took.

use super::args::DemoArgs;
use lightpath::v1::KernelModel;
use std::time::{Duration, Instant};

/// Share of the work after which its speed tells how long the rest takes.
const SHARE_MIN: f64 = 0.04;

/// Work with a progress bar.
#[derive(Clone, Copy, Debug)]
pub(super) enum Part {
    /// Holograms to learn from.
    Optimize,
    Photograph,
    Finalize,
    Learn(KernelModel),
    /// Losses of all kernels on the photographs.
    Evaluate,
    /// Holograms of the held-out targets.
    OptimizeHeldOut,
    PhotographHeldOut,
}

impl Part {
    /// What the part does, for its progress bar.
    pub(super) fn verb(self) -> &'static str {
        match self {
            Self::Optimize | Self::OptimizeHeldOut => "optimize",
            Self::Photograph | Self::PhotographHeldOut => "photograph",
            Self::Finalize => "finalize",
            Self::Learn(_) => "learn",
            Self::Evaluate => "evaluate",
        }
    }

    /// Its work, in the time of one iteration of a hologram through the ideal kernel.
    fn work(self, args: &DemoArgs) -> f64 {
        // A quarter more photographs are held out.
        let pairs = 1.25 * f64::from(args.pairs);
        // The learned kernels, the ideal one, and the display's true transfer function.
        let kernels = args.models.len() as f64 + 2.0;
        let held_out = kernels * f64::from(args.held_out);
        match self {
            Self::Optimize => pairs * (f64::from(args.training_iterations) + OF_HOLOGRAM),
            Self::Photograph => pairs * OF_PHOTOGRAPH,
            Self::Finalize => pairs * OF_PAIR,
            Self::Learn(model) => pairs * of_learning(model),
            Self::Evaluate => kernels * pairs * OF_LOSS,
            Self::OptimizeHeldOut => held_out * (f64::from(args.iterations) + OF_HOLOGRAM),
            Self::PhotographHeldOut => held_out * OF_PHOTOGRAPH,
        }
    }
}

/// Work of what a hologram needs besides its iterations, such as its judgements. This and the following numbers are from
/// a run of the demo with its default options on quiet cores; they only share the remaining time among its parts.
const OF_HOLOGRAM: f64 = 3.0;
const OF_PHOTOGRAPH: f64 = 17.0;
const OF_PAIR: f64 = 2.0;
const OF_LOSS: f64 = 2.0;

/// Work of learning a model, for each photograph.
fn of_learning(model: KernelModel) -> f64 {
    match model {
        KernelModel::Smooth => 28.0,
        KernelModel::Display => 61.0,
        // Not measured.
        _ => 200.0,
    }
}

/// The work of the whole demo, and what of it is done.
#[derive(Debug)]
pub(super) struct Remaining {
    begun: Instant,
    done: f64,
    total: f64,
}

impl Remaining {
    /// Begins the work.
    pub(super) fn begin(args: &DemoArgs) -> Self {
        use Part::{Evaluate, Finalize, Learn, Optimize, OptimizeHeldOut, Photograph, PhotographHeldOut};
        let learning = args.models.iter().map(|&model| Learn(model));
        let others = [Optimize, Photograph, Finalize, Evaluate, OptimizeHeldOut, PhotographHeldOut];
        let total = others.into_iter().chain(learning).map(|part| part.work(args)).sum();
        Self { begun: Instant::now(), done: 0.0, total }
    }

    /// Time since the beginning.
    pub(super) fn elapsed(&self) -> Duration {
        self.begun.elapsed()
    }

    /// Counts a part as done.
    pub(super) fn add(&mut self, part: Part, args: &DemoArgs) {
        self.done += part.work(args);
    }

    /// The time that is left, as text, if a share of `part` is done after the parts before it. Empty as long as too little
    /// is done to tell.
    pub(super) fn text(&self, part: Option<(Part, f64)>, args: &DemoArgs) -> String {
        let under_way = part.map_or(0.0, |(part, share)| part.work(args) * share.clamp(0.0, 1.0));
        left(self.begun.elapsed(), (self.done + under_way) / self.total)
    }
}

/// The time that is left after a time in which a share of the work was done.
fn left(elapsed: Duration, share: f64) -> String {
    if share < SHARE_MIN {
        return String::new();
    }
    let left_s = elapsed.as_secs_f64() * (1.0 - share).max(0.0) / share;
    // Steps that do not pretend to be exact.
    match left_s {
        ..10.0 => "some seconds left".to_owned(),
        ..100.0 => format!("about {:.0} s left", (left_s / 10.0).ceil() * 10.0),
        _ => format!("about {:.0} min left", (left_s / 60.0).ceil()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Cli {
        #[command(flatten)]
        args: DemoArgs,
    }

    #[test]
    fn remaining_time_follows_from_what_is_done() {
        let left = |elapsed_s, share| left(Duration::from_secs(elapsed_s), share);
        assert_eq!([left(1, 0.01), left(60, 0.5), left(100, 0.99)], ["", "about 60 s left", "some seconds left"]);
        assert_eq!(left(60, 0.1), "about 9 min left");
    }

    #[test]
    fn all_parts_together_are_the_whole_demo() {
        let args = Cli::parse_from(["demo"]).args.ordered();
        let mut remaining = Remaining::begin(&args);
        assert_eq!(remaining.text(None, &args), "");
        let models = args.models.iter().map(|&model| Part::Learn(model));
        for part in models.chain([Part::Optimize, Part::Photograph, Part::Finalize, Part::Evaluate]) {
            remaining.add(part, &args);
        }
        remaining.add(Part::PhotographHeldOut, &args);
        assert!(remaining.done < remaining.total);
        remaining.add(Part::OptimizeHeldOut, &args);
        assert!((remaining.done / remaining.total - 1.0).abs() < 1e-12, "{remaining:?}");
    }
}
