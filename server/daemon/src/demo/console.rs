//! Output of the demo in the terminal: numbered steps on stdout, progress bars on stderr, or lines where stderr is no terminal.

use super::args::{DISPLAY, DemoArgs};
use super::files::Files;
use super::programs::Programs;
use super::remaining::{Part, Remaining};
use indicatif::{ProgressBar, ProgressStyle};
use lightpath::units::show_m;
use std::cell::{Cell, RefCell};
use std::io::{IsTerminal as _, Write as _};
use std::time::{Duration, Instant};

/// How long the demo takes with its default options: measured 87 s and 124 s.
const DURATION: &str = "one and a half to two minutes on two cores";

/// Interval between lines about a step, without a terminal.
const LINES: Duration = Duration::from_secs(10);

/// Output of the demo, with the steps so far and the work that is left.
pub(super) struct Console {
    args: DemoArgs,
    remaining: RefCell<Remaining>,
    steps: Vec<(String, Instant)>,
}

impl Console {
    /// Prints the properties of the display and how long the demo takes, and starts the clock.
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
        if args.has_default_work() {
            writeln!(out, "It takes {DURATION}, longer if they are busy.")?;
        }
        Ok(Self { args: args.clone(), remaining: RefCell::new(Remaining::begin(args)), steps: Vec::new() })
    }

    /// Starts the next step, and prints its title and how long the rest of the demo takes.
    pub(super) fn step(&mut self, title: &str) -> anyhow::Result<()> {
        let number = self.steps.len() + 1;
        let left = self.remaining.borrow().text(None, &self.args);
        let left = if left.is_empty() { left } else { format!("  [{left}]") };
        writeln!(std::io::stdout().lock(), "\n{number:2}  {title}{left}")?;
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

    /// A progress bar for a part of this step, with the time that the whole demo still takes. It disappears when it is
    /// dropped; then the part counts as done.
    pub(super) fn bar(&self, part: Part) -> Bar<'_> {
        let bar = ProgressBar::new(0);
        let style = ProgressStyle::with_template("    {prefix} {wide_bar} {percent:>3}%  {msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.set_prefix(part.verb());
        bar.enable_steady_tick(Duration::from_millis(200));
        let printed = (!std::io::stderr().is_terminal()).then(|| Cell::new(Instant::now()));
        Bar { bar, part, printed, console: self }
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
        let Programs { lightpathd, lightpath, install } = Programs::find();
        let distance = show_m(args.distance_m()).replace(' ', "");
        let target = files.example_target();
        let mut stdout = std::io::stdout().lock();
        writeln!(
            stdout,
            "
Results   {out}/contact_sheet.png, {out}/kernel.png, {out}/loss.png; all numbers are in {out}/report.json.

Try next  a server on the data of this demo, which runs until Ctrl-C; see it at http://127.0.0.1:7070
          {lightpathd} serve --data-dir {data}
and then  in another terminal:
          {install}{lightpath} kernel list
          {lightpath} hologram optimize {target} \\
              --display {DISPLAY} --distance {distance} -o hologram.png
          {lightpath} simulate --display {DISPLAY} --distance {distance} \\
              --pattern hologram.png -o photograph.png

Done in {:.0} s.",
            self.remaining.borrow().elapsed().as_secs_f64(),
            data = data.display(),
            target = target.display(),
            install = install.map(|command| format!("{command}\n          ")).unwrap_or_default(),
        )?;
        Ok(())
    }
}

/// A progress bar over several jobs.
pub(super) struct Bar<'a> {
    bar: ProgressBar,
    part: Part,
    /// Time of the latest line, without a terminal.
    printed: Option<Cell<Instant>>,
    console: &'a Console,
}

impl Bar<'_> {
    /// Progress steps of one job, enough for a bar of any width.
    const JOB_STEPS: u64 = 1000;

    /// Shows the progress: the first `done` of `jobs` have ended, and the next one is done to the fraction `share`.
    pub(super) fn set(&self, done: usize, jobs: usize, share: f64) {
        let share = share.clamp(0.0, 1.0);
        self.bar.set_length(jobs as u64 * Self::JOB_STEPS);
        self.bar.set_position(done as u64 * Self::JOB_STEPS + (share * Self::JOB_STEPS as f64) as u64);
        if jobs > 1 {
            self.bar.set_prefix(format!("{} {}/{jobs}", self.part.verb(), (done + 1).min(jobs)));
        }
        let of_part = (done as f64 + share) / jobs.max(1) as f64;
        let left = self.console.remaining.borrow().text(Some((self.part, of_part)), &self.console.args);
        if let Some(printed) = self.printed.as_ref().filter(|printed| printed.get().elapsed() >= LINES) {
            printed.set(Instant::now());
            let of_part = format!("{}: {:.0} %", self.bar.prefix(), 100.0 * of_part);
            let line = if left.is_empty() { of_part } else { format!("{of_part}, {left}") };
            // Nobody may read the lines, and the demo goes on.
            drop(writeln!(std::io::stderr(), "    {line}"));
        }
        self.bar.set_message(left);
    }
}

impl Drop for Bar<'_> {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
        self.console.remaining.borrow_mut().add(self.part, &self.console.args);
    }
}
