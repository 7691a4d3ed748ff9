//! Tests of signed manifests and of kernels over HTTP, as a device sees them: with curl, and with root keys alone.

use crate::kernels::{KERNEL, import, kernel};
use crate::serving::{Serving, expect};
use lightpath_artifacts::digest_of;
use lightpath_manifest::{Manifest, Optics, SignedManifest, Time, Trust, Wanted};
use lightpath_proto::v1;
use lightpath_proto::v1::fetch_kernel_response::Part;
use lightpath_proto::v1::kernel_service_client::KernelServiceClient;
use lightpath_server::upkeep::{self, KeyChange};
use lightpath_store::Store;
use std::io::Read;
use std::process::{Command, Stdio};
use std::time::Duration;
use tonic::Code;
use tonic::transport::Channel;

fn kernels(serving: &Serving) -> KernelServiceClient<Channel> {
    KernelServiceClient::new(serving.channel.clone())
}

async fn promote(serving: &Serving, version: u32) {
    let request = v1::PromoteKernelRequest { kernel: KERNEL.into(), version, ..Default::default() };
    kernels(serving).promote_kernel(request).await.unwrap();
}

/// A server with three versions of a kernel, the first one active.
pub(crate) async fn serving() -> Serving {
    let serving = Serving::start().await;
    serving.display("lab").await;
    for phase in [0.1, 0.2, 0.3] {
        import(&serving, &kernel(64, phase), 0.05).await.unwrap();
    }
    promote(&serving, 1).await;
    serving
}

/// An answer that curl received.
#[derive(Debug)]
pub(crate) struct Answer {
    pub(crate) status: u16,
    head: String,
    pub(crate) body: Vec<u8>,
}

impl Answer {
    /// The answer that curl has written; `None` as long as its head is not complete.
    fn read(written: &[u8]) -> Option<Self> {
        let end = written.windows(4).position(|bytes| bytes == b"\r\n\r\n")?;
        let head = String::from_utf8(written[..end].to_vec()).unwrap();
        let status = head.split(' ').nth(1).unwrap().parse().unwrap();
        Some(Self { status, head, body: written[end + 4..].to_vec() })
    }

    pub(crate) fn field(&self, name: &str) -> Option<&str> {
        self.head.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(": ")).map(str::trim)
    }

    pub(crate) fn text(&self) -> String {
        String::from_utf8(self.body.clone()).unwrap()
    }
}

/// Asks the server with curl.
pub(crate) async fn curl(serving: &Serving, path: &str, more: &[&str]) -> Answer {
    let mut command = curl_command(serving, path, more);
    let run = move || {
        command.output().unwrap_or_else(|error| panic!("curl is needed for this test, but could not be run: {error}"))
    };
    let output = tokio::task::spawn_blocking(run).await.unwrap();
    Answer::read(&output.stdout).unwrap_or_else(|| panic!("{output:?}"))
}

/// Reads with curl an answer that never ends, until its text is enough.
pub(crate) async fn curl_until(serving: &Serving, path: &str, more: &[&str], enough: fn(&str) -> bool) -> Answer {
    let mut command = curl_command(serving, path, more);
    let run = move || {
        let mut curl = command.args(["--no-buffer", "--max-time", "30"]).stdout(Stdio::piped()).spawn().unwrap();
        let (mut read, mut buffer) = (Vec::new(), [0; 4096]);
        let answer = loop {
            let count = curl.stdout.as_mut().unwrap().read(&mut buffer).unwrap();
            read.extend_from_slice(&buffer[..count]);
            match Answer::read(&read) {
                Some(answer) if enough(&answer.text()) => break answer,
                answer if count == 0 => panic!("the answer ended: {answer:?}"),
                _ => {}
            }
        };
        curl.kill().unwrap();
        curl.wait().unwrap();
        answer
    };
    tokio::task::spawn_blocking(run).await.unwrap()
}

fn curl_command(serving: &Serving, path: &str, more: &[&str]) -> Command {
    let mut command = Command::new("curl");
    let url = format!("http://{}{path}", serving.address);
    command.args(["--silent", "--show-error", "--include", &url]).args(more);
    command
}

fn path(rest: &str) -> String {
    format!("/v1/{KERNEL}{rest}")
}

fn now() -> Time {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap();
    Time::from_unix_s(since.as_secs() as i64).unwrap()
}

fn wanted(format: &str, generation: u64) -> Wanted {
    let (display, format) = ("lab".to_owned(), format.to_owned());
    Wanted { display, optics: Optics::at_distance(515_000, 50_000_000), format, generation }
}

pub(crate) async fn store_of(serving: &Serving) -> Store {
    serving.config.database().unwrap().open_shared().await.unwrap()
}

/// What a device trusts that knows the server's root key from its manufacture.
async fn trust(serving: &Serving) -> Trust {
    let state = upkeep::state(&store_of(serving).await).await.unwrap();
    let root = state.keys.iter().find(|key| key.use_ == "root").unwrap();
    let roots = Trust::Roots(vec![lightpath_manifest::PublicKey::parse(&root.public).unwrap()]);
    let keyring = curl(serving, "/v1/keyring", &[]).await;
    Trust::Keyring(roots.renew(&keyring.body, now()).unwrap())
}

async fn manifest(serving: &Serving, format: &str) -> (Answer, Manifest) {
    let answer = curl(serving, &path(&format!("/manifest?format={format}")), &[]).await;
    assert_eq!(answer.status, 200, "{answer:?}");
    let said = SignedManifest::parse(&answer.body).unwrap().unchecked().clone();
    (answer, said)
}

fn file_path(manifest: &Manifest) -> String {
    path(&format!("/versions/{}/{}/{}", manifest.version, manifest.format, manifest.digest))
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn curl_gets_a_manifest_then_304_and_a_file_that_continues_after_a_cut() {
    let serving = serving().await;
    let trust = trust(&serving).await;
    for format in ["safetensors", "compact", "f16"] {
        let (answer, said) = manifest(&serving, format).await;
        assert_eq!(trust.manifest(&answer.body, &wanted(format, 1), now()).unwrap(), said);
        assert_eq!((said.version, said.generation, said.orders.as_str()), (1, 1, "first"));
        let etag = answer.field("etag").unwrap();
        assert!(!etag.starts_with("W/"), "{etag}");
        let poll_after_s: u32 = answer.field("lightpath-poll-after-s").unwrap().parse().unwrap();
        assert!((45..=75).contains(&poll_after_s));
        let condition = format!("if-none-match: {etag}");
        let same = curl(&serving, &path(&format!("/manifest?format={format}")), &["--header", &condition]).await;
        assert_eq!((same.status, same.body.len()), (304, 0), "{same:?}");

        let file = curl(&serving, &file_path(&said), &[]).await;
        assert_eq!((file.status, file.body.len() as u64), (200, said.size_bytes), "{}", file.head);
        assert_eq!(digest_of(&file.body), said.digest);
        assert_eq!(file.field("content-length"), Some(said.size_bytes.to_string().as_str()));
        assert!(file.field("cache-control").unwrap().contains("immutable"));
        // The download was cut after a third; the rest is asked for.
        let (cut, etag) = (file.body.len() / 3, file.field("etag").unwrap());
        let (range, condition) = (format!("{cut}-"), format!("if-range: {etag}"));
        let rest = curl(&serving, &file_path(&said), &["--range", &range, "--header", &condition]).await;
        assert_eq!(rest.status, 206, "{}", rest.head);
        assert_eq!(rest.body, file.body[cut..]);
        let expected = format!("bytes {cut}-{}/{}", said.size_bytes - 1, said.size_bytes);
        assert_eq!(rest.field("content-range"), Some(expected.as_str()));
        let other = curl(&serving, &file_path(&said), &["--range", &range, "--header", "if-range: \"other\""]).await;
        assert_eq!((other.status, other.body), (200, file.body.clone()));
        let beyond = curl(&serving, &file_path(&said), &["--range", "99999999-"]).await;
        assert_eq!((beyond.status, beyond.field("content-range").unwrap().starts_with("bytes */")), (416, true));
        let head = curl(&serving, &file_path(&said), &["--head"]).await;
        assert_eq!((head.status, head.field("content-length")), (200, file.field("content-length")));
    }
    let other = file_path(&Manifest { version: 2, ..manifest(&serving, "compact").await.1 });
    let refused = curl(&serving, &other, &[]).await;
    assert_eq!(refused.status, 404);
    assert!(refused.text().contains("read the manifest again"), "{}", refused.text());
    let refused = curl(&serving, &path("/manifest?format=round"), &[]).await;
    assert!(refused.status == 400 && refused.text().contains("one of safetensors, compact"), "{}", refused.text());
    // After a restart a cut download continues, although the server made the file anew.
    let (before, said) = manifest(&serving, "f16").await;
    let serving = serving.restart().await;
    let rest = curl(&serving, &file_path(&said), &["--range", "200-"]).await;
    assert_eq!((rest.status, rest.body.len() as u64), (206, said.size_bytes - 200), "{}", rest.head);
    assert_eq!(manifest(&serving, "f16").await.0.body, before.body);
    let list = curl(&serving, "/v1/displays/lab/kernels", &[]).await;
    assert!(list.status == 200 && list.text().contains(KERNEL), "{}", list.text());
    let one = curl(&serving, &path(""), &[]).await;
    assert!(one.text().contains("\"activeVersion\":1"), "{}", one.text());
    serving.stop().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn generation_rises_with_a_rollback_and_a_device_refuses_the_manifest_before() {
    let serving = serving().await;
    let trust = trust(&serving).await;
    promote(&serving, 2).await;
    let (old, said) = manifest(&serving, "compact").await;
    assert_eq!((said.version, said.generation), (2, 2));
    let back =
        v1::RollbackKernelRequest { kernel: KERNEL.into(), expected_active_version: Some(2), ..Default::default() };
    kernels(&serving).rollback_kernel(back).await.unwrap();
    let (new, said) = manifest(&serving, "compact").await;
    assert_eq!((said.version, said.generation), (1, 3));
    assert!(trust.manifest(&new.body, &wanted("compact", 2), now()).is_ok());
    let refused = trust.manifest(&old.body, &wanted("compact", 3), now()).unwrap_err().to_string();
    assert!(refused.contains("generation 2, but generation 3"), "{refused}");
    // gRPC has the same document.
    let request = v1::GetKernelManifestRequest {
        kernel: KERNEL.into(),
        format: v1::KernelFormat::Compact.into(),
        ..Default::default()
    };
    let same = kernels(&serving).get_kernel_manifest(request).await.unwrap().into_inner();
    assert_eq!((same.document.as_bytes(), same.generation), (new.body.as_slice(), 3));
    let other = v1::GetKernelManifestRequest { kernel: "displays/lab/kernels/515nm-60mm".into(), ..Default::default() };
    expect(kernels(&serving).get_kernel_manifest(other).await, Code::NotFound, "");
    serving.stop().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn request_for_a_manifest_waits_for_a_promotion() {
    let serving = serving().await;
    let (answer, _) = manifest(&serving, "compact").await;
    let condition = format!("if-none-match: {}", answer.field("etag").unwrap());
    let begin = std::time::Instant::now();
    let same = curl(&serving, &path("/manifest?format=compact&wait_s=1"), &["--header", &condition]).await;
    assert!(same.status == 304 && begin.elapsed() >= Duration::from_secs(1));
    let waiting = path("/manifest?format=compact&wait_s=50");
    let arguments = ["--header", &condition];
    let (changed, ()) = tokio::join!(curl(&serving, &waiting, &arguments), async {
        // The answer is right in any order; usually the request waits by now.
        tokio::time::sleep(Duration::from_millis(300)).await;
        promote(&serving, 3).await;
    });
    assert_eq!(SignedManifest::parse(&changed.body).unwrap().unchecked().version, 3);
    let refused = curl(&serving, &path("/manifest?wait_s=51"), &[]).await;
    assert!(refused.status == 400 && refused.text().contains("wait_s is 51"), "{}", refused.text());
    serving.stop().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn manifests_follow_rotated_and_revoked_keys_without_a_restart() {
    let serving = serving().await;
    let store = store_of(&serving).await;
    let (first_trust, (first, _)) = (trust(&serving).await, manifest(&serving, "compact").await);
    let now_ms = now().unix_s() * 1000;
    upkeep::change_keyring(&store, KeyChange::Rotate, now_ms + 1000).await.unwrap();
    let (rotated, _) = manifest(&serving, "compact").await;
    // The device needs the new keyring for the new key, and accepts the old key's manifest still.
    let refused = first_trust.manifest(&rotated.body, &wanted("compact", 1), now()).unwrap_err().to_string();
    assert!(refused.contains("does not list"), "{refused}");
    let keyring = curl(&serving, "/v1/keyring", &[]).await;
    let second_trust = Trust::Keyring(first_trust.renew(&keyring.body, now()).unwrap());
    for answer in [&first, &rotated] {
        second_trust.manifest(&answer.body, &wanted("compact", 1), now()).unwrap();
    }
    let old = SignedManifest::parse(&first.body).unwrap().key_id().to_owned();
    let state = upkeep::state(&store).await.unwrap();
    let public = &state.keys.iter().find(|key| key.id == old).unwrap().public;
    let revoked = lightpath_manifest::PublicKey::parse(public).unwrap();
    upkeep::change_keyring(&store, KeyChange::Revoke(revoked), now_ms).await.unwrap();
    let keyring = curl(&serving, "/v1/keyring", &[]).await;
    let third_trust = Trust::Keyring(second_trust.renew(&keyring.body, now()).unwrap());
    let refused = third_trust.manifest(&first.body, &wanted("compact", 1), now()).unwrap_err().to_string();
    assert!(refused.contains("is revoked"), "{refused}");
    let (newest, _) = manifest(&serving, "compact").await;
    third_trust.manifest(&newest.body, &wanted("compact", 1), now()).unwrap();
    serving.stop().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn cut_fetch_over_grpc_continues_at_an_offset() {
    let serving = serving().await;
    for format in [v1::KernelFormat::Safetensors, v1::KernelFormat::F16] {
        let mut files = Vec::new();
        for offset_bytes in [0, 100] {
            let request =
                v1::FetchKernelRequest { kernel: KERNEL.into(), version: Some(1), format: format.into(), offset_bytes };
            let mut stream = kernels(&serving).fetch_kernel(request).await.unwrap().into_inner();
            let mut bytes = Vec::new();
            while let Some(message) = stream.message().await.unwrap() {
                if let Some(Part::Chunk(chunk)) = message.part {
                    bytes.extend_from_slice(&chunk);
                }
            }
            files.push(bytes);
        }
        assert_eq!(files[1], files[0][100..]);
        let offset_bytes = 1 << 40;
        let request =
            v1::FetchKernelRequest { kernel: KERNEL.into(), version: Some(1), format: format.into(), offset_bytes };
        expect(kernels(&serving).fetch_kernel(request).await, Code::OutOfRange, "");
    }
    serving.stop().await.unwrap();
}
