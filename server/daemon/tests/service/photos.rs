//! Tests of scoring photographs.

use crate::serving::{Serving, expect};
use lightpath_bench::TestCard;
use lightpath_camera::alignment::{Homography, warp};
use lightpath_media::pictures;
use lightpath_optics::Plane;
use lightpath_proto::v1;
use lightpath_proto::v1::photo_service_client::PhotoServiceClient;
use tonic::{Code, Status};

const HEIGHT: usize = 180;
const WIDTH: usize = 320;

fn target() -> Plane<f32> {
    TestCard::City.render(HEIGHT, WIDTH, 3).unwrap()
}

/// Place of the target in the photograph.
fn place() -> Homography {
    let tilt = Homography::try_new([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1e-4, -5e-5, 1.0]).unwrap();
    Homography::similarity([0.0; 2], 0.03, 1.3, [45.0, 30.0]).after(&tilt)
}

/// A photograph of 480×300 px with half of the light, and 40 pixels of full scale.
fn photo() -> Plane<f32> {
    let mut photo = warp(&target().map(|light| 0.5 * light), &place().inverse(), 300, 480, f32::INFINITY, 0.0);
    photo.values_mut()[..40].fill(1.0);
    photo
}

async fn score(serving: &Serving, request: v1::ScorePhotoRequest) -> Result<v1::PhotoScore, Status> {
    Ok(PhotoServiceClient::new(serving.channel.clone()).score_photo(request).await?.into_inner())
}

async fn request(serving: &Serving) -> v1::ScorePhotoRequest {
    v1::ScorePhotoRequest {
        photo: serving.upload(&pictures::grey_png_linear(&photo()).unwrap()).await,
        target: serving.upload(&pictures::grey_png_srgb(&target()).unwrap()).await,
        ..Default::default()
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn photograph_is_found_measured_and_drawn() {
    let serving = Serving::start().await;
    let request = request(&serving).await;
    let found = score(&serving, request.clone()).await.unwrap();
    let at = found.place.clone().unwrap();
    let map = Homography::try_new(at.homography.try_into().unwrap()).unwrap();
    for point in [[40.0, 25.0], [280.0, 25.0], [160.0, 90.0], [40.0, 155.0], [280.0, 155.0]] {
        let (a, b) = (map.apply(point), place().apply(point));
        // The distortion, which the homography does not contain, takes a part of the perspective.
        assert!((a[0] - b[0]).hypot(a[1] - b[1]) < 1.0, "{point:?}: {a:?}, but {b:?} is true");
    }
    assert!(at.correlation > 0.9 && !at.mirrored && at.residual_rms_px.unwrap() < 0.2, "{:?}", found.place);
    let [channel] = &found.channels[..] else { panic!("{:?}", found.channels) };
    assert!((channel.gain - 2.0).abs() < 0.05 && channel.psnr_db > 30.0 && channel.ssim > 0.9, "{channel:?}");
    assert!((found.saturated - 40.0 / (300.0 * 480.0)).abs() < 1e-9, "{}", found.saturated);
    let region = v1::Region { x_px: 32, y_px: 18, width_px: 256, height_px: 144 };
    assert_eq!(found.region, Some(region));
    let aligned = serving.read(&found.aligned).await;
    assert_eq!(pictures::picture_size(&aligned).unwrap(), (WIDTH as u32, HEIGHT as u32));
    assert!(pictures::picture_size(&serving.read(&found.error).await).unwrap().0 > 900);
    // The same request gives the same answer, with the same pictures.
    assert_eq!(score(&serving, request).await.unwrap(), found);
    serving.stop().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn wrong_requests_are_refused_with_the_field_and_the_fix() {
    let serving = Serving::start().await;
    let request = request(&serving).await;
    let other = TestCard::Spheres.render(HEIGHT, WIDTH, 9).unwrap();
    let other = serving.upload(&pictures::grey_png_srgb(&other).unwrap()).await;
    let unrelated = score(&serving, v1::ScorePhotoRequest { target: other, ..request.clone() }).await;
    let message = unrelated.as_ref().unwrap_err().message().to_owned();
    assert!(message.contains("at least 0.35 is needed"), "{message}");
    expect(unrelated, Code::InvalidArgument, "photo (sha256-");
    let region = Some(v1::Region { x_px: 300, y_px: 0, width_px: 30, height_px: 30 });
    let outside = v1::ScorePhotoRequest { region, ..request.clone() };
    let start = "region is 30×30 px at (300, 0), but must be at least 1×1 px and inside the target, 320×180 px";
    expect(score(&serving, outside).await, Code::InvalidArgument, start);
    let tiny = serving.upload(&pictures::grey_png_srgb(&Plane::filled(20, 400, 0.5)).unwrap()).await;
    let tiny = v1::ScorePhotoRequest { target: tiny, ..request.clone() };
    expect(score(&serving, tiny).await, Code::InvalidArgument, "target (sha256-");
    let text = v1::ScorePhotoRequest { photo: serving.upload(b"no picture").await, ..request.clone() };
    expect(score(&serving, text).await, Code::InvalidArgument, "photo (sha256-");
    let encoding = v1::ScorePhotoRequest { photo_encoding: 9, ..request.clone() };
    expect(score(&serving, encoding).await, Code::InvalidArgument, "photo_encoding is 9");
    let missing = v1::ScorePhotoRequest { photo: format!("sha256-{}", "0".repeat(64)), ..request };
    expect(score(&serving, missing).await, Code::NotFound, "photo: artifact sha256-");
    serving.stop().await.unwrap();
}
