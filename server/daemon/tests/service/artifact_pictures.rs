//! Tests of artifacts as pictures over HTTP.

use crate::manifests::{Answer, curl};
use crate::serving::Serving;
use lightpath_artifacts::digest_of;
use lightpath_media::pictures::{grey_png_srgb, picture_size};
use lightpath_optics::Plane;

/// A server, and the digest of a picture of 80×40 px that has light on its left half only.
async fn serving_with_picture() -> (Serving, String) {
    let serving = Serving::start().await;
    let picture = grey_png_srgb(&Plane::from_fn(40, 80, |_, x| if x < 40 { 0.5 } else { 0.0 })).unwrap();
    let digest = serving.upload(&picture).await;
    (serving, digest)
}

async fn picture(serving: &Serving, digest: &str, query: &str) -> Answer {
    curl(serving, &format!("/v1/artifacts/{digest}/picture?{query}"), &[]).await
}

#[tokio::test]
async fn pictures_come_smaller_in_parts_and_in_colours() {
    let (serving, digest) = serving_with_picture().await;
    let whole = picture(&serving, &digest, "").await;
    assert_eq!((whole.status, whole.field("content-type")), (200, Some("image/png")));
    assert_eq!(picture_size(&whole.body).unwrap(), (80, 40));
    let part = picture(&serving, &digest, "width=10&region=30,0,20,40&colormap=sequential&log=2").await;
    assert_eq!(picture_size(&part.body).unwrap(), (10, 20));
    assert_eq!(part.field("picture-size"), Some("80x40"), "the whole picture");
    let nothing = picture(&serving, &digest, &format!("minus={digest}&minus_fit=exact&range=0.1")).await;
    assert_eq!((nothing.status, picture_size(&nothing.body).unwrap()), (200, (80, 40)));
    assert_ne!(nothing.body, whole.body);
    assert_eq!(nothing.field("picture-psnr"), Some("200.00"), "the most that is said");
    // Light on the left half only has no gain that brings it to light on the whole: half of the pixels are 0.5 off.
    let even = serving.upload(&grey_png_srgb(&Plane::from_fn(40, 80, |_, _| 0.5)).unwrap()).await;
    let halves = picture(&serving, &digest, &format!("minus={even}&width=8")).await;
    assert_eq!(halves.field("picture-psnr"), Some("8.98"), "of all pixels, however few are shown");
    let left = picture(&serving, &digest, &format!("minus={even}&region=0,0,40,40")).await;
    assert_eq!((left.field("picture-psnr"), whole.field("picture-psnr")), (Some("200.00"), None));

    let path = format!("/v1/artifacts/{digest}/picture");
    let known = format!("if-none-match: {}", whole.field("etag").unwrap());
    assert_eq!(curl(&serving, &path, &["--header", &known]).await.status, 304);
    assert_eq!(curl(&serving, &format!("{path}?width=10"), &["--header", &known]).await.status, 200, "another picture");
}

#[tokio::test]
async fn wrong_wishes_are_refused_with_the_parameter_and_the_fix() {
    let (serving, digest) = serving_with_picture().await;
    let text = serving.upload(b"no picture at all").await;
    let missing = digest_of(b"missing");
    for (digest, query, status, needed) in [
        (&digest, "width=0", 400, "width is 0"),
        (&digest, "width=many", 400, "width"),
        (&digest, "colour=red", 400, "colormap"),
        (&digest, "colormap=rainbow", 400, "`cyclic`"),
        (&digest, "log=-1", 400, "log is -1"),
        (&digest, "log=NaN", 400, "log is NaN"),
        (&digest, "minus_channel=pink", 400, "`green`"),
        (&digest, "range=0", 400, "range is 0"),
        (&digest, "range=2", 400, "range is 2"),
        (&digest, "region=1,2,3", 400, "x,y,width,height"),
        (&digest, "region=70,0,20,40", 400, "80×40 px"),
        (&digest, "minus=passwd", 400, "minus is"),
        (&digest, &format!("minus={missing}"), 404, "upload it first"),
        (&digest, &format!("minus={text}"), 400, "not a readable picture"),
        (&missing, "", 404, "upload it first"),
        (&text, "", 400, "not a readable picture"),
    ] {
        let refused = picture(&serving, digest, query).await;
        assert!(refused.status == status && refused.text().contains(needed), "{query}: {}", refused.text());
    }
}

#[tokio::test]
async fn colour_maps_come_as_a_row_of_colours() {
    let serving = Serving::start().await;
    for name in ["grey", "sequential", "diverging", "cyclic"] {
        let row = curl(&serving, &format!("/v1/colormaps/{name}"), &[]).await;
        assert_eq!((row.status, picture_size(&row.body).unwrap()), (200, (256, 1)), "{name}");
    }
    let unknown = curl(&serving, "/v1/colormaps/rainbow", &[]).await;
    assert!(unknown.status == 404 && unknown.text().contains("`cyclic`"), "{}", unknown.text());
}
