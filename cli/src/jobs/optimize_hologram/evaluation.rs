//! The command `lightpath hologram evaluate`: holograms of other programs, judged like those of this one.

use super::comparison::Comparison;
use super::outputs::Outputs;
use super::pictures::Scene;
use super::results::Item;
use super::{finish, only_kernel};
use crate::destination;
use crate::failure::Failure;
use crate::inputs;
use crate::jobs::submission::{Submission, label_of, submit_target};
use crate::kernel_choice::used;
use crate::session::Session;
use clap::Args;
use lightpath::v1::{
    Job, OptimizeHologram, job_spec,
    optimize_hologram::{
        InitialPhase,
        initial_phase::{Given, Kind},
    },
};
use std::path::PathBuf;

/// Judge holograms that any program made: predict what the display shows, and compare it with a target.
///
/// Each file is one hologram: the grey levels that the display shows (PNG or BMP), or the phase in radians without carrier
/// (.npy, floats). Several files for the same target are compared in one table. With several wavelengths or subframes,
/// give the files of one hologram one after the other: first those of the first wavelength. A .npy file may have all
/// subframes of its wavelength below one another.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  lightpath hologram evaluate theirs.png --target photo.png --display lab-2 \\
      --distance 150mm
  lightpath hologram evaluate gs.npy adam.npy ours.png --target photo.png \\
      --display lab-2 --distance 150mm --reconstruction seen/
  lightpath hologram evaluate red.png green.png blue.png --target photo.png \\
      --display rgb-1 --wavelength 638nm,520nm,450nm --distance 150mm

By the kernel of the display that is active, or by another one with --kernel. The job ends in seconds; its results are \
those of `lightpath hologram optimize`.")]
pub(crate) struct Evaluate {
    /// Judge these holograms
    #[arg(required = true, value_name = "HOLOGRAM")]
    holograms: Vec<PathBuf>,

    /// Compare with this picture: PNG (8 or 16 bit, grey or colour), JPEG or TIFF, at least 8x8 px
    #[arg(id = "targets", long = "target", required_unless_present = "planes", value_name = "TARGET")]
    target: Option<PathBuf>,

    #[command(flatten)]
    scene: Scene,

    /// Judge by this kernel: active, ideal, the number or name of a version, or an alias [default: the active version
    /// if there is one, else ideal]
    #[arg(long, value_name = "KERNEL", default_value = "", hide_default_value = true)]
    kernel: String,

    #[command(flatten)]
    comparison: Comparison,

    #[command(flatten)]
    submission: Submission,

    #[command(flatten)]
    outputs: Outputs,
}

impl Evaluate {
    pub(crate) async fn run(self, session: &Session) -> Result<(), Failure> {
        self.scene.check()?;
        let each = self.files_each()?;
        let groups: Vec<&[PathBuf]> = self.holograms.chunks(each).collect();
        let names: Vec<String> = groups.iter().map(|group| destination::name_of(&group[0])).collect();
        let others = self.target.iter().chain(self.scene.files()).chain(self.comparison.files());
        let inputs: Vec<PathBuf> = self.holograms.iter().chain(others).cloned().collect();
        inputs::check_readable(&inputs)?;
        let files = self.outputs.files(&session.stdout, &names, &inputs)?;
        let mut items: Vec<Item> = Vec::new();
        for ((group, name), files) in groups.into_iter().zip(names).zip(files) {
            let earlier = items.iter().map(|item: &Item| &item.job);
            let job = submit_target(&group[0], earlier, self.submit(session, group, &name)).await?;
            items.push(Item { name, job, files });
        }
        finish(session, items).await
    }

    /// Number of files of a hologram: one for each wavelength and subframe, or .npy files with all subframes.
    fn files_each(&self) -> Result<usize, Failure> {
        let (wavelengths, subframes) = (self.scene.wavelengths(), self.comparison.subframes());
        let (given, frames) = (self.holograms.len(), wavelengths * subframes);
        let is_npy = |file: &PathBuf| file.extension().is_some_and(|end| end.eq_ignore_ascii_case("npy"));
        match () {
            () if given == wavelengths && self.holograms.iter().all(is_npy) => Ok(wavelengths),
            () if frames > 0 && given.is_multiple_of(frames) => Ok(frames),
            () => Err(Failure::Usage(format!(
                "{given} files are no whole number of holograms: a hologram of {wavelengths} wavelengths and {subframes} \
                 subframes has {frames} files, or {wavelengths} .npy files with all subframes"
            ))),
        }
    }

    async fn submit(&self, session: &Session, files: &[PathBuf], name: &str) -> Result<Job, Failure> {
        let spec = self.scene.request(session, self.target.as_deref()).await?;
        let kernel = used(session, &self.kernel, async || Ok(only_kernel(&spec))).await?;
        let mut given = Given::default();
        for file in files {
            given.phases.push(session.upload(file).await?);
        }
        let initial_phase = Some(InitialPhase { kind: Some(Kind::Given(given)) });
        let spec = OptimizeHologram { kernel, iterations: Some(0), initial_phase, ..spec };
        let kind = job_spec::Kind::OptimizeHologram(self.comparison.fill(session, spec).await?);
        let several = self.holograms.len() > files.len();
        self.submission.submit(session, kind, &label_of(&files[0]), several.then_some(name)).await
    }
}
