//! Scoring photographs through the command line.

use crate::command_line::CommandLine;
use crate::material::png;

/// A target with details of all sizes.
fn picture(x: u32, y: u32) -> u8 {
    let block = (x / 24 * 7 + y / 18 * 13 + x / 24 * (y / 18) * 5) % 11;
    (20 * block + 3 * ((x / 4 + y / 6) % 9)) as u8
}

/// The target at (30, 20) in a dark photograph.
fn photo(x: u32, y: u32) -> u8 {
    let inside = (30..270).contains(&x) && (20..180).contains(&y);
    if inside { picture(x - 30, y - 20) / 2 + 10 } else { 10 }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn photographs_are_scored_with_their_pictures() {
    let cli = CommandLine::start().await;
    cli.write("target.png", &png(240, 160, picture));
    cli.write("a.png", &png(320, 210, photo));
    cli.write("b.png", &png(320, 210, |x, y| photo(x, y).saturating_add(((x * 31 + y * 17) % 23) as u8)));
    std::fs::create_dir(cli.path("out")).unwrap();
    let line = "photo score @/a.png @/b.png --target @/target.png --target-encoding linear";
    let text = cli.text(&format!("{line} --aligned @/out --error @/{{name}}-off.png")).await;
    assert!(text.lines().count() == 3 && text.starts_with("PHOTO") && text.contains("grey"), "{text}");
    for name in ["out/a-aligned.png", "out/b-aligned.png", "a-off.png", "b-off.png"] {
        assert!(std::fs::read(cli.path(name)).unwrap().starts_with(b"\x89PNG"), "{name}");
    }
    let one = cli.json("photo score @/a.png --target @/target.png --target-encoding linear").await;
    let channel = &one["channels"][0];
    assert!(channel["psnrWithOffsetDb"].as_f64().unwrap() > 35.0, "{one}");
    assert!(channel["psnrDb"].as_f64().unwrap() < channel["psnrWithOffsetDb"].as_f64().unwrap(), "{one}");
    let corner = one["place"]["homography"].as_array().unwrap();
    assert!(
        (corner[2].as_f64().unwrap() - 30.0).abs() < 0.3 && (corner[5].as_f64().unwrap() - 20.0).abs() < 0.3,
        "{one}"
    );
    // The word for a mistake, and what to do.
    let unrelated = cli.write("grey.png", &png(240, 160, |x, y| ((x * y) % 251) as u8));
    let refused = cli.run(&format!("photo score @/a.png --target {unrelated}")).await;
    refused.assert_refused(1, &["photo", "was not found", "at least 0.35 is needed", "in focus"]);
    cli.run(&format!("{line} --aligned @/one.png")).await.assert_refused(2, &["--aligned", "{name}"]);
    cli.run("photo score @/a.png --target @/target.png --error @/a.png").await.assert_refused(2, &["input file"]);
    cli.server.stop().await;
}
