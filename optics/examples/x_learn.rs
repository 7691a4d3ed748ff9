#![allow(missing_docs, clippy::all)]
use lightpath_optics::hologram::{initial_phase, quality};
use lightpath_optics::learning::*;
use lightpath_optics::metrics::{Gain, psnr_db};
use lightpath_optics::simulated_display::*;
use lightpath_optics::*;
use rand::{RngExt, SeedableRng};
use std::time::Instant;

fn card(h: usize, w: usize, seed: u64) -> Plane<f32> {
    let mut r = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let mut v = vec![0.0f32; h * w];
    for _ in 0..60 {
        let (cx, cy) = (r.random::<f32>() * w as f32, r.random::<f32>() * h as f32);
        let s = (r.random::<f32>() * 4.5).exp() + 2.0;
        let a = r.random::<f32>() - 0.3;
        let box_ = r.random::<f32>() < 0.4;
        for y in 0..h {
            for x in 0..w {
                let (dx, dy) = ((x as f32 - cx) / s, (y as f32 - cy) / s);
                v[y * w + x] += if box_ {
                    if dx.abs() < 1.0 && dy.abs() < 1.0 { a } else { 0.0 }
                } else {
                    a * (-dx * dx - dy * dy).exp()
                };
            }
        }
    }
    let (lo, hi) = v.iter().fold((f32::MAX, f32::MIN), |(l, h), &x| (l.min(x), h.max(x)));
    v.iter_mut().for_each(|x| *x = ((*x - lo) / (hi - lo)).powf(2.0));
    Plane::try_from_vec(h, w, v).unwrap()
}
fn optimize(
    model: &DisplayModel,
    t: &Plane<f32>,
    roi: RegionOfInterest,
    range: f64,
    seed: u64,
    n: usize,
) -> Plane<f32> {
    let (h, w) = (t.height_px(), t.width_px());
    let e = Engine::<f32>::new(model, Detector::Pixel, None).unwrap();
    let p = HologramProblem::new(e, t.clone(), roi).unwrap();
    let mut a = Adam::start(p, 0.1, initial_phase(h, w, range, seed).unwrap()).unwrap();
    for _ in 0..n {
        a.step();
    }
    let ph = a.into_state().phase;
    // quantize 8 bit
    let tau = std::f32::consts::TAU;
    Plane::try_from_vec(
        h,
        w,
        ph.into_iter().map(|p| (p.rem_euclid(tau) / tau * 256.0).round() % 256.0 * tau / 256.0).collect(),
    )
    .unwrap()
}
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let (h, w) = (270, 480);
    let n: usize = args.get(2).map_or(16, |s| s.parse().unwrap());
    let strength: f64 = args.get(3).map_or(1.0, |s| s.parse().unwrap());
    let refine: u32 = args.get(4).map_or(120, |s| s.parse().unwrap());
    let epochs: u32 = args.get(5).map_or(4, |s| s.parse().unwrap());
    let lr: f64 = args.get(6).map_or(0.05, |s| s.parse().unwrap());
    let order: usize = args.get(7).map_or(5, |s| s.parse().unwrap());
    for seed in args[1].split(',').map(|s| s.parse::<u64>().unwrap()) {
        let setup = OpticalSetup::try_new(Grid::try_new(h, w, 8e-6).unwrap(), 515e-9, 0.05).unwrap();
        let roi = RegionOfInterest::middle(&setup.grid());
        let full = RegionOfInterest::full(&setup.grid());
        let bench = SimulatedDisplay::draw(
            setup,
            None,
            Imperfections { seed, strength, camera_noise: 0.003, misalignment_px: 0.3 },
        )
        .unwrap();
        let ideal = DisplayModel::ideal(setup);
        let t0 = Instant::now();
        let photo = |p: &Plane<f32>, s| bench.capture(p, s).unwrap().map(|v| v as f32 / 255.0);
        let pairs: Vec<Pair> = (0..n as u64 + 4)
            .map(|i| {
                let t = card(h, w, 100 * seed + i);
                let phase = optimize(&ideal, &t, roi, if i % 2 == 0 { std::f64::consts::TAU } else { 1.0 }, i, 60);
                let ph = photo(&phase, i);
                Pair { phase, photo: ph }
            })
            .collect();
        println!("seed {seed}: pairs in {:.1?}", t0.elapsed());
        let (train, test) = pairs.split_at(n);
        let train = train.to_vec();
        let loss = |m: &DisplayModel, r| {
            let e = Engine::new(m, Detector::Pixel, None).unwrap();
            test.iter()
                .map(|p| {
                    let s = compare(&e, p, r).unwrap();
                    let (g, o) = s.best_gain_and_offset();
                    (g * g * s.pp + o * o * s.w + s.tt + 2.0 * (g * o * s.p - g * s.tp - o * s.t)) / s.w
                })
                .sum::<f64>()
                / test.len() as f64
        };
        println!("  ideal test loss {:.6}", loss(&ideal, roi));
        // true single kernel
        let bins = {
            let (h2, w2) = (2 * h, 2 * w);
            Plane::from_fn(h2, w2, |y, x| {
                let f = |i: usize, n: usize| (i as f64 - (n / 2) as f64) / (n as f64 * 8e-6);
                let c = bench.true_transfer(f(x, w2), f(y, h2));
                num_complex::Complex32::new(c.re as f32, c.im as f32)
            })
        };
        let truth = DisplayModel { kernel: KernelShape::Bins(bins), ..ideal.clone() };
        println!("  true kernel test loss {:.6}", loss(&truth, roi));
        let mut models = vec![("ideal", ideal.clone()), ("true", truth)];
        for m in [LearnModel::Smooth { order }, LearnModel::Display { order }] {
            let mut o = LearnOptions::new(m, roi);
            o.refinement_evaluations = refine;
            o.epochs = epochs;
            o.learning_rate = lr;
            let t0 = Instant::now();
            let mut l = Learner::start(setup, o, &train).unwrap();
            while let Some(_s) = l.step(&train).unwrap() {}
            let hist = l.loss_history();
            let show: Vec<String> = hist
                .iter()
                .enumerate()
                .filter(|(i, _)| *i < epochs as usize + 1 || i % 10 == 0 || *i + 1 == hist.len())
                .map(|(_, l)| format!("{l:.5}"))
                .collect();
            let model = l.model();
            println!(
                "  {m:?} {:.1?}: test loss {:.6} full {:.6}; history {}",
                t0.elapsed(),
                loss(&model, roi),
                loss(&model, full),
                show.join(" ")
            );
            if matches!(m, LearnModel::Display { .. }) {
                println!(
                    "   z0 {:.4} resp {:?} gain {:.3} off {:.4}",
                    model.zero_order, model.response, model.gain, model.offset
                );
            }
            models.push((if matches!(m, LearnModel::Smooth { .. }) { "smooth" } else { "display" }, model));
        }
        for (name, m) in &models {
            let res: Vec<String> = (0..4u64)
                .map(|i| {
                    let t = card(h, w, 100 * seed + 50 + i);
                    let p = optimize(m, &t, roi, 1.0, i, 100);
                    let e = Engine::<f32>::new(m, Detector::Pixel, None).unwrap();
                    let q = quality(&e, &p, &t, roi).unwrap();
                    format!("{:.1}/{:.1}", q.psnr_pixel_db, psnr_db(&photo(&p, 77 + i), &t, roi, Gain::Fitted).unwrap())
                })
                .collect();
            println!("  {name}: simulated/captured {}", res.join("  "));
        }
    }
}
