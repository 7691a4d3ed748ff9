use std::path::PathBuf;
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream, UnixStream};
use tokio::sync::watch;
use tokio::task::JoinHandle;

/// Delay of each piece on a slow connection.
const SLOW: Duration = Duration::from_millis(60);

/// What happens to the connections.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fault {
    /// Everything passes.
    None,
    /// Open connections end, and new ones end at once.
    Cut,
    /// Nothing passes, and nothing ends: the network swallows it.
    Silence,
    /// Everything passes late.
    Slow,
    /// Requests of HTTP are answered with the status 503.
    Unavailable,
}

/// The server behind a proxy.
#[derive(Clone, Debug)]
pub(crate) enum Upstream {
    Port(u16),
    Socket(PathBuf),
}

/// A proxy on 127.0.0.1. It ends with its handle.
pub(crate) struct FaultProxy {
    pub(crate) port: u16,
    fault: watch::Sender<Fault>,
    accepting: JoinHandle<()>,
}

impl Drop for FaultProxy {
    fn drop(&mut self) {
        self.accepting.abort();
        // Open connections end, too.
        self.fault.send_replace(Fault::Cut);
    }
}

impl FaultProxy {
    pub(crate) async fn start(upstream: Upstream) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let port = listener.local_addr().unwrap().port();
        let fault = watch::Sender::new(Fault::None);
        let faults = fault.subscribe();
        let accepting = tokio::spawn(async move {
            while let Ok((client, _)) = listener.accept().await {
                tokio::spawn(serve(client, upstream.clone(), faults.clone()));
            }
        });
        Self { port, fault, accepting }
    }

    pub(crate) fn set(&self, fault: Fault) {
        self.fault.send_replace(fault);
    }
}

async fn serve(mut client: TcpStream, upstream: Upstream, mut faults: watch::Receiver<Fault>) {
    let fault = *faults.borrow_and_update();
    match fault {
        Fault::Cut => return,
        Fault::Unavailable => return refuse(client).await,
        Fault::None | Fault::Silence | Fault::Slow => {}
    }
    let _ = client.set_nodelay(true);
    match upstream {
        Upstream::Port(port) => {
            let Ok(mut server) = TcpStream::connect(("127.0.0.1", port)).await else { return };
            let _ = server.set_nodelay(true);
            let (from_server, to_server) = server.split();
            let (from_client, to_client) = client.split();
            pass(from_client, to_server, from_server, to_client, faults).await;
        }
        Upstream::Socket(path) => {
            let Ok(mut server) = UnixStream::connect(path).await else { return };
            let (from_server, to_server) = server.split();
            let (from_client, to_client) = client.split();
            pass(from_client, to_server, from_server, to_client, faults).await;
        }
    }
}

/// Reads the head of a request and refuses it.
async fn refuse(mut client: TcpStream) {
    let mut head = vec![0; 16 << 10];
    let _ = client.read(&mut head).await;
    let _ =
        client.write_all(b"HTTP/1.1 503 Service Unavailable\r\nContent-Length: 0\r\nConnection: close\r\n\r\n").await;
}

/// Copies in both directions until one of them ends, or a fault ends the connection.
async fn pass(
    from_client: impl AsyncRead + Unpin,
    to_server: impl AsyncWrite + Unpin,
    from_server: impl AsyncRead + Unpin,
    to_client: impl AsyncWrite + Unpin,
    mut faults: watch::Receiver<Fault>,
) {
    let (up, down) = (faults.clone(), faults.clone());
    let ended = faults.wait_for(|fault| matches!(fault, Fault::Cut | Fault::Unavailable));
    tokio::select! {
        () = copy(from_client, to_server, up) => {}
        () = copy(from_server, to_client, down) => {}
        _ = ended => {}
    }
}

async fn copy(mut from: impl AsyncRead + Unpin, mut to: impl AsyncWrite + Unpin, mut faults: watch::Receiver<Fault>) {
    let mut bytes = vec![0; 16 << 10];
    loop {
        let Ok(count) = from.read(&mut bytes).await else { return };
        if count == 0 || faults.wait_for(|fault| *fault != Fault::Silence).await.is_err() {
            return;
        }
        if *faults.borrow() == Fault::Slow {
            tokio::time::sleep(SLOW).await;
        }
        if to.write_all(&bytes[..count]).await.is_err() {
            return;
        }
    }
}
