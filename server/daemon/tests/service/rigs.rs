//! Tests of rigs: who may serve a bench, photographs that jobs take there, and planted faults of camera and SLM.

use crate::access::{Guarded, create_token, with_token};
use crate::jobs::{submit, watch_to_end};
use crate::preparing::run_job;
use crate::serving::{Serving, expect, sized_display};
use crate::test_bench::{CENTRE, Dataset, HEIGHT, TestBench, WIDTH};
use lightpath_artifacts::digest_of;
use lightpath_bench::TestCard;
use lightpath_camera::alignment::Homography;
use lightpath_media::pictures;
use lightpath_optics::Plane;
use lightpath_proto::v1;
use lightpath_proto::v1::capture_photos::Pattern;
use lightpath_proto::v1::job_result::Kind as JobResult;
use lightpath_proto::v1::job_spec::Kind;
use lightpath_proto::v1::prepare_dataset::align::Source;
use lightpath_proto::v1::rig_service_client::RigServiceClient;
use lightpath_proto::v1::serve_rig_request::{Failed, Message, Taken};
use lightpath_proto::v1::serve_rig_response::{Message as Asked, Take};
use std::collections::HashMap;
use std::sync::{Arc, Mutex};
use tokio::sync::mpsc;
use tokio_stream::wrappers::UnboundedReceiverStream;
use tonic::{Code, Status, Streaming};

/// Size of the camera \[px\].
const CAMERA_PX: [usize; 2] = [260, 440];
const DISTANCE_M: f64 = 0.03;
/// Exposure at which the simulated camera is exposed as it was set up \[s\].
const USUAL_EXPOSURE_S: f64 = 0.02;

/// What is wrong with a photograph.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Fault {
    None,
    /// The frame before.
    Stale,
    /// The upper part new, the lower part of the frame before.
    Half,
    Black,
    Saturated,
    Shifted,
    /// Of the pattern after.
    Ahead,
    /// The SLM shows something else, and says so.
    OtherLevels,
    /// Exposed for another time, and says so.
    OtherExposure,
    /// Exposed for another time, without a word.
    LateExposure,
    /// The rig says that it failed.
    Failure,
}

/// A rig on a simulated bench.
struct TestRig {
    serving_address: String,
    bench: TestBench,
    map: Homography,
    /// The fault of each photograph, by its number.
    faults: Box<dyn Fn(usize) -> Fault + Send + Sync>,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    taken: HashMap<String, Taken>,
    lights: HashMap<String, (Plane<f32>, Vec<u8>)>,
    /// The pattern before, and its light.
    before: Option<(String, Plane<f32>)>,
    count: usize,
    /// Photographs with a fault.
    planted: HashMap<String, Fault>,
}

/// What a rig says of the test bench.
fn description(display: &str) -> v1::Rig {
    let [height, width] = CAMERA_PX.map(|side| side as u32);
    v1::Rig {
        name: format!("displays/{display}/rig"),
        program: "test 1".into(),
        slm: Some(v1::rig::Slm {
            width_px: WIDTH as u32,
            height_px: HEIGHT as u32,
            bit_depth: 8,
            settling_time_s: 0.0,
            reads_back: true,
        }),
        camera: Some(v1::rig::Camera {
            width_px: width,
            height_px: height,
            bit_depth: 8,
            exposure_min_s: 1e-5,
            exposure_max_s: 1.0,
            exposure_delay_frames: 0,
        }),
        has_shutter: true,
        wavelengths_m: vec![515e-9],
        place: Some(v1::Place::at_m(DISTANCE_M)),
    }
}

type Stream = (mpsc::UnboundedSender<v1::ServeRigRequest>, Streaming<v1::ServeRigResponse>);

/// Opens a stream that begins with a description.
async fn connect(serving: &Serving, token: Option<&str>, rig: v1::Rig) -> Result<Stream, Status> {
    let (say, said) = mpsc::unbounded_channel();
    say.send(v1::ServeRigRequest { message: Some(Message::Description(rig)) }).unwrap();
    let said = UnboundedReceiverStream::new(said);
    let request = match token {
        Some(token) => with_token(token, said),
        None => tonic::Request::new(said),
    };
    let mut asked = RigServiceClient::new(serving.channel.clone()).serve_rig(request).await?.into_inner();
    let first = asked.message().await?.unwrap();
    assert!(matches!(first.message, Some(Asked::Connected(_))), "{first:?}");
    Ok((say, asked))
}

impl TestRig {
    fn new(serving: &Serving, faults: impl Fn(usize) -> Fault + Send + Sync + 'static) -> Arc<Self> {
        let map = Homography::similarity(CENTRE, 0.02, 1.05, [28.0, 22.0]);
        let (bench, state) = (TestBench::new(3), Mutex::default());
        let serving_address = format!("http://{}", serving.address);
        Arc::new(Self { serving_address, bench, map, faults: Box::new(faults), state })
    }

    /// Serves the bench until the stream ends.
    async fn serve(self: Arc<Self>, (say, mut asked): Stream) {
        while let Ok(Some(request)) = asked.message().await {
            let Some(Asked::Take(take)) = request.message else { continue };
            let message = self.answer(take).await;
            if say.send(v1::ServeRigRequest { message: Some(message) }).is_err() {
                return;
            }
        }
    }

    async fn answer(&self, take: Take) -> Message {
        if let Some(taken) = self.state.lock().unwrap().taken.get(&take.take) {
            return Message::Taken(taken.clone());
        }
        let client = lightpath::Client::connect(&self.serving_address).unwrap();
        for pattern in [&take.pattern, &take.next_pattern] {
            if !pattern.is_empty() && !self.state.lock().unwrap().lights.contains_key(pattern) {
                let file = client.download(pattern).await.unwrap();
                let levels = image::load_from_memory(&file).unwrap().into_luma8();
                let phase = Plane::from_fn(HEIGHT, WIDTH, |y, x| {
                    f32::from(levels.get_pixel(x as u32, y as u32).0[0]) * std::f32::consts::TAU / 256.0
                });
                let light = self.bench.light(&phase);
                self.state.lock().unwrap().lights.insert(pattern.clone(), (light, levels.into_raw()));
            }
        }
        let (fault, photo, levels, frame) = self.expose(&take);
        if fault == Fault::Failure {
            let message = "the camera did not answer".to_owned();
            return Message::Failed(Failed { take: take.take, message, retryable: true });
        }
        let photo = client.upload_bytes(pictures::grey_png_linear(&photo).unwrap()).await.unwrap();
        let taken = Taken {
            take: take.take.clone(),
            photo: photo.clone(),
            levels_sha256: digest_of(&levels).trim_start_matches("sha256-").to_owned(),
            frame,
            exposure_time: Some(lightpath_proto::Timestamp { seconds: 1_800_000_000 + frame as i64, nanos: 0 }),
            exposure_s: if fault == Fault::OtherExposure { 2.0 * take.exposure_s } else { take.exposure_s },
            temperature_c: Some(23.5),
        };
        let mut state = self.state.lock().unwrap();
        if fault != Fault::None {
            state.planted.insert(photo, fault);
        }
        state.taken.insert(take.take, taken.clone());
        Message::Taken(taken)
    }

    /// A photograph with its fault, the levels that the rig reads back, and the number of the frame.
    fn expose(&self, take: &Take) -> (Fault, Plane<f32>, Vec<u8>, u64) {
        let mut state = self.state.lock().unwrap();
        state.count += 1;
        let mut fault = (self.faults)(state.count);
        let (light, mut levels) = state.lights[&take.pattern].clone();
        let before = state.before.replace((take.pattern.clone(), light.clone()));
        // A frame from before shows nothing else where the pattern has not changed.
        let before = before.filter(|(pattern, _)| *pattern != take.pattern).map(|(_, light)| light);
        if matches!(fault, Fault::Stale | Fault::Half) && before.is_none() {
            fault = Fault::None;
        }
        let before = before.unwrap_or_else(|| light.clone());
        let ahead = state.lights.get(&take.next_pattern).map(|(light, _)| light.clone());
        let mut scale = take.exposure_s / USUAL_EXPOSURE_S;
        let mut seen = match fault {
            Fault::Stale => before,
            Fault::Half => {
                Plane::from_fn(HEIGHT, WIDTH, |y, x| if y < HEIGHT / 2 { light.at(y, x) } else { before.at(y, x) })
            }
            Fault::Shifted => Plane::from_fn(HEIGHT, WIDTH, |y, x| light.at(y, (x + 6).min(WIDTH - 1))),
            Fault::Ahead if ahead.is_some() => ahead.unwrap(),
            Fault::Ahead => {
                fault = Fault::None;
                light
            }
            _ => light,
        };
        match fault {
            Fault::Black => scale = 0.0,
            Fault::Saturated => scale *= 60.0,
            Fault::LateExposure => scale *= 0.2,
            Fault::OtherLevels => levels[7] ^= 1,
            _ => {}
        }
        if take.dark {
            (fault, scale) = (Fault::None, 0.0);
        }
        seen = seen.map(|light| scale as f32 * light);
        let photo = self.bench.expose(&seen, state.count as u64, &self.map, CAMERA_PX[0], CAMERA_PX[1]);
        (fault, photo, levels, state.count as u64)
    }
}

/// Photographs patterns with a job. Returns its result, or the reason and message of its failure.
async fn capture(
    serving: &Serving,
    patterns: Vec<Pattern>,
    aligned_by: &str,
) -> Result<v1::CapturePhotosResult, String> {
    match run_job(serving, Kind::CapturePhotos(request(patterns, aligned_by))).await? {
        JobResult::CapturePhotos(result) => Ok(result),
        other => panic!("{other:?}"),
    }
}

fn request(patterns: Vec<Pattern>, aligned_by: &str) -> v1::CapturePhotos {
    v1::CapturePhotos {
        display: "displays/bench".into(),
        place: Some(v1::Place::at_m(DISTANCE_M)),
        patterns,
        aligned_by: aligned_by.into(),
        ..Default::default()
    }
}

/// Uploads holograms of test pictures.
async fn patterns(serving: &Serving, bench: &TestBench, count: usize) -> Vec<Pattern> {
    let mut patterns = Vec::new();
    for index in 0..count {
        let card = TestCard::ALL[index % TestCard::ALL.len()];
        let target = card.render(HEIGHT, WIDTH, (index / TestCard::ALL.len()) as u64).unwrap();
        let phase = bench.phase(&target, 6);
        let file = pictures::levels_png(&crate::test_bench::levels(&phase), 8).unwrap();
        patterns.push(Pattern { id: format!("p{index:03}"), pattern: serving.upload(&file).await });
    }
    patterns
}

/// Aligns the dataset by a photograph of the dots that the rig takes.
async fn align(dataset: &mut Dataset, bench: &TestBench) {
    let grid = lightpath_camera::alignment::DotGrid::of_display(HEIGHT, WIDTH).unwrap();
    let file = pictures::levels_png(&crate::test_bench::levels(&bench.phase(&grid.target(), 60)), 8).unwrap();
    let dots = vec![Pattern { id: "dots".into(), pattern: dataset.serving.upload(&file).await }];
    let found = capture(&dataset.serving, dots, "").await.unwrap();
    assert!(found.black_level.is_some(), "the rig has a shutter");
    let aligned = dataset.align(Source::DotsPhoto(found.photos[0].photo.clone())).await.unwrap();
    assert!(aligned.alignment.as_ref().unwrap().residual_px < 0.5);
}

/// Number of photographs with planted faults.
fn planted_count() -> usize {
    std::env::var("LIGHTPATH_PLANTED").map_or(10, |text| text.parse().unwrap())
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn every_planted_fault_is_noticed_and_no_photograph_is_kept_under_another_pattern() {
    const PLANTED: [Fault; 10] = [
        Fault::Stale,
        Fault::Half,
        Fault::Black,
        Fault::Saturated,
        Fault::Shifted,
        Fault::Ahead,
        Fault::OtherLevels,
        Fault::OtherExposure,
        Fault::LateExposure,
        Fault::Failure,
    ];
    let mut dataset = Dataset::open().await;
    // The faults begin when the camera is aligned. The first good photographs tell how good ones look.
    let begun = Arc::new(Mutex::new(None::<usize>));
    let rig = TestRig::new(&dataset.serving, {
        let begun = begun.clone();
        move |number| {
            let mut begun = begun.lock().unwrap();
            match *begun {
                Some(0) => {
                    *begun = Some(number);
                    Fault::None
                }
                Some(first) if number > first + 6 && number % 2 == 0 => PLANTED[number / 2 % PLANTED.len()],
                _ => Fault::None,
            }
        }
    });
    let stream = connect(&dataset.serving, None, description("bench")).await.unwrap();
    let serving_rig = tokio::spawn(rig.clone().serve(stream));
    align(&mut dataset, &rig.bench).await;
    *begun.lock().unwrap() = Some(0);
    let count = 6 + planted_count();
    let patterns = patterns(&dataset.serving, &rig.bench, count).await;
    let found = capture(&dataset.serving, patterns.clone(), "datasets/d").await.unwrap();

    let ids =
        |photos: &[v1::capture_photos_result::Photo]| photos.iter().map(|photo| photo.id.clone()).collect::<Vec<_>>();
    assert_eq!(ids(&found.photos), patterns.iter().map(|pattern| pattern.id.clone()).collect::<Vec<_>>());
    let state = rig.state.lock().unwrap();
    for photo in &found.photos {
        assert_eq!(state.planted.get(&photo.photo), None, "{photo:?} was kept");
        assert!(photo.correlation > photo.other_correlation, "{photo:?}");
    }
    let mut seen: Vec<&Fault> = state.planted.values().collect();
    seen.sort_by_key(|fault| format!("{fault:?}"));
    eprintln!("{} photographs, {} with a fault, {} taken again", state.count, seen.len(), found.retaken.len());
    for retaken in &found.retaken {
        eprintln!("{}: {}", retaken.id, retaken.reason);
    }
    seen.dedup();
    assert!(seen.len() >= 8, "{seen:?}");
    drop(state);
    serving_rig.abort();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_job_waits_for_its_rig_and_survives_that_the_rig_leaves() {
    let dataset = Dataset::open().await;
    let serving = &dataset.serving;
    let rig = TestRig::new(serving, |_| Fault::None);
    let patterns = patterns(serving, &rig.bench, 3).await;
    let job = submit(serving, Kind::CapturePhotos(request(patterns, "")), "").await.unwrap();
    assert_eq!(job.waits_for, "no rig serves displays/bench; start lightpath-rig at its bench");
    assert_eq!(job.needs, ["rig.bench"]);
    // Each connection answers one request, and is then cut before the next answer.
    let mut connections = 0;
    let serve = async {
        loop {
            let (say, mut asked) = connect(serving, None, description("bench")).await.unwrap();
            connections += 1;
            let mut answered = 0;
            while let Ok(Some(request)) = asked.message().await {
                let Some(Asked::Take(take)) = request.message else { continue };
                let message = rig.answer(take).await;
                if answered == 2 {
                    break;
                }
                answered += 1;
                say.send(v1::ServeRigRequest { message: Some(message) }).unwrap();
            }
        }
    };
    let ended = tokio::select! {
        job = watch_to_end(serving, &job.name) => job,
        () = serve => unreachable!("it serves until the job has ended"),
    };
    let Some(JobResult::CapturePhotos(result)) = ended.result.and_then(|result| result.kind) else {
        panic!("{:?}", ended.error)
    };
    assert!(connections > 1, "{connections}");
    let state = rig.state.lock().unwrap();
    assert_eq!(state.count, state.taken.len(), "nothing was taken twice");
    assert_eq!(result.photos.len(), 3);
    assert!(result.retaken.is_empty(), "{:?}", result.retaken);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_bench_has_one_rig_whose_display_fits_and_only_its_token_serves_it() {
    let guarded = Guarded::start().await;
    let serving = &guarded.serving;
    let token = async |name: &str, displays: &[String]| {
        let role = lightpath_domain::access::Role::Rig;
        create_token(&guarded.store().await, name, role, displays, None).await
    };
    for display in ["bench", "other"] {
        let display = Some(sized_display(display, WIDTH as u32, HEIGHT as u32));
        let request = with_token(&guarded.tokens["admin"], v1::CreateDisplayRequest { display });
        serving.displays().create_display(request).await.unwrap();
    }
    let (own, second) = (token("rig-1", &["bench".to_owned()]).await, token("rig-2", &["bench".to_owned()]).await);
    let refused = connect(serving, Some(&guarded.tokens["submitter"]), description("bench")).await;
    expect(refused.map(drop), Code::PermissionDenied, "");
    let refused = connect(serving, Some(&own), description("other")).await;
    expect(refused.map(drop), Code::PermissionDenied, "the token \"rig-1\" is not valid for displays/other");
    let mut small = description("bench");
    small.slm.as_mut().unwrap().width_px = 100;
    let refused = connect(serving, Some(&own), small).await;
    expect(refused.map(drop), Code::InvalidArgument, "description.slm.width_px is 100, but displays/bench has 384");

    let (_say, mut first) = connect(serving, Some(&own), description("bench")).await.unwrap();
    let refused = connect(serving, Some(&second), description("bench")).await;
    expect(
        refused.map(drop),
        Code::FailedPrecondition,
        "displays/bench: a rig of the token \"rig-1\" serves the display",
    );
    let (_say, mut asked) = connect(serving, Some(&own), description("bench")).await.unwrap();
    let ended = first.message().await.unwrap_err();
    assert_eq!(ended.code(), Code::FailedPrecondition, "{ended}");
    assert!(ended.message().starts_with("another connection of the same token"), "{ended}");
    let listing = with_token(&guarded.tokens["viewer"], v1::ListRigsRequest {});
    let rigs = RigServiceClient::new(serving.channel.clone()).list_rigs(listing).await.unwrap().into_inner().rigs;
    assert_eq!(rigs, [description("bench")]);

    // It reads the pattern that it is asked to show, which the server made of a phase, and nothing else.
    let client =
        |token: &str| lightpath::Client::connect_with_token(&format!("http://{}", serving.address), token).unwrap();
    let (admin, rig) = (client(&guarded.tokens["admin"]), client(&own));
    let phase = pictures::npy_f32(&Plane::from_fn(HEIGHT, WIDTH, |y, x| (x + y) as f32 * 0.1)).unwrap();
    let pattern = admin.upload_bytes(phase).await.unwrap();
    let spec = Kind::CapturePhotos(request(vec![Pattern { id: "p".into(), pattern: pattern.clone() }], ""));
    admin.submit(v1::SubmitJobRequest { spec: Some(lightpath::job_spec(spec)), ..Default::default() }).await.unwrap();
    let Some(Asked::Take(take)) = asked.message().await.unwrap().unwrap().message else { panic!("nothing is asked") };
    assert_ne!(take.pattern, pattern);
    assert!(rig.download(&take.pattern).await.unwrap().starts_with(b"\x89PNG"));
    for other in [&pattern, &take.pattern.replace('1', "2")] {
        let refused = rig.download(other).await.unwrap_err();
        assert_eq!(refused.code(), Some(Code::NotFound), "{refused}");
    }
}
