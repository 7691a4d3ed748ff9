//! Tests of datasets with imperfect photographs: turned, shifted, black, of wrong sizes or of other holograms.
//!
//! The runtime of these tests has two threads, so that the server can answer while a test computes.

use crate::preparing::assert_refused;
use crate::serving::expect;
use crate::test_bench::{CENTRE, Dataset, HEIGHT, TestBench, WIDTH, levels};
use lightpath_camera::alignment::Homography;
use lightpath_media::pictures;
use lightpath_optics::Plane;
use lightpath_proto::v1;
use lightpath_proto::v1::finding::Kind;
use lightpath_proto::v1::prepare_dataset::align::{ByPairs, NoAlignment, Source};
use tonic::Code;

/// Largest distance between two maps in the region of interest \[px of the display\].
fn largest_distance_px(found: &v1::Alignment, truth: &Homography) -> f64 {
    let found = Homography::try_new(found.homography.clone().try_into().unwrap()).unwrap();
    let back = truth.inverse();
    [[40.0, 22.0], [344.0, 22.0], CENTRE, [40.0, 194.0], [344.0, 194.0]]
        .map(|point| {
            let there = back.apply(found.apply(point));
            (there[0] - point[0]).hypot(there[1] - point[1])
        })
        .into_iter()
        .fold(0.0, f64::max)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn turned_and_shifted_photographs_are_aligned_and_a_wrong_one_is_excluded() {
    let (bench, mut dataset) = (TestBench::new(3), Dataset::open().await);
    let map = Homography::similarity(CENTRE, 1.0_f64.to_radians(), 1.0, [2.0, 0.0]);
    let phases: Vec<_> = (0..6).map(|card| bench.hologram(card)).collect();
    for (n, phase) in phases.iter().enumerate() {
        let shown = if n == 4 { &bench.hologram(7) } else { phase };
        dataset.add(&format!("p{n}"), phase, &bench.photo(shown, n as u64, &map, HEIGHT, WIDTH)).await;
    }
    let finalized = dataset.finalize().await.unwrap();
    let alignment = finalized.alignment.as_ref().expect("an alignment");
    assert_eq!(alignment.method(), v1::alignment::Method::Pairs);
    // The display's own aberrations displace the image by some tenths of a pixel. The alignment need not correct this.
    let error = largest_distance_px(alignment, &map);
    assert!(error < 0.6, "{error} px off");
    assert!((1.9..3.5).contains(&alignment.corrected_px), "{}", alignment.corrected_px);
    let [cosine, minus_sine, _, sine, ..] = alignment.homography[..] else { panic!("{alignment:?}") };
    assert!((sine + minus_sine).abs() < 1e-9 && (cosine.hypot(sine) - 1.0).abs() < 1e-9, "only turned: {alignment:?}");
    assert!(alignment.explanation.starts_with("corrects a shift of"), "{}", alignment.explanation);
    for picture in [&alignment.before, &alignment.after] {
        let request = v1::GetArtifactRequest { digest: picture.clone() };
        assert!(dataset.serving.artifacts().get_artifact(request).await.unwrap().into_inner().size_bytes > 1000);
    }
    let wrong: Vec<_> = finalized.findings.iter().filter(|finding| finding.kind() == Kind::WrongHologram).collect();
    assert_eq!(wrong.iter().map(|finding| finding.pair.as_str()).collect::<Vec<_>>(), ["p4"], "{wrong:?}");
    let splits: Vec<_> = finalized.pairs.iter().map(v1::Pair::split).collect();
    assert_eq!(splits.iter().filter(|split| **split == v1::Split::Excluded).count(), 1);
    // By default a fifth of the pairs is for validation.
    assert_eq!(splits.iter().filter(|split| **split == v1::Split::Validation).count(), 1);
    let few: Vec<_> = finalized.findings.iter().filter(|finding| finding.kind() == Kind::FewPairs).collect();
    assert_eq!(few.len(), 2, "1 pair for validation and 3 to learn from: {few:?}");
    assert_eq!(finalized.pairs[4].split(), v1::Split::Excluded);
    let good = finalized.pairs.iter().filter(|pair| pair.id != "p4");
    let left: Vec<_> = good.map(|pair| pair.checks.unwrap().misalignment_px).collect();
    assert!(left.iter().flatten().all(|px| *px < 0.7) && left.iter().flatten().count() >= 4, "{left:?}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn photograph_of_the_dots_aligns_photographs_of_any_size() {
    let (bench, mut dataset) = (TestBench::new(5), Dataset::open().await);
    let request = v1::CreateCalibrationTargetRequest { display: "displays/bench".into(), picture: None };
    let target = dataset.client.create_calibration_target(request).await.unwrap().into_inner();
    assert!(target.columns() >= 14 && target.rows() >= 8, "{target:?}");
    let dots = lightpath_camera::alignment::DotGrid::of_display(HEIGHT, WIDTH).unwrap().target();
    let map = Homography::try_new([1.3, 0.05, 40.0, -0.04, 1.35, 30.0, 6e-5, -4e-5, 1.0]).unwrap();
    let (height, width) = (380, 600);
    let photo = bench.photo(&bench.phase(&dots, 60), 1, &map, height, width);
    let digest = dataset.serving.upload(&pictures::grey_png_linear(&photo).unwrap()).await;
    let aligned = dataset.align(Source::DotsPhoto(digest)).await.unwrap();
    let alignment = aligned.alignment.clone().unwrap();
    assert_eq!((alignment.method(), alignment.photo_width_px), (v1::alignment::Method::Dots, 600));
    let error = largest_distance_px(&alignment, &map);
    assert!(error < 0.6, "{error} px off, {alignment:?}");

    let phase = bench.hologram(0);
    let added = dataset.add("p0", &phase, &bench.photo(&phase, 2, &map, height, width)).await;
    assert!(added.findings.iter().all(|finding| !finding.excludes), "{:?}", added.findings);
    // Photographs of the display's size no longer fit.
    let other = dataset.serving.upload(&pictures::grey_png_linear(&Plane::filled(HEIGHT, WIDTH, 0.5)).unwrap()).await;
    let hologram = dataset.serving.upload(&pictures::levels_png(&levels(&bench.hologram(1)), 8).unwrap()).await;
    let pair = v1::Pair { id: "p1".into(), pattern: hologram, photo: other, ..Default::default() };
    let request = v1::AddPairsRequest { dataset: "datasets/d".into(), pairs: vec![pair] };
    let answer = dataset.client.add_pairs(request).await;
    assert!(answer.as_ref().unwrap_err().message().contains("600×380"), "{answer:?}");
    expect(answer, Code::InvalidArgument, "pairs[0].photo (sha256-");
    let answer = dataset.align(Source::None(NoAlignment {})).await;
    assert_refused(answer, "ALIGNMENT_SIZE: pair \"p0\" has a photograph of 600×380 px");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn valid_points_align_and_invalid_points_are_refused() {
    let mut dataset = Dataset::open().await;
    let corners = [[0.0, 0.0], [383.0, 0.0], [0.0, 215.0], [383.0, 215.0]];
    let points = |count: usize, on_a_line: bool| {
        let point = |[x, y]: [f64; 2]| v1::AlignmentPoint {
            display_x_px: x,
            display_y_px: if on_a_line { x } else { y },
            photo_x_px: 2.0 * x + 10.0,
            photo_y_px: 2.0 * y + 7.0,
        };
        Source::Points(v1::AlignmentPoints {
            photo_width_px: 800,
            photo_height_px: 460,
            points: corners.iter().take(count).map(|corner| point(*corner)).collect(),
        })
    };
    let field = "spec.prepare_dataset.align.points.points";
    assert_refused(
        dataset.align(points(3, false)).await,
        &format!("{field} does not define an alignment: there are 3 points"),
    );
    assert_refused(
        dataset.align(points(4, true)).await,
        &format!("{field} does not define an alignment: the points lie on a line"),
    );
    assert_refused(
        dataset.align(Source::Pairs(ByPairs {})).await,
        "spec.prepare_dataset.dataset: datasets/d has no pairs",
    );
    let aligned = dataset.align(points(4, false)).await.unwrap();
    let truth = Homography::try_new([2.0, 0.0, 10.0, 0.0, 2.0, 7.0, 0.0, 0.0, 1.0]).unwrap();
    assert!(largest_distance_px(&aligned.alignment.clone().unwrap(), &truth) < 1e-6);
    let plain = dataset.align(Source::None(NoAlignment {})).await.unwrap();
    assert!(plain.alignment.is_none());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn unusable_datasets_are_refused_with_the_reason() {
    let bench = TestBench::new(1);
    let phases: Vec<_> = (0..5).map(|card| bench.hologram(card)).collect();
    let photograph = |phase: &Plane<f32>, n: u64| bench.photo(phase, n, &Homography::IDENTITY, HEIGHT, WIDTH);

    let mut dataset = Dataset::open().await;
    assert_refused(dataset.finalize().await, "spec.prepare_dataset.dataset: datasets/d has no pairs");
    // One pixel with two levels of 255 makes each photograph different from the others. All of them count as black.
    let dark = |n: usize| Plane::from_fn(HEIGHT, WIDTH, |y, x| if (y, x) == (0, n) { 0.008 } else { 0.0 });
    for (n, phase) in phases.iter().enumerate() {
        let added = dataset.add(&format!("p{n}"), phase, &dark(n)).await;
        assert_eq!(added.findings[0].kind(), Kind::Black);
    }
    assert_refused(dataset.finalize().await, "DATASET_UNUSABLE: 5 of 5 photographs of datasets/d are black");

    let mut dataset = Dataset::open().await;
    for (n, phase) in phases.iter().enumerate() {
        dataset.add(&format!("p{n}"), phase, &photograph(&phases[(n + 1) % phases.len()], n as u64)).await;
    }
    let message = dataset.finalize().await.unwrap_err();
    assert!(message.contains("photographs of datasets/d show other holograms than theirs"), "{message}");

    // One black photograph is excluded. The remaining pairs are enough to learn from.
    let mut dataset = Dataset::open().await;
    for (n, phase) in phases.iter().enumerate() {
        let photo = if n == 1 { dark(n) } else { photograph(phase, n as u64) };
        dataset.add(&format!("p{n}"), phase, &photo).await;
    }
    let finalized = dataset.finalize().await.unwrap();
    assert_eq!(finalized.pairs[1].split(), v1::Split::Excluded);
    let excluded = finalized.pairs.iter().filter(|pair| pair.split() == v1::Split::Excluded).count();
    assert_eq!(excluded, 1, "{:?}", finalized.findings);
    assert!(finalized.alignment.is_none(), "photographs that are aligned need no alignment: {:?}", finalized.alignment);
    let again = dataset.finalize().await.unwrap();
    assert_eq!(again.digest, finalized.digest);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn non_finite_values_and_wrong_sizes_are_refused_when_added() {
    let mut dataset = Dataset::open().await;
    let phase = Plane::from_fn(HEIGHT, WIDTH, |y, x| (y * x % 7) as f32);
    let hologram = dataset.serving.upload(&pictures::levels_png(&levels(&phase), 8).unwrap()).await;
    let mut broken = Plane::filled(HEIGHT, WIDTH, 0.5_f32);
    broken.values_mut()[WIDTH + 3] = f32::NAN;
    let cases = [
        (pictures::npy_f32(&broken).unwrap(), "not a finite number, at x = 3 px, y = 1 px"),
        (pictures::npy_f32(&Plane::filled(HEIGHT, WIDTH - 1, 0.5)).unwrap(), "383×216 px, but must have 384×216 px"),
    ];
    for (file, expected) in cases {
        let photo = dataset.serving.upload(&file).await;
        let pair = v1::Pair { id: "p".into(), pattern: hologram.clone(), photo, ..Default::default() };
        let request = v1::AddPairsRequest { dataset: "datasets/d".into(), pairs: vec![pair] };
        let answer = dataset.client.add_pairs(request).await;
        assert!(answer.as_ref().unwrap_err().message().contains(expected), "{answer:?}");
        expect(answer, Code::InvalidArgument, "pairs[0].photo (sha256-");
    }
    // A hologram can be an array of radians. Values that are not finite are refused.
    let photo = dataset.serving.upload(&pictures::npy_f32(&Plane::filled(HEIGHT, WIDTH, 0.5)).unwrap()).await;
    for (plane, good) in [(&broken, false), (&phase, true)] {
        let hologram = dataset.serving.upload(&pictures::npy_f32(plane).unwrap()).await;
        let pair = v1::Pair { id: "p".into(), pattern: hologram, photo: photo.clone(), ..Default::default() };
        let request = v1::AddPairsRequest { dataset: "datasets/d".into(), pairs: vec![pair] };
        let answer = dataset.client.add_pairs(request).await;
        if good {
            answer.unwrap();
        } else {
            expect(answer, Code::InvalidArgument, "pairs[0].pattern (sha256-");
        }
    }
}
