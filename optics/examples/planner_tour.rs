//! Prints the method that the planner chooses for a display at distances from near to far, and for other windows of the
//! image.
//!
//! ```text
//! cargo run --release --example planner_tour
//! ```
#![allow(clippy::print_stdout)] // an example prints its results

use lightpath_optics::propagation::{ImageWindow, PropagationMethod, assess, plan, plan_onto};
use lightpath_optics::{Grid, OpticalSetup, Result};

fn main() -> Result<()> {
    let display = Grid::try_new(1080, 1920, 8e-6)?;
    let at = |distance_m: f64| OpticalSetup::try_new(display, 515e-9, distance_m);

    println!("1920×1080 px of 8 µm, 515 nm\n");
    for distance_m in [0.07, 0.15, 0.275, 0.4, 0.5, 2.0] {
        println!("at {distance_m} m\n{}\n", plan(&at(distance_m)?)?);
    }

    println!("a zoom to a quarter of the pitch, and a window 2 mm beside the axis, at 0.15 m");
    let zoom = ImageWindow::try_new(1080, 1920, 2e-6)?;
    println!("{}\n", plan_onto(&at(0.15)?, &zoom)?);
    println!("{}\n", plan(&at(0.15)?.with_centre(2e-3, 0.0)?)?);

    println!("methods that are refused at 0.5 m");
    for method in PropagationMethod::ALL {
        if let Err(refusal) = assess(&at(0.5)?, method) {
            println!("- {refusal}");
        }
    }
    let small_display = OpticalSetup::try_new(Grid::try_new(64, 64, 8e-6)?, 515e-9, 2.0)?;
    if let Err(refusal) = plan(&small_display) {
        println!("\n64×64 px at 2 m\n- {refusal}");
    }
    Ok(())
}

#[test]
fn example_runs() {
    main().expect("the example runs without an error");
}
