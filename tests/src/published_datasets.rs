//! Datasets in the folders of published ones, through the command line.

use crate::command_line::CommandLine;
use crate::material::target;
use std::f64::consts::{PI, TAU};

fn write(cli: &CommandLine, name: &str, number: u32) {
    std::fs::create_dir_all(cli.path(name).parent().unwrap()).unwrap();
    cli.write(name, &target(96, 64, number));
}

#[tokio::test(flavor = "multi_thread")]
async fn two_folders_of_the_paper_become_a_dataset() {
    let cli = CommandLine::start().await;
    cli.text("display create pluto --resolution 96x64 --pixel-pitch 8um --wavelength 515nm").await;
    cli.text("dataset create paper --display pluto --distance 50mm").await;
    for number in 1..=3 {
        write(&cli, &format!("holograms/{number:04}.png"), number);
        write(&cli, &format!("warped/{number:04}_warped.png"), number + 10);
    }
    let import = "dataset import paper --layout realistic-holography @/holograms @/warped";
    cli.run(&format!("{import} --plane 1")).await.assert_refused(2, &["needs two folders", "--plane"]);
    cli.text(&format!("{import} --pairs 2")).await;
    // A repeated import adds what is missing.
    cli.text(import).await;
    let dataset = cli.json("dataset show paper").await;
    let pairs = dataset["pairs"].as_array().unwrap();
    let ids: Vec<_> = pairs.iter().map(|pair| pair["id"].as_str().unwrap()).collect();
    assert_eq!(ids, ["0001", "0002", "0003"]);
    std::fs::remove_file(cli.path("warped/0001_warped.png")).unwrap();
    cli.run(import).await.assert_refused(2, &["3 PNG files", "has 2"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn plane_of_a_neural_holography_folder_becomes_a_dataset() {
    let cli = CommandLine::start().await;
    let inverted: String = (0..256).map(|level| format!("{:.6}\n", PI - TAU * f64::from(level) / 255.0)).collect();
    cli.write("inverted.txt", inverted.as_bytes());
    let response = "--phase-response @/inverted.txt";
    cli.text(&format!("display create nh3d --resolution 96x64 --pixel-pitch 8um --wavelength 520nm {response}")).await;
    cli.text("dataset create green --display nh3d --distance 50mm").await;
    for (number, part) in ["train", "train", "val", "test"].iter().enumerate() {
        write(&cli, &format!("green/{part}/phase/{number}.png"), number as u32);
        write(&cli, &format!("green/{part}/captured/{number}_2.png"), number as u32 + 10);
    }
    let import = "dataset import green --layout neural-holography @/green";
    cli.run(import).await.assert_refused(2, &["needs one folder and --plane"]);
    cli.run(&format!("{import} --plane 0")).await.assert_refused(2, &["there is no photograph", "0_0.png"]);
    cli.text(&format!("{import} --plane 2")).await;
    let dataset = cli.json("dataset show green").await;
    let pairs = dataset["pairs"].as_array().unwrap();
    let splits: Vec<_> = pairs.iter().map(|pair| (pair["id"].as_str(), pair["split"].as_str())).collect();
    let [train, validation, test] = ["SPLIT_TRAIN", "SPLIT_VALIDATION", "SPLIT_TEST"].map(Some);
    let expected = [("test-3", test), ("train-0", train), ("train-1", train), ("val-2", validation)];
    let mut found = splits.clone();
    found.sort();
    assert_eq!(found, expected.map(|(id, split)| (Some(id), split)));
}
