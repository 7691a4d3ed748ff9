//! Whose artifacts are, how many bytes an owner may have, and how long a token holds what it has begun.

use crate::access::{Guarded, make, with_token};
use crate::serving::small_display;
use lightpath_artifacts::digest_of;
use lightpath_domain::access::Role;
use lightpath_media::pictures;
use lightpath_proto::v1::artifact_service_client::ArtifactServiceClient;
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

/// How long a token that has ended may go on, at most: some looks at the tokens, on a busy machine.
const LAPSE_MAX: Duration = Duration::from_secs(10);

/// Calls as the bearer of a token.
struct As<'a> {
    guarded: &'a Guarded,
    token: String,
}

impl As<'_> {
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

    async fn reads(&self, digest: &str) -> bool {
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
                distance_m: 0.05,
                target: target.to_owned(),
                weight: 0.0,
            }],
            iterations: 3,
            ..Default::default()
        };
        let spec = Some(v1::JobSpec { kind: Some(job_spec::Kind::OptimizeHologram(spec)) });
        let request = with_token(&self.token, v1::SubmitJobRequest { spec, ..Default::default() });
        Ok(JobServiceClient::new(self.channel()).submit_job(request).await?.into_inner())
    }

    /// A job's phase, once it has one.
    async fn phase(&self, job: &v1::Job) -> String {
        let request = with_token(&self.token, v1::WatchJobRequest { name: job.name.clone() });
        let mut stream = JobServiceClient::new(self.channel()).watch_job(request).await.unwrap().into_inner();
        let mut last = None;
        while let Some(job) = stream.message().await.unwrap() {
            last = Some(job);
        }
        let result = last.unwrap().result.unwrap().kind.unwrap();
        let v1::job_result::Kind::Hologram(hologram) = result else { panic!("{result:?}") };
        hologram.wavelengths[0].frames[0].phase.clone()
    }
}

fn picture(number: usize) -> Vec<u8> {
    let plane = lightpath_optics::Plane::from_fn(48, 64, |y, x| ((y + x + number) % 97) as f32 / 97.0);
    pictures::grey_png_srgb(&plane).unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_scoped_token_reads_and_uses_the_artifacts_of_its_own_displays_only() {
    let guarded = Guarded::start().await;
    let store = guarded.store().await;
    let as_admin = As { guarded: &guarded, token: guarded.tokens["admin"].clone() };
    for id in ["lab", "other"] {
        as_admin.display(id).await;
    }
    let own = |id: &str| vec![id.to_owned()];
    let ada = As { guarded: &guarded, token: make(&store, "ada", Role::Submitter, &own("lab"), None).await };
    let bob = As { guarded: &guarded, token: make(&store, "bob", Role::Submitter, &own("other"), None).await };
    let viewer = As { guarded: &guarded, token: make(&store, "eve", Role::Viewer, &own("lab"), None).await };

    let target = ada.upload(&picture(1)).await.unwrap();
    assert!(ada.reads(&target).await && as_admin.reads(&target).await);
    assert!(!bob.reads(&target).await, "somebody else's");
    assert!(!viewer.reads(&target).await, "nothing about its display refers to it yet");
    let job = ada.submit("lab", &target).await.unwrap();
    assert!(viewer.reads(&target).await, "a job on its display does");
    let phase = ada.phase(&job).await;
    assert!(ada.reads(&phase).await && viewer.reads(&phase).await);
    assert!(!bob.reads(&phase).await);

    // Neither is it used by whoever only knows its name, nor had by whoever only claims to bring it.
    let refused = bob.submit("other", &target).await.unwrap_err();
    assert_eq!(refused.code(), Code::NotFound, "{refused:?}");
    let start = v1::WriteArtifactStart { digest: target.clone(), size_bytes: picture(1).len() as u64, offset_bytes: 0 };
    let claim = tokio_stream::iter([v1::WriteArtifactRequest { part: Some(Part::Start(start)) }]);
    let claimed = ArtifactServiceClient::new(bob.channel()).write_artifact(with_token(&bob.token, claim)).await;
    assert_eq!(claimed.unwrap_err().code(), Code::InvalidArgument, "the bytes are missing");
    assert!(!bob.reads(&target).await);
    assert_eq!(bob.upload(&picture(1)).await.unwrap(), target);
    assert!(bob.reads(&target).await && ada.reads(&target).await, "who has the bytes may have them");
    bob.submit("other", &target).await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn who_has_stored_enough_brings_nothing_more() {
    let guarded = Guarded::start_with(|config| config.owner_stored_mib_max = 1.0).await;
    As { guarded: &guarded, token: guarded.tokens["admin"].clone() }.display("lab").await;
    let submitter = As { guarded: &guarded, token: guarded.tokens["submitter"].clone() };
    let target = submitter.upload(&picture(1)).await.unwrap();
    let spent = |status: Status| {
        let details = status.get_error_details();
        assert!(details.retry_info().is_some(), "{status:?}");
        (status.code(), details.error_info().unwrap().reason.clone())
    };
    let full = (Code::ResourceExhausted, "OWNER_STORED_BYTES".to_owned());
    assert_eq!(spent(submitter.upload(&vec![1; 1 << 20]).await.unwrap_err()), full, "with the target it is too much");
    submitter.upload(&vec![1; (1 << 20) - picture(1).len()]).await.unwrap();
    assert_eq!(spent(submitter.upload(b"1").await.unwrap_err()), full);
    assert_eq!(submitter.upload(&picture(1)).await.unwrap(), target, "what is there already is brought by nobody");
    assert_eq!(spent(submitter.submit("lab", &target).await.unwrap_err()), full);
    let curator = As { guarded: &guarded, token: guarded.tokens["curator"].clone() };
    let job = curator.submit("lab", &target).await.unwrap();
    assert!(curator.reads(&curator.phase(&job).await).await, "others go on");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_token_that_ends_ends_its_streams_and_uploads() {
    let guarded = Guarded::start().await;
    let store = guarded.store().await;
    let as_admin = As { guarded: &guarded, token: guarded.tokens["admin"].clone() };
    as_admin.display("lab").await;
    // A job that waits gives a stream in which nothing happens.
    let pause = with_token(&as_admin.token, v1::PauseQueueRequest::default());
    JobServiceClient::new(as_admin.channel()).pause_queue(pause).await.unwrap();
    let target = as_admin.upload(&picture(1)).await.unwrap();
    let job = as_admin.submit("lab", &target).await.unwrap();

    let soon_ms = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_millis() as i64 + 1500;
    let leaving = As { guarded: &guarded, token: make(&store, "leaving", Role::Submitter, &[], None).await };
    let expiring = As { guarded: &guarded, token: make(&store, "expiring", Role::Submitter, &[], Some(soon_ms)).await };
    let staying = As { guarded: &guarded, token: make(&store, "staying", Role::Submitter, &[], None).await };
    let mut streams = Vec::new();
    for bearer in [&leaving, &expiring, &staying] {
        let request = with_token(&bearer.token, v1::WatchJobRequest { name: job.name.clone() });
        let mut stream = JobServiceClient::new(bearer.channel()).watch_job(request).await.unwrap().into_inner();
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
    let mut stayed = streams.pop().unwrap();
    for mut stream in streams {
        let ended = timeout(LAPSE_MAX, stream.message()).await.expect("the stream ends").unwrap_err();
        assert_eq!(ended.code(), Code::Unauthenticated, "{ended:?}");
    }
    let ended = timeout(LAPSE_MAX, upload).await.expect("the upload ends").unwrap().unwrap_err();
    assert_eq!(ended.code(), Code::Unauthenticated, "{ended:?}");
    let cancel = with_token(&as_admin.token, v1::CancelJobRequest { name: job.name.clone() });
    JobServiceClient::new(as_admin.channel()).cancel_job(cancel).await.unwrap();
    assert_eq!(stayed.message().await.unwrap().unwrap().state(), v1::job::State::Cancelled, "others go on");
    drop(parts);
}
