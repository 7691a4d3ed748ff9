//! The compact form of a smooth kernel: a whole display model in some hundred bytes.
//!
//! Layout, little-endian, without gaps:
//!
//! | offset | type | meaning |
//! |---|---|---|
//! | 0 | 4 bytes | `LPKC` |
//! | 4 | u8 | version of the layout: 3 with cross-talk or a response that varies over the SLM, else 2 where the kernel varies over the SLM, else 1 |
//! | 5 | u8 | model: 3 `smooth`, 4 `display`, 5 `varying` |
//! | 6 | u8 | K, highest total degree of the kernel's series, 0 to 12; 0: H = H_ideal |
//! | 7 | u8 | S, highest total degree of the source's series, 0 to 12 |
//! | 8 | u8 | R, harmonics of the phase response, 0 to 8 |
//! | 9 | u8 | number of the method of H_ideal, listed below |
//! | 10 | u8 | V, highest total degree of the kernel's variation over the SLM, 0 to 8; 0: no variation |
//! | 11 | u8 | version 3: W + 1 with W the highest total degree of the response's variation, 0 to 12, or 0: no variation; else 0 |
//! | 12 | u32, u32 | rows, columns of the display |
//! | 20 | f64, f64, f64 | pixel pitch, wavelength, distance \[m\] |
//! | 44 | f32 × 4 | gain, offset, real and imaginary part of the zero order |
//! | 60 | f32 × t(K) | α: logarithm of the kernel's amplitude |
//! | | f32 × t(K) | ψ: the kernel's phase \[rad\] |
//! | | f32 × t(S) | logarithm of the source's amplitude |
//! | | f32 × t(S) | the source's phase \[rad\] |
//! | | f32 × 2R | a₁ b₁ a₂ b₂ … of r(ψ) = (1 + v) ψ + Σ a_k sin kψ + b_k cos kψ \[rad\] |
//! | | f32 × 2 | version 3 only: q of the cross-talk along x and along y |
//! | | f32 × (1 + t(W)) | version 3 with variation only: v of the response, its constant first |
//! | | f32 × 5·2t(V) | α₁ ψ₁ α₂ ψ₂ … of x, y, x², xy, y² |
//! | end − 4 | u32 | CRC-32 (IEEE 802.3) of all bytes before |
//!
//! ```text
//! t(n) = (n + 1)(n + 2)/2 − 1,   s(x, y) = Σ c_ij T_i(x) T_j(y),  1 ≤ i + j ≤ n, ordered by i, then j
//! H(fx, fy) = H_ideal · exp(α(2Δfx, 2Δfy) + iψ(2Δfx, 2Δfy))
//! source(x, y) = exp(series of the source's amplitude + i · series of its phase),   x, y from −1 to 1 over the SLM
//! v(x, y) = constant + its series,   ψ = Σ_k Σ_l K_k(q_y) K_l(q_x) wrap(φ)(y + k, x + l),   K_k(q) = q^{k²} / Σ_j q^{j²},   j, k, l = −3 … 3
//! H(fx, fy; x, y) = H(fx, fy) · exp( Σ_m P_m(x, y) (α_m + iψ_m) )   for the light from (x, y) on the SLM
//! ```
//!
//! T_i Chebyshev polynomials, Δ the pixel pitch. The form leaves out ghosts, further modes of the light, the blur of
//! the light, and dust in the light on the SLM, which has two numbers for each pixel. Methods: 0 band-limited, 1 angular spectrum, 2 band
//! response, 3 Rayleigh–Sommerfeld, 4 Fresnel transfer function, 5 Fresnel impulse response. `docs/compact-kernel.md`
//! describes the form for authors of other decoders; [`decode`] is the reference.

use super::archive::crc_of;
use super::error::KernelFormatError;
use lightpath_optics::KernelModel;
use lightpath_optics::numerics::chebyshev::ChebyshevBasis;
use lightpath_optics::{
    ConvolutionMethod, Crosstalk, DisplayModel, Grid, KernelShape, OpticalSetup, ResponseVariation, SmoothField,
    SpatialVariation,
};
use num_complex::Complex64;

const MAGIC: &[u8; 4] = b"LPKC";
const VERSION: u8 = 1;
const VERSION_VARYING: u8 = 2;
const VERSION_UNEVEN: u8 = 3;
/// Largest degree of the variation over the SLM. With higher degrees the largest model would not be compact.
const VARIATION_ORDER_MAX: usize = 8;
const HEADER_BYTES: usize = 60;
/// Numbers of the methods. The shifted angular spectrum has no number and no compact form.
const METHODS: [(usize, ConvolutionMethod); 6] = [
    (2, ConvolutionMethod::BandResponse),
    (0, ConvolutionMethod::BandLimited),
    (1, ConvolutionMethod::AngularSpectrum),
    (3, ConvolutionMethod::RayleighSommerfeld),
    (4, ConvolutionMethod::FresnelTransferFunction),
    (5, ConvolutionMethod::FresnelImpulseResponse),
];

/// Whether the first bytes of a file are those of a compact kernel.
#[must_use]
pub fn is_compact(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

/// Encodes a smooth model in the compact form.
///
/// # Errors
///
/// [`KernelFormatError::NoSuchForm`] for kernels of free bins, which have no compact form.
pub fn encode(model: &DisplayModel, kind: KernelModel) -> Result<Vec<u8>, KernelFormatError> {
    let flat = SmoothField::flat(0);
    let kernel = match &model.kernel {
        KernelShape::Ideal => &flat,
        KernelShape::Smooth(errors) => errors,
        KernelShape::Bins(_) => {
            let message = "a kernel with a value for each frequency has no compact form; learn it as smooth or display";
            return Err(KernelFormatError::NoSuchForm(message.to_owned()));
        }
    };
    refuse_without_form(model)?;
    let variation_order = model.variation.order();
    let is_uneven = !model.crosstalk.is_none() || !model.response_variation.is_none();
    let version = match (is_uneven, model.variation.is_none()) {
        (true, _) => VERSION_UNEVEN,
        (false, true) => VERSION,
        (false, false) => VERSION_VARYING,
    };
    let code = match kind {
        KernelModel::Varying => 5,
        KernelModel::Display => 4,
        KernelModel::Smooth | KernelModel::Paper | KernelModel::Dense => 3,
    };
    let (method, _) = METHODS.into_iter().find(|&(_, method)| method == model.setup.method()).ok_or_else(|| {
        KernelFormatError::NoSuchForm(format!(
            "the {} has no number in the compact form; export another form",
            model.setup.method()
        ))
    })?;
    let grid = model.setup.grid();
    let mut bytes = MAGIC.to_vec();
    let orders = [kernel.order, model.source.order, model.response.len(), method].map(|number| number as u8);
    bytes.extend([version, code]);
    bytes.extend(orders);
    let uneven_response = (!model.response_variation.is_none()).then_some(&model.response_variation);
    bytes.extend([variation_order as u8, uneven_response.map_or(0, |variation| variation.order as u8 + 1)]);
    bytes.extend((grid.height_px() as u32).to_le_bytes());
    bytes.extend((grid.width_px() as u32).to_le_bytes());
    for length_m in [grid.pixel_pitch_m(), model.setup.wavelength_m(), model.setup.distance_m()] {
        bytes.extend(length_m.to_le_bytes());
    }
    let photometry = [model.gain, model.offset, model.zero_order.re, model.zero_order.im];
    let series = [&kernel.log_amplitude, &kernel.phase, &model.source.log_amplitude, &model.source.phase];
    let variation = model.variation.fields().iter().flat_map(|field| [&field.log_amplitude, &field.phase]).flatten();
    let numbers = photometry.iter().chain(series.into_iter().flatten()).chain(model.response.as_flattened());
    let ratios = model.crosstalk.ratios();
    let crosstalk = if is_uneven { &ratios[..] } else { &[] };
    let uneven_response = uneven_response.into_iter().flat_map(|variation| &variation.coefficients);
    let numbers = numbers.chain(crosstalk).chain(uneven_response).chain(variation);
    bytes.extend(numbers.flat_map(|&number| (number as f32).to_le_bytes()));
    bytes.extend(crc_of(&bytes).to_le_bytes());
    Ok(bytes)
}

/// Refuses displays that have parts which the form does not hold.
fn refuse_without_form(model: &DisplayModel) -> Result<(), KernelFormatError> {
    if model.setup.orders().filter().is_some() {
        let message = "a kernel of a display with a filter has no compact form, which does not hold the filter; export another form";
        return Err(KernelFormatError::NoSuchForm(message.to_owned()));
    }
    let variation_order = model.variation.order();
    if variation_order > VARIATION_ORDER_MAX {
        let message = format!(
            "the kernel varies over the SLM with degree {variation_order}, but the compact form holds degrees up to \
             {VARIATION_ORDER_MAX}; export another form"
        );
        return Err(KernelFormatError::NoSuchForm(message));
    }
    Ok(())
}

/// Decodes a compact kernel.
///
/// # Errors
///
/// [`KernelFormatError::Compact`] for a file that is cut, damaged, of a later version, or not a possible display.
pub fn decode(bytes: &[u8]) -> Result<(DisplayModel, KernelModel), KernelFormatError> {
    let refused = |problem: String| KernelFormatError::Compact(problem);
    if !is_compact(bytes) || bytes.len() < HEADER_BYTES + 4 {
        return Err(refused(format!("has {} bytes, or does not start with LPKC", bytes.len())));
    }
    let shape = Shape::read(bytes)?;
    let expected = shape.bytes();
    if bytes.len() != expected {
        return Err(refused(format!("has {} bytes, but its header requires {expected}", bytes.len())));
    }
    let (content, crc) = bytes.split_at(expected - 4);
    if crc != crc_of(content).to_le_bytes() {
        return Err(refused("does not match its checksum: it was damaged; copy it again".to_owned()));
    }
    let kind = match bytes[5] {
        3 => KernelModel::Smooth,
        4 => KernelModel::Display,
        5 => KernelModel::Varying,
        other => return Err(refused(format!("has the model number {other}, but must have 3, 4 or 5"))),
    };
    let (_, method) = (METHODS.into_iter().find(|&(number, _)| number == usize::from(bytes[9])))
        .ok_or_else(|| refused(format!("has the method number {}, but must have 0 to 5", bytes[9])))?;
    let mut numbers = content[44..].as_chunks().0.iter().map(|&chunk| f64::from(f32::from_le_bytes(chunk)));
    let photometry = take(&mut numbers, 4);
    let (kernel, source) = (take_field(&mut numbers, shape.kernel_order), take_field(&mut numbers, shape.source_order));
    let response = take(&mut numbers, 2 * shape.harmonics).as_chunks().0.to_vec();
    let crosstalk = match take(&mut numbers, shape.crosstalk)[..] {
        [ratio_x, ratio_y] => Crosstalk { ratio_x: crosstalk_ratio(ratio_x), ratio_y: crosstalk_ratio(ratio_y) },
        _ => Crosstalk::NONE,
    };
    let response_variation = match shape.uneven_order {
        Some(order) => ResponseVariation { order, coefficients: take(&mut numbers, ResponseVariation::terms(order)) },
        None => ResponseVariation::none(),
    };
    let variation = match shape.variation_order {
        0 => SpatialVariation::none(),
        order => SpatialVariation::new([(); SpatialVariation::POWERS].map(|()| take_field(&mut numbers, order))),
    };
    let model = DisplayModel {
        kernel: KernelShape::Smooth(kernel),
        variation,
        source,
        response,
        response_variation,
        crosstalk,
        zero_order: Complex64::new(photometry[2], photometry[3]),
        gain: photometry[0],
        offset: photometry[1],
        ..DisplayModel::ideal(setup_of(content)?.with_method_regardless(method))
    };
    model.validate()?;
    Ok((model, kind))
}

/// The numbers of values in a compact kernel, from its header.
struct Shape {
    kernel_order: usize,
    source_order: usize,
    harmonics: usize,
    variation_order: usize,
    /// 2 in version 3, otherwise 0.
    crosstalk: usize,
    /// Order of the response's variation, if it varies.
    uneven_order: Option<usize>,
}

impl Shape {
    fn read(bytes: &[u8]) -> Result<Self, KernelFormatError> {
        let refused = |problem: String| KernelFormatError::Compact(problem);
        let version = bytes[4];
        if !(VERSION..=VERSION_UNEVEN).contains(&version) {
            return Err(refused(format!("is of version {version}; this server reads up to version {VERSION_UNEVEN}")));
        }
        let is_uneven = version == VERSION_UNEVEN;
        let [kernel_order, source_order, harmonics, variation_order, uneven] =
            [6, 7, 8, 10, 11].map(|at| usize::from(bytes[at]));
        if uneven > if_uneven(is_uneven, ChebyshevBasis::ORDER_MAX + 1) {
            return Err(refused(format!("has {uneven} in byte 11; version 3 has 0 to 13 there, the others 0")));
        }
        if kernel_order > ChebyshevBasis::ORDER_MAX || source_order > ChebyshevBasis::ORDER_MAX {
            return Err(refused(format!("has orders {kernel_order} and {source_order}, but 12 is the highest")));
        }
        let varies_rightly = is_uneven || (variation_order > 0) == (version == VERSION_VARYING);
        if variation_order > VARIATION_ORDER_MAX || !varies_rightly {
            return Err(refused(format!(
                "is of version {version} and varies over the SLM with degree {variation_order}; kernels of version 1 \
                 have degree 0, those of version 2 have 1 to {VARIATION_ORDER_MAX}"
            )));
        }
        let (crosstalk, uneven_order) = (if_uneven(is_uneven, 2), uneven.checked_sub(1));
        Ok(Self { kernel_order, source_order, harmonics, variation_order, crosstalk, uneven_order })
    }

    /// Number of bytes of the file.
    fn bytes(&self) -> usize {
        let terms = |order| ChebyshevBasis::new(order).terms();
        let variation = SpatialVariation::POWERS * terms(self.variation_order);
        let pairs = terms(self.kernel_order) + terms(self.source_order) + self.harmonics + variation;
        let uneven = self.uneven_order.map_or(0, ResponseVariation::terms);
        HEADER_BYTES + 4 * (2 * pairs + self.crosstalk + uneven) + 4
    }
}

/// A number that only version 3 has.
fn if_uneven(is_uneven: bool, number: usize) -> usize {
    if is_uneven { number } else { 0 }
}

/// The setup in the header of a compact kernel: height and width \[px\], then pitch, wavelength and distance \[m\].
fn setup_of(content: &[u8]) -> Result<OpticalSetup, KernelFormatError> {
    let sides: Vec<usize> =
        content[12..20].as_chunks().0.iter().map(|&chunk| u32::from_le_bytes(chunk) as usize).collect();
    let lengths: Vec<f64> = content[20..44].as_chunks().0.iter().map(|&chunk| f64::from_le_bytes(chunk)).collect();
    let grid = Grid::try_new(sides[0], sides[1], lengths[0])?;
    Ok(OpticalSetup::try_new(grid, lengths[1], lengths[2])?)
}

/// q of the cross-talk. The largest allowed one, 0.6, is larger when it is rounded to f32.
fn crosstalk_ratio(ratio: f64) -> f64 {
    if ratio == f64::from(Crosstalk::RATIO_MAX as f32) { Crosstalk::RATIO_MAX } else { ratio }
}

fn take(numbers: &mut impl Iterator<Item = f64>, count: usize) -> Vec<f64> {
    numbers.take(count).collect()
}

fn take_field(numbers: &mut impl Iterator<Item = f64>, order: usize) -> SmoothField {
    let terms = ChebyshevBasis::new(order).terms();
    SmoothField { order, log_amplitude: take(numbers, terms), phase: take(numbers, terms) }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(crate) fn smooth(order: usize) -> DisplayModel {
        let setup = OpticalSetup::try_new(Grid::try_new(32, 48, 8e-6).unwrap(), 515e-9, 0.07).unwrap();
        let mut kernel = SmoothField::flat(order);
        let mut source = SmoothField::flat(order);
        for (i, c) in kernel.phase.iter_mut().chain(&mut kernel.log_amplitude).enumerate() {
            *c = (i as f64 * 1.7).sin();
        }
        source.log_amplitude.iter_mut().enumerate().for_each(|(i, c)| *c = 0.1 * (i as f64).cos());
        DisplayModel {
            kernel: KernelShape::Smooth(kernel),
            source,
            response: vec![[0.15, -0.02]; DisplayModel::HARMONICS_MAX],
            zero_order: Complex64::new(0.03, 0.01),
            gain: 0.7,
            offset: 0.01,
            ..DisplayModel::ideal(setup)
        }
    }

    #[test]
    fn largest_model_is_below_4_kib_and_exact_to_f32() {
        for (order, variation_order, uneven) in [
            (0, 0, None),
            (5, 0, None),
            (5, 0, Some(3)),
            (5, 4, None),
            (5, 4, Some(0)),
            (ChebyshevBasis::ORDER_MAX, VARIATION_ORDER_MAX, Some(ChebyshevBasis::ORDER_MAX)),
        ] {
            let mut model = smooth(order);
            if let Some(order) = uneven {
                model.crosstalk = Crosstalk { ratio_x: 0.085, ratio_y: 0.0 };
                let coefficients = vec![0.01; ResponseVariation::terms(order)];
                model.response_variation = ResponseVariation { order, coefficients };
            }
            let model_kind = if variation_order == 0 { KernelModel::Display } else { KernelModel::Varying };
            if variation_order > 0 {
                let KernelShape::Smooth(field) = smooth(variation_order).kernel else { panic!() };
                model.variation = SpatialVariation::new([(); 5].map(|()| field.clone()));
            }
            let bytes = encode(&model, model_kind).unwrap();
            assert!(bytes.len() <= 4096, "{}", bytes.len());
            let (back, kind) = decode(&bytes).unwrap();
            assert_eq!((kind, back.variation.order()), (model_kind, variation_order));
            assert_eq!(back.response_variation.order, uneven.unwrap_or(0));
            assert!((back.crosstalk.ratio_x - model.crosstalk.ratio_x).abs() < 1e-8);
            assert_eq!(encode(&back, kind).unwrap(), bytes, "a second conversion loses nothing");
            let (KernelShape::Smooth(a), KernelShape::Smooth(b)) = (&model.kernel, &back.kernel) else { panic!() };
            // Rounding of coefficients up to 1 in f32.
            assert!(a.phase.iter().zip(&b.phase).all(|(a, b)| (a - b).abs() <= 2.0_f64.powi(-25)));
            assert_eq!(back.setup, model.setup);
        }
    }

    #[test]
    fn the_largest_crosstalk_is_read_back() {
        let crosstalk = Crosstalk { ratio_x: Crosstalk::RATIO_MAX, ratio_y: 0.0 };
        let bytes = encode(&DisplayModel { crosstalk, ..smooth(1) }, KernelModel::Display).unwrap();
        assert_eq!(decode(&bytes).unwrap().0.crosstalk, crosstalk);
    }

    /// PSNR \[dB\] of the display's image of a hologram optimized through `through`, with fitted gain.
    fn captured_psnr_db(display: &DisplayModel, through: &DisplayModel) -> f64 {
        use lightpath_bench::TestCard;
        use lightpath_optics::hologram::{HologramMethod, HologramOptions, initial_phase};
        use lightpath_optics::metrics::fitted_intensity_scale;
        use lightpath_optics::{Detector, Engine, HologramProblem, Optimization, Plane, RegionOfInterest};
        let grid = display.setup.grid();
        let (height, width) = (grid.height_px(), grid.width_px());
        let (target, region) = (TestCard::Portrait.render(height, width, 1).unwrap(), RegionOfInterest::middle(&grid));
        let engine = |model: &DisplayModel| Engine::new(model, Detector::Pixel, None).unwrap();
        let problem = HologramProblem::new(engine(through), target.clone(), region).unwrap();
        let options = HologramOptions::new(HologramMethod::Adam { learning_rate: 0.2 }, 60);
        let start = initial_phase(height, width, 1.0, 1).unwrap().into_vec();
        let mut adam = Optimization::start(problem, options, start).unwrap();
        while adam.step().is_some() {}
        let phase = Plane::try_from_vec(height, width, adam.phases().to_vec()).unwrap();
        let captured = engine(display).light(&phase).unwrap();
        let gain = fitted_intensity_scale(&captured, &target, region).unwrap();
        let (mut sum, mut count) = (0.0, 0.0);
        for (y, x) in (0..height).flat_map(|y| region.columns(y).unwrap_or_default().map(move |x| (y, x))) {
            sum += (gain * f64::from(captured.at(y, x)) - f64::from(target.at(y, x))).powi(2);
            count += 1.0;
        }
        -10.0 * (sum / count).log10()
    }

    #[test]
    fn compact_kernel_gives_equally_good_holograms() {
        let mut display = smooth(5);
        display.setup = OpticalSetup::try_new(Grid::try_new(96, 160, 8e-6).unwrap(), 515e-9, 5e-3).unwrap();
        let (compact, _) = decode(&encode(&display, KernelModel::Display).unwrap()).unwrap();
        let (full_db, compact_db) = (captured_psnr_db(&display, &display), captured_psnr_db(&display, &compact));
        assert!(full_db > 15.0 && (full_db - compact_db).abs() < 0.2, "{full_db} dB, {compact_db} dB");
    }

    #[test]
    fn damaged_kernels_and_later_versions_are_refused() {
        let bytes = encode(&smooth(5), KernelModel::Smooth).unwrap();
        for end in [0, 4, 59, 63, bytes.len() - 1] {
            assert!(decode(&bytes[..end]).is_err(), "cut at {end}");
        }
        for at in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x10;
            assert!(decode(&damaged).is_err(), "byte {at}");
        }
        let mut later = bytes;
        later[4] = VERSION_UNEVEN + 1;
        assert!(decode(&later).unwrap_err().to_string().contains(&format!("version {}", VERSION_UNEVEN + 1)));
    }

    #[test]
    fn free_bins_have_no_compact_form() {
        let mut model = smooth(2);
        model.kernel = KernelShape::Bins(lightpath_optics::Plane::filled(64, 96, num_complex::Complex32::ONE));
        assert!(encode(&model, KernelModel::Dense).unwrap_err().to_string().contains("learn it as smooth"));
    }
}
