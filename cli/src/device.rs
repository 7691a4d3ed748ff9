//! The commands `lightpath device …`.

use super::arguments::Limit;
use super::failure::Failure;
use super::pages::pages;
use super::session::Session;
use super::show;
use super::table::Table;
use clap::{Args, Subcommand};
use lightpath::{names, v1};

/// Commands for devices: displays in the field that fetch kernels.
#[derive(Debug, Subcommand)]
pub(crate) enum DeviceCommand {
    List(List),
    /// Put a device into a group for rollouts, or take it out of its group.
    ///
    /// The device need not have reported yet. Its id is the name of its token.
    #[command(after_long_help = "\
Example:
  lightpath device group --display lab-2 bench-7 first")]
    Group {
        /// Id of the display
        #[arg(long, value_name = "ID")]
        display: String,

        /// Id of the device
        #[arg(value_name = "DEVICE")]
        device: String,

        /// The group: a-z, 0-9 and '-' [default: none]
        #[arg(value_name = "GROUP")]
        group: Option<String>,
    },
    /// Forget a device and its reports. If it reports again, it is listed again.
    Delete {
        /// Id of the display
        #[arg(long, value_name = "ID")]
        display: String,

        /// Id of the device
        #[arg(value_name = "DEVICE")]
        device: String,
    },
}

/// Show which devices of a display use which version, and what they reported.
#[derive(Debug, Args)]
pub(crate) struct List {
    /// Id of the display
    #[arg(value_name = "DISPLAY")]
    display: String,

    #[command(flatten)]
    limit: Limit,
}

impl DeviceCommand {
    pub(crate) async fn run(self, session: &Session) -> Result<(), Failure> {
        match self {
            Self::List(list) => list.run(session).await,
            Self::Group { display, device, group } => {
                let (name, group) = (names::device(&display, &device), group.unwrap_or_default());
                let request = v1::SetDeviceGroupRequest { name, group };
                let device = session.client.set_device_group(request).await?;
                session.print(&device, |device| table(std::slice::from_ref(device)).text())
            }
            Self::Delete { display, device } => {
                let request = v1::DeleteDeviceRequest { name: names::device(&display, &device) };
                session.print(&session.client.delete_device(request).await?, |_| format!("deleted {device}\n"))
            }
        }
    }
}

impl List {
    async fn run(self, session: &Session) -> Result<(), Failure> {
        let display = names::display(&self.display);
        let list = pages(self.limit.limit, async |page_size, page_token| {
            let request = v1::ListDevicesRequest { display: display.clone(), page_size, page_token };
            session.client.list_devices(request).await
        })
        .await?;
        session.print_pages(list, |devices| {
            table(devices).text_or("no devices; docs/firmware.md says how a device reports")
        })
    }
}

/// One row for each kernel of each device.
fn table(devices: &[v1::Device]) -> Table {
    let mut table =
        Table::new("device|group~?|kernel|>version|form???|>generation????|>self-test?|reported??|agent~????|message_");
    for device in devices {
        let none = v1::InstalledKernel::default();
        let kernels = if device.kernels.is_empty() { std::slice::from_ref(&none) } else { &device.kernels };
        for installed in kernels {
            table.row([
                names::id(&device.name).to_owned(),
                show::or_dash(&device.group),
                show::or_dash(names::id(&installed.kernel)),
                show::version_or_dash(installed.version),
                show::or_dash(&installed.format),
                if installed.generation == 0 { "–".to_owned() } else { installed.generation.to_string() },
                installed.self_test_loss.map_or_else(|| "–".to_owned(), show::loss),
                installed.report_time.as_ref().map_or_else(|| "never".to_owned(), show::age),
                show::or_dash(&device.agent),
                message(installed),
            ]);
        }
    }
    table
}

fn message(installed: &v1::InstalledKernel) -> String {
    match installed.tried_version {
        None => installed.message.clone(),
        Some(version) => format!("gave up version {version}: {}", installed.message),
    }
}
