//! Pairs of a dataset: adding many with one call, and reading them by pages.

use crate::serving::expect;
use crate::test_bench::{Dataset, HEIGHT, TestBench, WIDTH, levels};
use lightpath_camera::alignment::Homography;
use lightpath_media::pictures;
use lightpath_optics::Plane;
use lightpath_proto::v1;
use tonic::Code;

/// Uploads a hologram with a photograph that shows it, or something else.
async fn pair(dataset: &Dataset, bench: &TestBench, n: usize, photo: Option<Plane<f32>>) -> v1::Pair {
    let phase = bench.hologram(n);
    let photo = photo.unwrap_or_else(|| bench.photo(&phase, n as u64, &Homography::IDENTITY, HEIGHT, WIDTH));
    v1::Pair {
        id: format!("p{n}"),
        pattern: dataset.serving.upload(&pictures::levels_png(&levels(&phase), 8).unwrap()).await,
        photo: dataset.serving.upload(&pictures::grey_png_linear(&photo).unwrap()).await,
        ..Default::default()
    }
}

fn add(pairs: &[v1::Pair]) -> v1::AddPairsRequest {
    v1::AddPairsRequest { dataset: "datasets/d".into(), pairs: pairs.to_vec() }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn pairs_are_added_together_or_not_at_all_and_every_wrong_field_is_named() {
    let (bench, mut dataset) = (TestBench::new(3), Dataset::open().await);
    let black = Plane::filled(HEIGHT, WIDTH, 0.0);
    let good = [pair(&dataset, &bench, 0, None).await, pair(&dataset, &bench, 1, Some(black)).await];
    let small = dataset.serving.upload(&pictures::grey_png_linear(&Plane::filled(9, 9, 0.5)).unwrap()).await;

    let odd = v1::Pair { id: "a/b".into(), black_level: 2.0, photo: String::new(), ..good[0].clone() };
    let refused = dataset.client.add_pairs(add(&[good[0].clone(), odd])).await.unwrap_err();
    let wrong = ["pairs[1].id", "pairs[1].photo", "pairs[1].black_level"];
    assert!(wrong.iter().all(|field| refused.message().contains(field)), "{refused:?}");
    let small = |id: &str| v1::Pair { id: id.into(), photo: small.clone(), ..good[0].clone() };
    expect(
        dataset.client.add_pairs(add(&[])).await,
        Code::InvalidArgument,
        "pairs has 0 pairs, but must have 1 to 500",
    );
    let twice = dataset.client.add_pairs(add(&[good[0].clone(), small("p0")])).await;
    assert!(twice.as_ref().unwrap_err().message().contains("pairs[1].id is that of pairs[0]"), "{twice:?}");
    let refused = dataset.client.add_pairs(add(&[good[1].clone(), small("x")])).await;
    expect(refused, Code::InvalidArgument, "pairs[1].photo (sha256-");
    let get = v1::GetDatasetRequest { name: "datasets/d".into() };
    assert_eq!(dataset.client.get_dataset(get.clone()).await.unwrap().into_inner().pair_count, 0, "none was added");

    let added = dataset.client.add_pairs(add(&good)).await.unwrap().into_inner();
    assert_eq!(added.pairs.iter().map(|pair| pair.id.as_str()).collect::<Vec<_>>(), ["p0", "p1"]);
    assert_eq!(added.pairs[1].findings[0].kind(), v1::finding::Kind::Black);
    assert!(added.pairs[0].checks.unwrap().correlation.unwrap() > 0.5);
    // A call whose answer was lost is repeated: it adds nothing, and has the same answer.
    assert_eq!(dataset.client.add_pairs(add(&good)).await.unwrap().into_inner(), added);
    assert_eq!(Some(dataset.client.get_dataset(get).await.unwrap().into_inner()), added.dataset);

    let list = |page_token: &str, with_findings| v1::ListPairsRequest {
        dataset: "datasets/d".into(),
        page_size: 1,
        page_token: page_token.into(),
        with_findings,
    };
    let first = dataset.client.list_pairs(list("", false)).await.unwrap().into_inner();
    let second = dataset.client.list_pairs(list(&first.next_page_token, false)).await.unwrap().into_inner();
    assert_eq!(([first.pairs, second.pairs].concat(), second.next_page_token.as_str()), (added.pairs.clone(), ""));
    let found = dataset.client.list_pairs(list("", true)).await.unwrap().into_inner();
    assert_eq!((found.pairs, found.next_page_token), (added.pairs[1..].to_vec(), String::new()));
    let other = dataset.client.list_pairs(list(&first.next_page_token, true)).await;
    expect(other, Code::InvalidArgument, "page_token is unknown");
}
