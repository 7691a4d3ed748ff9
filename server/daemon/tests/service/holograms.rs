//! Tests of hologram jobs: their files and quality, their judgement, and their results after a restart.

use crate::jobs::{optimize, picture, submit, watch_to_end};
use crate::kernels::{client, import, kernel};
use crate::serving::{Serving, expect, small_display};
use lightpath_proto::judgements::{judgement, opinions, other_orders};
use lightpath_proto::v1::optimize_hologram::{
    self, InitialPhase, Judging,
    initial_phase::{Given, Kind},
};
use lightpath_proto::v1::{
    self, job_spec,
    judgement::{Orders, Stage},
    optimize_hologram_result::WavelengthResult,
};
use tonic::{Code, Status};

pub(crate) fn hologram(job: &v1::Job) -> &v1::OptimizeHologramResult {
    match job.result.as_ref().and_then(|result| result.kind.as_ref()) {
        Some(v1::job_result::Kind::OptimizeHologram(result)) => result,
        _ => panic!("{job:?}"),
    }
}

#[tokio::test]
async fn optimized_hologram_has_its_files_and_quality() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    let target = serving.upload(&picture()).await;
    let spec = v1::OptimizeHologram { iterations: Some(30), ..optimize(&target) };
    let job = submit(&serving, job_spec::Kind::OptimizeHologram(spec), "").await.unwrap();
    let job = watch_to_end(&serving, &job.name).await;
    assert_eq!(job.state(), v1::job::State::Succeeded, "{job:?}");
    let result = hologram(&job);
    assert_eq!(result.iterations, 30);
    let [hologram] = &result.wavelengths[..] else { panic!("{result:?}") };
    let ([subframe], [plane]) = (&hologram.subframes[..], &hologram.planes[..]) else { panic!("{hologram:?}") };
    let judged = |stage, detector| judgement(&plane.judgements, stage, detector).unwrap();
    let pixel = judged(Stage::Optimized, v1::Detector::Pixel);
    assert!(pixel.psnr() > 10.0 && pixel.ssim.unwrap() > 0.5, "{plane:?}");
    // The region is too small for the five scales of MS-SSIM.
    assert_eq!(pixel.ms_ssim, None);
    let (inside, all) = (pixel.diffraction_efficiency.unwrap(), pixel.frame_efficiency.unwrap());
    assert!(0.0 < inside && inside < all && all <= 1.0 + 1e-6, "{plane:?}");
    assert_eq!(judged(Stage::Optimized, v1::Detector::Supersampled).diffraction_efficiency, Some(inside));
    let headlines: Vec<_> = plane.judgements.iter().filter(|judged| judged.headline).collect();
    assert_eq!(headlines, [judged(Stage::Displayed, v1::Detector::Pixel)]);
    for digest in [&subframe.pattern, &subframe.phase, &plane.reconstruction] {
        let request = v1::GetArtifactRequest { digest: digest.clone() };
        assert!(serving.artifacts().get_artifact(request).await.unwrap().into_inner().size_bytes > 0);
    }
    let (engine, independent) = opinions(&plane.judgements).next().unwrap();
    assert_eq!((engine.rows, independent.rows, independent.contradicts), (Some(8), Some(8), false));
    assert!((independent.psnr() - engine.psnr()).abs() < 0.3, "{plane:?}");
    let verified = verify(&serving, &job.name).await.unwrap();
    let [verified] = &verified.planes[..] else { panic!("{verified:?}") };
    assert_eq!(opinions(&verified.judgements).count(), 3);
    for (engine, independent) in opinions(&verified.judgements) {
        assert!((independent.psnr() - engine.psnr()).abs() < 0.3, "{verified:?}");
        // The display has so few rows that all of them are compared.
        let reported = judged(Stage::Displayed, engine.detector());
        assert!((engine.psnr() - reported.psnr()).abs() < 1e-3, "{engine:?} {reported:?}");
    }
}

#[tokio::test]
async fn foreign_holograms_are_judged_as_they_are() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    let target = serving.upload(&picture()).await;
    let run = async |spec: v1::OptimizeHologram, request_id: &str| {
        let job = submit(&serving, job_spec::Kind::OptimizeHologram(spec), request_id).await?;
        let job = watch_to_end(&serving, &job.name).await;
        assert_eq!(job.state(), v1::job::State::Succeeded, "{job:?}");
        Ok::<_, Status>((job.spec.clone().unwrap(), hologram(&job).wavelengths[0].clone()))
    };
    let (_, made) = run(v1::OptimizeHologram { iterations: Some(30), ..optimize(&target) }, "made").await.unwrap();
    let given = |digest: &str| {
        let given = Given { phases: vec![digest.to_owned()] };
        v1::OptimizeHologram {
            iterations: Some(0),
            initial_phase: Some(InitialPhase { kind: Some(Kind::Given(given)) }),
            ..optimize(&target)
        }
    };
    for (file, stage) in [(&made.subframes[0].phase, Stage::Optimized), (&made.subframes[0].pattern, Stage::Displayed)]
    {
        let (spec, judged) = run(given(file), file).await.unwrap();
        let Some(job_spec::Kind::OptimizeHologram(spec)) = spec.kind else { panic!("{spec:?}") };
        assert_eq!((spec.iterations, spec.target_area()), (Some(0), optimize_hologram::Area::Region));
        assert_eq!(judged.subframes[0].pattern, made.subframes[0].pattern, "{stage:?}");
        let psnr = |result: &v1::optimize_hologram_result::WavelengthResult, stage| {
            judgement(&result.planes[0].judgements, stage, v1::Detector::Pixel).unwrap().psnr()
        };
        assert!((psnr(&judged, Stage::Optimized) - psnr(&made, stage)).abs() < 1e-3, "{stage:?}");
        assert_eq!(judged.planes[0].reconstruction, made.planes[0].reconstruction);
        assert!(judged.loss > 0.0 && judged.loss < 2.0 * made.loss + 1e-4, "{} {}", judged.loss, made.loss);
        assert_eq!(judged.notes, [""; 0]);
    }
    // As a program writes it for which light travels as exp(−ikz), and in degrees.
    let mut phase = serving.read(&made.subframes[0].phase).await;
    let values = phase.len() - 4 * 64 * 48;
    for value in phase[values..].as_chunks_mut().0 {
        *value = (-f32::from_le_bytes(*value).to_degrees()).to_le_bytes();
    }
    let (_, judged) = run(given(&serving.upload(&phase).await), "degrees").await.unwrap();
    assert!(judged.notes.iter().any(|note| note.contains("are these degrees?")), "{:?}", judged.notes);
    for value in phase[values..].as_chunks_mut().0 {
        *value = f32::from_le_bytes(*value).to_radians().to_le_bytes();
    }
    let (_, judged) = run(given(&serving.upload(&phase).await), "negated").await.unwrap();
    assert!(judged.notes.iter().any(|note| note.contains("with the opposite sign")), "{:?}", judged.notes);
    let nothing = v1::OptimizeHologram { iterations: Some(0), ..optimize(&target) };
    expect(run(nothing, "nothing").await, Code::InvalidArgument, "spec.optimize_hologram.iterations is 0");
    let double =
        v1::OptimizeHologram { method: v1::HologramMethod::DoublePhase.into(), ..given(&made.subframes[0].phase) };
    expect(run(double, "double").await, Code::InvalidArgument, "spec.optimize_hologram.iterations is 0");
    expect(
        run(given(&target), "picture").await,
        Code::InvalidArgument,
        "spec.optimize_hologram.initial_phase.given.phases[0] (sha256-",
    );
}

#[tokio::test]
async fn job_says_what_its_judging_left_out() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    let target = serving.upload(&picture()).await;
    let run = async |judge: Judging| {
        let spec = v1::OptimizeHologram { iterations: Some(3), judge: judge.into(), ..optimize(&target) };
        let job = submit(&serving, job_spec::Kind::OptimizeHologram(spec), judge.as_str_name()).await.unwrap();
        let job = watch_to_end(&serving, &job.name).await;
        let result = hologram(&job).clone();
        assert_eq!(result.judged(), if judge == Judging::Unspecified { Judging::Full } else { judge });
        result.wavelengths[0].clone()
    };
    let [full, quick, none] = [run(Judging::Unspecified).await, run(Judging::Quick).await, run(Judging::None).await];
    let [judged, quickly, not] = [&full, &quick, &none].map(|result| &result.planes[0].judgements);
    assert!(other_orders(judged).is_some() && opinions(judged).next().is_some());
    let by_the_engine = judged.iter().filter(|one| one.orders() == Orders::Own && one.rows.is_none());
    assert_eq!(&by_the_engine.cloned().collect::<Vec<_>>(), quickly);
    assert!(quickly.iter().any(|one| one.headline) && not.is_empty());
    for less in [&quick, &none] {
        let shown = |of: &WavelengthResult| (of.subframes.clone(), of.planes[0].reconstruction.clone(), of.loss);
        assert_eq!(shown(less), shown(&full));
    }
    let given = InitialPhase { kind: Some(Kind::Given(Given { phases: vec![full.subframes[0].phase.clone()] })) };
    let judge = Judging::None.into();
    let spec = v1::OptimizeHologram { iterations: Some(0), initial_phase: Some(given), judge, ..optimize(&target) };
    let refused = submit(&serving, job_spec::Kind::OptimizeHologram(spec), "nothing").await;
    expect(refused, Code::InvalidArgument, "spec.optimize_hologram.judge is none");
}

#[tokio::test]
async fn active_kernel_judges_holograms_of_all_kernels() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    let target = serving.upload(&picture()).await;
    let job = |kernel: Option<v1::KernelChoice>| {
        let spec = v1::OptimizeHologram { iterations: Some(30), kernel, ..optimize(&target) };
        job_spec::Kind::OptimizeHologram(spec)
    };
    let headline = async |kind: job_spec::Kind, request_id: &str| {
        let job = submit(&serving, kind, request_id).await.unwrap();
        let job = watch_to_end(&serving, &job.name).await;
        let plane = hologram(&job).wavelengths[0].planes[0].clone();
        let headlines: Vec<_> = plane.judgements.iter().filter(|judged| judged.headline).cloned().collect();
        let [headline] = &headlines[..] else { panic!("{headlines:?}") };
        let own = judgement(&plane.judgements, Stage::Displayed, v1::Detector::Pixel).unwrap().clone();
        assert_eq!(own.kernel_version, "");
        (own, headline.clone())
    };
    let (own, expected) = headline(job(None), "before").await;
    assert_eq!(own, expected, "without an active kernel the hologram's own judges");

    import(&serving, &kernel(64, 2.0), 0.05).await.unwrap();
    let name = "displays/lab/kernels/515nm-50mm";
    let request = v1::PromoteKernelRequest { kernel: name.into(), version: 1, ..Default::default() };
    client(&serving).promote_kernel(request).await.unwrap();
    let (own, expected) = headline(job(Some(v1::KernelChoice::ideal())), "ideal").await;
    assert_eq!((expected.kernel_version.as_str(), own.headline), (&*format!("{name}/versions/1"), false));
    assert!(expected.psnr() < own.psnr() - 1.0, "{expected:?} {own:?}");
    assert!(expected.ssim.is_some() && expected.diffraction_efficiency.is_some(), "{expected:?}");
    let (own, expected) = headline(job(None), "active").await;
    assert_eq!(own, expected, "the active kernel judges its own hologram once");
    assert_eq!(expected.stage(), Stage::Displayed, "an imported kernel does not know its error");
    // A repeated request is the same job, although another version is active now.
    let (_, again) = headline(job(None), "before").await;
    assert_eq!(again.kernel_version, "");
}

#[tokio::test]
async fn hologram_is_made_for_the_fill_factor_of_the_camera() {
    let serving = Serving::start().await;
    let target = serving.upload(&picture()).await;
    let mut found = Vec::new();
    for (id, camera_fill_factor) in [("lab", None), ("gaps", Some(0.5))] {
        let display = v1::Display { camera_fill_factor, ..small_display(id) };
        let request = v1::CreateDisplayRequest { display: Some(display) };
        serving.displays().create_display(request).await.unwrap();
        let mut spec =
            v1::OptimizeHologram { display: format!("displays/{id}"), iterations: Some(30), ..optimize(&target) };
        // Within the critical distance, where light has details finer than a pixel.
        spec.planes[0].place = Some(v1::Place::at_m(5e-3));
        let job = submit(&serving, job_spec::Kind::OptimizeHologram(spec), "").await.unwrap();
        let job = watch_to_end(&serving, &job.name).await;
        let plane = hologram(&job).wavelengths[0].planes[0].clone();
        let (engine, independent) = opinions(&plane.judgements).next().unwrap();
        assert!((independent.psnr() - engine.psnr()).abs() < 0.3, "{camera_fill_factor:?}: {plane:?}");
        let [whole_db, point_db] = [v1::Detector::Pixel, v1::Detector::Point]
            .map(|detector| judgement(&plane.judgements, Stage::Optimized, detector).unwrap().psnr());
        found.push((whole_db, point_db));
    }
    // What a smaller part of the pixel sees is nearer to what a point sees.
    let [(whole_db, whole_point_db), (part_db, part_point_db)] = found[..] else { unreachable!("two displays") };
    assert!(part_db - part_point_db < whole_db - whole_point_db - 1.0, "{found:?}");
}

/// Runs a job that verifies the holograms of another job.
async fn verify(serving: &Serving, job: &str) -> Result<v1::VerifyHologramResult, Status> {
    let job = submit(serving, job_spec::Kind::VerifyHologram(v1::VerifyHologram { job: job.to_owned() }), "").await?;
    let job = watch_to_end(serving, &job.name).await;
    match job.result.as_ref().and_then(|result| result.kind.as_ref()) {
        Some(v1::job_result::Kind::VerifyHologram(result)) => Ok(result.clone()),
        _ => panic!("{job:?}"),
    }
}

#[tokio::test]
async fn only_finished_holograms_are_verified() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    let target = serving.upload(&picture()).await;
    let spec = v1::OptimizeHologram { iterations: Some(10_000), ..optimize(&target) };
    let running = submit(&serving, job_spec::Kind::OptimizeHologram(spec), "").await.unwrap();
    expect(verify(&serving, &running.name).await, Code::InvalidArgument, "spec.verify_hologram.job has no holograms");
    expect(verify(&serving, "jobs/none").await, Code::NotFound, "jobs/none does not exist");
    expect(verify(&serving, "").await, Code::InvalidArgument, "spec.verify_hologram.job");
}

#[tokio::test]
async fn restart_does_not_change_the_result() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    let target = serving.upload(&picture()).await;
    let kind = || job_spec::Kind::OptimizeHologram(v1::OptimizeHologram { iterations: Some(500), ..optimize(&target) });
    let job = submit(&serving, kind(), "").await.unwrap();
    let request = v1::WatchJobRequest { name: job.name.clone() };
    let mut stream = serving.jobs().watch_job(request).await.unwrap().into_inner();
    let running = loop {
        let job = stream.message().await.unwrap().unwrap();
        if job.progress.as_ref().is_some_and(|progress| progress.step > 0) {
            break job;
        }
    };
    drop(stream);
    assert_eq!(running.state(), v1::job::State::Running);
    let serving = serving.restart().await;
    let resumed = watch_to_end(&serving, &job.name).await;
    assert_eq!((resumed.state(), resumed.attempt), (v1::job::State::Succeeded, 2));
    let whole = submit(&serving, kind(), "").await.unwrap();
    let whole = watch_to_end(&serving, &whole.name).await;
    assert_eq!(hologram(&whole).wavelengths, hologram(&resumed).wavelengths);
}

#[tokio::test]
async fn restart_between_two_wavelengths_does_not_change_the_result() {
    let serving = Serving::start().await;
    let wavelengths_m = vec![638e-9, 515e-9];
    let display = Some(v1::Display { wavelengths_m: wavelengths_m.clone(), ..small_display("two") });
    serving.displays().create_display(v1::CreateDisplayRequest { display }).await.unwrap();
    let target = serving.upload(&picture()).await;
    let plane = |distance_m| v1::optimize_hologram::ImagePlane {
        place: Some(v1::Place::at_m(distance_m)),
        target: target.clone(),
        weight: None,
    };
    let spec = v1::OptimizeHologram {
        display: "displays/two".into(),
        wavelengths_m,
        planes: vec![plane(0.05), plane(0.07)],
        iterations: Some(1500),
        quantization_aware: true,
        ..Default::default()
    };
    let kind = || job_spec::Kind::OptimizeHologram(spec.clone());
    let job = submit(&serving, kind(), "").await.unwrap();
    let request = v1::WatchJobRequest { name: job.name.clone() };
    let mut stream = serving.jobs().watch_job(request).await.unwrap().into_inner();
    // Wait until the job computes the second wavelength.
    while stream.message().await.unwrap().unwrap().progress.is_none_or(|progress| progress.step <= 1600) {}
    drop(stream);
    let serving = serving.restart().await;
    let resumed = watch_to_end(&serving, &job.name).await;
    assert_eq!((resumed.state(), resumed.attempt), (v1::job::State::Succeeded, 2));
    let whole = submit(&serving, kind(), "").await.unwrap();
    let whole = watch_to_end(&serving, &whole.name).await;
    assert_eq!(hologram(&whole).wavelengths, hologram(&resumed).wavelengths);
    assert_eq!(hologram(&whole).wavelengths.len(), 2);
}
