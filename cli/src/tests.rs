//! Tests of the command line: arguments, errors and help.

use super::*;
use clap::error::ErrorKind;
use std::fs;
use std::path::Path;

/// Number of texts that [`damaged`] returns.
pub(crate) const DAMAGED: usize = 3000;

/// Damaged copies of `seed`: some characters are replaced, added or removed. The copies are the same in every run.
pub(crate) fn damaged(seed: &str) -> impl Iterator<Item = String> {
    const STRANGE: [char; 16] =
        ['"', '\'', '\\', ',', '=', '[', ']', '{', '}', '\n', '\0', '9', '-', 'e', 'é', '\u{feff}'];
    let seed: Vec<char> = seed.chars().collect();
    let mut state = 1_u64;
    // Lehmer's random number generator with the multiplier of Park and Miller.
    let mut below = move |end: usize| {
        state = state * 48_271 % 0x7fff_ffff;
        state as usize % end.max(1)
    };
    (0..DAMAGED).map(move |_| {
        let mut text = seed.clone();
        for _ in 0..=below(6) {
            let at = below(text.len());
            match below(4) {
                0 if at < text.len() => text[at] = STRANGE[below(STRANGE.len())],
                1 if at < text.len() => drop(text.remove(at)),
                2 if below(8) == 0 => text.truncate(at),
                _ => text.insert(at, STRANGE[below(STRANGE.len())]),
            }
        }
        text.into_iter().collect()
    })
}

/// Parses a command line.
fn parse(line: &str) -> Result<Cli, clap::Error> {
    Cli::try_parse_from(line.split_whitespace())
}

/// The error message of a command line that is refused with exit code 2.
fn refusal(line: &str) -> String {
    let error = parse(line).unwrap_err();
    assert_eq!(error.exit_code(), 2, "{line}");
    error.to_string()
}

#[test]
fn clap_accepts_the_definition_of_the_command_line() {
    Cli::command().debug_assert();
}

/// Commands that together use every option.
const COMMANDS: &[&str] = &[
    "lightpath display create lab-2 --resolution 1920x1080 --pixel-pitch 8um --wavelength 515nm",
    "lightpath display create toy --resolution 64x64 --pixel-pitch 8µm --wavelength 515nm --wavelength 632.8nm \
     --bit-depth 10 --carrier half-order-x --simulated-seed 3 --simulated-strength 0.5 --camera-noise 0.001 \
     --misalignment 0.3 --phase-response response.txt --notes bench",
    "lightpath display list --limit 3",
    "lightpath display show lab-2",
    "lightpath display delete lab-2",
    "lightpath hologram optimize a.png b.png --display lab-2 --distance 150mm -o {name}.png",
    "lightpath hologram optimize a.png --display lab-2 --distance -12.5mm --wavelength 515nm --kernel 3 --method \
     adam --iterations 5 --learning-rate 0.3 --seed 2 --detector point --target-encoding linear --fit cover --region \
     1,2,3,4 --phase-range 6.28 --wait --npy a.npy --reconstruction r.png --priority -5 --request-id r1",
    "lightpath hologram save 0193 -o pattern.png",
    "lightpath dataset create bench-1 --display lab-2 --distance 150mm --photo-encoding srgb",
    "lightpath dataset add bench-1 --pattern p.png --photo c.png --id p1 --split test",
    "lightpath dataset add bench-1 --pattern p.npy --photo c.tif --black-level 0.01 --exposure 0.02 --gain 1.5",
    "lightpath dataset add bench-1 --patterns holograms/ --photos photos/ --split train",
    "lightpath dataset add bench-1 --manifest pairs.toml",
    "lightpath dataset calibration bench-1 -o dots.png",
    "lightpath dataset align bench-1 --dots photo.png --picture-before b.png --picture-after a.png --after 0193",
    "lightpath dataset align bench-1 --points p.csv --photo-size 4096x3000",
    "lightpath dataset align bench-1 --pairs",
    "lightpath dataset finalize bench-1 --keep-alignment",
    "lightpath dataset finalize bench-1 --validation-fraction 0.1 --test-fraction 0.2 --seed 4",
    "lightpath dataset finalize bench-1 --test-fraction 0",
    "lightpath dataset show bench-1",
    "lightpath dataset list --display lab-2",
    "lightpath dataset delete bench-1",
    "lightpath kernel learn --dataset bench-1 --model smooth --epochs 3 --wait",
    "lightpath kernel learn --dataset near --dataset far --wait",
    "lightpath kernel interpolate --display lab-2 --wavelength 515nm --distance 170mm",
    "lightpath kernel evaluate --dataset bench-1 --kernel ideal --wait",
    "lightpath kernel list --display lab-2 --distance 150mm",
    "lightpath kernel show displays/lab-2/kernels/515nm-150mm --version 2",
    "lightpath kernel versions --display lab-2 --distance 150mm",
    "lightpath kernel history --display lab-2 --distance 150mm --wavelength 515nm",
    "lightpath kernel promote --display lab-2 --distance 150mm --version 3 --reason better",
    "lightpath kernel gate lab-2 --better-than-active 5% --test-pairs 4 --format compact --allow-worse-than-ideal \
     --reason firmware",
    "lightpath kernel gate lab-2 --default",
    "lightpath kernel check --display lab-2 --distance 150mm --version 4",
    "lightpath kernel alias candidate --display lab-2 --distance 150mm --version 4 --reason try --expected 0",
    "lightpath kernel alias candidate --display lab-2 --distance 150mm --remove",
    "lightpath kernel deprecate --display lab-2 --distance 150mm --version 2 --reason old --undo",
    "lightpath kernel mirror --display lab-2 --distance 150mm --format compact -o mirror/",
    "lightpath kernel nearest --display lab-2 --distance 151mm --wavelength 515nm",
    "lightpath rollout start --display lab-2 --distance 150mm --version 4 --share 5% --group first --failed-max 20% \
     --devices-min 5 --self-test-loss-max 0.01 --reason try --force --expected-active 3",
    "lightpath rollout widen --display lab-2 --distance 150mm --share 25% --number 2",
    "lightpath rollout complete --display lab-2 --distance 150mm",
    "lightpath rollout halt --display lab-2 --distance 150mm --reason noise",
    "lightpath rollout show --display lab-2 --distance 150mm",
    "lightpath rollout list --display lab-2 --distance 150mm --limit 3",
    "lightpath device list lab-2 --limit 3",
    "lightpath device group --display lab-2 bench-7 first",
    "lightpath device delete --display lab-2 bench-7",
    "lightpath kernel import --display lab-2 --distance 150mm k.bundle --from-another-display",
    "lightpath kernel compare --display lab-2 --distance 150mm --version 3 --with 4 -o difference.png",
    "lightpath kernel rollback --display lab-2 --distance 150mm --expected-active 3 --reason worse",
    "lightpath kernel fetch --display lab-2 --distance 150mm --format safetensors -o k.safetensors",
    "lightpath kernel export --display lab-2 --distance 150mm --version 1 -o k.safetensors",
    "lightpath kernel export --display lab-2 --distance 150mm --version 1 --format compact -o k.lpk",
    "lightpath kernel report --display lab-2 --distance 150mm --version 3 -o r.html --arrays r.npz --figures r/",
    "lightpath kernel import --display lab-2 --distance 150mm k.safetensors",
    "lightpath simulate --display toy --distance 150mm --pattern p.png -o photo.png",
    "lightpath simulate --display toy --distance 150mm --phase p.npy -o photo.png",
    "lightpath photo score a.png b.png --target t.png --photo-encoding srgb --target-encoding linear --region 1,2,3,4 \
     --aligned aligned/ --error {name}-error.png",
    "lightpath job list --state running --display lab-2",
    "lightpath job show 0193",
    "lightpath job watch 0193 0194",
    "lightpath job cancel 0193",
    "lightpath job retry 0193",
    "lightpath --server http://lab:7070 --token-file t --output json job logs 0193",
    "lightpath job logs 0193 --server http://lab:7070 --output json",
    "lightpath hologram optimize a.png --display d --distance 1mm --owner ada --batch night --unique-key k \
     --not-before 2026-11-21T22:00:00+01:00 --timeout 45m --after 0193 --after jobs/0194",
    "lightpath kernel learn --dataset bench-1 --not-before 90m",
    "lightpath job list --batch night",
    "lightpath job list --kind learn-kernel --owner ada --since 2h --text bench-1 --oldest-first",
    "lightpath job batch night",
    "lightpath queue show",
    "lightpath queue pause --display lab-2 --reason maintenance",
    "lightpath queue resume",
    "lightpath completions bash",
    "lightpath --output jsonl job watch 0193",
    "lightpath hologram optimize targets/ --display lab-2 --distance 150mm -o -",
    "lightpath hologram save 0193 0194 -o holograms/",
    "lightpath simulate --display toy --distance 150mm --pattern a.png b.png -o photos/ --seed 3",
    "lightpath kernel watch --display lab-2 --distance 150mm --exec true",
    "lightpath kernel fetch --display lab-2 --distance 150mm --dry-run -o k.lpk",
    "lightpath doctor --upload-mib 0",
    "lightpath man --out man",
];

#[test]
fn commands_with_all_their_options_are_parsed() {
    for line in COMMANDS {
        if let Err(error) = parse(line) {
            panic!("{line}\n{error}");
        }
    }
}

/// Commands that the dashboard tells users to run.
#[test]
fn commands_on_the_dashboard_are_parsed() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../server/dashboard/page/pages");
    let texts = fs::read_dir(folder).unwrap().map(|entry| fs::read_to_string(entry.unwrap().path()).unwrap());
    let texts: Vec<String> = texts.collect();
    let quoted = texts.iter().flat_map(|text| text.split(['"', '`']));
    let commands: Vec<&str> = quoted.filter(|text| text.starts_with("lightpath ")).collect();
    assert!(commands.len() > 3, "{commands:?}");
    for line in commands {
        if let Err(error) = parse(line) {
            panic!("{line}\n{error}");
        }
    }
}

#[test]
fn wrong_units_and_values_are_refused_with_an_explanation() {
    for (line, sign) in [
        ("lightpath hologram optimize a.png --display d --distance 150", "would be 150 m: write 150mm"),
        (
            "lightpath hologram optimize a.png --display d --distance NaN",
            "distance is NaN, but must be a finite number",
        ),
        ("lightpath hologram optimize a.png --display d --distance 1mile", "unknown unit \"mile\""),
        (
            "lightpath hologram optimize a.png --display d --distance 1mm --method sgd",
            "[possible values: lbfgs, adam, gerchberg-saxton, weighted-gerchberg-saxton, double-phase]",
        ),
        (
            "lightpath hologram optimize a.png --display d --distance 1mm --initial-phase lens",
            "quadratic[:FOCAL LENGTH]",
        ),
        ("lightpath hologram optimize --display d --plane near.png", "140mm=near.png"),
        ("lightpath hologram optimize a.png --display d --distance 1mm --region 1,2", "192,108,1536,864"),
        ("lightpath hologram optimize --display d --distance 1mm", "<TARGET>"),
        ("lightpath display create d --resolution 1920 --pixel-pitch 8um --wavelength 515nm", "such as 1920x1080"),
        ("lightpath display create d --resolution 9x9 --pixel-pitch 8 --wavelength 515nm", "write 8um"),
        ("lightpath display create d --resolution 9x9 --pixel-pitch 8um --wavelength 515", "write 515nm"),
        ("lightpath display create d --resolution 9x9 --pixel-pitch 8um", "--wavelength"),
        ("lightpath kernel show --display d", "--distance"),
        ("lightpath kernel export k --version 0 -o f", "0 is not in 1.."),
        ("lightpath dataset add d --pattern p.png", "--photo"),
        ("lightpath dataset add d --patterns p/", "--photos"),
        ("lightpath dataset align d", "--dots"),
        ("lightpath photo score a.png", "--target"),
        ("lightpath dataset align d --points p.csv", "--photo-size"),
        // These are never 0.
        ("lightpath hologram optimize a.png --display d --distance 1mm --iterations 0", "0 is not in 1.."),
        ("lightpath hologram optimize a.png --display d --distance 1mm --learning-rate 0", "must be above 0"),
        ("lightpath kernel learn --dataset d --epochs 0", "0 is not in 1.."),
    ] {
        let error = refusal(line);
        assert!(error.contains(sign), "{line}\n{error}");
    }
}

#[test]
fn zero_and_negative_lengths_are_left_to_the_server() {
    for pitch in ["0um", "-8um", "0"] {
        let line = format!("lightpath display create d --resolution 9x9 --pixel-pitch {pitch} --wavelength 515nm");
        assert!(parse(&line).is_ok(), "{pitch}");
    }
}

#[test]
fn help_is_complete_and_fits_a_terminal() {
    lightpath_program_docs::check_help(Cli::command()).unwrap_or_else(|mistakes| panic!("{mistakes}"));
}

#[test]
fn reference_in_the_documents_is_up_to_date() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/reference/command-line.md");
    let reference = lightpath_program_docs::markdown(Cli::command());
    lightpath_program_docs::check_document(&path, "lightpath", &reference).unwrap();
}

#[test]
fn help_has_examples_and_explanations() {
    for (line, sign) in [
        ("lightpath --help", "A first hologram:"),
        ("lightpath hologram optimize --help", "lightpath hologram optimize targets/*.png"),
        ("lightpath hologram optimize --help", "{name}"),
        ("lightpath display create --help", "--simulated-seed 1"),
        ("lightpath kernel learn --help", "[default: display]"),
        ("lightpath kernel learn --help", "It is not used until it is promoted"),
        ("lightpath hologram optimize --help", "Each target becomes a job of its own"),
        ("lightpath display create --help", "spatial light modulator"),
        ("lightpath dataset add --help", "The same pair again"),
        ("lightpath photo score --help", "Above 1 px, do not trust the figures"),
        ("lightpath simulate --help", "declared with --simulated or --simulated-seed"),
    ] {
        let error = parse(line).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::DisplayHelp);
        // Undo line breaks, so that a text counts even if it is wrapped.
        let words = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(words(&error.to_string()).contains(&words(sign)), "{line}\n{error}");
    }
}
