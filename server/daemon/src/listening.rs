//! Listens at the address of the settings. If its port is taken, the error says by whom, and what to do.

use anyhow::{Context as _, bail};
use lightpath_artifacts::LOCK;
use std::fmt::Write as _;
use std::fs;
use std::io::ErrorKind;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use tokio::net::TcpListener;

/// Ports after a taken one among which a free one is searched.
const NEXT_PORTS: u16 = 30;
/// State of a listening socket in the tables of the kernel of Linux.
const LISTENS: &str = "0A";
/// Name of a server's process.
const SERVER: &str = "lightpathd";

/// A process that listens on a port.
#[derive(Debug)]
struct Holder {
    pid: u32,
    program: String,
    /// Data folder of a server.
    data_dir: Option<PathBuf>,
}

/// Listens at `address` for a server with this data folder.
///
/// # Errors
///
/// Nobody may listen there, or somebody does already; the text says who, if the system tells.
pub async fn listen(address: SocketAddr, data_dir: &Path) -> anyhow::Result<TcpListener> {
    match TcpListener::bind(address).await {
        Err(error) if error.kind() == ErrorKind::AddrInUse => {
            bail!(taken(address, holder(address.port()).as_ref(), data_dir, next_free(address).await))
        }
        listener => {
            listener.with_context(|| format!("cannot listen on {address}; choose another address with --listen"))
        }
    }
}

/// Why the server cannot listen, and what to do.
fn taken(address: SocketAddr, holder: Option<&Holder>, data_dir: &Path, free: Option<SocketAddr>) -> String {
    let mut text = format!("cannot listen on {address}: port {} is taken by ", address.port());
    let mut own_folder = "";
    match holder {
        None => text += "another program",
        Some(Holder { pid, program, data_dir: None }) => _ = write!(text, "the program {program} (process {pid})"),
        Some(Holder { pid, data_dir: Some(theirs), .. }) => {
            _ = write!(text, "another lightpathd (process {pid}), whose data folder is {}", theirs.display());
            if same(theirs, data_dir) {
                text += "\n  that is the folder of this server, too: it runs already, and you can use it";
                own_folder = " --data-dir OTHER-FOLDER";
            } else {
                text += "\n  to use that server, start no other one";
            }
        }
    }
    if let Some(free) = free {
        _ = write!(text, "\n  to start one at another port: lightpathd serve --listen {free}{own_folder}");
        if free.ip().is_loopback() {
            _ = write!(text, "\n  and for its commands: export LIGHTPATH_SERVER=http://{free}");
        }
    }
    text
}

fn same(one: &Path, other: &Path) -> bool {
    fs::canonicalize(one).ok().zip(fs::canonicalize(other).ok()).is_some_and(|(one, other)| one == other)
}

/// The first free port after that of `address`.
async fn next_free(address: SocketAddr) -> Option<SocketAddr> {
    for port in (1..=NEXT_PORTS).filter_map(|more| address.port().checked_add(more)) {
        let next = SocketAddr::new(address.ip(), port);
        if TcpListener::bind(next).await.is_ok() {
            return Some(next);
        }
    }
    None
}

/// The process that listens on a port. `None` if the system does not tell, as for a process of another user.
fn holder(port: u16) -> Option<Holder> {
    let sockets: Vec<String> = ["tcp", "tcp6"].iter().flat_map(|table| sockets(table, port)).collect();
    let processes = fs::read_dir("/proc").ok()?.flatten();
    let pids = processes.filter_map(|entry| entry.file_name().to_str()?.parse::<u32>().ok());
    let is_holder =
        |pid: &u32| open_files(*pid).iter().any(|file| sockets.iter().any(|socket| Path::new(socket) == file));
    let pid = pids.into_iter().find(is_holder)?;
    let program = fs::read_to_string(format!("/proc/{pid}/comm")).ok()?.trim().to_owned();
    let lock = open_files(pid).into_iter().find(|file| program == SERVER && file.ends_with(LOCK));
    Some(Holder { pid, program, data_dir: lock.and_then(|lock| Some(lock.parent()?.to_owned())) })
}

/// Sockets that listen on a port, as the open files of a process name them.
fn sockets(table: &str, port: u16) -> Vec<String> {
    let text = fs::read_to_string(format!("/proc/net/{table}")).unwrap_or_default();
    let socket = |line: &str| {
        let columns: Vec<&str> = line.split_whitespace().collect();
        let (address, state, inode) = (columns.get(1)?, columns.get(3)?, columns.get(9)?);
        let (_, hexadecimal) = address.rsplit_once(':')?;
        let is_it = u16::from_str_radix(hexadecimal, 16) == Ok(port) && *state == LISTENS;
        is_it.then(|| format!("socket:[{inode}]"))
    };
    text.lines().filter_map(socket).collect()
}

/// What the open files of a process are. None of a process of another user.
fn open_files(pid: u32) -> Vec<PathBuf> {
    let files = fs::read_dir(format!("/proc/{pid}/fd")).map(|files| files.flatten().collect::<Vec<_>>());
    files.unwrap_or_default().iter().filter_map(|file| fs::read_link(file.path()).ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_taken_port_is_named_with_its_holder_and_a_free_one() {
        let taken = TcpListener::bind("127.0.0.1:0").await.unwrap().local_addr().unwrap();
        let _holds = TcpListener::bind(taken).await.unwrap();
        let error = listen(taken, Path::new("data")).await.unwrap_err().to_string();
        let this = if cfg!(target_os = "linux") { format!("(process {})", std::process::id()) } else { String::new() };
        for sign in [format!("port {} is taken by", taken.port()), this, "--listen 127.0.0.1:".to_owned()] {
            assert!(error.contains(&sign), "{sign}: {error}");
        }
        assert!(!error.contains(&format!("--listen {taken}\n")), "{error}");
    }

    #[test]
    fn another_server_is_named_with_its_data_folder() {
        let (here, there) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let address = "127.0.0.1:7070".parse().unwrap();
        let of = |data_dir: &Path| {
            let holder = Holder { pid: 7, program: "lightpathd".to_owned(), data_dir: Some(data_dir.to_owned()) };
            taken(address, Some(&holder), here.path(), Some(address))
        };
        let text = of(there.path());
        let folder = there.path().display();
        assert!(text.contains(&format!("another lightpathd (process 7), whose data folder is {folder}")), "{text}");
        assert!(text.contains("to use that server") && !text.contains("OTHER-FOLDER"), "{text}");
        let text = of(here.path());
        assert!(
            text.contains("it runs already, and you can use it") && text.contains("--data-dir OTHER-FOLDER"),
            "{text}"
        );
        assert!(taken(address, None, here.path(), None).ends_with("is taken by another program"));
    }
}
