//! The commands `lightpath dataset …`.

mod add;
mod align;
mod import;
mod layouts;
mod manifest;
mod show;
mod suggest;

use super::arguments::{Limit, Optics, above_zero};
use super::failure::Failure;
use super::job_text;
use super::session::{Session, more_hint, pages, print_note};
use super::show::{age_or_dash, clock_or_dash};
use super::submission::Submission;
use super::table::Table;
use super::words::WordParser;
use clap::{Args, Subcommand};
use lightpath::names;
use lightpath::v1::prepare_dataset::{self, Step};
use lightpath::v1::{self, Dataset, PrepareDataset, job_spec};
pub(crate) use show::{alignment, findings};
use show::{facts, state};

/// Commands for datasets.
// Variants without a comment take their help from the struct of their arguments. A comment here would hide all but its
// first line.
#[derive(Debug, Subcommand)]
pub(crate) enum DatasetCommand {
    Create(Create),
    Add(add::Add),
    Import(import::Import),
    Calibration(align::Calibration),
    Align(align::Align),
    Finalize(Finalize),
    Suggest(suggest::Suggest),
    /// Show a dataset with its pairs
    Show(Name),
    /// List datasets
    List(List),
    /// Delete a dataset permanently; kernels learned from it are kept
    Delete(Name),
}

/// Create an open dataset.
///
/// A dataset collects holograms of one display, wavelength and distance, each with a photograph.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Example:
  lightpath dataset create bench-1 --display lab-2 --distance 150mm
  lightpath dataset add bench-1 --phase p01.png --photo c01.png
  lightpath dataset finalize bench-1")]
pub(crate) struct Create {
    /// Name of the new dataset: 1 to 63 characters of a-z, 0-9 and '-', starting with a letter
    name: String,

    #[command(flatten)]
    optics: Optics,

    /// Choose how the photographs' grey values encode light
    #[arg(long, default_value = "linear", value_parser = WordParser::<v1::Encoding>::new())]
    photo_encoding: v1::Encoding,

    /// Set the camera's bit depth if its files have more bits, for example 12 for 16-bit files with values up to 4095;
    /// 8 to 16 [default: that of the files]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    photo_bit_depth: u32,
}

/// Draw the split and close a dataset permanently; kernels are learned only from finalized datasets.
///
/// The job first aligns photographs that are turned against what their holograms should show, or shifted so far that
/// learning may not find it. Scale and shear up to 2 px stay for learning, because an uneven modulator makes them, too.
/// The job leaves out pairs that cannot be learned from: black photographs, copies, and photographs of another
/// hologram. The printed findings say why.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  lightpath dataset finalize bench-1
  lightpath dataset finalize bench-1 --test-fraction 0.3 --seed 4")]
pub(crate) struct Finalize {
    /// Name of the dataset
    name: String,

    /// Draw this fraction of the pairs without a split for validation, 0 to 0.8; validation pairs choose the order of a
    /// kernel and the parts of a display model [default: 0.2]
    #[arg(long, value_name = "X")]
    validation_fraction: Option<f64>,

    /// Draw this fraction of the pairs without a split for the test, but at least one pair; above 0, at most 0.8
    #[arg(long, value_name = "X", default_value_t = 0.2, value_parser = above_zero)]
    test_fraction: f64,

    /// Set the seed of the draw
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,

    /// Keep the alignment unchanged even if the photographs are turned or shifted
    #[arg(long)]
    keep_alignment: bool,

    #[command(flatten)]
    submission: Submission,
}

/// The dataset that a command applies to.
#[derive(Debug, Args)]
pub(crate) struct Name {
    /// Name of the dataset
    name: String,
}

/// Arguments of `dataset list`.
#[derive(Debug, Args)]
pub(crate) struct List {
    /// List only datasets of the display with this id
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
            Self::Import(import) => import.run(session).await,
            Self::Calibration(calibration) => calibration.run(session).await,
            Self::Align(align) => align.run(session).await,
            Self::Finalize(finalize) => finalize.run(session).await,
            Self::Suggest(suggest) => suggest.run(session).await,
            Self::Show(name) => {
                let request = v1::GetDatasetRequest { name: names::dataset(&name.name) };
                session.print(&session.client.get_dataset(request).await?, facts)
            }
            Self::List(list) => list.run(session).await,
            Self::Delete(name) => delete(session, &name.name).await,
        }
    }
}

async fn delete(session: &Session, name: &str) -> Result<(), Failure> {
    let request = v1::DeleteDatasetRequest { name: names::dataset(name) };
    let answer = session.client.delete_dataset(request).await?;
    if session.is_json() {
        return session.print(&answer, |_| String::new());
    }
    print_note(&format!("deleted dataset {name}"));
    Ok(())
}

impl Create {
    fn request(&self) -> v1::CreateDatasetRequest {
        let dataset = Dataset {
            name: names::dataset(&self.name),
            display: names::display(&self.optics.display),
            wavelength_m: self.optics.wavelength_m(),
            distance_m: self.optics.distance,
            photo_encoding: self.photo_encoding.into(),
            photo_bit_depth: self.photo_bit_depth,
            ..Default::default()
        };
        v1::CreateDatasetRequest { dataset: Some(dataset) }
    }
}

impl Finalize {
    async fn run(self, session: &Session) -> Result<(), Failure> {
        let dataset = names::dataset(&self.name);
        let step = Step::Finalize(prepare_dataset::Finalize {
            validation_fraction: self.validation_fraction,
            test_fraction: self.test_fraction,
            seed: self.seed,
            keep_alignment: self.keep_alignment,
        });
        let kind = job_spec::Kind::PrepareDataset(PrepareDataset { dataset: dataset.clone(), step: Some(step) });
        self.submission.submit_and_wait(session, kind).await?;
        session.print(&session.client.get_dataset(v1::GetDatasetRequest { name: dataset }).await?, facts)
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
        session.print_list(
            &v1::ListDatasetsResponse { datasets, next_page_token },
            |list| &list.datasets,
            |list| {
                let mut table =
                    Table::new(&["dataset", "display", "optics?", "state", ">pairs", "created???", "age??"]);
                for dataset in &list.datasets {
                    table.row([
                        names::id(&dataset.name).to_owned(),
                        names::id(&dataset.display).to_owned(),
                        job_text::optics(dataset.wavelength_m, dataset.distance_m),
                        state(dataset),
                        dataset.pair_count.to_string(),
                        clock_or_dash(dataset.create_time.as_ref()),
                        age_or_dash(dataset.create_time.as_ref()),
                    ]);
                }
                table.text_or("no datasets; create one: lightpath dataset create --help")
                    + more_hint(&list.next_page_token)
            },
        )
    }
}
