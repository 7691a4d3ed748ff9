//! Small displays, pictures, kernels and job specs for the tests.

use image::{ExtendedColorType, ImageEncoder as _, codecs::png::PngEncoder};
use lightpath::v1::{self, Display, OptimizeHologram, SubmitJobRequest, job_spec, optimize_hologram::ImagePlane};
use lightpath::{Client, names};
use lightpath_domain::kernel::KernelModel;
use lightpath_media::kernel_file;
use lightpath_optics::{DisplayModel, Grid, KernelShape, OpticalSetup, SmoothField};

/// Wavelength of the displays \[m\].
pub(crate) const WAVELENGTH_M: f64 = 515e-9;
/// Distance of the holograms \[m\].
pub(crate) const DISTANCE_M: f64 = 0.05;

/// A simulated bench with this seed.
pub(crate) fn simulated(seed: u64) -> Option<v1::display::Bench> {
    Some(v1::display::Bench::SimulatedBench(v1::SimulatedBench { seed, ..Default::default() }))
}

/// A simulated display of this size.
pub(crate) fn display(id: &str, width_px: u32, height_px: u32) -> Display {
    Display {
        name: names::display(id),
        modulator: Some(v1::Modulator::of_phase(width_px, height_px, 8e-6)),
        wavelengths_m: vec![WAVELENGTH_M],
        bench: simulated(7),
        ..Default::default()
    }
}

/// Declares a simulated display of this size.
pub(crate) async fn declare(client: &Client, id: &str, width_px: u32, height_px: u32) -> Display {
    let display = Some(display(id, width_px, height_px));
    client.create_display(v1::CreateDisplayRequest { display }).await.unwrap()
}

/// A grey PNG with the pixels `value(x, y)`.
pub(crate) fn png(width_px: u32, height_px: u32, value: impl Fn(u32, u32) -> u8) -> Vec<u8> {
    let pixels: Vec<u8> = (0..width_px * height_px).map(|i| value(i % width_px, i / width_px)).collect();
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes).write_image(&pixels, width_px, height_px, ExtendedColorType::L8).unwrap();
    bytes
}

/// A picture with edges and slopes. Each `number` gives another picture.
pub(crate) fn target(width_px: u32, height_px: u32, number: u32) -> Vec<u8> {
    png(width_px, height_px, |x, y| {
        let disc = (x + number).abs_diff(width_px / 2).pow(2) + y.abs_diff(height_px / 2).pow(2);
        if disc < (height_px / 4).pow(2) { 230 } else { (40 + x * 120 / width_px + (y / 8 + number) % 2 * 30) as u8 }
    })
}

/// A PNG whose header gives a size, with only a few bytes of pixels.
pub(crate) fn png_header(width_px: u32, height_px: u32) -> Vec<u8> {
    let mut header = b"IHDR".to_vec();
    header.extend(width_px.to_be_bytes());
    header.extend(height_px.to_be_bytes());
    // Bit depth 8, grey, and method 0 of compression, filter and interlace.
    header.extend([8, 0, 0, 0, 0]);
    let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
    for chunk in [&header[..], b"IDAT\x78\x01\x03\x00\x00\x00\x00\x01", b"IEND"] {
        file.extend((chunk.len() as u32 - 4).to_be_bytes());
        file.extend(chunk);
        file.extend(crc32(chunk).to_be_bytes());
    }
    file
}

fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| if crc & 1 == 1 { (crc >> 1) ^ 0xedb8_8320 } else { crc >> 1 };
    !bytes.iter().fold(!0, |crc, &byte| (0..8).fold(crc ^ u32::from(byte), step))
}

/// A kernel of a display of this size, tilted by `tilt` \[rad\].
pub(crate) fn kernel_file(width_px: usize, height_px: usize, tilt: f64) -> Vec<u8> {
    let grid = Grid::try_new(height_px, width_px, 8e-6).unwrap();
    let setup = OpticalSetup::try_new(grid, WAVELENGTH_M, DISTANCE_M).unwrap();
    let mut errors = SmoothField::flat(3);
    errors.phase[1] = tilt;
    let model = DisplayModel { kernel: KernelShape::Smooth(errors), ..DisplayModel::ideal(setup) };
    kernel_file::encode(&model, KernelModel::Smooth).unwrap()
}

/// Spec of a hologram optimization.
pub(crate) fn hologram(display: &str, target: &str, iterations: u32, seed: u64) -> OptimizeHologram {
    OptimizeHologram {
        display: names::display(display),
        planes: vec![ImagePlane { place: Some(v1::Place::at_m(DISTANCE_M)), target: target.to_owned(), weight: None }],
        iterations: Some(iterations),
        seed,
        ..Default::default()
    }
}

/// A request for a hologram optimization. The request id may be empty.
pub(crate) fn request(hologram: OptimizeHologram, request_id: &str) -> SubmitJobRequest {
    SubmitJobRequest {
        spec: Some(lightpath::job_spec(job_spec::Kind::OptimizeHologram(hologram))),
        request_id: request_id.to_owned(),
        ..Default::default()
    }
}

/// Messages of a job's events.
pub(crate) async fn events(client: &Client, job: &str) -> Vec<String> {
    let request = v1::ListJobEventsRequest { name: job.to_owned(), page_size: 1000, page_token: String::new() };
    let events = client.list_job_events(request).await.unwrap().events;
    events.into_iter().map(|event| event.message).collect()
}

/// Checks that the job's events contain "succeeded" exactly once.
pub(crate) async fn assert_succeeded_once(client: &Client, job: &str) {
    let events = events(client, job).await;
    assert_eq!(events.iter().filter(|event| *event == "succeeded").count(), 1, "{job}: {events:#?}");
}
