//! `lightpath dataset …`

use super::arguments::{Encoding, Limit, Optics, above_zero};
use super::destination::name_of;
use super::failure::Failure;
use super::session::{Session, more_hint, pages};
use super::table::{Facts, Table};
use super::{job_text, show};
use clap::{Args, Subcommand, ValueEnum};
use lightpath::names;
use lightpath::v1::{self, Dataset, dataset::State};
use std::path::PathBuf;

/// What can be done with datasets.
// Where the help is with the arguments, a comment here would hide all but its first line.
#[derive(Debug, Subcommand)]
pub(crate) enum DatasetCommand {
    Create(Create),
    Add(Add),
    Finalize(Finalize),
    /// Show a dataset with its pairs
    Show(Name),
    /// List datasets
    List(List),
}

/// Open a dataset.
///
/// A dataset collects photographs of holograms of one display, wavelength and distance.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Example:
  lightpath dataset create bench-1 --display lab-2 --distance 150mm
  lightpath dataset add bench-1 --phase p01.png --photo c01.png
  lightpath dataset finalize bench-1")]
pub(crate) struct Create {
    /// Its name: 1 to 63 characters of a-z, 0-9 and '-', starting with a letter
    name: String,

    #[command(flatten)]
    optics: Optics,

    /// How the photographs' grey values stand for light
    #[arg(long, value_name = "ENCODING", default_value = "linear")]
    photo_encoding: Encoding,
}

/// Add a hologram and its photograph.
///
/// Both must have the display's size; one camera pixel stands for one SLM pixel. The same pair again changes nothing.
#[derive(Debug, Args)]
pub(crate) struct Add {
    /// Name of the dataset
    name: String,

    /// The hologram as displayed: a grey PNG of levels
    #[arg(long, value_name = "FILE.png")]
    phase: PathBuf,

    /// The photograph of it: PNG, TIFF or JPEG
    #[arg(long, value_name = "FILE")]
    photo: PathBuf,

    /// Id of the pair in the dataset [default: the hologram's file name without its extension]
    #[arg(long, value_name = "ID")]
    id: Option<String>,

    /// What the pair is for [default: drawn when the dataset is finalized]
    #[arg(long)]
    split: Option<Split>,
}

/// What a pair is for.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum Split {
    /// Learned from.
    Train,
    /// Watched while learning.
    Validation,
    /// Looked at once, after learning.
    Test,
}

/// Draw the split and close the dataset for good.
///
/// Only then can it be learned from.
#[derive(Debug, Args)]
pub(crate) struct Finalize {
    /// Name of the dataset
    name: String,

    /// Fraction of the pairs without a split that is drawn for validation, 0 to 0.8
    #[arg(long, value_name = "X", default_value_t = 0.0)]
    validation_fraction: f64,

    /// Fraction of the pairs without a split that is drawn for the test, at least one pair, above 0, at most 0.8
    #[arg(long, value_name = "X", default_value_t = 0.2, value_parser = above_zero)]
    test_fraction: f64,

    /// Seed of the draw
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
}

/// Which dataset.
#[derive(Debug, Args)]
pub(crate) struct Name {
    /// Name of the dataset
    name: String,
}

/// Which datasets.
#[derive(Debug, Args)]
pub(crate) struct List {
    /// Only this display's
    #[arg(long, value_name = "ID")]
    display: Option<String>,

    #[command(flatten)]
    limit: Limit,
}

impl DatasetCommand {
    pub(crate) async fn run(self, session: &Session) -> Result<(), Failure> {
        match self {
            Self::Create(create) => {
                let dataset = session.client.create_dataset(create.request()).await?;
                session.print(&dataset, facts)
            }
            Self::Add(add) => add.run(session).await,
            Self::Finalize(finalize) => {
                let request = v1::FinalizeDatasetRequest {
                    name: names::dataset(&finalize.name),
                    validation_fraction: finalize.validation_fraction,
                    test_fraction: finalize.test_fraction,
                    seed: finalize.seed,
                };
                session.print(&session.client.finalize_dataset(request).await?, facts)
            }
            Self::Show(name) => {
                let request = v1::GetDatasetRequest { name: names::dataset(&name.name) };
                session.print(&session.client.get_dataset(request).await?, facts)
            }
            Self::List(list) => list.run(session).await,
        }
    }
}

impl Create {
    fn request(&self) -> v1::CreateDatasetRequest {
        let dataset = Dataset {
            name: names::dataset(&self.name),
            display: names::display(&self.optics.display),
            wavelength_m: self.optics.wavelength_m(),
            distance_m: self.optics.distance,
            photo_encoding: v1::Encoding::from(self.photo_encoding).into(),
            ..Default::default()
        };
        v1::CreateDatasetRequest { dataset: Some(dataset) }
    }
}

impl Add {
    async fn run(self, session: &Session) -> Result<(), Failure> {
        let split = match self.split {
            None => v1::Split::Unspecified,
            Some(Split::Train) => v1::Split::Train,
            Some(Split::Validation) => v1::Split::Validation,
            Some(Split::Test) => v1::Split::Test,
        };
        let pair = v1::Pair {
            id: self.id.unwrap_or_else(|| name_of(&self.phase)),
            phase: session.client.upload_file(&self.phase).await?,
            photo: session.client.upload_file(&self.photo).await?,
            split: split.into(),
        };
        let id = pair.id.clone();
        let request = v1::AddPairRequest { dataset: names::dataset(&self.name), pair: Some(pair) };
        let dataset = session.client.add_pair(request).await?;
        session.print(&dataset, |dataset| {
            format!("added pair {id} to {}; pairs now: {}", names::id(&dataset.name), dataset.pair_count)
        })
    }
}

impl List {
    async fn run(self, session: &Session) -> Result<(), Failure> {
        let display = self.display.as_deref().map(names::display).unwrap_or_default();
        let (datasets, next_page_token) = pages(self.limit.limit, async |page_size, page_token| {
            let request = v1::ListDatasetsRequest { page_size, page_token, display: display.clone() };
            let answer = session.client.list_datasets(request).await?;
            Ok((answer.datasets, answer.next_page_token))
        })
        .await?;
        session.print(&v1::ListDatasetsResponse { datasets, next_page_token }, |list| {
            let mut table = Table::new(&["dataset", "display", "optics", "state", ">pairs", "created"]);
            for dataset in &list.datasets {
                table.row([
                    names::id(&dataset.name).to_owned(),
                    names::id(&dataset.display).to_owned(),
                    job_text::optics(dataset.wavelength_m, dataset.distance_m),
                    state(dataset),
                    dataset.pair_count.to_string(),
                    show::time_or_dash(dataset.create_time.as_ref()),
                ]);
            }
            table.text_or("no datasets; open one: lightpath dataset create --help") + more_hint(&list.next_page_token)
        })
    }
}

fn state(dataset: &Dataset) -> String {
    show::word("STATE_", dataset.state().as_str_name())
}

fn facts(dataset: &Dataset) -> String {
    let mut facts = Facts::default();
    facts.add("dataset", names::id(&dataset.name));
    facts.add("display", names::id(&dataset.display));
    facts.add("optics", job_text::optics(dataset.wavelength_m, dataset.distance_m));
    facts.add(
        "state",
        match dataset.state() {
            State::Open => "open: takes pairs".to_owned(),
            State::Finalized | State::Unspecified => state(dataset),
        },
    );
    facts.add("photographs", show::word("ENCODING_", dataset.photo_encoding().as_str_name()));
    facts.add("pairs", dataset.pair_count.to_string());
    facts.add_some("created", dataset.create_time.as_ref().map(show::time));
    facts.add_some("finalized", dataset.finalize_time.as_ref().map(show::time));
    if !dataset.digest.is_empty() {
        facts.add("digest", &dataset.digest);
    }
    if dataset.pairs.is_empty() {
        return facts.text();
    }
    let mut table = Table::new(&["pair", "split", "hologram", "photograph"]);
    for pair in &dataset.pairs {
        let split = match pair.split() {
            v1::Split::Unspecified => "–".to_owned(),
            split => show::word("SPLIT_", split.as_str_name()),
        };
        table.row([pair.id.clone(), split, pair.phase.clone(), pair.photo.clone()]);
    }
    format!("{}\n{}", facts.text(), table.text())
}
