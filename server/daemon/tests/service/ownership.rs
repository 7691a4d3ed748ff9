//! Tests of the owners of artifacts, of the limit on their bytes, and of streams whose token ends.

use crate::access::{Guarded, create_token, with_token};
use crate::serving::{sized_display, small_display};
use lightpath_artifacts::digest_of;
use lightpath_domain::access::Role;
use lightpath_media::pictures;
use lightpath_proto::v1::artifact_service_client::ArtifactServiceClient;
use lightpath_proto::v1::dataset_service_client::DatasetServiceClient;
use lightpath_proto::v1::display_service_client::DisplayServiceClient;
use lightpath_proto::v1::job_service_client::JobServiceClient;
use lightpath_proto::v1::write_artifact_request::Part;
use lightpath_proto::v1::{self, job_spec};
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use tokio::sync::mpsc;
use tokio::time::timeout;
use tokio_stream::wrappers::ReceiverStream;
use tonic::transport::Channel;
use tonic::{Code, Status};
use tonic_types::StatusExt as _;

/// Time limit for the end of the streams of an ended token: several times the interval of the checks for such tokens.
const STREAM_END_MAX: Duration = Duration::from_secs(10);

/// A client with a token.
struct Bearer<'a> {
    guarded: &'a Guarded,
    token: String,
}

impl Bearer<'_> {
    fn channel(&self) -> Channel {
        self.guarded.serving.channel.clone()
    }

    async fn display(&self, id: &str) {
        let request = v1::CreateDisplayRequest { display: Some(small_display(id)) };
        DisplayServiceClient::new(self.channel()).create_display(with_token(&self.token, request)).await.unwrap();
    }

    async fn upload(&self, bytes: &[u8]) -> Result<String, Status> {
        let start =
            v1::WriteArtifactStart { digest: digest_of(bytes), size_bytes: bytes.len() as u64, offset_bytes: 0 };
        let parts = [Part::Start(start), Part::Chunk(bytes.to_vec().into())];
        let parts = parts.map(|part| v1::WriteArtifactRequest { part: Some(part) });
        let request = with_token(&self.token, tokio_stream::iter(parts));
        Ok(ArtifactServiceClient::new(self.channel()).write_artifact(request).await?.into_inner().digest)
    }

    async fn can_read(&self, digest: &str) -> bool {
        let request = v1::ReadArtifactRequest { digest: digest.to_owned(), ..Default::default() };
        let read = ArtifactServiceClient::new(self.channel()).read_artifact(with_token(&self.token, request)).await;
        let get = v1::GetArtifactRequest { digest: digest.to_owned() };
        let got = ArtifactServiceClient::new(self.channel()).get_artifact(with_token(&self.token, get)).await;
        let codes = (
            read.map_or_else(|status| status.code(), |_| Code::Ok),
            got.map_or_else(|status| status.code(), |_| Code::Ok),
        );
        assert!(matches!(codes, (Code::Ok, Code::Ok) | (Code::NotFound, Code::NotFound)), "{codes:?}");
        codes.0 == Code::Ok
    }

    async fn submit(&self, display: &str, target: &str) -> Result<v1::Job, Status> {
        let spec = v1::OptimizeHologram {
            display: format!("displays/{display}"),
            planes: vec![v1::optimize_hologram::ImagePlane {
                place: Some(v1::Place::at_m(0.05)),
                target: target.to_owned(),
                weight: None,
            }],
            iterations: Some(3),
            ..Default::default()
        };
        let spec = Some(v1::JobSpec { kind: Some(job_spec::Kind::OptimizeHologram(spec)) });
        let request = with_token(&self.token, v1::SubmitJobRequest { spec, ..Default::default() });
        Ok(JobServiceClient::new(self.channel()).submit_job(request).await?.into_inner())
    }

    /// Waits until a job has ended, and returns the digest of its phase.
    async fn phase(&self, job: &v1::Job) -> String {
        let request = with_token(&self.token, v1::WatchJobRequest { name: job.name.clone() });
        let mut stream = JobServiceClient::new(self.channel()).watch_job(request).await.unwrap().into_inner();
        let mut last = None;
        while let Some(job) = stream.message().await.unwrap() {
            last = Some(job);
        }
        let result = last.unwrap().result.unwrap().kind.unwrap();
        let v1::job_result::Kind::OptimizeHologram(hologram) = result else { panic!("{result:?}") };
        hologram.wavelengths[0].subframes[0].pattern.clone()
    }
}

fn picture(number: usize) -> Vec<u8> {
    let plane = lightpath_optics::Plane::from_fn(48, 64, |y, x| ((y + x + number) % 97) as f32 / 97.0);
    pictures::grey_png_srgb(&plane).unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn scoped_token_uses_only_its_own_artifacts_and_those_of_its_displays() {
    let guarded = Guarded::start().await;
    let store = guarded.store().await;
    let as_admin = Bearer { guarded: &guarded, token: guarded.tokens["admin"].clone() };
    for id in ["lab", "other"] {
        as_admin.display(id).await;
    }
    let own = |id: &str| vec![id.to_owned()];
    let ada =
        Bearer { guarded: &guarded, token: create_token(&store, "ada", Role::Submitter, &own("lab"), None).await };
    let bob =
        Bearer { guarded: &guarded, token: create_token(&store, "bob", Role::Submitter, &own("other"), None).await };
    let viewer =
        Bearer { guarded: &guarded, token: create_token(&store, "eve", Role::Viewer, &own("lab"), None).await };

    let target = ada.upload(&picture(1)).await.unwrap();
    assert!(ada.can_read(&target).await && as_admin.can_read(&target).await);
    assert!(!bob.can_read(&target).await, "the artifact belongs to another owner");
    assert!(!viewer.can_read(&target).await, "no record about the display refers to the artifact yet");
    let job = ada.submit("lab", &target).await.unwrap();
    assert!(viewer.can_read(&target).await, "a job on the display refers to the artifact");
    let phase = ada.phase(&job).await;
    assert!(ada.can_read(&phase).await && viewer.can_read(&phase).await);
    assert!(!bob.can_read(&phase).await);

    // Knowing the digest is not enough to use the artifact. An upload without the bytes is not enough to own it.
    let refused = bob.submit("other", &target).await.unwrap_err();
    assert_eq!(refused.code(), Code::NotFound, "{refused:?}");
    let start = v1::WriteArtifactStart { digest: target.clone(), size_bytes: picture(1).len() as u64, offset_bytes: 0 };
    let claim = tokio_stream::iter([v1::WriteArtifactRequest { part: Some(Part::Start(start)) }]);
    let claimed = ArtifactServiceClient::new(bob.channel()).write_artifact(with_token(&bob.token, claim)).await;
    assert_eq!(claimed.unwrap_err().code(), Code::InvalidArgument, "the bytes are missing");
    assert!(!bob.can_read(&target).await);
    assert_eq!(bob.upload(&picture(1)).await.unwrap(), target);
    assert!(
        bob.can_read(&target).await && ada.can_read(&target).await,
        "a caller that has sent the bytes owns the artifact, too"
    );
    bob.submit("other", &target).await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn owner_at_the_storage_limit_cannot_store_more() {
    let guarded = Guarded::start_with(|config| config.owner_stored_mib_max = 1.0).await;
    Bearer { guarded: &guarded, token: guarded.tokens["admin"].clone() }.display("lab").await;
    let submitter = Bearer { guarded: &guarded, token: guarded.tokens["submitter"].clone() };
    let target = submitter.upload(&picture(1)).await.unwrap();
    let code_and_reason = |status: Status| {
        let details = status.get_error_details();
        assert!(details.retry_info().is_some(), "{status:?}");
        (status.code(), details.error_info().unwrap().reason.clone())
    };
    let full = (Code::ResourceExhausted, "OWNER_STORED_BYTES".to_owned());
    assert_eq!(
        code_and_reason(submitter.upload(&vec![1; 1 << 20]).await.unwrap_err()),
        full,
        "together with the target this exceeds the limit"
    );
    submitter.upload(&vec![1; (1 << 20) - picture(1).len()]).await.unwrap();
    assert_eq!(code_and_reason(submitter.upload(b"1").await.unwrap_err()), full);
    assert_eq!(
        submitter.upload(&picture(1)).await.unwrap(),
        target,
        "uploading a stored artifact again needs no space"
    );
    assert_eq!(code_and_reason(submitter.submit("lab", &target).await.unwrap_err()), full);
    let curator = Bearer { guarded: &guarded, token: guarded.tokens["curator"].clone() };
    let job = curator.submit("lab", &target).await.unwrap();
    assert!(curator.can_read(&curator.phase(&job).await).await, "other callers are not affected");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn artifacts_that_the_server_makes_need_the_same_room_as_uploads() {
    let guarded = Guarded::start_with(|config| config.owner_stored_mib_max = 1.0).await;
    let bearer = |role: &str| Bearer { guarded: &guarded, token: guarded.tokens[role].clone() };
    let (admin, submitter) = (bearer("admin"), bearer("submitter"));
    let display = sized_display("lab", 400, 300);
    let request = with_token(&admin.token, v1::CreateDisplayRequest { display: Some(display) });
    DisplayServiceClient::new(admin.channel()).create_display(request).await.unwrap();
    let target = async |bearer: &Bearer<'_>| {
        let request = v1::CreateCalibrationTargetRequest { display: "displays/lab".to_owned(), picture: None };
        let request = with_token(&bearer.token, request);
        DatasetServiceClient::new(bearer.channel()).create_calibration_target(request).await
    };
    submitter.upload(&vec![1; 1 << 20]).await.unwrap();
    let refused = target(&submitter).await.unwrap_err();
    assert_eq!(refused.get_error_details().error_info().unwrap().reason, "OWNER_STORED_BYTES", "{refused:?}");
    let made = target(&admin).await.unwrap().into_inner();
    assert_eq!(target(&submitter).await.unwrap().into_inner(), made, "what is stored already needs no room");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn uploads_under_way_count_towards_the_storage_limit_of_their_owner() {
    let guarded = Guarded::start_with(|config| config.owner_stored_mib_max = 1.0).await;
    let submitter = Bearer { guarded: &guarded, token: guarded.tokens["submitter"].clone() };
    let file = |seed: u8| vec![seed; 400_000];
    let begin = |seed: u8, sent_bytes: usize| {
        let (sender, parts) = mpsc::channel(4);
        let bytes = file(seed);
        let start = v1::WriteArtifactStart { digest: digest_of(&bytes), size_bytes: 400_000, offset_bytes: 0 };
        sender.try_send(v1::WriteArtifactRequest { part: Some(Part::Start(start)) }).unwrap();
        sender
            .try_send(v1::WriteArtifactRequest { part: Some(Part::Chunk(bytes[..sent_bytes].to_vec().into())) })
            .unwrap();
        let (mut client, request) =
            (ArtifactServiceClient::new(submitter.channel()), with_token(&submitter.token, ReceiverStream::new(parts)));
        (sender, tokio::spawn(async move { client.write_artifact(request).await.map(drop) }))
    };
    let received = async |seed: u8| {
        let request = v1::GetUploadRequest { digest: digest_of(&file(seed)) };
        let mut client = ArtifactServiceClient::new(submitter.channel());
        client.get_upload(with_token(&submitter.token, request)).await.unwrap().into_inner().received_bytes
    };
    let (first, first_end) = begin(1, 100_000);
    let (second, second_end) = begin(2, 100_000);
    while received(1).await + received(2).await < 200_000 {
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    let refused = submitter.upload(&file(3)).await.unwrap_err();
    assert_eq!(refused.get_error_details().error_info().unwrap().reason, "OWNER_STORED_BYTES", "{refused:?}");

    // Interrupted uploads make room for their owner, the oldest first.
    drop(first);
    first_end.await.unwrap().unwrap_err();
    submitter.upload(&file(3)).await.unwrap();
    assert_eq!(received(1).await, 100_000, "there was enough room");
    drop(second);
    second_end.await.unwrap().unwrap_err();
    submitter.upload(&vec![4; 500_000]).await.unwrap();
    assert_eq!((received(1).await, received(2).await), (0, 100_000));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn ended_token_ends_its_streams_and_uploads() {
    let guarded = Guarded::start().await;
    let store = guarded.store().await;
    let as_admin = Bearer { guarded: &guarded, token: guarded.tokens["admin"].clone() };
    as_admin.display("lab").await;
    // The queue is paused, so the streams about the waiting job stay open without messages.
    let pause = with_token(&as_admin.token, v1::PauseQueueRequest::default());
    JobServiceClient::new(as_admin.channel()).pause_queue(pause).await.unwrap();
    let target = as_admin.upload(&picture(1)).await.unwrap();
    let job = as_admin.submit("lab", &target).await.unwrap();

    let soon_ms = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_millis() as i64 + 1500;
    let leaving =
        Bearer { guarded: &guarded, token: create_token(&store, "leaving", Role::Submitter, &[], None).await };
    let expiring = Bearer {
        guarded: &guarded,
        token: create_token(&store, "expiring", Role::Submitter, &[], Some(soon_ms)).await,
    };
    let staying =
        Bearer { guarded: &guarded, token: create_token(&store, "staying", Role::Submitter, &[], None).await };
    let mut streams = Vec::new();
    for watcher in [&leaving, &expiring, &staying] {
        let request = with_token(&watcher.token, v1::WatchJobRequest { name: job.name.clone() });
        let mut stream = JobServiceClient::new(watcher.channel()).watch_job(request).await.unwrap().into_inner();
        stream.message().await.unwrap().unwrap();
        streams.push(stream);
    }
    let (parts, sent) = mpsc::channel(4);
    let start = v1::WriteArtifactStart { digest: digest_of(b"never"), size_bytes: 5, offset_bytes: 0 };
    parts.send(v1::WriteArtifactRequest { part: Some(Part::Start(start)) }).await.unwrap();
    let request = with_token(&leaving.token, ReceiverStream::new(sent));
    let mut artifacts = ArtifactServiceClient::new(leaving.channel());
    let upload = tokio::spawn(async move { artifacts.write_artifact(request).await });

    store.revoke_token("leaving", 5).await.unwrap();
    let mut open_stream = streams.pop().unwrap();
    for mut stream in streams {
        let ended =
            timeout(STREAM_END_MAX, stream.message()).await.expect("the stream did not end in time").unwrap_err();
        assert_eq!(ended.code(), Code::Unauthenticated, "{ended:?}");
    }
    let ended = timeout(STREAM_END_MAX, upload).await.expect("the upload did not end in time").unwrap().unwrap_err();
    assert_eq!(ended.code(), Code::Unauthenticated, "{ended:?}");
    let cancel = with_token(&as_admin.token, v1::CancelJobRequest { name: job.name.clone() });
    JobServiceClient::new(as_admin.channel()).cancel_job(cancel).await.unwrap();
    assert_eq!(
        open_stream.message().await.unwrap().unwrap().state(),
        v1::job::State::Cancelled,
        "other callers are not affected"
    );
    drop(parts);
}
