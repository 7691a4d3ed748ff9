//! Computes a hologram with the library alone: plans the propagation, optimizes the phase, and writes the phase and the
//! predicted image.
//!
//! ```text
//! cargo run --release --example hologram [FOLDER]
//! ```
//!
//! The example writes `phase.pgm` and `image.pgm` into the folder. The default is the current folder.
#![allow(clippy::print_stdout)] // an example prints its results

use lightpath_optics::{Grid, OpticalSetup, Plane, optimize};
use std::f32::consts::TAU;
use std::path::{Path, PathBuf};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args_os().nth(1).map_or_else(|| PathBuf::from("."), PathBuf::from);
    make(&folder)
}

fn make(folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let (height_px, width_px) = (180, 240);
    let setup = OpticalSetup::try_new(Grid::try_new(height_px, width_px, 8e-6)?, 515e-9, 0.03)?;
    let hologram = optimize(&rings(height_px, width_px), &setup)?;
    println!("{}\n", hologram.validity);
    println!("PSNR of the light integrated over each pixel: {:.1} dB", hologram.quality.pixel.psnr_db);
    write_pgm(&folder.join("phase.pgm"), &hologram.phase.map(|phase| phase / TAU))?;
    write_pgm(&folder.join("image.pgm"), &hologram.reconstruction.map(|light| light.clamp(0.0, 1.0)))?;
    println!("\nwrote phase.pgm and image.pgm into {}", folder.display());
    Ok(())
}

/// The target: rings around a disc, in linear light.
fn rings(height_px: usize, width_px: usize) -> Plane<f32> {
    Plane::from_fn(height_px, width_px, |y, x| {
        let radius_px = (y as f32 - height_px as f32 / 2.0).hypot(x as f32 - width_px as f32 / 2.0);
        if radius_px < 15.0 || (radius_px / 12.0) % 2.0 < 1.0 { 0.9 } else { 0.05 }
    })
}

/// Writes values from 0 to 1 as a grey picture (PGM).
fn write_pgm(path: &Path, values: &Plane<f32>) -> std::io::Result<()> {
    let mut bytes = format!("P5\n{} {}\n255\n", values.width_px(), values.height_px()).into_bytes();
    bytes.extend(values.values().iter().map(|value| (255.0 * value).round() as u8));
    std::fs::write(path, bytes)
}

#[test]
fn example_writes_two_pictures() {
    let folder = std::env::temp_dir().join(format!("lightpath-hologram-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("the folder is created");
    make(&folder).expect("the example runs without an error");
    for file in ["phase.pgm", "image.pgm"] {
        let size = std::fs::metadata(folder.join(file)).expect("the file exists").len();
        assert_eq!(size, 15 + 180 * 240, "{file}");
    }
    std::fs::remove_dir_all(&folder).expect("the folder is removed");
}
