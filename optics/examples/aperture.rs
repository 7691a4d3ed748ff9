//! Compares every valid method with the direct sum, for the light behind a square hole.
//!
//! ```text
//! cargo run --release --example aperture
//! ```
#![allow(clippy::print_stdout)] // an example prints its results

use lightpath_optics::propagation::PropagationMethod;
use lightpath_optics::reference::rayleigh_sommerfeld_onto;
use lightpath_optics::{Grid, OpticalSetup, Plane, Propagator, Result};
use num_complex::{Complex32, Complex64};

fn main() -> Result<()> {
    let side_px = 48;
    let grid = Grid::try_new(side_px, side_px, 8e-6)?;
    // The edges of the hole fall off over two pixels: a sharper hole has frequencies beyond the pixels' band.
    let soft = |i: usize| 0.5 - 0.5 * ((i as f64 - 23.5).abs() - 8.0).tanh();
    let hole = Plane::from_fn(side_px, side_px, |y, x| Complex64::from(soft(y) * soft(x)));
    let hole_f32 = hole.map(|field| Complex32::new(field.re as f32, field.im as f32));
    for distance_m in [6e-3, 12e-3, 50e-3, 1.0] {
        let setup = OpticalSetup::try_new(grid, 515e-9, distance_m)?;
        println!("\n{} mm; critical distance {:.1} mm", 1e3 * distance_m, 1e3 * setup.critical_distance_x_m());
        for method in PropagationMethod::ALL {
            let propagator = match Propagator::new(&setup, method) {
                Ok(propagator) => propagator,
                Err(refusal) => {
                    println!("  {:37} refused: {refusal}", method.to_string());
                    continue;
                }
            };
            let image = propagator.forward(&hole_f32)?.map(|field| Complex64::new(field.re.into(), field.im.into()));
            // The direct sum is valid only at and beyond the critical distance.
            let sum = rayleigh_sommerfeld_onto(&setup, &hole, propagator.window())?;
            let light = |plane: &Plane<Complex64>| plane.values().iter().map(Complex64::norm_sqr).sum::<f64>();
            let difference = Plane::from_fn(side_px, side_px, |y, x| image.at(y, x) - sum.at(y, x));
            let pitch_um = 1e6 * propagator.window().pitch_x_m();
            let error = (light(&difference) / light(&sum)).sqrt();
            println!(
                "  {:37} error {error:8.1e} relative to the direct sum, pixels of {pitch_um:.1} µm",
                method.to_string()
            );
        }
    }
    Ok(())
}

#[test]
fn example_runs() {
    main().expect("the example runs without an error");
}
