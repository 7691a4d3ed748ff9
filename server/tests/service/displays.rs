//! Displays: declared once, listed in pages, refused with the field.

use crate::serving::{Serving, expect, small_display};
use lightpath_proto::v1;
use tonic::Code;
use tonic_types::StatusExt as _;

#[tokio::test]
async fn a_display_is_declared_once() {
    let serving = Serving::start().await;
    let first = serving.display("lab-2").await;
    assert_eq!((first.name.as_str(), first.bit_depth), ("displays/lab-2", 8));
    assert_eq!(serving.display("lab-2").await, first, "the same again is the same");
    let other = v1::Display { width_px: 128, ..small_display("lab-2") };
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
async fn refusals_carry_the_field_for_programs_too() {
    let serving = Serving::start().await;
    let bad = v1::Display { pixel_pitch_m: -8e-6, ..small_display("lab") };
    let answer = serving.displays().create_display(v1::CreateDisplayRequest { display: Some(bad) }).await;
    let status = answer.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
    let details = status.get_error_details();
    assert_eq!(details.bad_request().unwrap().field_violations[0].field, "display.pixel_pitch_m");
    assert_eq!(details.error_info().unwrap().reason, "INVALID_FIELD");
    let answer = serving.displays().create_display(v1::CreateDisplayRequest { display: None }).await;
    expect(answer, Code::InvalidArgument, "display is not set");
}

#[tokio::test]
async fn lists_come_in_pages() {
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
    expect(serving.displays().list_displays(request).await, Code::InvalidArgument, "page_token is not known");
}
