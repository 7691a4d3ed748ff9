//! `lightpath doctor`

mod findings;

use super::failure::Failure;
use super::pages::pages;
use super::session::Session;
use super::terminal;
use clap::Args;
use findings::{Finding, Findings, address, clock, disk, kernels, latency, role, throughput, version};
use lightpath::{Code, Error, v1};
use std::io::IsTerminal as _;
use std::net::IpAddr;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Calls of which the latency is the median.
const LATENCY_CALLS: usize = 5;

/// Check the connection to the server, the token, the server itself and the terminal.
///
/// Each line is ok, a warning or a problem, with what to do about it. The exit code is 0 if there is no problem, 1 if
/// there is one, and 3 if no server can be reached. To measure how fast uploads are, the command uploads some random
/// bytes, which the server removes by itself after a while; roles that may not upload skip this.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  lightpath doctor
  lightpath doctor --server https://lab:7070 --token-file ada.token
  lightpath doctor --output json | jq '.checks[] | select(.state != \"ok\")'")]
pub(crate) struct Doctor {
    /// Measure uploads with this many MiB, 0 to 64; 0 uploads nothing
    #[arg(long, value_name = "MIB", default_value_t = 4, value_parser = clap::value_parser!(u32).range(0..=64))]
    upload_mib: u32,
}

impl Doctor {
    pub(crate) async fn run(self, session: &Session) -> Result<(), Failure> {
        let mut findings = Findings::default();
        findings.add(address(session.client.url()));
        let unreachable = match self.check_server(session, &mut findings).await {
            Ok(()) => None,
            Err(Failure::Client(error)) if error.is_unreachable() => Some(error),
            Err(Failure::Client(error)) => {
                findings.add(Finding::problem("server", error.to_string(), "see the message of the server"));
                None
            }
            Err(other) => return Err(other),
        };
        if let Some(error) = &unreachable {
            findings.add(Finding::problem("server", error.to_string(), unreachable_fix(session.client.url())));
        }
        findings.add(terminal_finding());
        session.print(&findings, Findings::text)?;
        match (unreachable, findings.problems()) {
            (Some(_), _) => Err(Failure::Silent(3)),
            (None, 0) => Ok(()),
            (None, _) => Err(Failure::Silent(1)),
        }
    }

    /// Checks that need the server. An error ends them.
    async fn check_server(&self, session: &Session, findings: &mut Findings) -> Result<(), Failure> {
        let client = &session.client;
        let (server, duration, now_s) = match timed_server(session).await {
            Ok(answer) => answer,
            Err(error) if error.code() == Some(Code::Unimplemented) => {
                let fix = "use a server of the client's version";
                findings.add(Finding::warning("version", "the server is older than this client".to_owned(), fix));
                return Ok(());
            }
            Err(error) if error.code() == Some(Code::Unauthenticated) => {
                let fix = "give a token: --token-file, or LIGHTPATH_TOKEN_FILE; `lightpathd token create` makes one";
                findings.add(Finding::problem("token", error.to_string(), fix));
                return Ok(());
            }
            Err(error) => return Err(error.into()),
        };
        findings.add(Finding::ok("server", format!("answers at {}", client.url())));
        findings.add(version(&server.version, env!("CARGO_PKG_VERSION")));
        findings.add(role(&server, is_local(client.url())));
        let server_s = server.time.map_or(now_s, |time| time.seconds as f64 + f64::from(time.nanos) / 1e9);
        findings.add(clock(server_s - now_s, duration));
        findings.add(disk(server.disk_free_bytes, server.disk_reserve_bytes));
        // A device may not list displays and not upload.
        if server.role != "firmware" {
            self.check_displays(session, &server, findings).await?;
        }
        let mut durations = vec![duration];
        for _ in 1..LATENCY_CALLS {
            durations.push(timed_server(session).await?.1);
        }
        durations.sort_unstable();
        findings.add(latency(durations[LATENCY_CALLS / 2]));
        if self.upload_mib > 0 && matches!(server.role.as_str(), "submitter" | "curator" | "admin") {
            findings.add(self.upload(session).await?);
        }
        Ok(())
    }

    /// Counts the displays that the token may use, and their active kernels.
    async fn check_displays(
        &self,
        session: &Session,
        server: &v1::Server,
        findings: &mut Findings,
    ) -> Result<(), Failure> {
        let displays = pages(0, async |page_size, page_token| {
            session.client.list_displays(v1::ListDisplaysRequest { page_size, page_token }).await
        })
        .await?;
        // A token for some displays may list the kernels of each of them, but not all kernels.
        let all = [String::new()];
        let of = if server.displays.is_empty() { &all[..] } else { &server.displays };
        let (mut known, mut active) = (0, 0);
        for display in of {
            let found = pages(0, async |page_size, page_token| {
                let request =
                    v1::ListKernelsRequest { page_size, page_token, display: display.clone(), ..Default::default() };
                session.client.list_kernels(request).await
            })
            .await?;
            known += found.kernels.len();
            active += found.kernels.iter().filter(|kernel| kernel.active_version.is_some()).count();
        }
        findings.add(kernels(displays.displays.len(), known, active));
        Ok(())
    }

    async fn upload(&self, session: &Session) -> Result<Finding, Failure> {
        let bytes = random_bytes((self.upload_mib as usize) << 20)?;
        let size_bytes = bytes.len();
        let begin = Instant::now();
        session.client.upload_bytes(bytes).await?;
        Ok(throughput(size_bytes as u64, begin.elapsed()))
    }
}

/// Facts about the server, the time that the call took, and the client's clock in the middle of it \[s since 1970\].
async fn timed_server(session: &Session) -> Result<(v1::Server, Duration, f64), Error> {
    let begin = Instant::now();
    let server = session.client.get_server(v1::GetServerRequest {}).await?;
    let duration = begin.elapsed();
    let now_s = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64();
    Ok((server, duration, now_s - duration.as_secs_f64() / 2.0))
}

/// Bytes that no server has yet.
fn random_bytes(count: usize) -> Result<Vec<u8>, Failure> {
    let mut bytes = vec![0; count];
    getrandom::fill(&mut bytes)
        .map_err(|error| Failure::Refused(format!("this system has no random numbers: {error}")))?;
    Ok(bytes)
}

/// True for a server on the same machine.
fn is_local(url: &str) -> bool {
    let site = url.split_once("://").map_or(url, |(_, rest)| rest).split('/').next().unwrap_or_default();
    let host = match site.rsplit_once(':') {
        Some((host, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => host,
        _ => site,
    };
    let address = host.trim_start_matches('[').trim_end_matches(']').parse::<IpAddr>();
    host == "localhost" || address.is_ok_and(|address| address.is_loopback())
}

fn unreachable_fix(url: &str) -> &'static str {
    match (is_local(url), url.starts_with("https")) {
        (true, _) => "start it with `lightpathd serve`, or give another address with --server or LIGHTPATH_SERVER",
        (false, true) => {
            "check the address, the network and that the server runs; for a certificate of your own give --ca-file"
        }
        (false, false) => {
            "check the address, the network and that the server runs and listens beyond its machine; a server with TLS \
             needs https://"
        }
    }
}

/// What the terminal can show.
fn terminal_finding() -> Finding {
    let variable = |name: &str| std::env::var(name).unwrap_or_default();
    let charset = ["LC_ALL", "LC_CTYPE", "LANG"].map(variable).into_iter().find(|value| !value.is_empty());
    let is_unicode = charset.is_some_and(|charset| charset.to_lowercase().replace('-', "").contains("utf8"));
    let colours = match (variable("NO_COLOR").is_empty(), std::io::stderr().is_terminal()) {
        (false, _) => "no colours (NO_COLOR)",
        (true, true) => "colours",
        (true, false) => "no colours",
    };
    let width = terminal::columns()
        .map_or_else(|| "no terminal: lines of any length".to_owned(), |columns| format!("{columns} columns"));
    findings::terminal(&width, colours, is_unicode, terminal::columns())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn local_addresses_are_recognized() {
        assert!(is_local("http://127.0.0.1:7070") && is_local("https://localhost:1") && is_local("http://[::1]:7070"));
        assert!(is_local("http://[::1]/") && is_local("127.0.0.7") && is_local("http://localhost/"));
        for other in ["http://lab:7070", "http://localhost.example:7070", "http://127.example", "http://[::2]:7070"] {
            assert!(!is_local(other), "{other}");
        }
    }

    #[test]
    fn random_bytes_differ_and_have_the_wanted_number() {
        let (one, two) = (random_bytes(1001).unwrap(), random_bytes(1001).unwrap());
        assert!(one.len() == 1001 && one != two);
    }
}
