use super::server::Server;
use lightpath::v1::serve_rig_request::Message;
use lightpath::v1::serve_rig_response::Take;
use lightpath_rig::device::Levels;
use lightpath_rig::pictures;
use lightpath_rig::settings::EXAMPLE;
use std::path::Path;
use std::process::{Output, Stdio};
use tonic::Status;

fn rig(folder: &Path, words: &[&str]) -> tokio::process::Command {
    let mut command = tokio::process::Command::new(env!("CARGO_BIN_EXE_lightpath-rig"));
    command.args(words).current_dir(folder).env("LIGHTPATH_TOKEN", "lp_token").kill_on_drop(true);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

/// Makes the example's bench small.
fn shrink(folder: &Path, url: &str) {
    let text = EXAMPLE.replace("width_px = 1920", "width_px = 64").replace("height_px = 1080", "height_px = 40");
    let text = text.replace("http://127.0.0.1:7070", url).replace("150mm", "5mm");
    let text = text.replace("settling_time_ms = 100.0", "settling_time_ms = 60.0");
    std::fs::write(folder.join("rig.toml"), text).unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn the_program_serves_pauses_and_ends_on_a_signal() {
    let (server, mut heard) = Server::start(64, 40).await;
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    assert!(rig(folder, &["init"]).output().await.unwrap().status.success());
    let again = rig(folder, &["init"]).output().await.unwrap();
    assert!(again.status.code() == Some(2) && text(&again).contains("is there already"), "{}", text(&again));
    shrink(folder, &server.url);
    let serving = rig(folder, &["serve"]).spawn().unwrap();
    server.connected(1).await;
    let levels = Levels::try_new(64, 40, 8, (0..64 * 40).map(|at| (at * 37 % 256) as u16).collect::<Vec<_>>()).unwrap();
    let pattern = server.store(pictures::levels_png(&levels).unwrap());
    let (take, wavelength_m) = ("t1".to_owned(), 515e-9);
    server.ask(Take { take, pattern, exposure_s: 0.01, exposure_count: 2, wavelength_m, ..Take::default() }).await;
    let Some(Message::Taken(taken)) = heard.recv().await else { panic!("not taken") };
    assert_eq!(taken.levels_sha256, levels.sha256());
    let photo = pictures::grey(&server.stored(&taken.photo).unwrap()).unwrap();
    assert_eq!((photo.width_px, photo.height_px, photo.file_bits), (64, 40, 16));
    let paused = rig(folder, &["pause", "--reason", "aligning, Ada"]).output().await.unwrap();
    assert!(text(&paused).contains("has put the bench into its safe state"), "{}", text(&paused));
    assert!(text(&rig(folder, &["resume"]).output().await.unwrap()).contains("has ended"));
    let pid = serving.id().unwrap().to_string();
    assert!(std::process::Command::new("kill").args(["-TERM", &pid]).status().unwrap().success());
    let ended = serving.wait_with_output().await.unwrap();
    assert_eq!(ended.status.code(), Some(0), "{}", text(&ended));
    assert!(text(&ended).contains("aligning, Ada") && text(&ended).contains("safe state"), "{}", text(&ended));
    server.refuse(Status::unauthenticated("unknown token"));
    let refused = rig(folder, &["serve"]).output().await.unwrap();
    assert_eq!(refused.status.code(), Some(3), "{}", text(&refused));
}

#[tokio::test(flavor = "multi_thread")]
async fn check_prints_what_was_measured() {
    let place = tempfile::tempdir().unwrap();
    shrink(place.path(), "http://127.0.0.1:1");
    let checked = rig(place.path(), &["check"]).output().await.unwrap();
    let said = text(&checked);
    assert!(checked.status.success(), "{said}");
    for row in ["64×40 px, 8 bits", "noise of a frame", "saturated", "settled after", "correlation"] {
        assert!(said.contains(row), "{row}: {said}");
    }
    assert!(!said.contains("WARNING"), "{said}");
    let missing = rig(place.path(), &["check", "--settings", "no.toml"]).output().await.unwrap();
    assert!(missing.status.code() == Some(2) && text(&missing).contains("lightpath-rig init"), "{}", text(&missing));
}
