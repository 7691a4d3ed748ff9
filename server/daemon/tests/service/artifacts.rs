//! Tests of artifacts: uploads, interrupted uploads, checks of digests, reads of ranges.

use crate::manifests::curl;
use crate::serving::{Serving, expect};
use lightpath_artifacts::digest_of;
use lightpath_proto::v1;
use lightpath_proto::v1::write_artifact_request::Part;
use std::time::Duration;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Code, Status};

async fn read(serving: &Serving, digest: &str, offset_bytes: u64, limit_bytes: u64) -> Result<Vec<u8>, Status> {
    let limit_bytes = (limit_bytes > 0).then_some(limit_bytes);
    let request = v1::ReadArtifactRequest { digest: digest.to_owned(), offset_bytes, limit_bytes };
    let mut stream = serving.artifacts().read_artifact(request).await?.into_inner();
    let mut bytes = Vec::new();
    while let Some(message) = stream.message().await? {
        bytes.extend_from_slice(&message.chunk);
    }
    Ok(bytes)
}

#[tokio::test]
async fn uploaded_bytes_are_read_back() {
    let serving = Serving::start().await;
    let bytes: Vec<u8> = (0..3_000_000_u32).map(|i| (i.wrapping_mul(7919) >> 8) as u8).collect();
    let digest = serving.upload(&bytes).await;
    assert_eq!(serving.upload(&bytes).await, digest, "uploading the same bytes again returns the same digest");
    assert_eq!(read(&serving, &digest, 0, 0).await.unwrap(), bytes);
    assert_eq!(read(&serving, &digest, 2_999_990, 5).await.unwrap(), bytes[2_999_990..2_999_995]);
    expect(read(&serving, &digest, 3_000_001, 0).await, Code::OutOfRange, "offset_bytes is 3000001");
    let missing = digest_of(b"missing");
    expect(read(&serving, &missing, 0, 0).await, Code::NotFound, "digest: artifact sha256-");
    expect(read(&serving, "../../etc/passwd", 0, 0).await, Code::InvalidArgument, "digest is \"../../etc/passwd\"");
}

#[tokio::test]
async fn an_upload_without_a_digest_is_told_it() {
    let serving = Serving::start().await;
    let bytes: Vec<u8> = (0..200_000_u32).map(|i| (i.wrapping_mul(7919) >> 8) as u8).collect();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, &bytes).unwrap();
    let body = format!("@{}", file.display());
    let octets = "content-type: application/octet-stream";
    let send = |headers: &[&str]| {
        let headers = headers.iter().flat_map(|header| ["--header".to_owned(), (*header).to_owned()]);
        let more: Vec<String> = ["--data-binary".to_owned(), body.clone()].into_iter().chain(headers).collect();
        let serving = &serving;
        async move { curl(serving, "/v1/artifacts", &more.iter().map(String::as_str).collect::<Vec<_>>()).await }
    };
    for _ in 0..2 {
        let stored = send(&[octets]).await;
        assert_eq!(stored.status, 200, "{}", stored.text());
        assert!(stored.text().contains(&digest_of(&bytes)), "{}", stored.text());
    }
    assert_eq!(serving.read(&digest_of(&bytes)).await, bytes);
    for (headers, status, needed) in [
        (["content-type: text/plain", "x-test: 1"], 415, "application/octet-stream"),
        ([octets, "content-range: bytes 10-19/20"], 400, "PUT /v1/artifacts/{digest}/upload"),
        ([octets, "content-length: 9000000000"], 400, "content-length is 9000000000"),
        ([octets, "transfer-encoding: chunked"], 411, "content-length"),
    ] {
        let refused = send(&headers).await;
        assert!(refused.status == status && refused.text().contains(needed), "{headers:?}: {}", refused.text());
    }
    let left = std::fs::read_dir(serving.config.data_dir.join("uploads")).unwrap().count();
    assert_eq!(left, 0, "nothing is left of refused uploads");
}

#[tokio::test]
async fn interrupted_upload_continues() {
    let serving = Serving::start().await;
    let bytes = b"holography is photography without a lens".repeat(1000);
    let (digest, size) = (digest_of(&bytes), bytes.len() as u64);
    let cut = serving.write(&digest, size, 0, &bytes[..1000]).await;
    expect(cut, Code::InvalidArgument, "1000 bytes arrived");
    let request = v1::GetUploadRequest { digest: digest.clone() };
    let upload = serving.artifacts().get_upload(request.clone()).await.unwrap().into_inner();
    assert_eq!((upload.received_bytes, upload.complete), (1000, false));
    expect(serving.write(&digest, size, 999, &bytes[999..]).await, Code::Aborted, "offset_bytes is 999");
    serving.write(&digest, size, 1000, &bytes[1000..]).await.unwrap();
    assert!(serving.artifacts().get_upload(request).await.unwrap().into_inner().complete);
    assert_eq!(read(&serving, &digest, 0, 0).await.unwrap(), bytes);
}

#[tokio::test]
async fn upload_repairs_a_damaged_artifact() {
    let serving = Serving::start_with(|config| config.owner_stored_mib_max = 1.0).await;
    // The owner may store no second copy of these bytes.
    let bytes = vec![7_u8; 700_000];
    let digest = serving.upload(&bytes).await;
    let path = serving.config.data_dir.join("artifacts").join(&digest[7..9]).join(&digest);
    let request = v1::GetUploadRequest { digest: digest.clone() };
    assert!(serving.artifacts().get_upload(request.clone()).await.unwrap().into_inner().complete);
    for damage in ["damaged", "truncated", "missing"] {
        match damage {
            "damaged" => std::fs::write(&path, vec![8_u8; 700_000]).unwrap(),
            "truncated" => std::fs::write(&path, b"").unwrap(),
            _ => std::fs::remove_file(&path).unwrap(),
        }
        let upload = serving.artifacts().get_upload(request.clone()).await.unwrap().into_inner();
        assert_eq!((upload.received_bytes, upload.complete), (0, false), "{damage}");
        assert_eq!(serving.upload(&bytes).await, digest);
        assert_eq!(read(&serving, &digest, 0, 0).await.unwrap(), bytes, "{damage}");
        assert!(serving.artifacts().get_upload(request.clone()).await.unwrap().into_inner().complete);
    }
}

#[tokio::test]
async fn wrong_content_is_refused() {
    let serving = Serving::start().await;
    let digest = digest_of(b"right");
    expect(serving.write(&digest, 5, 0, b"wrong").await, Code::InvalidArgument, "the content hashes to sha256-");
    let request = v1::GetArtifactRequest { digest: digest.clone() };
    expect(serving.artifacts().get_artifact(request).await, Code::NotFound, "digest: artifact");
    let size = (1 << 30) + 1;
    expect(serving.write(&digest, size, 0, b"x").await, Code::InvalidArgument, "start.size_bytes is 1073741825");
    expect(serving.write(&digest, 2, 0, b"too long").await, Code::InvalidArgument, "8 bytes arrived");
    let none = serving.artifacts().write_artifact(tokio_stream::iter([])).await;
    expect(none, Code::InvalidArgument, "start is missing");
}

#[tokio::test]
async fn concurrent_uploads_of_the_same_bytes_succeed() {
    let serving = Serving::start().await;
    let bytes = vec![7; 1 << 20];
    let uploads = (0..8).map(|_| serving.upload(&bytes));
    let digests = futures::future::join_all(uploads).await;
    assert!(digests.iter().all(|digest| *digest == digest_of(&bytes)));
}

#[tokio::test]
async fn concurrent_uploads_are_limited() {
    let serving = Serving::start().await;
    let mut waiting = Vec::new();
    // Each upload waits for its second message. The last upload is refused.
    let refused = loop {
        assert!(waiting.len() < 1000, "no upload was refused");
        let digest = digest_of(waiting.len().to_string().as_bytes());
        let start = v1::WriteArtifactStart { digest, size_bytes: 9, offset_bytes: 0 };
        let (parts, sent) = mpsc::channel(1);
        parts.send(v1::WriteArtifactRequest { part: Some(Part::Start(start)) }).await.unwrap();
        let mut artifacts = serving.artifacts();
        let mut upload = tokio::spawn(async move { artifacts.write_artifact(ReceiverStream::new(sent)).await });
        match tokio::time::timeout(Duration::from_millis(20), &mut upload).await {
            Ok(ended) => break ended.unwrap().unwrap_err(),
            Err(_) => waiting.push((parts, upload)),
        }
    };
    expect(Err::<(), _>(refused), Code::ResourceExhausted, "the address 127.0.0.1 already has 16 uploads");
    assert!(waiting.len() >= 16, "{}", waiting.len());
    let (parts, upload) = waiting.remove(0);
    drop(parts);
    expect(upload.await.unwrap(), Code::InvalidArgument, "0 bytes arrived");
    serving.upload(b"another").await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn curl_uploads_continues_and_downloads() {
    let serving = Serving::start().await;
    let bytes: Vec<u8> = (0..300_000_u32).map(|i| (i.wrapping_mul(7919) >> 8) as u8).collect();
    let digest = digest_of(&bytes);
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, part: &[u8]| {
        std::fs::write(folder.path().join(name), part).unwrap();
        format!("@{}", folder.path().join(name).display())
    };
    let (first, rest, whole) = (file("first", &bytes[..1000]), file("rest", &bytes[1000..]), file("whole", &bytes));
    let upload = format!("/v1/artifacts/{digest}/upload");
    let put = async |range: &str, data: &str| {
        let range = format!("content-range: {range}");
        let common = ["--request", "PUT", "--header", "expect:", "--data-binary", data];
        let more = if range.ends_with(' ') { &[][..] } else { &["--header", &range][..] };
        curl(&serving, &upload, &[&common[..], more].concat()).await
    };
    let cut = put("bytes 0-299999/300000", &first).await;
    assert!(cut.status == 400 && cut.text().contains("1000 bytes arrived"), "{cut:?}");
    let state = curl(&serving, &format!("/v1/uploads/{digest}"), &[]).await;
    assert!(state.text().contains("\"receivedBytes\":\"1000\""), "{}", state.text());
    let gap = put("bytes 2000-299999/300000", &rest).await;
    assert_eq!((gap.status, gap.text().contains("offset_bytes is 2000")), (409, true), "{}", gap.text());
    let wrong = put("bytes 1000-1999/300000", &rest).await;
    assert!(wrong.status == 400 && wrong.text().contains("must reach to the end"), "{}", wrong.text());
    let done = put("bytes 1000-299999/300000", &rest).await;
    assert!(done.status == 200 && done.text().contains("\"sizeBytes\":\"300000\""), "{}", done.text());
    assert_eq!(put("", &whole).await.status, 200, "the same bytes again");

    let content = format!("/v1/artifacts/{digest}/content");
    let downloaded = curl(&serving, &content, &[]).await;
    assert_eq!((downloaded.status, downloaded.field("content-length")), (200, Some("300000")));
    assert_eq!(downloaded.field("x-content-type-options"), Some("nosniff"));
    assert_eq!(downloaded.body, bytes);
    let part = curl(&serving, &content, &["--range", "299990-"]).await;
    assert_eq!((part.status, part.field("content-range")), (206, Some("bytes 299990-299999/300000")));
    assert_eq!(part.body, bytes[299_990..]);
    let known = format!("if-none-match: {}", downloaded.field("etag").unwrap());
    assert_eq!(curl(&serving, &content, &["--header", &known]).await.status, 304);
    let missing = curl(&serving, &format!("/v1/artifacts/{}/content", digest_of(b"missing")), &[]).await;
    assert_eq!(missing.status, 404, "{}", missing.text());
    let unnamed = curl(&serving, "/v1/artifacts/passwd/content", &[]).await;
    assert!(unnamed.status == 400 && unnamed.text().contains("digest is"), "{}", unnamed.text());
}

#[tokio::test]
async fn an_upload_with_other_bytes_than_its_digest_says_is_refused() {
    let serving = Serving::start().await;
    let upload = format!("/v1/artifacts/{}/upload", digest_of(b"these bytes"));
    let other = curl(&serving, &upload, &["--request", "PUT", "--data-binary", "other bytes"]).await;
    assert!(other.status == 400 && other.text().contains("digest"), "{}", other.text());
    let chunked = ["--request", "PUT", "--header", "transfer-encoding: chunked", "--data-binary", "these bytes"];
    let unknown = curl(&serving, &upload, &chunked).await;
    assert!(unknown.status == 411 && unknown.text().contains("content-length"), "{}", unknown.text());
    let right = curl(&serving, &upload, &["--request", "PUT", "--data-binary", "these bytes"]).await;
    assert_eq!(right.status, 200, "{}", right.text());
}
