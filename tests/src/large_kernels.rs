use crate::command_line::CommandLine;
use crate::material::kernel_file;
use crate::process::agent;
use lightpath::digest_of;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tokio::time::sleep;

/// The forms that an agent can have.
const FORMS: [&str; 7] = ["safetensors", "compact", "npz", "complex64", "f16", "npy", "pt"];
const KERNEL: &str = "--display lab --distance 50mm";
/// Time for all forms of a kernel of 3840×2160 px on two busy cores.
const PATIENCE: Duration = Duration::from_secs(1800);

/// Rows and columns of the display: `LIGHTPATH_LARGE_KERNEL=2160x3840` is a large one. Without it a small display and idle
/// cores show only that every form arrives.
fn large_px() -> Option<[usize; 2]> {
    let text = std::env::var("LIGHTPATH_LARGE_KERNEL").ok()?;
    let sides: Vec<usize> = text.split('x').map(|side| side.parse().unwrap()).collect();
    Some([sides[0], sides[1]])
}

/// Computes on two cores until it is dropped.
struct Busy(Arc<AtomicBool>);

impl Busy {
    fn cores() -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        for _ in 0..2 {
            let stop = Arc::clone(&stop);
            std::thread::spawn(move || {
                while !stop.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        Self(stop)
    }
}

impl Drop for Busy {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Waits until an agent uses a kernel, and returns it.
async fn installed(directory: PathBuf, begin: Instant) -> (Vec<u8>, Duration) {
    loop {
        if let Ok(kernel) = std::fs::read(directory.join("current/kernel")) {
            return (kernel, begin.elapsed());
        }
        assert!(begin.elapsed() < PATIENCE, "{} has no kernel", directory.display());
        sleep(Duration::from_millis(200)).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn every_form_of_a_large_kernel_arrives_at_agents_with_their_default_waits() {
    let large_px = large_px();
    let [height_px, width_px] = large_px.unwrap_or([96, 160]);
    let cli = CommandLine::start().await;
    cli.text(&format!("display create lab --resolution {width_px}x{height_px} --pixel-pitch 8um --wavelength 515nm"))
        .await;
    cli.write("k.safetensors", &kernel_file(width_px, height_px, 0.1));
    cli.text(&format!("kernel import {KERNEL} @/k.safetensors")).await;
    cli.text(&format!("kernel promote {KERNEL} --version 1")).await;
    let shown = cli.text("keyring show").await;
    let root = shown.lines().find_map(|line| line.strip_prefix("root ")).unwrap_or_else(|| panic!("{shown}"));
    let _busy = large_px.map(|_| Busy::cores());
    let begin = Instant::now();
    let directory = |form: &str| cli.path(&format!("device-{form}"));
    let start = |form: &str| {
        std::fs::create_dir(directory(form)).unwrap();
        let (device, directory) = (format!("bench-{form}"), directory(form));
        let options = [
            ("--server", cli.server.url()),
            ("--display", "lab"),
            ("--device", &device),
            ("--wavelength", "515nm"),
            ("--distance", "50mm"),
            ("--format", form),
            ("--root", root),
            ("--directory", directory.to_str().unwrap()),
        ];
        agent(&options.map(|(name, value)| [name, value]).concat())
    };
    let _agents = FORMS.map(start);
    for form in FORMS {
        let (kernel, took) = installed(directory(form), begin).await;
        eprintln!("{form}: {} bytes after {:.1} s", kernel.len(), took.as_secs_f64());
        let manifest = cli.text(&format!("kernel manifest {KERNEL} --format {form}")).await;
        assert!(manifest.contains(&digest_of(&kernel)), "{form}: {manifest}");
    }
    cli.server.stop().await;
}
