//! `lightpath-rig serve`.

use crate::arguments::ServeArguments;
use crate::session::{self, Pace};
use crate::settings::{Adapter, Settings};
use crate::{Problem, log, opening};
use lightpath::v1::{Display, GetDisplayRequest};
use lightpath::{Client, Credentials, names};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::watch;

/// Time for threads that wait for a device when the program ends.
const END: Duration = Duration::from_millis(500);

pub(super) fn serve(arguments: &ServeArguments) -> Result<(), Problem> {
    let settings = Settings::read(&arguments.settings.settings)?;
    let missing = |field: &str| Problem::Setting(format!("{field} is missing: the rig's file must name it to serve"));
    let server = settings.server.clone().ok_or_else(|| missing("server"))?;
    if settings.display.is_none() {
        return Err(missing("display"));
    }
    let credentials = credentials(arguments)?;
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build();
    let runtime = runtime.map_err(|error| Problem::Setting(format!("no threads: {error}")))?;
    let ended = runtime.block_on(async {
        let client = Client::connect_as(&server, &credentials).map_err(|error| Problem::Setting(error.to_string()))?;
        run(&settings, client).await
    });
    // A device that hangs must not keep the program.
    runtime.shutdown_timeout(END);
    ended
}

async fn run(settings: &Settings, client: Client) -> Result<(), Problem> {
    let (stop, stopped) = watch::channel(false);
    tokio::spawn(async move {
        ended_by_signal().await;
        log::line("ending: the bench goes to its safe state");
        let _ = stop.send(true);
        // The sender lives as long as the program, so that who waits for it waits.
        std::future::pending::<()>().await;
    });
    let display = match settings.adapter {
        // A simulated bench has the optics of its display.
        Adapter::Simulated => match display(settings, &client, stopped.clone()).await? {
            None => return Ok(()),
            some => some,
        },
        Adapter::Folder | Adapter::Command => None,
    };
    // Devices are opened by code that blocks.
    let opened = {
        let settings = settings.clone();
        tokio::task::spawn_blocking(move || opening::open(&settings, display.as_ref()))
    };
    let bench =
        opened.await.map_err(|error| Problem::Devices(format!("the devices could not be opened: {error}")))??;
    session::serve(settings, client, Arc::new(bench), Pace::default(), stopped).await
}

/// Reads the display, for as long as that takes; `None`: the rig shall end.
async fn display(
    settings: &Settings,
    client: &Client,
    mut stopped: watch::Receiver<bool>,
) -> Result<Option<Display>, Problem> {
    let name = names::display(settings.display.as_deref().unwrap_or_default());
    loop {
        let request = GetDisplayRequest { name: name.clone() };
        let error = match client.get_display(request).await {
            Ok(display) => return Ok(Some(display)),
            Err(error) => error,
        };
        log::line(format_args!("{}", session::lost_or_problem(&error)?));
        tokio::select! {
            () = tokio::time::sleep(Pace::default().retry_max / 10) => {}
            _ = stopped.wait_for(|stop| *stop) => return Ok(None),
        }
    }
}

/// Waits for SIGINT or SIGTERM.
async fn ended_by_signal() {
    let (Ok(mut interrupt), Ok(mut terminate)) = (signal(SignalKind::interrupt()), signal(SignalKind::terminate()))
    else {
        // Without them a signal ends the program at once, as it always did.
        return std::future::pending().await;
    };
    tokio::select! {
        _ = interrupt.recv() => {}
        _ = terminate.recv() => {}
    }
}

fn credentials(arguments: &ServeArguments) -> Result<Credentials, Problem> {
    let token_file = arguments.token_file.as_deref().map(|path| read(path, "--token-file")).transpose()?;
    let token_file = token_file.map(|bytes| String::from_utf8_lossy(&bytes).trim().to_owned());
    let certificate = match (&arguments.client_cert, &arguments.client_key) {
        (Some(certificate), Some(key)) => Some((read(certificate, "--client-cert")?, read(key, "--client-key")?)),
        _ => None,
    };
    Ok(Credentials {
        token: token_file.or(arguments.token.clone()),
        authority_pem: arguments.ca_file.as_deref().map(|path| read(path, "--ca-file")).transpose()?,
        certificate_and_key_pem: certificate,
        token_over_http: arguments.token_over_http,
    })
}

fn read(path: &Path, option: &str) -> Result<Vec<u8>, Problem> {
    let wrong = |error| Problem::Setting(format!("{} cannot be read: {error}; correct {option}", path.display()));
    std::fs::read(path).map_err(wrong)
}
