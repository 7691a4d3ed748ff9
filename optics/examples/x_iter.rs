#![allow(missing_docs, clippy::all)]
use lightpath_optics::*;
use std::time::Instant;
fn main() {
    let a: Vec<usize> = std::env::args().skip(1).map(|s| s.parse().unwrap()).collect();
    let (h, w) = if a.len() >= 2 { (a[0], a[1]) } else { (1080, 1920) };
    let setup = OpticalSetup::try_new(Grid::try_new(h, w, 8e-6).unwrap(), 515e-9, 0.15).unwrap();
    for detector in [Detector::Point, Detector::Pixel] {
        let engine = Engine::<f32>::new(&DisplayModel::ideal(setup), detector, None).unwrap();
        let target =
            Plane::from_fn(h, w, |y, x| (0.5 + 0.5 * ((x as f32) * 0.02).sin() * (y as f32 * 0.03).cos()).powi(2));
        let roi = RegionOfInterest::middle(&setup.grid());
        let problem = HologramProblem::new(engine, target, roi).unwrap();
        let mut adam = Adam::start(problem, 0.1, hologram::initial_phase(h, w, 1.0, 1).unwrap()).unwrap();
        let n = 20;
        let mut times = vec![];
        for _ in 0..n {
            let t = Instant::now();
            adam.step();
            times.push(t.elapsed().as_secs_f64() * 1e3);
        }
        times.sort_by(f64::total_cmp);
        println!("{detector:?}: median {:.1} ms, min {:.1}", times[n / 2], times[0]);
    }
}
