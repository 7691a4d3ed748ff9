//! Test with thousands of malformed requests. Each must get an allowed status, and the server must keep answering.

use crate::mutation::{Random, add_to_corpus, mutated, with_changed_fields};
use crate::raw::{call, methods};
use crate::serving::{Serving, small_display};
use futures::stream::{self, StreamExt as _};
use lightpath_media::pictures;
use lightpath_optics::Plane;
use lightpath_proto::v1::{self, job_spec};
use prost::Message as _;
use std::collections::BTreeMap;
use std::io::Write as _;
use tonic::{Code, Status};

const REQUESTS: u64 = 10_000;
const AT_ONCE: usize = 32;

/// Whether this answer is allowed for a malformed message. Some messages are still valid after their changes.
fn is_allowed(answer: &Result<(), Status>) -> bool {
    match answer.as_ref().map_err(Status::code) {
        Ok(()) => true,
        Err(
            Code::InvalidArgument
            | Code::NotFound
            | Code::AlreadyExists
            | Code::FailedPrecondition
            | Code::Aborted
            | Code::OutOfRange
            | Code::ResourceExhausted,
        ) => true,
        // gRPC requires INTERNAL for bytes that cannot be decoded.
        Err(Code::Internal) => answer.as_ref().is_err_and(|status| status.message().contains("failed to decode")),
        Err(_) => false,
    }
}

/// Valid messages for the methods that check many fields.
fn seeds(target: &str, spot: &str) -> Vec<(&'static str, Vec<u8>)> {
    let display = || {
        Some(v1::Display {
            bench: Some(v1::display::Bench::SimulatedBench(v1::SimulatedBench::default())),
            ..small_display("other")
        })
    };
    let spec = v1::OptimizeHologram {
        display: "displays/lab".into(),
        planes: vec![v1::optimize_hologram::ImagePlane {
            place: Some(v1::Place::at_m(0.05)),
            target: target.to_owned(),
            weight: None,
        }],
        iterations: Some(1),
        ..Default::default()
    };
    let spec = Some(v1::JobSpec { kind: Some(job_spec::Kind::OptimizeHologram(spec)) });
    let dataset = v1::Dataset {
        name: "datasets/bench".into(),
        display: "displays/lab".into(),
        place: Some(v1::Place::at_m(0.05)),
        ..Default::default()
    };
    let pair = v1::Pair { id: "p".into(), pattern: target.to_owned(), photo: target.to_owned(), ..Default::default() };
    let plan = v1::PlanPropagationRequest {
        display: "displays/lab".into(),
        place: Some(v1::Place::at_m(0.05)),
        ..Default::default()
    };
    let fetch = v1::FetchKernelRequest { kernel: "displays/lab/kernels/515nm-50mm".into(), ..Default::default() };
    let read = v1::ReadArtifactRequest { digest: target.to_owned(), offset_bytes: 1, limit_bytes: Some(5) };
    let list = v1::ListJobsRequest { page_size: 7, display: "displays/lab".into(), ..Default::default() };
    // Finding a target in a photograph takes a while. It is soon found in a spot.
    let score = v1::ScorePhotoRequest { photo: spot.to_owned(), target: spot.to_owned(), ..Default::default() };
    vec![
        ("CreateDisplay", v1::CreateDisplayRequest { display: display() }.encode_to_vec()),
        ("SubmitJob", v1::SubmitJobRequest { spec, batch: "night".into(), ..Default::default() }.encode_to_vec()),
        ("CreateDataset", v1::CreateDatasetRequest { dataset: Some(dataset) }.encode_to_vec()),
        ("AddPairs", v1::AddPairsRequest { dataset: "datasets/bench".into(), pairs: vec![pair] }.encode_to_vec()),
        ("PlanPropagation", plan.encode_to_vec()),
        ("FetchKernel", fetch.encode_to_vec()),
        ("ReadArtifact", read.encode_to_vec()),
        ("ListJobs", list.encode_to_vec()),
        ("ScorePhoto", score.encode_to_vec()),
    ]
}

/// Messages in the form that `fuzz/fuzz_targets/requests.rs` reads: one byte with the number of the method, then the
/// message.
fn with_method_numbers(seeds: &[(&str, Vec<u8>)], methods: &[String]) -> Vec<Vec<u8>> {
    let number = |name: &str| methods.iter().position(|path| path.ends_with(&format!("/{name}"))).unwrap() as u8;
    seeds.iter().map(|(name, seed)| [&[number(name)], &seed[..]].concat()).collect()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn malformed_requests_get_the_right_status() {
    let serving = Serving::start_with(|config| config.calls_per_s_max = 0).await;
    serving.display("lab").await;
    let ramp = |height_px, width_px| {
        pictures::grey_png_srgb(&Plane::from_fn(height_px, width_px, |y, x| (y + x) as f32 / 120.0)).unwrap()
    };
    let picture = ramp(48, 64);
    let (target, spot) = (serving.upload(&picture).await, serving.upload(&ramp(8, 8)).await);
    let (methods, seeds) = (methods(), seeds(&target, &spot));
    add_to_corpus("requests", &with_method_numbers(&seeds, &methods));
    let texts: Vec<Vec<u8>> = seeds.iter().map(|(_, seed)| seed.clone()).collect();
    let (channel, methods, seeds, texts) = (&serving.channel, &methods, &seeds, &texts);
    let answers = stream::iter(0..REQUESTS).map(|n| async move {
        let mut random = Random::new(n);
        let (name, seed) = &seeds[random.below(seeds.len())];
        let seed_method = || methods.iter().find(|path| path.ends_with(&format!("/{name}"))).unwrap();
        // Most requests can be decoded and have invalid values. The others cannot be decoded, or belong to another
        // method.
        let (path, message) = match n % 4 {
            0 | 1 => (seed_method(), with_changed_fields(seed, &mut random)),
            2 => (seed_method(), mutated(seed, texts, &mut random)),
            _ => (&methods[random.below(methods.len())], with_changed_fields(seed, &mut random)),
        };
        let answer = call(channel, path, message.clone()).await;
        assert!(is_allowed(&answer), "{path} with {message:02x?}: {answer:?}");
        answer.err().map_or(Code::Ok, |status| status.code())
    });
    let answers: Vec<Code> = answers.buffer_unordered(AT_ONCE).collect().await;
    let mut counts = BTreeMap::<String, u32>::new();
    for code in answers {
        *counts.entry(format!("{code:?}")).or_default() += 1;
    }
    writeln!(std::io::stderr(), "{REQUESTS} malformed requests: {counts:?}").unwrap();
    assert!(counts["InvalidArgument"] > 2000 && counts["Internal"] > 500, "{counts:?}");
    assert_eq!(serving.read(&target).await, picture, "the server still answers");
    serving.stop().await.unwrap();
}
