#![allow(missing_docs, clippy::unwrap_used, clippy::print_stdout)]
use lightpath_optics::photo_score::*;
use lightpath_optics::*;
use npyz::NpyFile;
use std::time::Instant;
fn read(path: &str) -> Vec<Plane<f32>> {
    let bytes = std::fs::read(path).unwrap();
    let file = NpyFile::new(&bytes[..]).unwrap();
    let [c, h, w] = *file.shape() else { panic!() };
    let v = file.into_vec::<f32>().unwrap();
    v.chunks((h * w) as usize)
        .take(c as usize)
        .map(|p| Plane::try_from_vec(h as usize, w as usize, p.to_vec()).unwrap())
        .collect()
}
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let (photo, target) = (read(&args[1]), read(&args[2]));
    let t = Instant::now();
    let grid = Grid::try_new(target[0].height_px(), target[0].width_px(), 8e-6).unwrap();
    let roi = RegionOfInterest::middle(&grid);
    match align(&photo, &target, roi) {
        Err(e) => println!("{} -> {e} [{:.2} s]", args[1], t.elapsed().as_secs_f64()),
        Ok(a) => {
            println!(
                "{} corr {:.3} mag {:.4} k {:?} residual {:?} [{:.2} s]",
                args[1],
                a.found.correlation,
                a.found.map.magnification([100.0, 100.0]),
                a.found.map.distortion(),
                a.residual,
                t.elapsed().as_secs_f64()
            );
            for (p, q) in a.channels.iter().zip(target.iter().cycle()) {
                println!("   {:?}", score(p, q, roi).unwrap());
            }
            println!("   [{:.2} s]", t.elapsed().as_secs_f64());
        }
    }
}
