//! The command `lightpath dataset add`.

use super::manifest::{self, Entry};
use crate::destination::name_of;
use crate::failure::Failure;
use crate::inputs;
use crate::session::{Output, Session, print_note};
use crate::show;
use crate::words::WordParser;
use clap::Args;
use lightpath::{names, v1};
use std::path::PathBuf;

/// Pairs that are added with one call. Measuring one takes up to some seconds, and each call shows what was added.
const PAIRS_AT_ONCE: usize = 16;

/// Add holograms with their photographs: one pair, two folders or a list of pairs.
///
/// A photograph has one camera pixel for each pixel of the display, or any size if the dataset has an alignment. Each
/// pair is checked when it is added. The same pair again changes nothing, so an interrupted import can be repeated.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  lightpath dataset add bench-1 --pattern p01.png --photo c01.png
  lightpath dataset add bench-1 --pattern p02.png --photo c02.tif \\
      --black-level 0.012 --exposure 0.02 --gain 1.5 --split test

  Two folders, matched by file name without extension
    lightpath dataset add bench-1 --patterns holograms/ --photos photos/

  A manifest with explicit ids: .toml, .json or .csv; paths are relative to it
    lightpath dataset add bench-1 --manifest bench-1/pairs.toml

    black_level = 0.012          # for all pairs without their own
    [[pairs]]
    id = \"p01\"
    pattern = \"holograms/01.png\"
    photo = \"photos/01.tif\"
    exposure_s = 0.02            # also: camera_gain, black_level, split

  A .csv manifest has a line of names, then a line for each pair
    id,pattern,photo,split,exposure_s
    p01,holograms/01.png,photos/01.tif,train,0.02")]
pub(crate) struct Add {
    /// Name of the dataset
    name: String,

    /// Add this pattern as it was displayed: a grey PNG or BMP of levels, or a .npy file of the phase in radians (floats)
    #[arg(long, value_name = "FILE", requires = "photo", required_unless_present_any = ["manifest", "patterns"])]
    pattern: Option<PathBuf>,

    /// Add this photograph of the hologram of --pattern: PNG, JPEG, TIFF, BMP or .npy, grey or colour
    #[arg(long, value_name = "FILE", requires = "pattern", required_unless_present_any = ["manifest", "patterns"])]
    photo: Option<PathBuf>,

    /// Add the pairs in this list: a .toml, .json or .csv file
    #[arg(long, value_name = "FILE", conflicts_with_all = ["pattern", "photo", "patterns", "photos", "id"])]
    manifest: Option<PathBuf>,

    /// Add the holograms in this folder, each with the photograph of the same name in --photos
    #[arg(long, value_name = "FOLDER", requires = "photos", conflicts_with_all = ["pattern", "photo", "id"])]
    patterns: Option<PathBuf>,

    /// Take the photographs for --patterns from this folder
    #[arg(long, value_name = "FOLDER", requires = "patterns")]
    photos: Option<PathBuf>,

    /// Set the id of the pair in the dataset [default: the hologram's file name without its extension]
    #[arg(long, value_name = "ID")]
    id: Option<String>,

    #[command(flatten)]
    defaults: Defaults,
}

/// Properties of the pairs that do not have their own.
#[derive(Debug, Args)]
pub(super) struct Defaults {
    /// Choose the use of the pairs [default: drawn when the dataset is finalized]
    #[arg(long, value_parser = WordParser::<v1::Split>::new().without("excluded"))]
    split: Option<v1::Split>,

    /// Set the camera's value in the dark as a fraction of full scale, 0 to 0.9 [default: 0]
    #[arg(long, value_name = "X")]
    black_level: Option<f64>,

    /// Set the exposure time in seconds, 0 to 3600; give it for all pairs of a dataset or for none [default: unknown]
    #[arg(long, value_name = "SECONDS")]
    exposure: Option<f64>,

    /// Set the camera's gain as a factor, at most 1e6 [default: unknown]
    #[arg(long, value_name = "FACTOR")]
    gain: Option<f64>,
}

impl Defaults {
    /// Fills in the values that the entry lacks.
    pub(super) fn fill(&self, entry: Entry) -> Entry {
        Entry {
            split: entry.split.or(self.split),
            black_level: entry.black_level.or(self.black_level),
            exposure_s: entry.exposure_s.or(self.exposure),
            camera_gain: entry.camera_gain.or(self.gain),
            ..entry
        }
    }
}

impl Add {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let entries = self.entries()?.into_iter().map(|entry| self.defaults.fill(entry)).collect();
        add_pairs(session, &self.name, entries).await
    }

    fn entries(&self) -> Result<Vec<Entry>, Failure> {
        if let Some(path) = &self.manifest {
            return manifest::read(path);
        }
        if let (Some(phases), Some(photos)) = (&self.patterns, &self.photos) {
            return manifest::match_folders(phases, photos);
        }
        let (Some(pattern), Some(photo)) = (&self.pattern, &self.photo) else {
            return Err(Failure::Usage(
                "give --pattern and --photo, --patterns and --photos, or --manifest".to_owned(),
            ));
        };
        let id = self.id.clone().unwrap_or_else(|| name_of(pattern));
        Ok(vec![Entry::new(id, pattern.clone(), photo.clone())])
    }
}

/// Uploads the files of the pairs and adds the pairs to a dataset, some at a time.
pub(super) async fn add_pairs(session: &Session, dataset: &str, entries: Vec<Entry>) -> Result<(), Failure> {
    inputs::require_pictures(entries.iter().flat_map(|entry| [&entry.pattern, &entry.photo]))?;
    let count = entries.len();
    let mut all = v1::AddPairsResponse::default();
    for entries in entries.chunks(PAIRS_AT_ONCE) {
        let mut pairs = Vec::new();
        for entry in entries {
            pairs.push(pair(session, entry).await?);
        }
        let request = v1::AddPairsRequest { dataset: names::dataset(dataset), pairs };
        let added = session.client.add_pairs(request).await.map_err(|error| refused(entries, count, error))?;
        if count > 1 {
            added.pairs.iter().try_for_each(|pair| session.print_line(pair))?;
            session.print_text(&text(&added))?;
        }
        all.pairs.extend(added.pairs);
        all.dataset = added.dataset;
    }
    let findings: usize = all.pairs.iter().map(|pair| pair.findings.len()).sum();
    if findings > 0 && count > 1 {
        let found = show::counted(findings, "finding");
        print_note(&format!("{found}; list them: lightpath dataset show {dataset}"));
    }
    match session.output {
        // One document: the dataset after the last pair, and all pairs.
        Output::Json => session.print(&all, |_| String::new()),
        _ if count == 1 => session.print(&all, text),
        _ => Ok(()),
    }
}

/// Uploads the files of a pair.
async fn pair(session: &Session, entry: &Entry) -> Result<v1::Pair, Failure> {
    Ok(v1::Pair {
        id: entry.id.clone(),
        pattern: session.upload(&entry.pattern).await?,
        photo: session.upload(&entry.photo).await?,
        split: entry.split.unwrap_or_default().into(),
        black_level: entry.black_level.unwrap_or(0.0),
        exposure_s: entry.exposure_s,
        camera_gain: entry.camera_gain,
        ..Default::default()
    })
}

/// Converts an error into a failure. If there are several pairs, it first prints which pairs the numbers in the error
/// mean.
fn refused(entries: &[Entry], count: usize, error: lightpath::Error) -> Failure {
    if count > 1 {
        let named = |(number, entry): (usize, &Entry)| format!("pairs[{number}] is {}", entry.id);
        let names: Vec<String> = entries.iter().enumerate().map(named).collect();
        print_note(&format!(
            "none of these pairs was added; those before them are in the dataset: {}",
            names.join(", ")
        ));
    }
    error.into()
}

/// Text about pairs that were added, with their findings.
fn text(added: &v1::AddPairsResponse) -> String {
    let mut lines = Vec::new();
    for pair in &added.pairs {
        lines.push(format!("added pair {}", pair.id));
        lines.extend(pair.findings.iter().map(|finding| format!("  it {}", finding.message)));
    }
    if let Some(dataset) = &added.dataset {
        lines.push(format!("pairs of {} now: {}", names::id(&dataset.name), dataset.pair_count));
    }
    lines.join("\n")
}
