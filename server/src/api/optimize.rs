//! From a request for holograms to what they are to be: every field checked, every default filled in.

use super::Api;
use super::encodings::{detector, encoding, region};
use super::error::ApiError;
use super::field::Field;
use super::propagation::{check_distance, check_method as check_propagation_method, convolution};
use super::submit::learning_rate;
use crate::dataset::Encoding;
use crate::display::Display;
use crate::job::{
    Detector, Fit, ImagePlane, InitialPhase, Job, JobSpec, Loss, Method, OptimizeHologram, Quantity, Region,
};
use crate::kernel::KernelKey;
use crate::units::{Distance, Wavelength};
use lightpath_proto::v1::{
    self,
    optimize_hologram::{self, initial_phase::Kind, loss},
};
use std::f64::consts::TAU;

/// Fifty times what a good hologram takes; bounds how long one job can hold a worker.
const ITERATIONS_MAX: u32 = 10_000;
const ITERATIONS_DEFAULT: u32 = 200;
/// Adam's step, the paper's \[rad\].
const LEARNING_RATE_DEFAULT: f64 = 0.1;
/// Initial phases within one radian speckle little.
const INITIAL_PHASE_RANGE_DEFAULT_RAD: f64 = 1.0;
/// Focal stacks beyond this do not fit the light of one hologram.
const PLANES_MAX: usize = 16;
/// No display is lit with more.
const WAVELENGTHS_MAX: usize = 8;
/// A second of the fastest phase modulators at the rate of the eye.
const FRAMES_MAX: u32 = 24;
/// All frames' pixels: L-BFGS keeps some 60 bytes for each.
const FRAME_PIXELS_MAX: u64 = 100_000_000;
/// All planes' pixels: a transfer function takes 32 bytes for each.
const PLANE_PIXELS_MAX: u64 = 100_000_000;
/// A term beyond this leaves nothing of the picture.
const FACTOR_MAX: f64 = 1000.0;
const PLANE_WEIGHT_MAX: f64 = 1000.0;
/// Larger blocks hold more picture than speckle \[px\].
const SPECKLE_BLOCK_PX_MAX: u32 = 256;
const SPECKLE_BLOCK_PX_DEFAULT: u32 = 8;

impl Api {
    pub(super) async fn optimize(
        &self,
        message: v1::OptimizeHologram,
        field: &Field,
        before: Option<&Job>,
    ) -> Result<OptimizeHologram, ApiError> {
        let at = |name| field.at(name);
        let display = self.display_named(&at("display"), &message.display).await?;
        let wavelengths = wavelengths(field, &message, &display)?;
        let (planes, depth_map) = planes(field, &message)?;
        let method = at("method").known(message.method, method)?;
        let detector = detector(&at("detector"), message.detector)?;
        let begins = Begins { method, detector, wavelengths: wavelengths.len() };
        let initial_phase = initial_phase(&at("initial_phase"), &message, begins)?;
        let range_default_rad = match initial_phase {
            InitialPhase::BackPropagated => 0.0,
            _ => INITIAL_PHASE_RANGE_DEFAULT_RAD,
        };
        let range_rad = message.initial_phase_range_rad.unwrap_or(range_default_rad);
        let mut spec = OptimizeHologram {
            wavelength: wavelengths[0],
            distance: planes[0].distance,
            target: planes[0].target.clone(),
            target_encoding: encoding(&at("target_encoding"), message.target_encoding, Encoding::Srgb)?,
            target_fit: at("target_fit").known(message.target_fit, fit)?,
            kernel_version: None,
            detector,
            iterations: at("iterations").integer_or(message.iterations, ITERATIONS_DEFAULT, 1..=ITERATIONS_MAX)?,
            learning_rate: adams_rate(&at("learning_rate"), message.learning_rate, method)?,
            seed: message.seed,
            initial_phase_range_rad: phase_range(&at("initial_phase_range_rad"), range_rad)?,
            region_of_interest: region(&at("region_of_interest"), message.region_of_interest, &display)?,
            display: display.id.clone(),
            method,
            more_wavelengths: wavelengths[1..].to_vec(),
            plane_weight: planes[0].weight,
            more_planes: planes[1..].to_vec(),
            depth_map,
            kernel_versions: Vec::new(),
            frames: at("frames").integer_or(message.frames, 1, 1..=FRAMES_MAX)?,
            initial_phase,
            loss: Loss::default(),
            weight_mask: optional_digest(&at("weight_mask"), &message.weight_mask)?,
            quantization_aware: message.quantization_aware,
            propagation: convolution(&at("propagation"), message.propagation)?,
        };
        spec.loss = loss_of(&at("loss"), message.loss, spec.region_of_interest)?;
        check_method(field, &spec)?;
        check_size(field, &spec, &display)?;
        self.choose_kernels(&at("kernel"), &message.kernel, &mut spec, before).await?;
        check_propagation(field, &spec, &display)?;
        self.check_pictures(field, &spec, &display).await?;
        Ok(spec)
    }

    /// One kernel, or one for each wavelength and plane.
    async fn choose_kernels(
        &self,
        field: &Field,
        kernel: &str,
        spec: &mut OptimizeHologram,
        before: Option<&Job>,
    ) -> Result<(), ApiError> {
        let key = |wavelength, distance| KernelKey { display: spec.display.clone(), wavelength, distance };
        let (wavelengths, planes) = (spec.wavelengths(), spec.planes());
        if wavelengths.len() * planes.len() == 1 {
            let key = key(spec.wavelength, spec.distance);
            spec.kernel_version = self.kernel_version_for(field, kernel, &key, before, false).await?;
            return Ok(());
        }
        if !["", "active", "ideal"].contains(&kernel) {
            let fix = "each of several wavelengths and planes has a kernel of its own: leave it empty, or say active or ideal";
            return Err(field.invalid(format!("is {:?}, but {fix}", super::field::shortened(kernel))));
        }
        // A repeated submit means what it meant the first time, even if `active` has moved.
        if let Some(JobSpec::OptimizeHologram(job)) = before.map(|job| &job.spec)
            && kernel != "ideal"
            && (job.wavelengths(), job.planes().len()) == (wavelengths.clone(), planes.len())
        {
            (spec.kernel_version, spec.kernel_versions) = (job.kernel_version, job.kernel_versions.clone());
            return Ok(());
        }
        let mut versions = Vec::new();
        for wavelength in &wavelengths {
            for plane in &planes {
                let key = key(*wavelength, plane.distance);
                versions.push(self.kernel_version_for(field, kernel, &key, None, false).await?);
            }
        }
        spec.kernel_version = versions.first().copied().flatten();
        spec.kernel_versions = versions;
        Ok(())
    }

    /// Decodes every picture once, so that what is wrong with one is said now.
    async fn check_pictures(&self, field: &Field, spec: &OptimizeHologram, display: &Display) -> Result<(), ApiError> {
        let planes = spec.planes();
        let one = planes.len() == 1 || spec.depth_map.is_some();
        for (p, plane) in planes.iter().enumerate().take(if one { 1 } else { planes.len() }) {
            let field = if one { field.at("target") } else { field.at("planes").index(p).at("target") };
            self.check_target(&field, spec, &plane.target, display).await?;
        }
        if let Some(map) = &spec.depth_map {
            self.check_grey(&field.at("depth_map").at("map"), spec, map, display).await?;
        }
        if let Some(mask) = &spec.weight_mask {
            self.check_mask(&field.at("weight_mask"), spec, mask, display).await?;
        }
        if let InitialPhase::Given(phases) = &spec.initial_phase {
            for (i, phase) in phases.iter().enumerate() {
                let field = field.at("initial_phase").at("phases").index(i);
                self.check_phase(&field, phase, spec.frames, display).await?;
            }
        }
        Ok(())
    }
}

/// Refuses ways to an image that can't be right, of every wavelength to every plane.
fn check_propagation(field: &Field, spec: &OptimizeHologram, display: &Display) -> Result<(), ApiError> {
    let (wavelengths, planes) = (spec.wavelengths(), spec.planes());
    for (w, &wavelength) in wavelengths.iter().enumerate() {
        for (p, plane) in planes.iter().enumerate() {
            let Some(method) = spec.propagation else {
                let at = match (&spec.depth_map, planes.len()) {
                    (_, 1) => field.at("distance_m"),
                    (Some(_), _) => field.at("depth_map").at("distances_m").index(p),
                    (None, _) => field.at("planes").index(p).at("distance_m"),
                };
                check_distance(&at, display, wavelength, plane.distance)?;
                continue;
            };
            let at = field.at("propagation");
            if let Some(version) = spec.kernel_of(w, p) {
                let fix = "leave it unspecified, or optimize through the kernel `ideal`";
                let problem = format!("is given, but version {version} brings what it was learned with; {fix}");
                return Err(at.invalid(problem));
            }
            check_propagation_method(&at, display, wavelength, plane.distance, method)?;
        }
    }
    Ok(())
}

fn wavelengths(field: &Field, message: &v1::OptimizeHologram, display: &Display) -> Result<Vec<Wavelength>, ApiError> {
    let list = field.at("wavelengths_m");
    if message.wavelengths_m.is_empty() {
        return Ok(vec![field.at("wavelength_m").wavelength_of(message.wavelength_m, display)?]);
    }
    if message.wavelength_m != 0.0 {
        return Err(field.at("wavelength_m").invalid("is given beside wavelengths_m; give one of them"));
    }
    at_most(&list, message.wavelengths_m.len(), WAVELENGTHS_MAX)?;
    let mut found = Vec::new();
    for (i, &value) in message.wavelengths_m.iter().enumerate() {
        let field = list.index(i);
        if value == 0.0 {
            return Err(field.invalid("is 0, but must be one of the display's wavelengths"));
        }
        let wavelength = field.wavelength_of(value, display)?;
        if found.contains(&wavelength) {
            return Err(field.invalid(format!("is {wavelength} again; no two may be equal")));
        }
        found.push(wavelength);
    }
    Ok(found)
}

/// The planes, and the depth map that cuts them out of one picture.
fn planes(field: &Field, message: &v1::OptimizeHologram) -> Result<(Vec<ImagePlane>, Option<String>), ApiError> {
    let at = |name| field.at(name);
    match (&message.depth_map, message.planes.as_slice()) {
        (Some(_), [_, ..]) => Err(at("depth_map").invalid("is given beside planes; give one of them")),
        (None, []) => {
            let distance = at("distance_m").distance(message.distance_m)?;
            let target = at("target").digest(&message.target)?;
            Ok((vec![ImagePlane { distance, target, weight: 1.0 }], None))
        }
        (Some(map), []) => {
            no_distance(field, message, "depth_map")?;
            let list = at("depth_map").at("distances_m");
            if map.distances_m.len() < 2 {
                return Err(list.invalid(format!("has {} distances, but must have 2 or more", map.distances_m.len())));
            }
            let target = at("target").digest(&message.target)?;
            let distances = distances(&list, map.distances_m.iter().enumerate().map(|(i, &z)| (list.index(i), z)))?;
            let plane = |distance| ImagePlane { distance, target: target.clone(), weight: 1.0 };
            let digest = at("depth_map").at("map").digest(&map.map)?;
            Ok((distances.into_iter().map(plane).collect(), Some(digest)))
        }
        (None, planes) => {
            no_distance(field, message, "planes")?;
            if !message.target.is_empty() {
                return Err(at("target").invalid("is given beside planes, which have targets of their own"));
            }
            let list = at("planes");
            let given = planes.iter().enumerate().map(|(i, plane)| (list.index(i).at("distance_m"), plane.distance_m));
            let distances = distances(&list, given)?;
            let plane = |(i, (plane, distance)): (usize, (&optimize_hologram::ImagePlane, Distance))| {
                let field = list.index(i);
                let target = field.at("target").digest(&plane.target)?;
                let weight = field.at("weight").number_or(plane.weight, 1.0, f64::MIN_POSITIVE..=PLANE_WEIGHT_MAX)?;
                Ok(ImagePlane { distance, target, weight })
            };
            Ok((planes.iter().zip(distances).enumerate().map(plane).collect::<Result<_, ApiError>>()?, None))
        }
    }
}

fn no_distance(field: &Field, message: &v1::OptimizeHologram, beside: &str) -> Result<(), ApiError> {
    if message.distance_m == 0.0 {
        return Ok(());
    }
    Err(field.at("distance_m").invalid(format!("is given beside {beside}, which has distances of its own")))
}

fn distances(list: &Field, given: impl ExactSizeIterator<Item = (Field, f64)>) -> Result<Vec<Distance>, ApiError> {
    at_most(list, given.len(), PLANES_MAX)?;
    let mut found = Vec::new();
    for (field, value) in given {
        let distance = field.distance(value)?;
        if found.contains(&distance) {
            return Err(field.invalid(format!("is {distance} again; no two planes may be at one distance")));
        }
        found.push(distance);
    }
    Ok(found)
}

fn at_most(list: &Field, count: usize, most: usize) -> Result<(), ApiError> {
    if count <= most {
        return Ok(());
    }
    Err(list.invalid(format!("has {count} entries, but at most {most} are accepted")))
}

fn method(value: i32) -> Option<Method> {
    Some(match optimize_hologram::Method::try_from(value).ok()? {
        optimize_hologram::Method::Unspecified | optimize_hologram::Method::Lbfgs => Method::Lbfgs,
        optimize_hologram::Method::Adam => Method::Adam,
        optimize_hologram::Method::GerchbergSaxton => Method::GerchbergSaxton,
        optimize_hologram::Method::WeightedGerchbergSaxton => Method::WeightedGerchbergSaxton,
        optimize_hologram::Method::DoublePhase => Method::DoublePhase,
    })
}

fn fit(value: i32) -> Option<Fit> {
    match optimize_hologram::Fit::try_from(value).ok()? {
        optimize_hologram::Fit::Unspecified | optimize_hologram::Fit::Contain => Some(Fit::Contain),
        optimize_hologram::Fit::Cover => Some(Fit::Cover),
        optimize_hologram::Fit::Stretch => Some(Fit::Stretch),
        optimize_hologram::Fit::Exact => Some(Fit::Exact),
    }
}

fn adams_rate(field: &Field, value: f64, method: Method) -> Result<f64, ApiError> {
    let given = learning_rate(field, value)?;
    if given.is_some() && method != Method::Adam {
        return Err(field.invalid(format!("is {value}, but only the method adam has a learning rate")));
    }
    Ok(given.unwrap_or(LEARNING_RATE_DEFAULT))
}

fn phase_range(field: &Field, value: f64) -> Result<f64, ApiError> {
    /// 2π, as people and other programs round it.
    const ROUNDING: f64 = 1e-6;
    if (0.0..=TAU + ROUNDING).contains(&value) {
        return Ok(value.min(TAU));
    }
    Err(field.invalid(format!("is {value}, but must be 0 to 2π rad")))
}

fn optional_digest(field: &Field, value: &str) -> Result<Option<String>, ApiError> {
    if value.is_empty() { Ok(None) } else { field.digest(value).map(Some) }
}

/// What an initial phase depends on.
#[derive(Clone, Copy)]
struct Begins {
    method: Method,
    detector: Detector,
    wavelengths: usize,
}

impl Begins {
    /// Where nobody said.
    fn by_default(self, message: &v1::OptimizeHologram) -> InitialPhase {
        let follows_gradient = matches!(self.method, Method::Adam | Method::Lbfgs);
        // What vortices a random phase has between the pixels stay; without any, L-BFGS ends some 4 dB higher. Several
        // frames have to differ, and a range is asked for to be used.
        let smooth = self.detector == Detector::Supersampled
            && follows_gradient
            && message.frames <= 1
            && message.initial_phase_range_rad.is_none();
        if smooth || self.method == Method::DoublePhase {
            return InitialPhase::Constant { phase_rad: 0.0 };
        }
        InitialPhase::Random
    }
}

fn initial_phase(field: &Field, message: &v1::OptimizeHologram, begins: Begins) -> Result<InitialPhase, ApiError> {
    let Begins { method, wavelengths, .. } = begins;
    let given = message.initial_phase.clone().unwrap_or_default();
    let kind = field.at("kind").known(given.kind, |value| Kind::try_from(value).ok())?;
    let refuse = |name, of| Err(field.at(name).invalid(format!("is given, but the kind of initial phase is not {of}")));
    if kind != Kind::Constant && given.constant_rad != 0.0 {
        return refuse("constant_rad", "constant");
    }
    if kind != Kind::Quadratic && given.focal_length_m != 0.0 {
        return refuse("focal_length_m", "quadratic");
    }
    if kind != Kind::Given && !given.phases.is_empty() {
        return refuse("phases", "given");
    }
    if method == Method::DoublePhase && kind == Kind::BackPropagated {
        return Err(field.at("kind").invalid("is back-propagated, but double phase begins with a phase of the image"));
    }
    Ok(match kind {
        Kind::Unspecified => begins.by_default(message),
        Kind::Random => InitialPhase::Random,
        Kind::BackPropagated => InitialPhase::BackPropagated,
        Kind::Quadratic => {
            let value = given.focal_length_m;
            let focal_length_m = field.at("focal_length_m").number(value, -1e3..=1e3)?;
            InitialPhase::Quadratic { focal_length_m: (focal_length_m != 0.0).then_some(focal_length_m) }
        }
        Kind::Constant => {
            InitialPhase::Constant { phase_rad: field.at("constant_rad").number(given.constant_rad, -TAU..=TAU)? }
        }
        Kind::Given => {
            let list = field.at("phases");
            if given.phases.len() != wavelengths {
                let count = given.phases.len();
                return Err(
                    list.invalid(format!("has {count} entries, but must have one for each wavelength, {wavelengths}"))
                );
            }
            let digests = given.phases.iter().enumerate().map(|(i, digest)| list.index(i).digest(digest));
            InitialPhase::Given(digests.collect::<Result<_, _>>()?)
        }
    })
}

fn loss_of(field: &Field, given: Option<optimize_hologram::Loss>, region: Region) -> Result<Loss, ApiError> {
    let given = given.unwrap_or_default();
    let quantity =
        field.at("quantity").known(given.quantity, |value| match loss::Quantity::try_from(value).ok()? {
            loss::Quantity::Unspecified | loss::Quantity::Intensity => Some(Quantity::Intensity),
            loss::Quantity::Amplitude => Some(Quantity::Amplitude),
        })?;
    let block = field.at("speckle_block_px");
    let speckle_block_px =
        block.integer_or(given.speckle_block_px, SPECKLE_BLOCK_PX_DEFAULT, 2..=SPECKLE_BLOCK_PX_MAX)?;
    if given.speckle > 0.0 && speckle_block_px > region.width_px.min(region.height_px) {
        return Err(block.invalid(format!("is {speckle_block_px}, but must fit into the region of interest")));
    }
    Ok(Loss {
        quantity,
        total_variation: field.at("total_variation").number(given.total_variation, 0.0..=FACTOR_MAX)?,
        speckle: field.at("speckle").number(given.speckle, 0.0..=FACTOR_MAX)?,
        speckle_block_px,
    })
}

/// What only methods that follow a gradient can do.
fn check_method(field: &Field, spec: &OptimizeHologram) -> Result<(), ApiError> {
    match spec.method {
        Method::Adam | Method::Lbfgs => return Ok(()),
        Method::GerchbergSaxton | Method::WeightedGerchbergSaxton | Method::DoublePhase => {}
    }
    let fix = "is given, but only the methods adam and lbfgs can follow it";
    if spec.loss != (Loss { speckle_block_px: spec.loss.speckle_block_px, ..Loss::default() }) {
        return Err(field.at("loss").invalid(fix));
    }
    if spec.quantization_aware {
        return Err(field.at("quantization_aware").invalid(fix));
    }
    Ok(())
}

/// What all frames and planes together may take of the machine's memory.
fn check_size(field: &Field, spec: &OptimizeHologram, display: &Display) -> Result<(), ApiError> {
    let pixels = u64::from(display.width_px) * u64::from(display.height_px);
    let planes = spec.planes().len() as u64;
    for (name, count, most) in
        [("frames", u64::from(spec.frames), FRAME_PIXELS_MAX), ("planes", planes, PLANE_PIXELS_MAX)]
    {
        if count > 1 && count * pixels > most {
            let (display, fits) = (&spec.display, (most / pixels).max(1));
            let problem = format!("are {count}, but on displays/{display} at most {fits} fit into memory");
            return Err(field.at(name).invalid(problem));
        }
    }
    Ok(())
}
