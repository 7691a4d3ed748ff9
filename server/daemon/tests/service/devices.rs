//! Holograms on a graphics card. Where there is none, Mesa's driver that computes on the processor stands for it.

use crate::holograms::hologram;
use crate::jobs::{optimize, picture, submit, watch_to_end};
use crate::serving::Serving;
use lightpath_gpu::DeviceChoice;
use lightpath_proto::judgements::judgement;
use lightpath_proto::v1::judgement::Stage;
use lightpath_proto::v1::{self, HologramMethod, job_spec};
use lightpath_server::config::Config;
use lightpath_server::server;
use std::future::pending;
use tokio::net::TcpListener;

#[tokio::test]
async fn hologram_from_a_card_is_as_good_and_its_result_names_the_card() {
    assert!(!lightpath_gpu::cards().is_empty(), "a Vulkan driver is needed, such as Debian's mesa-vulkan-drivers");
    let run = async |device| {
        let serving = Serving::start_with(|config| config.device = device).await;
        serving.display("lab").await;
        let target = serving.upload(&picture()).await;
        let mut results = Vec::new();
        for method in [HologramMethod::Lbfgs, HologramMethod::Adam] {
            let spec = v1::OptimizeHologram { iterations: Some(20), method: method as i32, ..optimize(&target) };
            let job = submit(&serving, job_spec::Kind::OptimizeHologram(spec), &format!("{method:?}")).await.unwrap();
            let job = watch_to_end(&serving, &job.name).await;
            assert_eq!(job.state(), v1::job::State::Succeeded, "{job:?}");
            results.push(hologram(&job).clone());
        }
        let queue = serving.jobs().get_queue(v1::GetQueueRequest {}).await.unwrap().into_inner();
        let labels = queue.processes[0].labels.clone();
        serving.stop().await.unwrap();
        (results, labels)
    };
    let (on_processor, no_labels) = run(DeviceChoice::Cpu).await;
    let (on_card, labels) = run(DeviceChoice::Gpu(0)).await;
    assert_eq!((no_labels, labels), (vec![], vec!["gpu".to_owned()]));
    let name = lightpath_gpu::cards()[0].to_string();
    let psnr_db = |result: &v1::OptimizeHologramResult| {
        let judgements = &result.wavelengths[0].planes[0].judgements;
        judgement(judgements, Stage::Optimized, v1::Detector::Pixel).unwrap().psnr()
    };
    for (on_card, on_processor) in on_card.iter().zip(&on_processor) {
        assert_eq!((on_card.computed_by.as_str(), on_processor.computed_by.as_str()), (name.as_str(), ""));
        let (found, wanted) = (psnr_db(on_card), psnr_db(on_processor));
        assert!((found - wanted).abs() < 0.1, "{found} dB, {wanted} dB");
    }
}

#[tokio::test]
async fn server_does_not_start_with_a_card_that_is_not_there() {
    let folder = tempfile::tempdir().unwrap();
    let config = Config { data_dir: folder.path().join("data"), device: DeviceChoice::Gpu(99), ..Config::default() };
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let error = server::run(listener, config, pending()).await.unwrap_err().to_string();
    assert!(error.contains("device is gpu:99, but there is no graphics card number 99"), "{error}");
}
