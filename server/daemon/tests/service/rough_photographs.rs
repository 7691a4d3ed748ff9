//! Test of a display that was learned from imperfect photographs: turned, shifted and overexposed photographs, and one
//! of another hologram.

use crate::jobs::{submit, watch_to_end};
use crate::kernels::fetch_version;
use crate::preparing::prepare;
use crate::test_bench::{CENTRE, Dataset, HEIGHT, TestBench, WIDTH};
use lightpath_bench::TestCard;
use lightpath_camera::alignment::{Homography, warp};
use lightpath_media::kernel_file;
use lightpath_optics::metrics::{Gain, psnr_db};
use lightpath_optics::{Detector, Engine, Plane, RegionOfInterest};
use lightpath_proto::v1;
use lightpath_proto::v1::finding::Kind;
use lightpath_proto::v1::job_spec;
use lightpath_proto::v1::prepare_dataset::{Finalize, Step};

const PAIRS: usize = 16;
/// The pair whose photograph shows another hologram.
const WRONG: usize = 4;
/// Fraction of the pixels in the region of interest that the camera saturates.
const SATURATED: f64 = 0.02;
/// Cards that no training hologram shows.
const HELD_OUT: [TestCard; 3] = [TestCard::Portrait, TestCard::Planet, TestCard::Leaf];

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn display_is_learned_from_turned_overexposed_and_swapped_photographs() {
    let (bench, mut dataset) = (TestBench::new(3), Dataset::open().await);
    let map = Homography::similarity(CENTRE, 1.0_f64.to_radians(), 1.0, [2.0, 0.0]);
    let cards: Vec<TestCard> = TestCard::ALL.into_iter().filter(|card| !HELD_OUT.contains(card)).collect();
    let target = |n: usize| cards[n % cards.len()].render(HEIGHT, WIDTH, n as u64).unwrap();
    for n in 0..PAIRS {
        let phase = bench.phase(&target(n), 30);
        let light = bench.light(&if n == WRONG { bench.phase(&target(PAIRS), 30) } else { phase.clone() });
        let photo = bench.expose(&overexposed(&light, bench.region()), n as u64, &map, HEIGHT, WIDTH);
        dataset.add(&format!("p{n}"), &phase, &photo).await;
    }
    // Without validation pairs learning is shorter.
    let finalize = Step::Finalize(Finalize { validation_fraction: Some(0.0), ..Default::default() });
    let finalized = prepare(&dataset.serving, "datasets/d", finalize).await.unwrap();
    let reported = |kind: Kind| finalized.findings.iter().filter(move |finding| finding.kind() == kind);
    assert_eq!(reported(Kind::WrongHologram).map(|finding| finding.pair.as_str()).collect::<Vec<_>>(), ["p4"]);
    assert!(reported(Kind::Saturated).count() >= PAIRS - 1, "{:?}", finalized.findings);
    let alignment = finalized.alignment.as_ref().expect("the photographs are turned");

    let learn = v1::LearnKernel { datasets: vec!["datasets/d".into()], degree: Some(5), ..Default::default() };
    let job = submit(&dataset.serving, job_spec::Kind::LearnKernel(learn), "").await.unwrap();
    let job = watch_to_end(&dataset.serving, &job.name).await;
    let Some(v1::job_result::Kind::LearnKernel(learned)) = job.result.clone().and_then(|result| result.kind) else {
        panic!("{job:?}")
    };
    let (kernel, version) = learned.kernels[0].kernel_version.split_once("/versions/").unwrap();
    let (_, file) = fetch_version(&dataset.serving, kernel, version.parse().unwrap()).await.unwrap();
    let engine = Engine::new(&kernel_file::decode(&file).unwrap().0, Detector::Pixel, None).unwrap();

    // Photographs of new holograms by the same camera, resampled to the display's pixels with the alignment of the
    // dataset.
    let found = Homography::try_new(alignment.homography.clone().try_into().unwrap()).unwrap();
    let captured_db = |engine: &Engine, target: &Plane<f32>, seed: u64| {
        let photo = bench.photo(&bench.phase_through(engine, target, 60), seed, &map, HEIGHT, WIDTH);
        psnr_db(&warp(&photo, &found, HEIGHT, WIDTH, 9.0, 0.0), target, bench.region(), Gain::Fitted).unwrap()
    };
    for (card, seed) in HELD_OUT.into_iter().zip(100..) {
        let target = card.render(HEIGHT, WIDTH, seed).unwrap();
        let [ideal, learned] = [&bench.engine, &engine].map(|engine| captured_db(engine, &target, seed));
        assert!(learned > ideal + 9.0, "{card:?}: {learned} dB after {ideal} dB");
    }
}

/// Light with a longer exposure: the fraction [`SATURATED`] of the region exceeds the full scale of the camera.
fn overexposed(light: &Plane<f32>, region: RegionOfInterest) -> Plane<f32> {
    let rows = (0..HEIGHT).filter_map(|y| region.columns(y).map(|columns| &light.row(y)[columns]));
    let mut values: Vec<f32> = rows.flatten().copied().collect();
    values.sort_by(f32::total_cmp);
    let brightest_seen = values[(values.len() as f64 * (1.0 - SATURATED)) as usize];
    light.map(|value| value / brightest_seen)
}
