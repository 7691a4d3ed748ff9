//! The numbers of each vector, from the engine.

use crate::import;
use crate::kernels::{self, Case};
use crate::plain_decoder;
use crate::text::{self, Block};
use lightpath_media::kernel_formats::{KernelFormat, compact, export};
use lightpath_optics::display::parts::crosstalk;
use lightpath_optics::engine::EngineCore;
use lightpath_optics::numerics::grid::frequency;
use lightpath_optics::{
    ConvolutionMethod, Crosstalk, Detector, DisplayModel, KernelShape, OpticalSetup, Plane, SpatialVariation,
};
use num_complex::Complex64;
use std::f64::consts::TAU;
use std::fs;
use std::path::Path;

/// Allowed difference between committed numbers and those of this machine, relative over a block. Texts round to nine
/// digits, and each machine's sines differ in their last bits.
const TOLERANCE: f64 = 1e-8;
/// Largest difference between the engine's band response and plain sums, relative over the band.
const BAND_RESPONSE_TOLERANCE: f64 = 2e-7;
/// A phase step of the vectors' holograms: a 512th of a turn.
const STEP_RAD: f64 = TAU / 512.0;
/// Phases at which the response is given \[rad\].
const RESPONSE_PHASES: [f64; 8] = [0.0, 0.5, 1.25, 2.0, 3.0, 4.25, 5.5, 6.25];

/// Writes all vectors, and removes those of the old list.
pub(crate) fn write(folder: &Path) {
    fs::create_dir_all(folder).unwrap();
    let old = fs::read_to_string(folder.join("vectors.txt")).unwrap_or_default();
    for name in old.lines().filter(|name| !name.starts_with('#')) {
        fs::remove_file(folder.join(name)).unwrap();
        fs::remove_file(folder.join(name).with_extension("txt")).unwrap();
    }
    fs::write(folder.join("vectors.txt"), list()).unwrap();
    for case in kernels::all() {
        fs::write(folder.join(format!("{}.lpk", case.name)), file_of(&case)).unwrap();
        fs::write(folder.join(format!("{}.txt", case.name)), text_of(&case)).unwrap();
    }
    for case in kernels::arrays() {
        let array = array_of(&case);
        fs::write(folder.join(format!("{}.npy", case.name)), &array).unwrap();
        fs::write(folder.join(format!("{}.txt", case.name)), array_text_of(&case, &array)).unwrap();
    }
}

/// Compares the committed vectors with what this code writes.
pub(crate) fn compare(folder: &Path) {
    let read = |name: &str| fs::read_to_string(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
    assert_eq!(read("vectors.txt"), list(), "the list of vectors");
    for case in kernels::all() {
        let file = fs::read(folder.join(format!("{}.lpk", case.name))).unwrap();
        assert_eq!(file, file_of(&case), "{}.lpk; {} writes new vectors", case.name, crate::WRITE);
        compare_texts(&case.name, &read(&format!("{}.txt", case.name)), &text_of(&case));
    }
    for case in kernels::arrays() {
        let array = fs::read(folder.join(format!("{}.npy", case.name))).unwrap();
        let transfer = |array: &[u8]| numbers_of(&rows_of(&case, array, &case.rows));
        // Half of the last bit of a float16, and an engine whose last bits differ.
        let error = text::error(&transfer(&array_of(&case)), &transfer(&array));
        assert!(error < 1e-3, "{}.npy differs by {error:e}; {} writes new vectors", case.name, crate::WRITE);
        compare_texts(&case.name, &read(&format!("{}.txt", case.name)), &array_text_of(&case, &array));
    }
}

fn compare_texts(name: &str, committed: &str, now: &str) {
    let (committed, now) = (text::read(committed), text::read(now));
    assert_eq!(committed.len(), now.len(), "{name}.txt; {} writes new vectors", crate::WRITE);
    for (committed, now) in committed.iter().zip(&now) {
        assert_eq!(committed.title, now.title, "{name}.txt; {} writes new vectors", crate::WRITE);
        assert_eq!(committed.numbers.len(), now.numbers.len(), "{name}.txt: {}", now.title);
        let error = text::error(&now.numbers, &committed.numbers);
        assert!(
            error <= TOLERANCE,
            "{name}.txt: {} differs by {error:e}; {} writes new vectors",
            now.title,
            crate::WRITE
        );
    }
}

fn list() -> String {
    let kernels = kernels::all().into_iter().map(|case| format!("{}.lpk\n", case.name));
    let arrays = kernels::arrays().into_iter().map(|case| format!("{}.npy\n", case.name));
    let names: String = kernels.chain(arrays).collect();
    format!("# Test vectors of the compact kernel. docs/compact-kernel.md describes them.\n{names}")
}

fn file_of(case: &Case) -> Vec<u8> {
    compact::encode(&case.model, case.kind).unwrap()
}

fn array_of(case: &Case) -> Vec<u8> {
    export(&case.model, case.kind, KernelFormat::F16).unwrap().bytes
}

fn text_of(case: &Case) -> String {
    let file = file_of(case);
    // The numbers are those of the file.
    let (model, _) = compact::decode(&file).unwrap();
    let mut blocks = values(&model, &file);
    let axis = on_axis(&model, &file);
    for &place in &case.places {
        blocks.extend(transfer(&model, &axis, &case.rows, place));
    }
    if !case.modulator_rows.is_empty() {
        blocks.extend(modulator(&model, &case.modulator_rows));
    }
    text::write(&format!("What a decoder must compute from {}.lpk.", case.name), &blocks)
}

fn block(title: String, numbers: Vec<f64>) -> Block {
    Block { title, numbers }
}

fn numbers_of(values: &[Complex64]) -> Vec<f64> {
    values.iter().flat_map(|value| [value.re, value.im]).collect()
}

/// Numbers of the header.
fn values(model: &DisplayModel, file: &[u8]) -> Vec<Block> {
    let grid = model.setup.grid();
    let numbers: [(&str, f64); 12] = [
        ("version", file[4].into()),
        ("model", file[5].into()),
        ("method", file[9].into()),
        ("rows", grid.height_px() as f64),
        ("columns", grid.width_px() as f64),
        ("pitch", grid.pixel_pitch_m()),
        ("wavelength", model.setup.wavelength_m()),
        ("distance", model.setup.distance_m()),
        ("gain", model.gain),
        ("offset", model.offset),
        ("zero_order_re", model.zero_order.re),
        ("zero_order_im", model.zero_order.im),
    ];
    let written = |(name, number): (&str, f64)| match number.fract() == 0.0 {
        true => block(format!("value {name} {number}"), Vec::new()),
        false => block(format!("value {name} {number:e}"), Vec::new()),
    };
    numbers.into_iter().map(written).collect()
}

/// H on the axis at all padded bins, zero frequency at `[0][0]`. The engine rounds the phases of its band response to
/// f32, which rows with little light would show. So these values come from plain sums in f64, with which the engine must
/// agree.
fn on_axis(model: &DisplayModel, file: &[u8]) -> Vec<Complex64> {
    let (rows, columns) = (model.setup.padded_height_px(), model.setup.padded_width_px());
    let (at, pitch_m) = (model.sampled(), model.setup.grid().pixel_pitch_m());
    let bins = (0..rows).flat_map(|v| (0..columns).map(move |u| (u, v)));
    let engine: Vec<Complex64> =
        bins.map(|(u, v)| at(frequency(u, columns, pitch_m), frequency(v, rows, pitch_m))).collect();
    if model.setup.method() != ConvolutionMethod::BandResponse {
        return engine;
    }
    let plain = plain_decoder::read(file).transfer();
    let error = text::error(&numbers_of(&plain), &numbers_of(&engine));
    assert!(error < BAND_RESPONSE_TOLERANCE, "{error:e}");
    plain
}

/// Rows of H for the light from (x, y).
fn transfer(model: &DisplayModel, axis: &[Complex64], rows: &[usize], (x, y): (f64, f64)) -> Vec<Block> {
    let (padded_rows, columns) = (model.setup.padded_height_px(), model.setup.padded_width_px());
    let place = |bin: usize, bins: usize| 2.0 * frequency(bin, bins, 1.0);
    let row = |&v: &usize| {
        let local = |u: usize| model.variation.exponent(x, y, place(u, columns), place(v, padded_rows)).exp();
        let values: Vec<Complex64> = (0..columns).map(|u| axis[v * columns + u] * local(u)).collect();
        block(format!("transfer {v} {x} {y} {columns}"), numbers_of(&values))
    };
    rows.iter().map(row).collect()
}

fn place(index: usize, count: usize) -> f64 {
    (2 * index + 1) as f64 / count as f64 - 1.0
}

/// The light on the modulator, its response and cross-talk, the phases that it is given, and the field behind it.
fn modulator(model: &DisplayModel, rows: &[usize]) -> Vec<Block> {
    let (height_px, width_px) = (model.setup.grid().height_px(), model.setup.grid().width_px());
    let mut blocks = Vec::new();
    for &row in rows {
        let values = (0..width_px).map(|x| model.source.value(place(x, width_px), place(row, height_px)));
        blocks.push(block(format!("source {row} {width_px}"), numbers_of(&values.collect::<Vec<_>>())));
    }
    for (x, y) in [(0.0, 0.0), (-0.5, 0.875)] {
        let v = model.response_variation.value(x, y);
        let responses = RESPONSE_PHASES.map(|psi| (1.0 + v) * psi + harmonics(model, psi));
        let title = format!("response {x} {y} {}", RESPONSE_PHASES.len());
        blocks.push(block(title, [RESPONSE_PHASES, responses].concat()));
    }
    for (axis, ratio) in ["x", "y"].into_iter().zip(model.crosstalk.ratios()) {
        blocks.push(block(format!("crosstalk {axis} 7"), weights(ratio)));
    }
    let steps = Plane::from_fn(height_px, width_px, phase_step);
    for row in 0..height_px {
        blocks.push(block(format!("phases {row} {width_px}"), steps.row(row).to_vec()));
    }
    let field = field_behind(model, &steps.map(|step| step * STEP_RAD));
    for &row in rows {
        blocks.push(block(format!("field {row} {width_px}"), numbers_of(field.row(row))));
    }
    blocks
}

/// Phases between −2π and 4π. They are odd, so that none is a whole turn: there, rounding decides the wrapped phase.
fn phase_step(y: usize, x: usize) -> f64 {
    (2 * ((y * 331 + x * 147 + x * y * 29) % 768)) as f64 - 511.0
}

fn harmonics(model: &DisplayModel, psi: f64) -> f64 {
    let terms = (1..).zip(&model.response).map(|(k, [a, b])| {
        let (sine, cosine) = (f64::from(k) * psi).sin_cos();
        a * sine + b * cosine
    });
    terms.sum()
}

/// The weights with which phases blur into a pixel: the blurred phases of a single pixel, by their definition.
fn weights(ratio: f64) -> Vec<f64> {
    let mut alone = Plane::filled(1, 7, 0.0);
    alone.values_mut()[3] = 1.0;
    crosstalk::shown_phase(&alone, &Crosstalk { ratio_x: ratio, ratio_y: 0.0 }).values().to_vec()
}

/// The field behind the modulator, by the engine in f64: the light after so short a distance that H is 1.
fn field_behind(model: &DisplayModel, phase: &Plane<f64>) -> Plane<Complex64> {
    let setup = OpticalSetup::try_new(model.setup.grid(), model.setup.wavelength_m(), 1e-30).unwrap();
    let here = DisplayModel {
        setup: setup.with_method_regardless(ConvolutionMethod::FresnelTransferFunction),
        kernel: KernelShape::Ideal,
        variation: SpatialVariation::none(),
        ..model.clone()
    };
    EngineCore::<f64>::new(&here, Detector::Point, None).unwrap().field(phase).unwrap()
}

/// Rows of an array, zero frequency at `[0][0]`.
fn rows_of(case: &Case, array: &[u8], rows: &[usize]) -> Vec<Complex64> {
    let KernelShape::Bins(stored) = import(array, &case.model.setup).unwrap().model.kernel else {
        panic!("an array has a value for each frequency")
    };
    let (height, width) = (stored.height_px(), stored.width_px());
    let value = |u: usize, v: usize| stored.at((v + height / 2) % height, (u + width / 2) % width);
    let values = rows.iter().flat_map(|&v| (0..width).map(move |u| value(u, v)));
    values.map(|value| Complex64::new(value.re.into(), value.im.into())).collect()
}

fn array_text_of(case: &Case, array: &[u8]) -> String {
    let columns = case.model.setup.padded_width_px();
    let row = |&v: &usize| block(format!("transfer {v} 0 0 {columns}"), numbers_of(&rows_of(case, array, &[v])));
    let blocks: Vec<Block> = case.rows.iter().map(row).collect();
    text::write(&format!("What a decoder must read from {}.npy.", case.name), &blocks)
}
