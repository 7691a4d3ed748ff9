//! The commands `lightpath kernel list`, `show` and `versions`.

use super::origin;
use crate::arguments::{Limit, distance};
use crate::failure::Failure;
use crate::kernel_choice::KernelChoice;
use crate::metrics_text::{self, against_ideal};
use crate::missing;
use crate::pages::{more_hint, pages};
use crate::session::Session;
use crate::show;
use crate::table::{Facts, Table};
use clap::Args;
use lightpath::v1::{self, Kernel, KernelVersion};
use lightpath::{Words as _, names};

/// List kernels.
#[derive(Debug, Args)]
pub(crate) struct List {
    /// List only kernels of the display with this id
    #[arg(long, value_name = "ID")]
    display: Option<String>,

    /// List only kernels of this distance, for example 150mm
    #[arg(long, value_name = "LENGTH", value_parser = distance, allow_hyphen_values = true)]
    distance: Option<f64>,

    #[command(flatten)]
    limit: Limit,
}

/// Show a kernel and its versions, or one version in full.
#[derive(Debug, Args)]
pub(crate) struct Show {
    #[command(flatten)]
    kernel: KernelChoice,

    /// Show this version in full, with its lineage [default: the kernel and its newest 50 versions]
    #[arg(long, value_name = "N")]
    version: Option<u32>,
}

/// List the versions of a kernel, newest first.
#[derive(Debug, Args)]
pub(crate) struct Versions {
    #[command(flatten)]
    kernel: KernelChoice,

    #[command(flatten)]
    limit: Limit,
}

impl List {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let display = self.display.as_deref().map(names::display).unwrap_or_default();
        let place = self.distance.map(v1::Place::at_m);
        let list = pages(self.limit.limit, async |page_size, page_token| {
            let (display, place) = (display.clone(), place);
            let request = v1::ListKernelsRequest { page_size, page_token, display, place, ..Default::default() };
            session.client.list_kernels(request).await
        })
        .await?;
        if list.kernels.is_empty() {
            missing::check_display(session, &display).await?;
        }
        session.print_pages(list, |kernels| {
            let mut table = Table::new("kernel|optics???|>active|>latest|from?|created????|age??");
            for kernel in kernels {
                table.row([
                    kernel.name.clone(),
                    show::optics(kernel.wavelength_m, kernel.place.as_ref()),
                    show::version_or_dash(kernel.active_version),
                    kernel.latest_version.to_string(),
                    if kernel.interpolated { "interpolated" } else { "" }.to_owned(),
                    show::clock_or_dash(kernel.create_time.as_ref()),
                    show::age_or_dash(kernel.create_time.as_ref()),
                ]);
            }
            table.text_or("no kernels; learn one: lightpath kernel learn --help")
        })
    }
}

impl Show {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let name = self.kernel.name(session).await?;
        if let Some(version) = self.version {
            let request = v1::GetKernelVersionRequest { name: names::kernel_version(&name, version) };
            return session.print(&session.client.get_kernel_version(request).await?, version_facts);
        }
        let kernel = session.client.get_kernel(v1::GetKernelRequest { name: name.clone() }).await?;
        if session.is_json() {
            return session.print(&kernel, |_| String::new());
        }
        let list = versions(session, &name, 50).await?;
        let table = version_table(&list.versions).text() + more_hint(&list.next_page_token);
        session.print_text(&format!("{}\n{table}", kernel_facts(&kernel)))
    }
}

impl Versions {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let name = self.kernel.name(session).await?;
        let list = versions(session, &name, self.limit.limit).await?;
        session.print_pages(list, |versions| version_table(versions).text())
    }
}

async fn versions(session: &Session, kernel: &str, limit: u32) -> Result<v1::ListKernelVersionsResponse, Failure> {
    pages(limit, async |page_size, page_token| {
        let request = v1::ListKernelVersionsRequest { kernel: kernel.to_owned(), page_size, page_token };
        session.client.list_kernel_versions(request).await
    })
    .await
}

/// Text about a kernel without its versions.
pub(super) fn kernel_facts(kernel: &Kernel) -> String {
    let mut facts = Facts::default();
    facts.add("kernel", &kernel.name);
    facts.add("optics", show::optics(kernel.wavelength_m, kernel.place.as_ref()));
    facts.add(
        "active",
        match kernel.active_version {
            None => "none; choose one: lightpath kernel promote --help".to_owned(),
            Some(version) => show::kernel_version(version),
        },
    );
    facts.add("latest", show::kernel_version(kernel.latest_version));
    let mut aliases: Vec<String> = kernel.aliases.iter().map(|(alias, version)| format!("{alias} {version}")).collect();
    aliases.sort();
    facts.add_some("aliases", (!aliases.is_empty()).then(|| aliases.join(", ")));
    facts.add_some("rollout", (!kernel.rollout.is_empty()).then(|| format!("{} is running", kernel.rollout)));
    if kernel.interpolated {
        facts.add("from", "interpolated between photographed distances");
    }
    facts.add_some("created", kernel.create_time.as_ref().map(show::time));
    facts.text()
}

fn version_table(versions: &[KernelVersion]) -> Table {
    let mut table = Table::new(">version|state|model?|>held-out loss|>ideal?|>size???|dataset~|created????|age??");
    for version in versions {
        let metrics = version.metrics.clone().unwrap_or_default();
        let lineage = version.lineage.clone().unwrap_or_default();
        let measured = |loss| if metrics.test_pairs == 0 { "–".to_owned() } else { show::loss(loss) };
        table.row([
            version.version.to_string(),
            state(version).to_owned(),
            version.model().word().to_owned(),
            measured(metrics.test_loss),
            measured(metrics.ideal_test_loss),
            show::bytes(version.size_bytes),
            origin::word(&lineage),
            show::clock_or_dash(version.create_time.as_ref()),
            show::age_or_dash(version.create_time.as_ref()),
        ]);
    }
    table
}

fn state(version: &KernelVersion) -> &'static str {
    match (version.active, version.deprecation.is_some()) {
        (true, false) => "active",
        (true, true) => "active, deprecated",
        (false, true) => "deprecated",
        (false, false) => "",
    }
}

/// Text about a version in full.
pub(super) fn version_facts(version: &KernelVersion) -> String {
    let mut facts = Facts::default();
    facts.add("version", &version.name);
    facts.add("model", version.model().word());
    facts.add("active", if version.active { "yes" } else { "no" });
    if let Some(deprecation) = &version.deprecation {
        let by = if deprecation.caller.is_empty() { String::new() } else { format!(", by {}", deprecation.caller) };
        let time = show::time_or_dash(deprecation.time.as_ref());
        facts.add("deprecated", format!("{} ({time}{by})", deprecation.reason));
    }
    facts.add("file", format!("{}, {}", version.artifact, show::bytes(version.size_bytes)));
    if let Some(metrics) = &version.metrics {
        facts.add("held-out loss", against_ideal(metrics.test_loss, metrics.ideal_test_loss));
        facts.add("full frame", against_ideal(metrics.test_loss_full_frame, metrics.ideal_test_loss_full_frame));
        metrics_text::verdict(metrics, &mut facts);
        facts.add("training loss", show::loss(metrics.train_loss));
        facts.add_some("validation loss", metrics.validation_loss.map(show::loss));
        facts.add("pairs", metrics_text::pairs(metrics));
    }
    if let Some(lineage) = &version.lineage {
        origin::add(lineage, &mut facts);
    }
    facts.add_some("created", version.create_time.as_ref().map(show::time));
    let parts = version.metrics.as_ref().map(metrics_text::parts).filter(|table| !table.is_empty());
    facts.text() + &parts.map(|table| format!("\n{table}")).unwrap_or_default()
}
