//! The commands `lightpath dataset …`.

mod add;
mod calibration;
mod import;
mod layouts;
mod manifest;

use super::arguments::{Limit, Optics};
use super::dataset_text::facts;
use super::failure::Failure;
use super::jobs::prepare_dataset::{Align, Finalize};
use super::jobs::suggest_holograms::Suggest;
use super::missing;
use super::pages::pages;
use super::session::Session;
use super::show::{age_or_dash, clock_or_dash, optics};
use super::table::Table;
use super::whole_dataset::print_whole_dataset;
use super::words::WordParser;
use clap::{Args, Subcommand};
use lightpath::v1::{self, Dataset};
use lightpath::{Words as _, names};

/// Commands for datasets.
// Variants without a comment take their help from the struct of their arguments. A comment here would hide all but its
// first line.
#[derive(Debug, Subcommand)]
pub(crate) enum DatasetCommand {
    Create(Create),
    Add(add::Add),
    Import(import::Import),
    Calibration(calibration::Calibration),
    Align(Align),
    Finalize(Finalize),
    Suggest(Suggest),
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
#[command(override_usage = "lightpath dataset create [OPTIONS] --display <ID>\n           --distance <LENGTH> <NAME>")]
#[command(after_long_help = "\
Example:
  lightpath dataset create bench-1 --display lab-2 --distance 150mm
  lightpath dataset add bench-1 --pattern p01.png --photo c01.png
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
    #[arg(long, value_name = "N")]
    photo_bit_depth: Option<u32>,
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
            Self::Show(name) => print_whole_dataset(session, &names::dataset(&name.name)).await,
            Self::List(list) => list.run(session).await,
            Self::Delete(name) => {
                let request = v1::DeleteDatasetRequest { name: names::dataset(&name.name) };
                let answer = session.client.delete_dataset(request).await?;
                session.print_done(&answer, &format!("deleted dataset {}", name.name))
            }
        }
    }
}

impl Create {
    fn request(&self) -> v1::CreateDatasetRequest {
        let dataset = Dataset {
            name: names::dataset(&self.name),
            display: names::display(&self.optics.display),
            wavelength_m: self.optics.wavelength_m(),
            place: Some(v1::Place::at_m(self.optics.distance)),
            photo_encoding: self.photo_encoding.into(),
            photo_bit_depth: self.photo_bit_depth,
            ..Default::default()
        };
        v1::CreateDatasetRequest { dataset: Some(dataset) }
    }
}

impl List {
    async fn run(self, session: &Session) -> Result<(), Failure> {
        let display = self.display.as_deref().map(names::display).unwrap_or_default();
        let list = pages(self.limit.limit, async |page_size, page_token| {
            let request = v1::ListDatasetsRequest { page_size, page_token, display: display.clone() };
            session.client.list_datasets(request).await
        })
        .await?;
        if list.datasets.is_empty() {
            missing::check_display(session, &display).await?;
        }
        session.print_pages(list, |datasets| {
            let mut table = Table::new("dataset|display|optics?|state|>pairs|created???|age??");
            for dataset in datasets {
                table.row([
                    names::id(&dataset.name).to_owned(),
                    names::id(&dataset.display).to_owned(),
                    optics(dataset.wavelength_m(), dataset.place.as_ref()),
                    dataset.state().word().to_owned(),
                    dataset.pair_count.to_string(),
                    clock_or_dash(dataset.create_time.as_ref()),
                    age_or_dash(dataset.create_time.as_ref()),
                ]);
            }
            table.text_or("no datasets; create one: lightpath dataset create --help")
        })
    }
}
