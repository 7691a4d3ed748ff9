use super::fake::{Fake, HEIGHT_PX, WIDTH_PX};
use super::server::Server;
use lightpath::v1::serve_rig_request::{Failed, Message, Taken};
use lightpath::v1::serve_rig_response::Take;
use lightpath_rig::bench::Bench;
use lightpath_rig::device::Levels;
use lightpath_rig::session::{self, Pace};
use lightpath_rig::settings::{EXAMPLE, Settings};
use lightpath_rig::state::{Pause, PauseFile};
use lightpath_rig::{Problem, pictures};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{mpsc, watch};
use tokio::task::JoinHandle;
use tonic::Status;

/// A server, a fake bench, and a rig between them.
struct World {
    server: Server,
    heard: mpsc::UnboundedReceiver<Message>,
    fake: Fake,
    settings: Settings,
    folder: tempfile::TempDir,
    stop: watch::Sender<bool>,
    rig: JoinHandle<Result<(), Problem>>,
}

impl World {
    async fn new(changes: &[(&str, &str)]) -> Self {
        let (server, heard) = Server::start(WIDTH_PX, HEIGHT_PX).await;
        let folder = tempfile::tempdir().unwrap();
        let settings = settings(changes, folder.path());
        let fake = Fake::default();
        let (stop, rig) = start(&server, &fake, &settings);
        Self { server, heard, fake, settings, folder, stop, rig }
    }

    async fn connected(changes: &[(&str, &str)]) -> Self {
        let world = Self::new(changes).await;
        world.server.connected(1).await;
        world
    }

    /// Ends the rig and starts it anew, as after a kill.
    async fn restart(&mut self) {
        self.rig.abort();
        let _ = (&mut self.rig).await;
        (self.stop, self.rig) = start(&self.server, &self.fake, &self.settings);
        self.server.connected(2).await;
    }

    /// A request for a photograph of a pattern.
    fn request(&self, take: &str, seed: u16) -> Take {
        let pattern = self.server.store(pictures::levels_png(&levels(seed)).unwrap());
        Take {
            take: take.into(),
            pattern,
            exposure_s: 0.001,
            exposure_count: 1,
            wavelength_m: 515e-9,
            ..Take::default()
        }
    }

    async fn answer(&mut self) -> Message {
        let answer = tokio::time::timeout(Duration::from_secs(20), self.heard.recv()).await;
        answer.expect("the rig answers").unwrap()
    }

    async fn taken(&mut self) -> Taken {
        match self.answer().await {
            Message::Taken(taken) => taken,
            other => panic!("{other:?}"),
        }
    }

    async fn failed(&mut self) -> Failed {
        match self.answer().await {
            Message::Failed(failed) => failed,
            other => panic!("{other:?}"),
        }
    }

    fn frames(&self) -> u64 {
        self.fake.change(|inside| inside.frames)
    }
}

fn settings(changes: &[(&str, &str)], folder: &Path) -> Settings {
    let mut text = EXAMPLE.replace("width_px = 1920", "width_px = 32").replace("height_px = 1080", "height_px = 16");
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    Settings::parse(&text, folder).unwrap()
}

fn start(server: &Server, fake: &Fake, settings: &Settings) -> (watch::Sender<bool>, JoinHandle<Result<(), Problem>>) {
    let (stop, stopped) = watch::channel(false);
    let pace = Pace {
        retry_min: Duration::from_millis(5),
        retry_max: Duration::from_millis(20),
        pause_look: Duration::from_millis(5),
        ..Pace::default()
    };
    let (client, settings, devices) = (server.client(), settings.clone(), fake.clone());
    let open = Box::new(move || Ok(devices.devices()));
    let rig = async move {
        let bench = Bench::open(open, |slm| settings.safe_pattern(slm))?;
        session::serve(&settings, client, Arc::new(bench), pace, stopped).await
    };
    (stop, tokio::spawn(rig))
}

fn levels(seed: u16) -> Levels {
    let values: Vec<u16> = (0..WIDTH_PX * HEIGHT_PX).map(|at| (at as u16).wrapping_mul(seed) & 255).collect();
    Levels::try_new(WIDTH_PX, HEIGHT_PX, 8, values).unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn each_request_gets_the_photograph_of_its_own_pattern_once() {
    let mut world = World::connected(&[]).await;
    let rig = world.server.rig();
    assert_eq!((rig.name.as_str(), rig.has_shutter, rig.wavelengths_m.len()), ("displays/lab/rig", true, 1));
    assert_eq!(rig.camera.unwrap().exposure_max_s, 0.1, "the limits count, too");
    let requests: Vec<_> = (1..=6).map(|n| world.request(&format!("t{n}"), n)).collect();
    for (n, request) in requests.iter().enumerate() {
        let next_pattern = requests.get(n + 1).map_or_else(String::new, |next| next.pattern.clone());
        world.server.ask(Take { next_pattern, ..request.clone() }).await;
    }
    let mut first = None;
    for _ in &requests {
        let taken = world.taken().await;
        let seed: u16 = taken.take[1..].parse().unwrap();
        let photo = pictures::grey(&world.server.stored(&taken.photo).unwrap()).unwrap();
        assert_eq!(photo.values, levels(seed).values(), "the fake camera sees the levels");
        assert_eq!(taken.levels_sha256, levels(seed).sha256());
        assert!(taken.exposure_s == 0.001 && taken.exposure_time.is_some() && taken.frame > 0);
        if seed == 1 {
            first = Some(taken);
        }
    }
    assert_eq!(world.frames(), 6);
    assert!(world.fake.change(|inside| !inside.is_open), "light is on only during photographs");
    // Asked again, also of a rig that was killed meanwhile: the same answer, and no other photograph.
    world.server.ask(requests[0].clone()).await;
    assert_eq!(Some(world.taken().await), first);
    world.restart().await;
    world.server.ask(requests[0].clone()).await;
    assert_eq!(Some(world.taken().await), first);
    assert_eq!(world.frames(), 6);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_photograph_goes_on_while_the_link_is_cut_and_is_not_taken_twice() {
    let mut world = World::connected(&[]).await;
    world.fake.change(|inside| inside.is_held = true);
    let request = world.request("t1", 3);
    world.server.ask(request.clone()).await;
    world.fake.until("exposing", |inside| inside.is_exposing).await;
    world.server.cut(Status::unavailable("the server restarts"), None).await;
    world.server.connected(2).await;
    world.server.ask(request.clone()).await;
    world.server.ask(request).await;
    world.fake.change(|inside| inside.is_held = false);
    let taken = world.taken().await;
    assert_eq!((taken.take.as_str(), world.frames()), ("t1", 1));
}

#[tokio::test(flavor = "multi_thread")]
async fn no_photograph_is_lost_doubled_or_of_another_pattern_however_often_the_link_is_cut() {
    let mut world = World::connected(&[]).await;
    let request = |n: u16| (format!("t{n}"), world.request(&format!("t{n}"), n));
    let mut open: BTreeMap<String, Take> = (1..=30).map(request).collect();
    let (mut cuts, mut answers) = (0, Vec::new());
    while !open.is_empty() {
        for take in open.values() {
            world.server.ask(take.clone()).await;
        }
        // The link is cut after none to two answers, until it has been cut often; then it stays.
        let patience = if cuts < 20 { cuts % 3 } else { open.len() };
        for _ in 0..patience.min(open.len()) {
            let taken = world.taken().await;
            // An answer that was under way when the link was cut may come twice.
            if open.remove(&taken.take).is_some() {
                answers.push(taken);
            }
        }
        if cuts < 20 {
            cuts += 1;
            world.server.cut(Status::unavailable("cut"), None).await;
            world.server.connected(cuts as u32 + 1).await;
        }
    }
    assert_eq!((world.frames(), answers.len()), (30, 30));
    for taken in answers {
        let seed: u16 = taken.take[1..].parse().unwrap();
        let photo = pictures::grey(&world.server.stored(&taken.photo).unwrap()).unwrap();
        assert_eq!((photo.values.as_slice(), taken.levels_sha256), (levels(seed).values(), levels(seed).sha256()));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_photograph_that_could_not_be_uploaded_is_kept_and_uploaded_later() {
    let mut world = World::connected(&[]).await;
    world.server.refuse_uploads(Some(Status::resource_exhausted("the disk is nearly full")));
    let request = world.request("t1", 3);
    world.server.ask(request.clone()).await;
    let failed = world.failed().await;
    assert!(failed.retryable && failed.message.contains("the disk is nearly full"), "{failed:?}");
    world.server.refuse_uploads(None);
    world.server.ask(request).await;
    assert_eq!((world.taken().await.take.as_str(), world.frames()), ("t1", 1));
}

#[tokio::test(flavor = "multi_thread")]
async fn what_limits_and_bench_do_not_allow_is_refused_for_good_and_named() {
    let limits = [("exposure_max_ms = 100.0", "exposure_max_ms = 20.0"), ("frames_max = 64", "frames_max = 2")];
    let duty = [("# duty_percent = 50.0", "duty_percent = 0.05")];
    let mut world = World::connected(&[&limits[..], &duty].concat()).await;
    let plain = world.request("t", 1);
    let coloured = world.server.store(b"hello".to_vec());
    for (request, name) in [
        (Take { exposure_s: 0.021, ..plain.clone() }, "limits.exposure_max_ms"),
        (Take { exposure_count: 3, ..plain.clone() }, "limits.frames_max"),
        (Take { exposure_s: 0.02, exposure_count: 2, ..plain.clone() }, "limits.duty_percent"),
        (Take { exposure_s: 0.0, ..plain.clone() }, "not within those of the camera"),
        (Take { wavelength_m: 633e-9, ..plain.clone() }, "no light of 633.000 nm"),
        (Take { pattern: coloured, ..plain.clone() }, "no PNG"),
        (Take { pattern: format!("sha256-{:064}", 0), ..plain.clone() }, "could not be read"),
    ] {
        world.server.ask(request).await;
        let failed = world.failed().await;
        assert!(failed.message.contains(name) && !failed.retryable, "{failed:?}");
    }
    for chosen_s in [0.4, -1.0, f64::NAN] {
        world.fake.change(|inside| inside.chooses_s = Some(chosen_s));
        world.server.ask(plain.clone()).await;
        let failed = world.failed().await;
        assert!(failed.message.contains("the camera was told to expose 1 ms and chose"), "{failed:?}");
    }
    world.fake.change(|inside| inside.chooses_s = None);
    assert_eq!(world.frames(), 0);
    world.server.ask(Take { dark: true, exposure_count: 2, ..plain }).await;
    let dark = world.taken().await;
    let photo = pictures::grey(&world.server.stored(&dark.photo).unwrap()).unwrap();
    assert!(photo.values.iter().all(|&value| value == 0), "the shutter was closed");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_pause_lets_requests_wait_in_the_safe_state() {
    let mut world = World::connected(&[]).await;
    let pause = PauseFile::in_folder(&world.settings.state_folder);
    world.server.ask(world.request("t1", 1)).await;
    world.taken().await;
    pause.begin(&Pause::now("aligning, Ada")).unwrap();
    assert!(pause.read().unwrap().in_words().ends_with("min: aligning, Ada"));
    while !pause.is_seen() {
        tokio::task::yield_now().await;
    }
    assert!(world.fake.change(|inside| Fake::is_safe(inside)));
    world.server.ask(world.request("t2", 2)).await;
    // An answer to a request that does not wait shows that the one before was received.
    world.server.ask(world.request("t1", 1)).await;
    assert_eq!(world.taken().await.take, "t1");
    assert_eq!(world.frames(), 1);
    assert!(pause.end().unwrap());
    assert_eq!(world.taken().await.take, "t2");
    assert!(!pause.is_seen());
    drop(world.folder);
}

#[tokio::test(flavor = "multi_thread")]
async fn rest_stop_and_a_lost_link_lead_to_the_safe_state() {
    let mut world = World::connected(&[("lost_link_s = 60.0", "lost_link_s = 0.05")]).await;
    world.fake.until("safe at the start", Fake::is_safe).await;
    // Rest, during an exposure: the request is void and gets no answer.
    world.fake.change(|inside| inside.is_held = true);
    world.server.ask(world.request("t1", 1)).await;
    world.fake.until("exposing with light", |inside| inside.is_exposing && inside.is_open).await;
    world.server.rest().await;
    world.fake.until("safe after rest", Fake::is_safe).await;
    world.fake.change(|inside| inside.is_held = false);
    world.server.ask(world.request("t2", 2)).await;
    assert_eq!(world.taken().await.take, "t2");
    assert!(!world.fake.change(|inside| Fake::is_safe(inside)), "the pattern stays while more may come");
    // A lost link, for longer than the file allows.
    world.server.cut(Status::unavailable("away"), Some(Status::unavailable("away"))).await;
    world.fake.until("safe after the link was lost", Fake::is_safe).await;
    // The end.
    let shown = world.fake.change(|inside| inside.shown.len());
    world.stop.send(true).unwrap();
    assert_eq!(world.rig.await.unwrap(), Ok(()));
    assert!(world.fake.change(|inside| inside.shown.len() > shown && Fake::is_safe(inside)));
}

#[tokio::test(flavor = "multi_thread")]
async fn devices_that_hang_or_panic_become_errors_and_the_rig_goes_on() {
    let mut world = World::connected(&[]).await;
    world.fake.change(|inside| inside.is_held = true);
    world.server.ask(world.request("t1", 1)).await;
    let failed = world.failed().await;
    assert!(failed.retryable && failed.message.contains("the camera hangs"), "{failed:?}");
    assert!(world.fake.change(|inside| Fake::is_safe(inside)), "the shutter is closed although the camera hangs");
    world.fake.change(|inside| inside.is_held = false);
    world.server.ask(world.request("t1", 1)).await;
    assert_eq!(world.taken().await.take, "t1");
    world.fake.change(|inside| inside.panics_next = true);
    world.server.ask(world.request("t2", 2)).await;
    let failed = world.failed().await;
    assert!(failed.retryable && failed.message.contains("the adapter of the camera panicked"), "{failed:?}");
    assert!(world.fake.change(|inside| Fake::is_safe(inside) && inside.opened == 2), "opened anew");
    world.server.ask(world.request("t2", 2)).await;
    assert_eq!(world.taken().await.take, "t2");
}

#[tokio::test(flavor = "multi_thread")]
async fn what_no_retry_can_mend_ends_the_rig_with_clear_words() {
    for (changes, refusal, words) in [
        (&[("width_px = 32", "width_px = 32")][..], Status::unauthenticated("unknown token"), "--role rig"),
        (&[], Status::permission_denied("no"), "needs the role rig"),
        (&[], Status::failed_precondition("a rig of another token serves it"), "a rig of another token serves it"),
        (&[("display = \"lab\"", "display = \"lob\"")], Status::ok(""), "not declared"),
        (&[("[\"515nm\"]", "[\"633nm\"]")], Status::ok(""), "no light of 633.000 nm, but of 515.000 nm"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let (server, _heard) = Server::start(WIDTH_PX, HEIGHT_PX).await;
        if refusal.code() != tonic::Code::Ok {
            server.refuse(refusal);
        }
        let (_stop, rig) = start(&server, &Fake::default(), &settings(changes, folder.path()));
        let ended = rig.await.unwrap().unwrap_err();
        assert!(matches!(&ended, Problem::Refused(text) if text.contains(words)), "{words}: {ended:?}");
    }
    let (server, _heard) = Server::start(640, 480).await;
    let folder = tempfile::tempdir().unwrap();
    let (_stop, rig) = start(&server, &Fake::default(), &settings(&[], folder.path()));
    let ended = rig.await.unwrap().unwrap_err().to_string();
    assert!(ended.contains("displays/lab has 640×480 px, but the SLM 32×16 px"), "{ended}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_later_stream_of_the_same_token_ends_the_earlier_rig() {
    let world = World::connected(&[]).await;
    world.server.cut(Status::failed_precondition("another connection of the same token serves it"), None).await;
    let ended = world.rig.await.unwrap().unwrap_err().to_string();
    assert!(ended.contains("another connection of the same token serves it"), "{ended}");
    let other = lightpath_rig::state::Running::take(&world.settings.state_folder).unwrap();
    let (_stop, second) = start(&world.server, &world.fake, &world.settings);
    let ended = second.await.unwrap().unwrap_err().to_string();
    assert!(ended.contains("another lightpath-rig uses"), "one rig for each folder: {ended}");
    drop(other);
}
