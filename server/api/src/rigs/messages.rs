//! Conversions of the messages of rigs.

use crate::optics::to_wire::place;
use crate::time::ms;
use lightpath_domain::display::Display;
use lightpath_domain::units::Wavelength;
use lightpath_proto::v1::{self, serve_rig_request, serve_rig_response};
use lightpath_rigs::{Ask, Camera, Failure, RigDescription, Slm, Take, Taken};
use lightpath_service::{Field, Result, check_all, collect_all};

/// Limit on the length of the name of a program \[bytes\].
const PROGRAM_BYTES_MAX: usize = 256;
/// Limit on the length of a rig's message \[bytes\].
const MESSAGE_BYTES_MAX: usize = 1024;
/// Limit on the length of the id of a request \[bytes\].
const TAKE_BYTES_MAX: usize = 128;
/// Limit on the sides of a camera \[px\].
const CAMERA_PX_MAX: u32 = 16_384;
/// Limit on times of a bench \[s\].
const TIME_S_MAX: f64 = 3600.0;
/// Coldest and hottest bench \[°C\].
const TEMPERATURES_C: std::ops::RangeInclusive<f64> = -100.0..=200.0;

/// Checks the description of a bench at a display.
pub(super) fn description(field: &Field, rig: v1::Rig, display: &Display) -> Result<RigDescription> {
    let (of_slm, of_camera) = (field.at("slm"), field.at("camera"));
    check_all! {
        program = field.at("program").line(rig.program, PROGRAM_BYTES_MAX);
        slm = of_slm.required(rig.slm).and_then(|slm| self::slm(&of_slm, slm, display));
        camera = of_camera.required(rig.camera).and_then(|camera| self::camera(&of_camera, camera));
        wavelengths = wavelengths(&field.at("wavelengths_m"), &rig.wavelengths_m, display);
        distance = crate::optics::from_wire::distance(&field.at("place"), rig.place.as_ref());
    }
    Ok(RigDescription { program, slm, camera, has_shutter: rig.has_shutter, wavelengths, distance })
}

fn slm(field: &Field, slm: v1::rig::Slm, display: &Display) -> Result<Slm> {
    let of_display = |name: &str, value: u32, own: u32| {
        let problem = format!("is {value}, but displays/{} has {own}", display.id);
        if value == own { Ok(value) } else { Err(field.at(name).invalid(problem, "serve the display that the SLM is")) }
    };
    check_all! {
        width_px = of_display("width_px", slm.width_px, display.width_px);
        height_px = of_display("height_px", slm.height_px, display.height_px);
        bit_depth = of_display("bit_depth", slm.bit_depth, display.bit_depth);
        settling_time_s = field.at("settling_time_s").number(slm.settling_time_s, 0.0..=TIME_S_MAX);
    }
    Ok(Slm { width_px, height_px, bit_depth, settling_time_s, reads_back: slm.reads_back })
}

fn camera(field: &Field, camera: v1::rig::Camera) -> Result<Camera> {
    check_all! {
        width_px = field.at("width_px").integer(camera.width_px, 16..=CAMERA_PX_MAX);
        height_px = field.at("height_px").integer(camera.height_px, 16..=CAMERA_PX_MAX);
        bit_depth = field.at("bit_depth").integer(camera.bit_depth, 1..=16);
        exposure_min_s = field.at("exposure_min_s").positive(camera.exposure_min_s, TIME_S_MAX);
        exposure_delay_frames = field.at("exposure_delay_frames").integer(camera.exposure_delay_frames, 0..=1000);
    }
    let exposure_max_s = field.at("exposure_max_s").number(camera.exposure_max_s, exposure_min_s..=TIME_S_MAX)?;
    Ok(Camera { width_px, height_px, bit_depth, exposure_min_s, exposure_max_s, exposure_delay_frames })
}

fn wavelengths(field: &Field, wavelengths_m: &[f64], display: &Display) -> Result<Vec<Wavelength>> {
    if wavelengths_m.is_empty() {
        return Err(field.but("is empty", "must have the wavelengths with which the rig lights the SLM [m]"));
    }
    let each = wavelengths_m.iter().enumerate();
    collect_all(each.map(|(index, &wavelength_m)| field.index(index).wavelength_of(Some(wavelength_m), display)))
}

/// Checks a photograph that was taken, and returns also the id of its request.
pub(super) fn taken(field: &Field, taken: serve_rig_request::Taken) -> Result<(String, Taken)> {
    let of_time = field.at("exposure_time");
    let is_hash = |text: &str| text.len() == 64 && text.bytes().all(|byte| byte.is_ascii_hexdigit());
    check_all! {
        take = field.at("take").line(taken.take, TAKE_BYTES_MAX);
        photo = field.at("photo").digest(&taken.photo);
        exposure_s = field.at("exposure_s").number(taken.exposure_s, 0.0..=TIME_S_MAX);
        exposure_time_ms = of_time.required(taken.exposure_time).and_then(|time| {
            ms(&time).ok_or_else(|| of_time.but("is no time", "must be a valid time"))
        });
        temperature_c = taken.temperature_c.map(|each| field.at("temperature_c").number(each, TEMPERATURES_C)).transpose();
        levels_sha256 = match is_hash(&taken.levels_sha256) {
            true => Ok(taken.levels_sha256.to_ascii_lowercase()),
            false => Err(field.at("levels_sha256").but("is no SHA-256", "must have 64 hexadecimal digits")),
        };
    }
    let frame = taken.frame;
    Ok((take, Taken { photo, levels_sha256, frame, exposure_time_ms, exposure_s, temperature_c }))
}

/// Checks a failure, and returns also the id of its request.
pub(super) fn failed(field: &Field, failed: serve_rig_request::Failed) -> Result<(String, Failure)> {
    check_all! {
        take = field.at("take").line(failed.take, TAKE_BYTES_MAX);
        message = field.at("message").line(failed.message, MESSAGE_BYTES_MAX);
    }
    Ok((take, Failure { message, retryable: failed.retryable }))
}

/// Message for what is asked of a rig.
pub(super) fn ask(ask: Ask) -> v1::ServeRigResponse {
    let message = match ask {
        Ask::Take(Take { id, pattern, exposure_s, exposures, dark, next_pattern, wavelength_m }) => {
            let next_pattern = next_pattern.unwrap_or_default();
            let take = id;
            serve_rig_response::Message::Take(serve_rig_response::Take {
                take,
                pattern,
                exposure_s,
                exposure_count: exposures,
                dark,
                next_pattern,
                wavelength_m,
            })
        }
        Ask::Rest => serve_rig_response::Message::Rest(serve_rig_response::Rest {}),
    };
    v1::ServeRigResponse { message: Some(message) }
}

/// Message for a connected rig.
pub(super) fn rig(display: &str, rig: RigDescription) -> v1::Rig {
    let RigDescription { program, slm, camera, has_shutter, wavelengths, distance } = rig;
    let Slm { width_px, height_px, bit_depth, settling_time_s, reads_back } = slm;
    let slm = v1::rig::Slm { width_px, height_px, bit_depth, settling_time_s, reads_back };
    let Camera { width_px, height_px, bit_depth, exposure_min_s, exposure_max_s, exposure_delay_frames } = camera;
    let camera =
        v1::rig::Camera { width_px, height_px, bit_depth, exposure_min_s, exposure_max_s, exposure_delay_frames };
    v1::Rig {
        name: format!("displays/{display}/rig"),
        program,
        slm: Some(slm),
        camera: Some(camera),
        has_shutter,
        wavelengths_m: wavelengths.into_iter().map(Wavelength::m).collect(),
        place: place(distance),
    }
}
