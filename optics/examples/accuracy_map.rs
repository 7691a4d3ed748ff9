//! Differences between the reported quality of holograms and that of an independent model, over distances, aspect
//! ratios, kinds of displays, detectors and propagation methods: a picture, and a summary as text.
//!
//! ```text
//! cargo run --release -p lightpath-optics --example accuracy_map -- accuracy-map.svg
//! ```
#![allow(clippy::print_stdout)]

use lightpath_bench::TestCard;
use lightpath_optics::hologram::{HologramMethod, HologramOptions, ShownLight, initial_phase};
use lightpath_optics::propagation::assess;
use lightpath_optics::second_opinion::{Effort, SecondOpinion};
use lightpath_optics::{
    ConvolutionMethod, Detector, DisplayModel, Engine, FilterShape, Grid, HologramProblem, OpticalSetup, Optimization,
    OrderFilter, Orders, Plane, RegionOfInterest,
};
use std::error::Error;
use std::fmt::Write as _;

const DISTANCES_MM: [f64; 13] = [1.0, 2.0, 5.0, 10.0, 15.0, 20.0, 30.0, 40.0, 55.0, 80.0, 150.0, 400.0, 1000.0];
/// Columns and rows of the displays [px].
const SIZES: [[usize; 2]; 3] = [[192, 108], [144, 144], [80, 200]];
const METHODS: [ConvolutionMethod; 5] = [
    ConvolutionMethod::BandLimited,
    ConvolutionMethod::AngularSpectrum,
    ConvolutionMethod::RayleighSommerfeld,
    ConvolutionMethod::FresnelTransferFunction,
    ConvolutionMethod::FresnelImpulseResponse,
];
const STEPS: u32 = 60;
/// All rows of these displays, or a few where the light of many orders reaches the image.
const EFFORTS: [Effort; 2] =
    [Effort { rows_max: 1000, values_max: 1 << 27 }, Effort { rows_max: 8, values_max: 1 << 31 }];
/// A filter that passes half an order along y, not quite in the middle.
const SLIT: Orders = Orders::Filtered(OrderFilter {
    shape: FilterShape::Rectangle,
    width: 1.0,
    height: 0.5,
    centre_x: 0.0,
    centre_y: 0.05,
});

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "accuracy-map.svg".to_owned());
    let mut rows = Vec::new();
    for orders in [Orders::First, Orders::SQUARE] {
        for detector in Detector::ALL {
            for size in SIZES {
                rows.push(Row { orders, detector, size, method: None });
            }
        }
    }
    for size in SIZES {
        rows.push(Row { orders: SLIT, detector: Detector::Pixel, size, method: None });
    }
    for method in METHODS {
        for size in SIZES {
            rows.push(Row { orders: Orders::First, detector: Detector::Pixel, size, method: Some(method) });
        }
    }
    let mut cells = Vec::new();
    for row in &rows {
        let found = DISTANCES_MM.map(|mm| row.cell(1e-3 * mm));
        let texts: Vec<String> = found.iter().map(Cell::text).collect();
        println!("{:60} {}", row.name(), texts.join("  "));
        cells.push(found);
    }
    let judged: Vec<&Found> = cells.iter().flatten().filter_map(Cell::unwarned).collect();
    let largest = |below: bool| {
        let of = judged.iter().filter(|found| (found.engine_db <= 40.0) == below);
        of.map(|found| found.difference_db.abs()).fold(0.0, f64::max)
    };
    println!(
        "{} pictures without warning: at most {:.3} dB up to 40 dB, {:.3} dB above",
        judged.len(),
        largest(true),
        largest(false)
    );
    std::fs::write(path, svg(&rows, &cells))?;
    Ok(())
}

/// A row of the map.
struct Row {
    orders: Orders,
    detector: Detector,
    size: [usize; 2],
    /// Propagation method; `None`: the planner's choice.
    method: Option<ConvolutionMethod>,
}

/// A picture that was judged.
struct Found {
    engine_db: f64,
    difference_db: f64,
    has_warning: bool,
}

/// A hologram of the map.
enum Cell {
    /// The method is refused at this distance.
    Refused,
    /// The independent model would take too long.
    NotJudged,
    Judged(Found),
}

impl Row {
    fn name(&self) -> String {
        let [width, height] = self.size;
        let orders = match self.orders {
            Orders::First => "first order",
            Orders::Filtered(_) => "slit of half an order",
            Orders::All { .. } => "all orders",
        };
        let method =
            self.method.map_or("default method", |method| lightpath_optics::PropagationMethod::from(method).name());
        format!("{orders}, {:?}, {width}×{height} px, {method}", self.detector).to_lowercase()
    }

    fn cell(&self, distance_m: f64) -> Cell {
        let [width_px, height_px] = self.size;
        let setup = || -> Result<_, lightpath_optics::Error> {
            let grid = Grid::try_new(height_px, width_px, 8e-6)?;
            let setup = OpticalSetup::try_new(grid, 515e-9, distance_m)?.with_orders(self.orders)?;
            match self.method {
                None => setup.planned(),
                Some(method) => {
                    let setup = setup.with_method(method)?;
                    Ok((setup, assess(&setup, method.into())?))
                }
            }
        };
        let Ok((setup, report)) = setup() else { return Cell::Refused };
        let has_warning = !report.warnings.is_empty();
        match judged(&DisplayModel::ideal(setup), self.detector) {
            Ok(Some(found)) => Cell::Judged(Found {
                engine_db: found.engine_psnr_db,
                difference_db: found.engine_psnr_db - found.independent_psnr_db,
                has_warning,
            }),
            Ok(None) => Cell::NotJudged,
            Err(_) => Cell::Refused,
        }
    }
}

/// Optimizes a hologram, and compares its quality with that of the independent model.
fn judged(model: &DisplayModel, detector: Detector) -> Result<Option<SecondOpinion>, lightpath_optics::Error> {
    let grid = model.setup.grid();
    let (height_px, width_px) = (grid.height_px(), grid.width_px());
    let (target, region) = (TestCard::Portrait.render(height_px, width_px, 3)?, RegionOfInterest::middle(&grid));
    let engine = Engine::new(model, detector, None)?;
    let problem = HologramProblem::new(engine.clone(), target.clone(), region)?;
    let start = initial_phase(height_px, width_px, 0.5, 4)?.into_vec();
    let mut optimization = Optimization::start(problem, HologramOptions::new(HologramMethod::Lbfgs, STEPS), start)?;
    while optimization.step().is_some() {}
    let phases = [Plane::try_from_vec(height_px, width_px, optimization.phases().to_vec())?];
    let shown = ShownLight::of_frames(&engine, &phases)?;
    for effort in EFFORTS {
        let opinion = SecondOpinion::of((model, None), &phases, &shown, detector, (&target, region).into(), effort)?;
        if opinion.is_some() {
            return Ok(opinion);
        }
    }
    Ok(None)
}

impl Cell {
    fn text(&self) -> String {
        match self {
            Self::Refused => "–".to_owned(),
            Self::NotJudged => "?".to_owned(),
            Self::Judged(found) => {
                let mark = if found.has_warning { "!" } else { "" };
                format!("{:+.2}{mark} ({:.0})", found.difference_db, found.engine_db)
            }
        }
    }

    fn unwarned(&self) -> Option<&Found> {
        match self {
            Self::Judged(found) if !found.has_warning => Some(found),
            _ => None,
        }
    }

    fn colour(&self) -> &'static str {
        match self {
            Self::Refused | Self::NotJudged => "#eeeeee",
            Self::Judged(found) => match found.difference_db.abs() {
                difference if difference <= 0.05 => "#d8f0d8",
                difference if difference <= 0.3 => "#eef3c2",
                difference if difference <= 0.5 => "#fbe3a6",
                difference if difference <= 2.0 => "#f7c0a0",
                _ => "#ee9a9a",
            },
        }
    }
}

/// The map as a picture: a row for each display, detector and method, a column for each distance.
fn svg(rows: &[Row], cells: &[[Cell; DISTANCES_MM.len()]]) -> String {
    const LEFT: usize = 430;
    const TOP: usize = 60;
    const CELL: [usize; 2] = [66, 20];
    let (width, height) = (LEFT + CELL[0] * DISTANCES_MM.len() + 10, TOP + CELL[1] * rows.len() + 10);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" \
         font-size=\"11\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n\
         <text x=\"{LEFT}\" y=\"20\" font-size=\"13\">reported minus independent PSNR [dB], in parentheses the reported PSNR; \
         ! with a warning, – refused, ? not judged</text>\n"
    );
    for (i, mm) in DISTANCES_MM.iter().enumerate() {
        let x = LEFT + CELL[0] * i + CELL[0] / 2;
        let _ = writeln!(svg, "<text x=\"{x}\" y=\"{}\" text-anchor=\"middle\">{mm} mm</text>", TOP - 8);
    }
    for (j, (row, cells)) in rows.iter().zip(cells).enumerate() {
        let y = TOP + CELL[1] * j;
        let _ = writeln!(svg, "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text>", LEFT - 8, y + 14, row.name());
        for (i, cell) in cells.iter().enumerate() {
            let (x, [w, h]) = (LEFT + CELL[0] * i, [CELL[0] - 1, CELL[1] - 1]);
            let _ = writeln!(
                svg,
                "<rect x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" fill=\"{}\"/><text x=\"{}\" y=\"{}\" \
                 text-anchor=\"middle\">{}</text>",
                cell.colour(),
                x + CELL[0] / 2,
                y + 14,
                cell.text()
            );
        }
    }
    svg + "</svg>\n"
}
