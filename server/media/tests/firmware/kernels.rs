//! The kernels of the vectors. Each is small, and each number of a file is exact in 32 bits, so that every machine
//! writes the same file.

use lightpath_optics::{
    ConvolutionMethod, Crosstalk, DisplayModel, Grid, KernelModel, KernelShape, OpticalSetup, ResponseVariation,
    SmoothField, SpatialVariation,
};
use num_complex::Complex64;

/// A kernel with the parts of it that its text has.
pub(crate) struct Case {
    /// Name of its files.
    pub(crate) name: String,
    pub(crate) model: DisplayModel,
    pub(crate) kind: KernelModel,
    /// Rows of H.
    pub(crate) rows: Vec<usize>,
    /// Places of the modulator at which H is given.
    pub(crate) places: Vec<(f64, f64)>,
    /// Rows of the source and of the field behind the modulator; none: only H is given.
    pub(crate) modulator_rows: Vec<usize>,
}

/// Sides, pixel pitch \[m\] and distance \[m\] of a display for green light.
#[derive(Clone, Copy)]
struct Optics {
    rows: usize,
    columns: usize,
    pitch_m: f64,
    distance_m: f64,
}

impl Optics {
    const fn small(distance_m: f64) -> Self {
        Self { rows: 12, columns: 16, pitch_m: 8e-6, distance_m }
    }

    /// Pixels shorter than a wavelength: the corners of the band are evanescent.
    const fn fine(distance_m: f64) -> Self {
        Self { rows: 12, columns: 16, pitch_m: 0.3e-6, distance_m }
    }

    fn model(self, method: ConvolutionMethod) -> DisplayModel {
        let grid = Grid::try_new(self.rows, self.columns, self.pitch_m).unwrap();
        let setup = OpticalSetup::try_new(grid, 515e-9, self.distance_m).unwrap();
        DisplayModel {
            kernel: KernelShape::Smooth(SmoothField::flat(0)),
            ..DisplayModel::ideal(setup.with_method_regardless(method))
        }
    }
}

/// Names of the methods in the names of files, in the order of their numbers.
const METHODS: [(&str, ConvolutionMethod); 6] = [
    ("band-limited", ConvolutionMethod::BandLimited),
    ("angular-spectrum", ConvolutionMethod::AngularSpectrum),
    ("band-response", ConvolutionMethod::BandResponse),
    ("rayleigh-sommerfeld", ConvolutionMethod::RayleighSommerfeld),
    ("fresnel-transfer-function", ConvolutionMethod::FresnelTransferFunction),
    ("fresnel-impulse-response", ConvolutionMethod::FresnelImpulseResponse),
];

/// Coefficients up to `scale`, each a whole number of 256ths of it. `seed` makes them differ.
fn coefficients(count: usize, seed: usize, scale: f64) -> Vec<f64> {
    (0..count).map(|i| ((i * 97 + seed * 41 + 17) % 511) as f64 - 255.0).map(|step| scale * step / 256.0).collect()
}

fn field(order: usize, seed: usize, amplitude: f64, phase: f64) -> SmoothField {
    let terms = SmoothField::flat(order).log_amplitude.len();
    SmoothField {
        order,
        log_amplitude: coefficients(terms, seed, amplitude),
        phase: coefficients(terms, seed + 1, phase),
    }
}

fn with_kernel(model: DisplayModel, order: usize) -> DisplayModel {
    DisplayModel { kernel: KernelShape::Smooth(field(order, order, 0.125, 1.0)), ..model }
}

/// A model with a source, a phase response and undiffracted light.
fn with_modulator(model: DisplayModel, order: usize, harmonics: usize) -> DisplayModel {
    DisplayModel {
        source: field(order, 5, 0.25, 0.5),
        response: coefficients(2 * harmonics, 9, 0.25).as_chunks().0.to_vec(),
        zero_order: Complex64::new(0.0625, -0.03125),
        gain: 0.75,
        offset: 0.015625,
        ..model
    }
}

fn with_variation(model: DisplayModel, order: usize) -> DisplayModel {
    let mut seed = 20;
    let fields = [(); SpatialVariation::POWERS].map(|()| {
        seed += 2;
        field(order, seed, 0.0625, 0.5)
    });
    DisplayModel { variation: SpatialVariation::new(fields), ..model }
}

fn with_uneven_response(model: DisplayModel, order: usize) -> DisplayModel {
    let coefficients = coefficients(ResponseVariation::terms(order), 3, 0.125);
    DisplayModel { response_variation: ResponseVariation { order, coefficients }, ..model }
}

fn with_crosstalk(model: DisplayModel, ratio_x: f64, ratio_y: f64) -> DisplayModel {
    DisplayModel { crosstalk: Crosstalk { ratio_x, ratio_y }, ..model }
}

/// A kernel whose text has only H.
fn transfer_only(name: &str, model: DisplayModel, rows: &[usize]) -> Case {
    Case {
        name: name.to_owned(),
        model,
        kind: KernelModel::Smooth,
        rows: rows.to_vec(),
        places: vec![(0.0, 0.0)],
        modulator_rows: Vec::new(),
    }
}

/// A kernel whose text has H and the modulator.
fn whole(name: &str, model: DisplayModel, kind: KernelModel) -> Case {
    let rows = model.setup.grid().height_px();
    let places = match model.variation.is_none() {
        true => vec![(0.0, 0.0)],
        false => vec![(0.0, 0.0), (0.75, -0.5), (-1.0, 1.0)],
    };
    Case {
        name: name.to_owned(),
        model,
        kind,
        rows: vec![0, 3, rows],
        places,
        modulator_rows: vec![0, 1, rows / 2, rows - 1],
    }
}

/// Each method within and beyond the critical distance and for a negative distance.
fn of_every_method() -> Vec<Case> {
    let places = [("near", 2e-3), ("far", 60e-3), ("behind", -7e-3)];
    let cases = METHODS.into_iter().flat_map(|(name, method)| {
        places.map(|(place, distance_m)| {
            let model = with_kernel(Optics::small(distance_m).model(method), 3);
            transfer_only(&format!("{name}-{place}"), model, &[0, 1, 5, 12, 13, 23])
        })
    });
    cases.collect()
}

/// Waves that decay forwards and are removed backwards.
fn with_evanescent_waves() -> Vec<Case> {
    let cases = METHODS[..4].iter().flat_map(|&(name, method)| {
        [("evanescent", 0.4e-6), ("evanescent-behind", -0.4e-6)].map(|(place, distance_m)| {
            transfer_only(&format!("{name}-{place}"), Optics::fine(distance_m).model(method), &[0, 7, 12])
        })
    });
    cases.collect()
}

/// Sides of other sizes, among them the smallest and odd ones.
fn of_every_size() -> Vec<Case> {
    let sizes = [
        ("one-pixel", 1, 1, [0, 1, 1], &METHODS[..]),
        ("odd", 13, 17, [0, 13, 25], &METHODS[2..]),
        ("tall", 48, 20, [0, 31, 70], &METHODS[2..3]),
        ("wide", 20, 48, [0, 17, 33], &METHODS[3..4]),
    ];
    let cases = sizes.into_iter().flat_map(|(size, rows, columns, of, methods)| {
        methods.iter().map(move |&(name, method)| {
            let optics = Optics { rows, columns, pitch_m: 8e-6, distance_m: 5e-3 };
            transfer_only(&format!("{name}-{size}"), with_kernel(optics.model(method), 1), &of)
        })
    });
    cases.collect()
}

/// Models with all other parts, in all versions of the layout.
fn of_every_part() -> Vec<Case> {
    let plain = |method| with_kernel(Optics::small(3e-3).model(method), 5);
    let modulated = |method| with_modulator(plain(method), 4, 3);
    let (band_limited, band_response) = (ConvolutionMethod::BandLimited, ConvolutionMethod::BandResponse);
    let largest = with_modulator(with_kernel(Optics::small(3e-3).model(band_limited), 12), 12, 8);
    let largest = with_uneven_response(with_variation(largest, 8), 12);
    let crosstalk = |model, x, y| with_crosstalk(model, x, y);
    let crossed = |x, y| crosstalk(modulated(band_limited), x, y);
    vec![
        whole("display", modulated(band_response), KernelModel::Display),
        whole("crosstalk", crossed(0.125, 0.0625), KernelModel::Display),
        whole("crosstalk-along-x", crossed(0.25, 0.0), KernelModel::Display),
        whole("crosstalk-largest", crossed(Crosstalk::RATIO_MAX, 0.5), KernelModel::Display),
        whole("uneven-constant", with_uneven_response(modulated(band_limited), 0), KernelModel::Display),
        whole("uneven", with_uneven_response(modulated(band_limited), 3), KernelModel::Display),
        whole("varying", with_variation(modulated(band_response), 3), KernelModel::Varying),
        // Its variation has a higher order than the kernel itself.
        whole("varying-most", with_variation(with_kernel(modulated(band_limited), 2), 6), KernelModel::Varying),
        whole(
            "everything",
            crosstalk(with_uneven_response(with_variation(modulated(band_limited), 2), 2), 0.125, 0.0625),
            KernelModel::Varying,
        ),
        whole("largest", crosstalk(largest, 0.125, 0.0625), KernelModel::Varying),
    ]
}

/// All kernels in the compact form.
pub(crate) fn all() -> Vec<Case> {
    [of_every_method(), with_evanescent_waves(), of_every_size(), of_every_part()].into_iter().flatten().collect()
}

/// Kernels as float16 arrays.
pub(crate) fn arrays() -> Vec<Case> {
    // Its values fall below the smallest normal float16.
    let mut faint = Optics::small(3e-3).model(ConvolutionMethod::AngularSpectrum);
    let mut errors = SmoothField::flat(1);
    errors.log_amplitude[0] = 10.0;
    faint.kernel = KernelShape::Smooth(errors);
    let usual = with_kernel(Optics::small(3e-3).model(ConvolutionMethod::BandLimited), 3);
    let rows = [0, 1, 11, 12, 13, 23];
    vec![transfer_only("array", usual, &rows), transfer_only("array-faint", faint, &rows)]
}
