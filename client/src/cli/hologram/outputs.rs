//! The files of a hologram: where they go, and saving them.

use crate::cli::destination;
use crate::cli::failure::Failure;
use crate::cli::session::Session;
use clap::Args;
use lightpath::v1;
use std::path::{Path, PathBuf};

/// Files of a result.
#[derive(Debug, Args)]
#[command(next_help_heading = "Output files")]
pub(super) struct Outputs {
    /// The hologram for the display, a grey PNG of levels; .npy gives radians as float32
    #[arg(short = 'o', value_name = "PHASE.png")]
    phase: Option<PathBuf>,

    /// The phase before response, carrier and quantization, in radians, float32
    #[arg(long, value_name = "FILE.npy")]
    npy: Option<PathBuf>,

    /// What the kernel predicts the detector sees
    #[arg(long, value_name = "FILE.png")]
    reconstruction: Option<PathBuf>,
}

/// Where the files of one target go.
#[derive(Clone, Debug, Default)]
pub(super) struct Files {
    phase: Option<PathBuf>,
    npy: Option<PathBuf>,
    reconstruction: Option<PathBuf>,
}

impl Outputs {
    pub(super) fn any(&self) -> bool {
        self.phase.is_some() || self.npy.is_some() || self.reconstruction.is_some()
    }

    /// Where the files of each target go.
    pub(super) fn files(&self, names: &[String], targets: &[PathBuf]) -> Result<Vec<Files>, Failure> {
        let places = |option: &str, destination: &Option<PathBuf>, suffix: &str| match destination {
            None => Ok(vec![None; names.len()]),
            Some(destination) => {
                let files = destination::files(option, destination, names, suffix)?;
                Ok::<_, Failure>(files.into_iter().map(Some).collect())
            }
        };
        let phases = places("-o", &self.phase, "-phase.png")?;
        let npys = places("--npy", &self.npy, "-phase.npy")?;
        let reconstructions = places("--reconstruction", &self.reconstruction, "-reconstruction.png")?;
        let all = || [&phases, &npys, &reconstructions].into_iter().flatten().flatten();
        destination::check_distinct(targets.iter().map(PathBuf::as_path), all().map(PathBuf::as_path))?;
        let zipped = phases.into_iter().zip(npys).zip(reconstructions);
        Ok(zipped.map(|((phase, npy), reconstruction)| Files { phase, npy, reconstruction }).collect())
    }
}

impl Files {
    pub(super) async fn save(&self, session: &Session, result: &v1::HologramResult) -> lightpath::Result<()> {
        let is_npy = |path: &Path| path.extension().is_some_and(|extension| extension == "npy");
        if let Some(path) = &self.phase {
            let digest = if is_npy(path) { &result.phase_npy } else { &result.phase };
            session.client.download_to(digest, path).await?;
        }
        if let Some(path) = &self.npy {
            session.client.download_to(&result.phase_npy, path).await?;
        }
        if let Some(path) = &self.reconstruction {
            session.client.download_to(&result.reconstruction, path).await?;
        }
        Ok(())
    }

    pub(super) fn text(&self) -> Option<String> {
        let files = [&self.phase, &self.npy, &self.reconstruction].into_iter().flatten();
        let text = files.map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ");
        (!text.is_empty()).then_some(text)
    }
}
