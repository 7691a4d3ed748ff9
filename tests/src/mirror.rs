use crate::command_line::CommandLine;
use crate::material::kernel_file;
use crate::process::agent;
use std::fs;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use tokio::io::{AsyncBufReadExt as _, AsyncReadExt as _, AsyncWriteExt as _, BufReader};
use tokio::net::{TcpListener, TcpStream};

const KERNEL: &str = "--display lab --distance 50mm";

/// Serves the files of a folder, as any web server does: it ignores queries, and knows neither ranges nor reports.
async fn serve_files(root: PathBuf) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    tokio::spawn(async move {
        while let Ok((stream, _)) = listener.accept().await {
            let root = root.clone();
            tokio::spawn(async move { answer(stream, &root).await });
        }
    });
    address
}

/// Answers the first request of a connection, and closes it.
async fn answer(stream: TcpStream, root: &Path) -> std::io::Result<()> {
    let mut stream = BufReader::new(stream);
    let (mut request, mut length) = (String::new(), 0);
    stream.read_line(&mut request).await?;
    loop {
        let mut header = String::new();
        stream.read_line(&mut header).await?;
        if let Some(value) = header.to_lowercase().strip_prefix("content-length:") {
            length = value.trim().parse().unwrap_or(0);
        }
        if header.trim().is_empty() {
            break;
        }
    }
    stream.read_exact(&mut vec![0; length]).await?;
    let mut words = request.split(' ');
    let (method, path) = (words.next().unwrap_or(""), words.next().unwrap_or(""));
    let path = path.split('?').next().unwrap_or("").trim_start_matches('/');
    let (status, body) = match (method, fs::read(root.join(path))) {
        ("GET", Ok(file)) => ("200 OK", file),
        ("GET", Err(_)) => ("404 Not Found", Vec::new()),
        _ => ("501 Unsupported method", Vec::new()),
    };
    let head = format!("HTTP/1.1 {status}\r\ncontent-length: {}\r\nconnection: close\r\n\r\n", body.len());
    stream.write_all(&[head.as_bytes(), &body].concat()).await?;
    stream.shutdown().await
}

/// Lets an agent ask the mirror once, and returns the kernel that it then uses.
async fn ask_once(cli: &CommandLine, mirror: SocketAddr, root: &str) -> Vec<u8> {
    let (server, directory) = (format!("http://{mirror}"), cli.path("device"));
    let options = [
        ("--server", server.as_str()),
        ("--display", "lab"),
        ("--device", "bench-1"),
        ("--wavelength", "515nm"),
        ("--distance", "50mm"),
        ("--kernel", "515nm-50mm"),
        ("--format", "compact"),
        ("--root", root),
        ("--directory", directory.to_str().unwrap()),
    ];
    let mut arguments = options.map(|(name, value)| [name, value]).concat();
    arguments.push("--once");
    let status = agent(&arguments).wait().await.unwrap();
    assert!(status.success(), "{status}");
    fs::read(directory.join("current/kernel")).unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn an_agent_gets_its_kernels_from_a_mirror_of_files() {
    let cli = CommandLine::start().await;
    cli.text("display create lab --resolution 96x64 --pixel-pitch 8um --wavelength 515nm").await;
    for version in 1..=2 {
        cli.write("k.safetensors", &kernel_file(96, 64, 0.1 * f64::from(version)));
        cli.text(&format!("kernel import {KERNEL} @/k.safetensors")).await;
        cli.text(&format!("kernel export {KERNEL} --version {version} --format compact -o @/{version}.lpk")).await;
    }
    let shown = cli.text("keyring show").await;
    let root = shown.lines().find_map(|line| line.strip_prefix("root ")).unwrap_or_else(|| panic!("{shown}"));
    let mirror = serve_files(cli.path("mirror")).await;
    fs::create_dir(cli.path("device")).unwrap();
    let write = format!("kernel mirror {KERNEL} --format compact --root {root} -o @/mirror");
    for version in 1..=2 {
        cli.text(&format!("kernel promote {KERNEL} --version {version}")).await;
        let written = cli.text(&write).await;
        assert!(written.contains("515nm-50mm") && written.contains("counts until"), "{written}");
        let expected = fs::read(cli.path(&format!("{version}.lpk"))).unwrap();
        assert!(ask_once(&cli, mirror, root).await == expected, "version {version}");
    }
    // Nothing has changed: the same files are written again.
    cli.text(&write).await;
    // A rollout that gives the caller another version does not reach the devices of the mirror.
    cli.text(&format!("rollout start {KERNEL} --version 1 --share 100%")).await;
    let rolled = cli.run(&write).await;
    assert!(rolled.code == Some(1) && rolled.stderr.contains("a rollout gives this token version 1"), "{rolled:?}");
    assert!(ask_once(&cli, mirror, root).await == fs::read(cli.path("2.lpk")).unwrap(), "the active version stays");
    let stranger = format!("kernel mirror {KERNEL} --root {} -o @/other", "0".repeat(64));
    let refused = cli.run(&stranger).await;
    assert!(refused.code == Some(1) && !cli.path("other").exists(), "{refused:?}");
    cli.server.stop().await;
}
