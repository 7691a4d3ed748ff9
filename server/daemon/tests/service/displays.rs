//! Tests of displays, their lists, and plans of propagation.

use crate::serving::{Serving, expect, sized_display, small_display};
use lightpath_proto::v1;
use tonic::Code;
use tonic_types::StatusExt as _;

#[tokio::test]
async fn display_is_created_once() {
    let serving = Serving::start().await;
    let first = serving.display("lab-2").await;
    assert_eq!((first.name.as_str(), first.modulator.as_ref().unwrap().bit_depth), ("displays/lab-2", Some(8)));
    assert_eq!(serving.display("lab-2").await, first, "a repeated request returns the same display");
    let other = sized_display("lab-2", 128, 48);
    let answer = serving.displays().create_display(v1::CreateDisplayRequest { display: Some(other) }).await;
    expect(answer, Code::AlreadyExists, "displays/lab-2 already exists");

    let name = "displays/lab-2".to_owned();
    let found = serving.displays().get_display(v1::GetDisplayRequest { name: name.clone() }).await.unwrap();
    assert_eq!(found.into_inner(), first);
    serving.displays().delete_display(v1::DeleteDisplayRequest { name: name.clone() }).await.unwrap();
    let answer = serving.displays().get_display(v1::GetDisplayRequest { name }).await;
    expect(answer, Code::NotFound, "displays/lab-2 does not exist");
}

#[tokio::test]
async fn only_the_notes_of_a_display_change_and_only_from_what_was_seen() {
    let serving = Serving::start().await;
    let first = serving.display("lab").await;
    let update = async |display: v1::Display, paths: &[&str], expected_revision| {
        let paths: Vec<String> = paths.iter().map(|path| (*path).to_owned()).collect();
        let update_mask = (!paths.is_empty()).then_some(lightpath_proto::FieldMask { paths });
        let request = v1::UpdateDisplayRequest { display: Some(display), update_mask, expected_revision };
        serving.displays().update_display(request).await.map(tonic::Response::into_inner)
    };
    let named = |notes: &str| v1::Display { name: "displays/lab".into(), notes: notes.into(), ..Default::default() };
    let second = update(named("new lamp"), &[], Some(1)).await.unwrap();
    assert_eq!(second, v1::Display { notes: "new lamp".into(), revision: 2, ..first.clone() });
    assert_eq!(update(named("new lamp"), &["notes"], None).await.unwrap(), second, "the same again changes nothing");
    expect(update(named("old"), &["notes"], Some(1)).await, Code::Aborted, "displays/lab has the revision 2, not 1");
    let whole = v1::Display { notes: String::new(), ..second.clone() };
    assert_eq!(update(whole.clone(), &[], None).await.unwrap(), second, "an empty text counts as not set");
    assert_eq!(update(whole.clone(), &["*"], None).await.unwrap(), v1::Display { revision: 3, ..whole.clone() });

    let refused =
        "display.wavelengths_m is not that of the display, and kernels were learned for its optics; create a new";
    let other = v1::Display { wavelengths_m: vec![638e-9], ..whole };
    for mask in [&[][..], &["*"], &["wavelengths_m", "notes"]] {
        expect(update(other.clone(), mask, None).await, Code::InvalidArgument, refused);
    }
    assert_eq!(update(other, &["notes"], None).await.unwrap().revision, 3, "what the mask leaves out is not read");
    let unknown = update(named("x"), &["colour"], None).await;
    expect(unknown, Code::InvalidArgument, "update_mask.paths[0] is \"colour\", but must be notes or *");
    let simulated = update(named("x"), &["simulated_bench.seed"], None).await.unwrap();
    assert_eq!(simulated.revision, 3, "it has no bench, before and after");
}

#[tokio::test]
async fn details_of_a_refusal_name_the_field() {
    let serving = Serving::start().await;
    let bad = v1::Display { modulator: Some(v1::Modulator::of_phase(64, 48, -8e-6)), ..small_display("lab") };
    let answer = serving.displays().create_display(v1::CreateDisplayRequest { display: Some(bad) }).await;
    let status = answer.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
    let details = status.get_error_details();
    assert_eq!(details.bad_request().unwrap().field_violations[0].field, "display.modulator.pixel_pitch_x_m");
    assert_eq!(details.error_info().unwrap().reason, "INVALID_FIELD");
    let answer = serving.displays().create_display(v1::CreateDisplayRequest { display: None }).await;
    expect(answer, Code::InvalidArgument, "display is not set");
}

#[tokio::test]
async fn propagation_plans_report_method_distances_and_warnings() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    let request_with = |change: &dyn Fn(&mut v1::PlanPropagationRequest)| {
        let mut request = v1::PlanPropagationRequest { display: "displays/lab".into(), ..Default::default() };
        request.place = Some(v1::Place::at_m(0.01));
        change(&mut request);
        request
    };
    let plan = async |request| serving.displays().plan_propagation(request).await.map(tonic::Response::into_inner);
    // 64×48 px of 8 µm at 515 nm: z_c = 15.9 mm and 11.9 mm.
    let near = plan(request_with(&|_| ())).await.unwrap();
    let report = near.report.unwrap();
    assert_eq!(report.method(), v1::PropagationMethod::BandResponse);
    assert!((report.critical_distance_y_m - 0.01193).abs() < 1e-5 && report.band_kept_area > 0.99, "{report:?}");
    let refused =
        near.alternatives.iter().find(|other| other.method() == v1::PropagationMethod::FresnelImpulseResponse);
    assert!(refused.is_some_and(|other| !other.possible && other.text.contains("15.9 mm")), "{refused:?}");

    let far =
        plan(request_with(&|request| request.place = Some(v1::Place::at_m(-0.05)))).await.unwrap().report.unwrap();
    assert_eq!(far.method(), v1::PropagationMethod::BandResponse);
    assert_eq!(far.warnings[0].code, "BAND_LIMITED");

    let window = v1::ImageWindow { width_px: 32, height_px: 32, pitch_x_m: 2e-6, ..Default::default() };
    let zoom = plan(request_with(&|request| request.window = Some(window))).await.unwrap().report.unwrap();
    assert_eq!(zoom.method(), v1::PropagationMethod::Scaled);
    assert_eq!(zoom.window.unwrap().pitch_y_m, Some(2e-6));

    let endless = v1::ImageWindow { centre_x_m: f64::INFINITY, ..window };
    let fresnel = v1::PropagationMethod::FresnelImpulseResponse.into();
    for (request, start) in [
        (
            request_with(&|request| request.place = Some(v1::Place::at_m(5.0))),
            "place.distance_m is 5: the Rayleigh–Sommerfeld impulse response cannot",
        ),
        (
            request_with(&|request| request.method = fresnel),
            "method cannot be used: the Fresnel impulse response cannot be used",
        ),
        (request_with(&|request| request.method = 99), "method is 99"),
        (request_with(&|request| request.window = Some(endless)), "window is not possible: centre_x_m is inf"),
        (
            request_with(&|request| (request.method, request.window) = (fresnel, Some(window))),
            "method is given together with a window",
        ),
        (request_with(&|request| request.wavelength_m = Some(1e-6)), "wavelength_m is 1000nm"),
    ] {
        expect(plan(request).await, Code::InvalidArgument, start);
    }
    let missing = plan(request_with(&|request| request.display = "displays/none".into())).await;
    expect(missing, Code::NotFound, "display: displays/none does not exist");
}

#[tokio::test]
async fn lists_are_paged() {
    let serving = Serving::start().await;
    for id in ["a", "b", "c"] {
        serving.display(id).await;
    }
    let mut names = Vec::new();
    let mut page_token = String::new();
    loop {
        let request = v1::ListDisplaysRequest { page_size: 2, page_token };
        let page = serving.displays().list_displays(request).await.unwrap().into_inner();
        names.extend(page.displays.into_iter().map(|display| display.name));
        page_token = page.next_page_token;
        if page_token.is_empty() {
            break;
        }
    }
    assert_eq!(names, ["displays/a", "displays/b", "displays/c"]);
    let request = v1::ListDisplaysRequest { page_size: 0, page_token: "zz".into() };
    expect(serving.displays().list_displays(request).await, Code::InvalidArgument, "page_token is unknown");
}
