//! Output of the demo in the terminal: numbered steps on stdout, progress bars on stderr, or lines where stderr is no terminal.

use super::args::{DISPLAY, DemoArgs};
use super::files::Files;
use indicatif::{ProgressBar, ProgressStyle};
use lightpath::units::show_m;
use std::cell::Cell;
use std::io::{IsTerminal as _, Write as _};
use std::time::{Duration, Instant};

/// Interval between lines about a step, without a terminal.
const LINES: Duration = Duration::from_secs(10);

/// Output of the demo, with the steps so far.
pub(super) struct Console {
    begun: Instant,
    steps: Vec<(String, Instant)>,
}

impl Console {
    /// Prints the properties of the display and starts the clock.
    pub(super) fn begin(args: &DemoArgs) -> anyhow::Result<Self> {
        let (width_px, height_px) = args.resolution();
        let mut out = std::io::stdout().lock();
        writeln!(
            out,
            "Lightpath demo: a display of {width_px}×{height_px} px of {}, {}, image at {}, seed {}",
            show_m(args.pixel_pitch),
            show_m(args.wavelength),
            show_m(args.distance_m()),
            args.seed
        )?;
        Ok(Self { begun: Instant::now(), steps: Vec::new() })
    }

    /// Starts the next step and prints its title.
    pub(super) fn step(&mut self, title: &str) -> anyhow::Result<()> {
        let number = self.steps.len() + 1;
        writeln!(std::io::stdout().lock(), "\n{number:2}  {title}")?;
        self.steps.push((title.to_owned(), Instant::now()));
        Ok(())
    }

    /// Prints the result of the step and how long it took.
    pub(super) fn print_result(&self, text: String) -> anyhow::Result<()> {
        let took_s = self.steps.last().map_or(0.0, |(_, begun)| begun.elapsed().as_secs_f64());
        writeln!(std::io::stdout().lock(), "    {text}  ({took_s:.1} s)")?;
        Ok(())
    }

    /// Prints lines without changes.
    pub(super) fn print(&self, text: &str) -> anyhow::Result<()> {
        writeln!(std::io::stdout().lock(), "\n{text}")?;
        Ok(())
    }

    /// A progress bar for this step. It disappears when it is dropped.
    pub(super) fn bar(&self, verb: &'static str) -> Bar {
        let bar = ProgressBar::new(0);
        let style = ProgressStyle::with_template("    {msg} {wide_bar} {percent:>3}% {eta:>4}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.set_message(verb);
        bar.enable_steady_tick(Duration::from_millis(200));
        let printed = (!std::io::stderr().is_terminal()).then(|| Cell::new(Instant::now()));
        Bar { bar, verb, printed }
    }

    /// The steps and the duration of each \[s\].
    pub(super) fn steps(&self) -> Vec<(String, f64)> {
        let ends = self.steps.iter().skip(1).map(|(_, begun)| *begun).chain([Instant::now()]);
        let took = |((title, begun), end): (&(String, Instant), Instant)| {
            (title.clone(), end.duration_since(*begun).as_secs_f64())
        };
        self.steps.iter().zip(ends).map(took).collect()
    }

    /// Prints which files were written and which commands to try next.
    pub(super) fn finish(self, args: &DemoArgs, files: &Files) -> anyhow::Result<()> {
        let out = args.out.display();
        let data = files.data_dir();
        let (serve, cli) = programs();
        let distance = show_m(args.distance_m()).replace(' ', "");
        let target = files.example_target();
        let mut stdout = std::io::stdout().lock();
        writeln!(
            stdout,
            "
Results   {out}/contact_sheet.png, {out}/kernel.png, {out}/loss.png; all numbers are in {out}/report.json.

Try next  {serve} serve --data-dir {}
          {cli} kernel list
          {cli} hologram optimize {} --display {} --distance {distance} -o hologram.png
          {cli} simulate --display {} --distance {distance} --pattern hologram.png -o photograph.png

Done in {:.0} s.",
            data.display(),
            target.display(),
            DISPLAY,
            DISPLAY,
            self.begun.elapsed().as_secs_f64()
        )?;
        Ok(())
    }
}

/// Paths of the daemon and of the command-line client, as the user calls them.
fn programs() -> (&'static str, &'static str) {
    let path = std::env::current_exe().unwrap_or_default();
    let built = |profile: &str| path.components().any(|part| part.as_os_str() == profile);
    match () {
        () if built("target") && built("release") => {
            ("cargo run --release --bin lightpathd --", "cargo run --release --bin lightpath --")
        }
        () if built("target") => ("cargo run --bin lightpathd --", "cargo run --bin lightpath --"),
        () => ("lightpathd", "lightpath"),
    }
}

/// A progress bar over several jobs.
pub(super) struct Bar {
    bar: ProgressBar,
    verb: &'static str,
    /// Time of the latest line, without a terminal.
    printed: Option<Cell<Instant>>,
}

impl Bar {
    /// Progress steps of one job, enough for a bar of any width.
    const JOB_STEPS: u64 = 1000;

    /// Shows the progress: the first `done` of `jobs` have ended, and the next one is done to the fraction `share`.
    pub(super) fn set(&self, done: usize, jobs: usize, share: f64) {
        self.bar.set_length(jobs as u64 * Self::JOB_STEPS);
        self.bar.set_position(done as u64 * Self::JOB_STEPS + (share.clamp(0.0, 1.0) * Self::JOB_STEPS as f64) as u64);
        if jobs > 1 {
            self.bar.set_message(format!("{} {}/{jobs}", self.verb, (done + 1).min(jobs)));
        }
        if let Some(printed) = self.printed.as_ref().filter(|printed| printed.get().elapsed() >= LINES) {
            printed.set(Instant::now());
            let percent = 100.0 * (done as f64 + share.clamp(0.0, 1.0)) / jobs.max(1) as f64;
            // Nobody may read the lines, and the demo goes on.
            drop(writeln!(std::io::stderr(), "    {}: {percent:.0} %", self.bar.message()));
        }
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
