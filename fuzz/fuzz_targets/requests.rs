//! Sends messages to every method of a real server. The first byte of the input chooses the method.
#![no_main]

#[path = "../../server/daemon/tests/service/raw.rs"]
mod raw;

use lightpath_proto::v1::CreateDisplayRequest;
use lightpath_proto::v1::display_service_client::DisplayServiceClient;
use lightpath_server::config::Config;
use lightpath_server::server;
use std::sync::LazyLock;
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio::runtime::Runtime;
use tonic::Code;
use tonic::transport::Channel;

struct Serving {
    runtime: Runtime,
    channel: Channel,
    methods: Vec<String>,
    _folder: TempDir,
}

static SERVING: LazyLock<Serving> = LazyLock::new(|| {
    let (runtime, folder) = (Runtime::new().unwrap(), TempDir::new().unwrap());
    let config = Config { data_dir: folder.path().join("data"), calls_per_s_max: 0, ..Config::default() };
    let channel = runtime.block_on(async {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        tokio::spawn(server::run(listener, config, std::future::pending()));
        let channel = Channel::from_shared(url).unwrap().connect().await.unwrap();
        let display = lightpath_proto::v1::Display {
            name: "displays/lab".into(),
            modulator: Some(lightpath_proto::v1::Modulator::of_phase(64, 48, 8e-6)),
            wavelengths_m: vec![515e-9],
            ..Default::default()
        };
        let request = CreateDisplayRequest { display: Some(display) };
        DisplayServiceClient::new(channel.clone()).create_display(request).await.unwrap();
        channel
    });
    Serving { runtime, channel, methods: raw::methods(), _folder: folder }
});

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some((method, message)) = bytes.split_first() else { return };
    let Serving { runtime, channel, methods, .. } = &*SERVING;
    let path = &methods[usize::from(*method) % methods.len()];
    let answer = runtime.block_on(raw::call(channel, path, message.to_vec()));
    if let Err(status) = answer {
        let is_wrong = matches!(status.code(), Code::Unknown | Code::Unavailable | Code::DataLoss);
        let is_failure = status.code() == Code::Internal && !status.message().contains("failed to decode");
        assert!(!is_wrong && !is_failure, "{path}: {status:?}");
    }
});
