//! Test of every file form of every model: what a fetched file holds, an import restores; what it does not hold, the
//! fetch has said.

use crate::interpolation::create_dataset_at;
use crate::kernels::client;
use crate::preparing::run_job;
use crate::serving::Serving;
use lightpath_proto::v1::fetch_kernel_response::Part;
use lightpath_proto::v1::job_result::Kind as JobResult;
use lightpath_proto::v1::job_spec::Kind;
use lightpath_proto::v1::kernel_lineage::import::Original;
use lightpath_proto::v1::kernel_lineage::{Import, Origin};
use lightpath_proto::v1::{self, KernelFormat, KernelModel};
use tonic::{Code, Status};

const KERNEL: &str = "displays/lab/kernels/515nm-4mm";
const MODELS: [KernelModel; 5] =
    [KernelModel::Paper, KernelModel::Dense, KernelModel::Smooth, KernelModel::Display, KernelModel::Varying];
const FORMS: [KernelFormat; 8] = [
    KernelFormat::Safetensors,
    KernelFormat::Compact,
    KernelFormat::Pt,
    KernelFormat::Npy,
    KernelFormat::Npz,
    KernelFormat::Complex64,
    KernelFormat::F16,
    KernelFormat::Bundle,
];

/// The file of a version in a form, and what the form loses.
async fn fetch(serving: &Serving, version: u32, form: KernelFormat) -> Result<(Vec<u8>, v1::KernelFile), Status> {
    let request = v1::FetchKernelRequest {
        kernel: KERNEL.into(),
        version: Some(version),
        format: form.into(),
        ..Default::default()
    };
    let mut stream = client(serving).fetch_kernel(request).await?.into_inner();
    let (mut bytes, mut file) = (Vec::new(), v1::KernelFile::default());
    while let Some(message) = stream.message().await? {
        match message.part {
            Some(Part::Chunk(chunk)) => bytes.extend_from_slice(&chunk),
            Some(Part::File(said)) => file = said,
            _ => {}
        }
    }
    Ok((bytes, file))
}

async fn import(serving: &Serving, display: &str, bytes: &[u8], any: bool) -> Result<v1::KernelVersion, Status> {
    let request = v1::ImportKernelRequest {
        display: display.to_owned(),
        place: Some(v1::Place::at_m(4e-3)),
        artifact: serving.upload(bytes).await,
        from_another_display: any,
        ..Default::default()
    };
    Ok(client(serving).import_kernel(request).await?.into_inner())
}

/// Loss of a version, as a sum over the photographs.
async fn loss(serving: &Serving, dataset: &str, version: u32) -> f64 {
    let kernel = Some(v1::KernelChoice::version(format!("{KERNEL}/versions/{version}")));
    let spec = v1::EvaluateKernel { dataset: dataset.to_owned(), kernel, ..Default::default() };
    match run_job(serving, Kind::EvaluateKernel(spec)).await.unwrap() {
        JobResult::EvaluateKernel(result) => result.pairs.iter().map(|pair| pair.loss).sum(),
        other => panic!("{other:?}"),
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn every_form_of_every_model_is_restored_or_its_losses_are_announced() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    let dataset = create_dataset_at(&serving, 4).await;
    let mut restored = 0;
    for model in MODELS {
        let learn = v1::LearnKernel {
            datasets: vec![dataset.clone()],
            model: model.into(),
            degree: (!matches!(model, KernelModel::Paper | KernelModel::Dense)).then_some(4),
            epochs: Some(3),
            ..Default::default()
        };
        let JobResult::LearnKernel(learned) = run_job(&serving, Kind::LearnKernel(learn)).await.unwrap() else {
            panic!()
        };
        let name = &learned.kernels[0].kernel_version;
        let version: u32 = name.rsplit('/').next().unwrap().parse().unwrap();
        let before = loss(&serving, &dataset, version).await;
        for form in FORMS {
            let (bytes, file) = match fetch(&serving, version, form).await {
                Ok(fetched) => fetched,
                Err(status) => {
                    let is_frequencies = matches!(model, KernelModel::Paper | KernelModel::Dense);
                    assert!(is_frequencies && form == KernelFormat::Compact, "{model:?} {form:?}: {status:?}");
                    assert_eq!(status.code(), Code::FailedPrecondition);
                    continue;
                }
            };
            let back = import(&serving, "displays/lab", &bytes, false).await.unwrap();
            let after = loss(&serving, &dataset, back.version).await;
            let change = (after / before - 1.0).abs();
            let lost: Vec<&str> = file.losses.iter().map(|loss| loss.name.as_str()).collect();
            let about = format!("{model:?} {form:?}: {before} {after} {lost:?} {:e}", file.relative_error);
            match lost[..] {
                // The form said that it loses nothing, or only digits of the numbers.
                [] => assert_eq!(before, after, "{about}"),
                ["precision"] => assert!(change < 0.02, "{about}"),
                // H remains at each frequency, but no series.
                ["parameters", "precision"] => assert!(change < 0.02, "{about}"),
                _ => {}
            }
            restored += u32::from(lost.is_empty());
            if form == KernelFormat::Bundle {
                let metrics = back.metrics.unwrap();
                assert_eq!(metrics.test_loss, learned.kernels[0].metrics.as_ref().unwrap().test_loss, "{about}");
            }
        }
    }
    // safetensors, npz and bundles hold all of every model.
    assert_eq!(restored, 15);
    serving.stop().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_bundle_brings_all_of_a_version_to_another_server() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    let dataset = create_dataset_at(&serving, 4).await;
    let learn = v1::LearnKernel { datasets: vec![dataset], degree: Some(4), epochs: Some(2), ..Default::default() };
    run_job(&serving, Kind::LearnKernel(learn)).await.unwrap();
    let (bundle, file) = fetch(&serving, 1, KernelFormat::Bundle).await.unwrap();
    assert_eq!((file.losses.len(), file.relative_error), (0, 0.0));
    let get = v1::GetKernelVersionRequest { name: format!("{KERNEL}/versions/1") };
    let first = client(&serving).get_kernel_version(get).await.unwrap().into_inner();

    let other = Serving::start().await;
    for display in ["lab", "lab-3"] {
        other.display(display).await;
    }
    let same = import(&other, "displays/lab", &bundle, false).await.unwrap();
    assert_eq!((&same.artifact, &same.metrics, same.model), (&first.artifact, &first.metrics, first.model));
    let Some(Origin::Learned(learned)) = first.lineage.unwrap().origin else { panic!("it was learned here") };
    assert_eq!(learned.parameters.unwrap().degree, Some(4));
    let lineage = same.lineage.clone().unwrap();
    let Some(Origin::Imported(file)) = lineage.origin.clone() else { panic!("{lineage:?}") };
    assert_eq!((file.format(), &file.original_version, &*file.note), (KernelFormat::Bundle, &first.name, ""));
    assert_eq!((file.original_create_time, file.original), (first.create_time, Some(Original::Learned(learned))));

    // A bundle of the imported version names the server that learned it.
    let (again, _) = fetch(&other, 1, KernelFormat::Bundle).await.unwrap();
    let twice = import(&other, "displays/lab", &again, false).await.unwrap();
    let Some(Origin::Imported(passed_on)) = twice.lineage.unwrap().origin else { panic!("it was imported") };
    let Some(Origin::Imported(file)) = lineage.origin else { panic!("it was imported") };
    assert_eq!(passed_on, Import { artifact: passed_on.artifact.clone(), ..file });

    let refused = import(&other, "displays/lab-3", &bundle, false).await.unwrap_err();
    assert_eq!(refused.code(), Code::InvalidArgument);
    assert!(
        refused.message().contains("is a kernel of displays/lab, but must be one of displays/lab-3"),
        "{refused:?}"
    );
    let accepted = import(&other, "displays/lab-3", &bundle, true).await.unwrap();
    assert_ne!(accepted.artifact, first.artifact, "the file names its new display");
    assert_eq!(accepted.metrics, None, "photographs of another display say nothing about this one");
    let npz = fetch(&serving, 1, KernelFormat::Npz).await.unwrap().0;
    assert_eq!(import(&other, "displays/lab-3", &npz, false).await.unwrap_err().code(), Code::InvalidArgument);
    for serving in [serving, other] {
        serving.stop().await.unwrap();
    }
}
