//! `.npz` archives with a whole model as arrays of numbers and texts.
//!
//! | array | type, shape | meaning |
//! |---|---|---|
//! | `transfer` | complex64, \[2·rows, 2·columns\] | H on the axis, zero frequency in the middle |
//! | `source` | complex64, \[rows, columns\] | the source profile at each pixel, with its dust |
//! | `pitch_wavelength_distance_m` | float64, \[3\] | pixel pitch, wavelength, distance \[m\] |
//! | `response_harmonics` | float64, \[R, 2\] | r(φ) = φ + Σ a_k sin kφ + b_k cos kφ \[rad\] |
//! | `photometry` | float64, \[4\] | gain, offset, zero order (real, imaginary) |
//! | `kernel.log_amplitude`, `kernel.phase` | float64, \[terms\] | α and ψ of H = H_ideal · exp(α + iψ) (`smooth`, `display`, `varying`) |
//! | `kernel.bins_shape` | float64, \[2\] | rows and columns of the middle part of `transfer` that is the kernel (`paper`, `dense`) |
//! | `source.log_amplitude`, `source.phase` | float64, \[terms\] | the source profile |
//! | `variation.log_amplitude`, `variation.phase` | float64, \[5, terms\] | factors of x, y, x², xy and y² (`varying`) |
//! | `crosstalk`, `response_variation`, `light_blur` | float64 | as in the native form (where the display has them) |
//! | `mode.light`, `mode.log_amplitude`, `mode.phase` | float64 | the further modes of the light, as in the native form (partially coherent light); `transfer` is H of the first mode |
//! | `ghost` | float64, \[5\] | real and imaginary part of the ghost's amplitude, its shift along x and y \[px\], its defocus \[rad\] (with a ghost) |
//! | `dust` | int16, \[rows, columns, 2\] | A and B of each pixel's factor exp(10⁻⁴ (A + iB)) of the source (with dust) |
//! | `lightpath` | text | model, method, orders and optics: the JSON object of [`crate::kernel_file`] |
//! | `transfer.digest`, `source.digest` | text | SHA-256 of the numbers of `transfer` and `source` |
//!
//! The arrays from `response_harmonics` on give the model exactly. `transfer` and `source` are for readers that only want numbers, and follow
//! from them. If `transfer` was changed, its digest does not match. Then H is what `transfer` holds: the imported model
//! is dense, and the series of the kernel and its variation do not count. A changed `source` cannot be imported,
//! because a model has the source as a series. The import says both. An archive without `lightpath` is one of another
//! program.

use super::archive::{self, Archive, Content};
use super::array::{self, Array, NpyFile};
use super::dense::{Transfer, f32_bytes, of_array, parts};
use super::error::KernelFormatError;
use super::imported::Imported;
use super::losses::Loss;
use crate::budget::Budget;
use crate::kernel_file::{self, Header, METADATA_KEY, Origin};
use crate::shortened::{shortened, sides};
use lightpath_domain::digests::digest_of;
use lightpath_domain::kernel_format::KernelFormat;
use lightpath_optics::display::parts::InBins;
use lightpath_optics::display::parts::stored::{Entry, Numbers, Stored, StoredArray, StoredError, StoredParts};
use lightpath_optics::learning::ModelPart;
use lightpath_optics::{DisplayModel, KernelModel, KernelShape, OpticalSetup, Plane};
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;

const TRANSFER: &str = "transfer";
const SOURCE: &str = "source";
const BINS_SHAPE: &str = "kernel.bins_shape";

/// Writes the model of `transfer`.
pub(super) fn write(transfer: &Transfer<'_>, kind: KernelModel, origin: &Origin) -> Result<Vec<u8>, KernelFormatError> {
    let model = transfer.model;
    let grid = model.setup.grid();
    let mut files: Vec<(String, Vec<u8>)> = Vec::new();
    let mut add = |name: &str, file: Vec<u8>| files.push((format!("{name}.npy"), file));
    let mut add_plane = |name: &str, plane: &Plane<Complex32>| {
        let bytes = f32_bytes(&parts(plane));
        add(&format!("{name}.digest"), array::npy_text(&digest_of(&bytes)));
        add(name, array::npy("<c8", &[plane.height_px(), plane.width_px()], &bytes));
    };
    add_plane(TRANSFER, &transfer.padded());
    add_plane(SOURCE, &sampled_source(model));
    let mut add_f64 = |name: &str, shape: &[usize], numbers: &[f64]| {
        let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        add(name, array::npy("<f8", shape, &bytes));
    };
    let optics = [grid.pixel_pitch_m(), model.setup.wavelength_m(), model.setup.distance_m()];
    add_f64("pitch_wavelength_distance_m", &[3], &optics);
    if let KernelShape::Bins(bins) = &model.kernel {
        add_f64(BINS_SHAPE, &[2], &[bins.height_px() as f64, bins.width_px() as f64]);
    }
    let stored = Stored::of(model);
    let header = kernel_file::header_text(model, kind, &stored, origin)?;
    for StoredArray { name, shape, numbers } in stored.into_arrays() {
        let descr = match numbers {
            Numbers::F64(_) => "<f8",
            Numbers::I16(_) => array::I16,
            // The bins are the middle of `transfer`.
            Numbers::F32(_) => continue,
        };
        add(array_name(name), array::npy(descr, &shape, &kernel_file::bytes(&numbers)));
    }
    add(METADATA_KEY, array::npy_text(&header));
    let files: Vec<(&str, &[u8])> = files.iter().map(|(name, file)| (name.as_str(), &file[..])).collect();
    archive::write(&files)
}

/// Name of the array with the numbers of a tensor of the native form.
fn array_name(tensor: &'static str) -> &'static str {
    if tensor == "response" { "response_harmonics" } else { tensor }
}

/// The source at each pixel.
fn sampled_source(model: &DisplayModel) -> Plane<Complex32> {
    let (height, width) = (model.setup.grid().height_px(), model.setup.grid().width_px());
    let mut source = Plane::filled(height, width, Complex32::ZERO);
    source.values_mut().par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        let position = |i: usize, n: usize| (2 * i + 1) as f64 / n as f64 - 1.0;
        for (x, value) in row.iter_mut().enumerate() {
            let Complex64 { re, im } =
                model.source.value(position(x, width), position(y, height)) * model.dust.factor(y, x);
            *value = Complex32::new(re as f32, im as f32);
        }
    });
    source
}

/// The files of an archive, and the memory that may be taken to read them.
#[derive(Clone, Copy)]
struct Files<'a> {
    archive: &'a Archive<'a>,
    budget: &'a Budget,
}

impl<'a> Files<'a> {
    /// The `.npy` file of an array, if there is one.
    fn named(self, array: &str) -> Result<Option<Content<'a>>, KernelFormatError> {
        self.archive.content(&format!("{array}.npy"), self.budget)
    }

    fn require(self, array: &str) -> Result<Content<'a>, KernelFormatError> {
        self.named(array)?.ok_or_else(|| absent(array))
    }

    fn f64s(self, array: &str, file: &[u8]) -> Result<Vec<f64>, KernelFormatError> {
        NpyFile::open(array, file)?.f64s(self.budget)
    }
}

/// Reads an archive: one that [`write()`] wrote, or one of another program.
pub(super) fn read(
    archive: &Archive<'_>,
    setup: &OpticalSetup,
    budget: &Budget,
) -> Result<Imported, KernelFormatError> {
    let files = Files { archive, budget };
    match files.named(METADATA_KEY)? {
        Some(header) => read_own(files, &header),
        None => read_foreign(files, setup),
    }
}

fn read_own(files: Files<'_>, header: &[u8]) -> Result<Imported, KernelFormatError> {
    let budget = files.budget;
    let header = Header::parse(&NpyFile::open(METADATA_KEY, header)?.text(budget)?)?;
    let is_changed = |name: &str| -> Result<bool, KernelFormatError> {
        let digest = format!("{name}.digest");
        let expected = NpyFile::open(&digest, &files.require(&digest)?)?.text(budget)?;
        Ok(expected != digest_of_numbers(name, &files.require(name)?, budget)?)
    };
    let model = kernel_file::assemble(&header, &Own { header: &header, files })?;
    let mut imported =
        Imported { kind: header.model, origin: header.into_origin(), ..Imported::new(KernelFormat::Npz, model) };
    if is_changed(SOURCE)? {
        imported.remarks.push(
            "the array `source` was changed and is not imported: a kernel has its source as a series and as dust, which stay \
             as they were",
        );
    }
    if is_changed(TRANSFER)? {
        take_transfer(&mut imported, &Array::read_npy(TRANSFER, &files.require(TRANSFER)?, budget)?, budget)?;
    }
    Ok(imported)
}

/// An archive that [`write()`] wrote.
struct Own<'a> {
    header: &'a Header,
    files: Files<'a>,
}

impl Own<'_> {
    /// Reads the array of a name.
    fn read<T>(
        &self,
        name: &str,
        of: impl FnOnce(NpyFile<'_>) -> Result<T, KernelFormatError>,
    ) -> Result<T, StoredError> {
        let read = self.files.require(name).and_then(|file| of(NpyFile::open(name, &file)?));
        read.map_err(|error| StoredError::Form(Box::new(error)))
    }
}

impl StoredParts for Own<'_> {
    fn has_bins(&self) -> bool {
        !self.header.model.is_smooth()
    }

    fn entry(&self, key: &'static str) -> Result<Option<Entry>, StoredError> {
        self.header.entry(key)
    }

    fn f64s(&self, name: &'static str) -> Result<Vec<f64>, StoredError> {
        self.read(array_name(name), |file| file.f64s(self.files.budget))
    }

    fn i16_pairs(&self, name: &'static str) -> Result<Plane<[i16; 2]>, StoredError> {
        self.read(name, |file| file.i16_pairs(self.files.budget))
    }

    /// The bins are in `transfer`.
    fn complex32s(&self, _name: &'static str) -> Result<Plane<Complex32>, StoredError> {
        let shape = self.f64s(BINS_SHAPE)?;
        let Files { budget, .. } = self.files;
        let transfer = self.files.require(TRANSFER);
        let transfer = transfer.and_then(|file| middle(&Array::read_npy(TRANSFER, &file, budget)?, &shape, budget));
        transfer.map_err(|error| StoredError::Form(Box::new(error)))
    }
}

/// Replaces the kernel of an imported model by the changed H of its archive.
fn take_transfer(imported: &mut Imported, transfer: &Array<'_>, budget: &Budget) -> Result<(), KernelFormatError> {
    let Imported { model, kind, absent, remarks, .. } = imported;
    let changed = of_array(transfer, &model.setup, KernelFormat::Npz, budget)?;
    let parts = || ModelPart::ALL.iter().copied().filter(|part| part.is_in(model));
    absent.extend(parts().filter(|part| part.in_bins() == InBins::Lost).map(Loss::Part));
    let replaced: Vec<ModelPart> = parts().filter(|part| part.in_bins() != InBins::Beside).collect();
    replaced.into_iter().for_each(|part| part.remove(model));
    (model.kernel, *kind) = (changed.model.kernel, changed.kind);
    remarks.push("the array `transfer` was changed, so H is taken from it and not from the parameters");
    Ok(())
}

fn absent(name: &str) -> KernelFormatError {
    KernelFormatError::Array {
        name: "the archive".to_owned(),
        actual: format!("one without the array `{name}`"),
        expected:
            "one with all arrays that `kernel fetch` wrote, or one without the array `lightpath`, whose `transfer` \
                   is read as a kernel of another program"
                .to_owned(),
    }
}

/// SHA-256 of the numbers of an array as complex64.
fn digest_of_numbers(name: &str, file: &[u8], budget: &Budget) -> Result<String, KernelFormatError> {
    let opened = NpyFile::open(name, file)?;
    if opened.descr == "<c8" {
        return Ok(digest_of(opened.data));
    }
    // The same numbers in another type are the same H.
    let array = Array::read_npy(name, file, budget)?;
    let _bytes = budget.hold(size_of_val(&array.numbers[..]) as u64)?;
    Ok(digest_of(&f32_bytes(&array.numbers)))
}

/// The middle bins of a transfer function. `shape` has their rows and columns.
fn middle(transfer: &Array<'_>, shape: &[f64], budget: &Budget) -> Result<Plane<Complex32>, KernelFormatError> {
    let refused = || KernelFormatError::Array {
        name: TRANSFER.to_owned(),
        actual: transfer.described(),
        expected: format!("complex, with rows and columns for the middle part of shape {}", sides(shape)),
    };
    let (true, &[all_rows, all_columns], &[rows, columns]) = (transfer.complex, &transfer.shape[..], shape) else {
        return Err(refused());
    };
    let side = |wanted: f64, all: usize| (1.0..=all as f64).contains(&wanted).then_some(wanted as usize);
    let (Some(rows), Some(columns)) = (side(rows, all_rows), side(columns, all_columns)) else {
        return Err(refused());
    };
    let (top, left) = (all_rows / 2 - rows / 2, all_columns / 2 - columns / 2);
    let values = transfer.numbers.as_chunks().0;
    budget.take((size_of::<Complex32>() * rows * columns) as u64)?;
    Ok(Plane::from_fn(rows, columns, |y, x| {
        let [re, im] = values[(top + y) * all_columns + left + x];
        Complex32::new(re, im)
    }))
}

/// Reads the kernel of another program: the array `kernel`, else `transfer`, else the only array.
fn read_foreign(files: Files<'_>, setup: &OpticalSetup) -> Result<Imported, KernelFormatError> {
    let budget = files.budget;
    let names: Vec<&str> = files.archive.names().map(|name| name.strip_suffix(".npy").unwrap_or(name)).collect();
    let name = match ["kernel", TRANSFER].into_iter().find(|name| names.contains(name)) {
        Some(name) => name,
        None if names.len() == 1 => names[0],
        None => {
            return Err(KernelFormatError::Array {
                name: "the archive".to_owned(),
                actual: format!("one with the arrays {}", shortened(names.join(", "))),
                expected: "one with an array `kernel` or `transfer`, or with a single array".to_owned(),
            });
        }
    };
    let mut imported =
        of_array(&Array::read_npy(name, &files.require(name)?, budget)?, setup, KernelFormat::Npz, budget)?;
    if let Some(file) = files.named("response_harmonics")? {
        let harmonics = files.f64s("response_harmonics", &file)?;
        imported.model.response = harmonics.as_chunks().0.to_vec();
        imported.absent.retain(|loss| *loss != Loss::Part(ModelPart::PhaseResponse));
    }
    if let Some(file) = files.named("photometry")?
        && let [gain, offset, re, im] = files.f64s("photometry", &file)?[..]
    {
        (imported.model.gain, imported.model.offset) = (gain, offset);
        imported.model.zero_order = Complex64::new(re, im);
        imported.absent.retain(|loss| !matches!(loss, Loss::Part(ModelPart::ZeroOrder) | Loss::GainAndOffset));
    }
    imported.model.validate()?;
    Ok(imported)
}

#[cfg(test)]
mod tests {
    use super::super::tests::import;
    use super::super::{KernelFormat, export};
    use super::*;
    use lightpath_optics::{
        ConvolutionMethod, Crosstalk, Dust, FurtherMode, Ghost, Grid, LightBlur, PartialCoherence, ResponseVariation,
        SmoothField, SpatialVariation,
    };

    /// A series with many digits.
    fn field(order: usize, size: f64) -> SmoothField {
        let mut field = SmoothField::flat(order);
        field.log_amplitude.iter_mut().enumerate().for_each(|(i, c)| *c = size * (i as f64 + 0.1).sin() / 3.0);
        field.phase.iter_mut().enumerate().for_each(|(i, c)| *c = size * (i as f64 + 0.7).cos() / 7.0);
        field
    }

    fn model(kernel: KernelShape) -> DisplayModel {
        let setup = OpticalSetup::try_new(Grid::try_new(12, 16, 8e-6).unwrap(), 515e-9, -3e-3).unwrap();
        DisplayModel {
            kernel,
            source: field(2, 0.5),
            response: vec![[0.1, -1.0 / 3.0], [1e-9, 0.0]],
            zero_order: Complex64::new(0.03, 0.1 + 0.2),
            gain: 1.0 / 3.0,
            offset: 0.01,
            ..DisplayModel::ideal(setup.with_method_regardless(ConvolutionMethod::BandResponse))
        }
    }

    fn models() -> Vec<(DisplayModel, KernelModel)> {
        let bins = |rows, columns| {
            let at = |y: usize, x: usize| Complex32::new((y as f32).sin(), (x as f32 + 0.3).cos());
            model(KernelShape::Bins(Plane::from_fn(rows, columns, at)))
        };
        let display = model(KernelShape::Smooth(field(4, 1.0)));
        let variation = SpatialVariation::new([1.0, 2.0, 3.0, 4.0, 5.0].map(|size| field(2, 0.1 * size)));
        let crosstalk = Crosstalk { ratio_x: 0.1 / 3.0, ratio_y: 0.02 };
        let light_blur = LightBlur { ratio_x: 0.1 / 3.0, ratio_y: 0.0 };
        let response_variation = ResponseVariation { order: 1, coefficients: vec![0.1 / 3.0, 0.0, -0.07] };
        let ghost = Ghost::of_numbers([0.1 / 3.0, -0.02, 11.3, -7.0 / 3.0, 4.5]);
        let dust = Dust::new(Plane::from_fn(12, 16, |y, x| [y as i16 - 3, -7 * x as i16]));
        let coherence = PartialCoherence::new(vec![FurtherMode { light: 0.3, errors: field(2, 0.1) }]);
        let plain = DisplayModel { kernel: display.kernel.clone(), ..DisplayModel::ideal(display.setup) };
        vec![
            (plain, KernelModel::Smooth),
            (display.clone(), KernelModel::Display),
            (DisplayModel { crosstalk, light_blur, response_variation, ..display.clone() }, KernelModel::Display),
            (DisplayModel { dust, ghost, coherence, ..display.clone() }, KernelModel::Display),
            (DisplayModel { variation, ..display }, KernelModel::Varying),
            (bins(24, 32), KernelModel::Dense),
            (bins(12, 16), KernelModel::Paper),
            (bins(6, 30), KernelModel::Dense),
        ]
    }

    /// The archive of a model after `change` changed the contents of an array.
    fn changed(model: &DisplayModel, kind: KernelModel, array: &str, change: impl Fn(&[u8]) -> Vec<u8>) -> Vec<u8> {
        let mut files = archive::files(&write(&Transfer::of(model), kind, &Origin::default()).unwrap()).unwrap();
        let file = files.iter_mut().find(|(name, _)| name.strip_suffix(".npy") == Some(array)).unwrap();
        file.1 = change(&file.1);
        let files: Vec<(&str, &[u8])> = files.iter().map(|(name, file)| (name.as_str(), &file[..])).collect();
        archive::write(&files).unwrap()
    }

    /// Adds a half to the last number of an array.
    fn last_number_changed(file: &[u8]) -> Vec<u8> {
        let (head, last) = file.split_last_chunk::<4>().unwrap();
        [head, &(f32::from_le_bytes(*last) + 0.5).to_le_bytes()].concat()
    }

    #[test]
    fn every_model_is_read_back_exactly() {
        for (model, kind) in models() {
            let exported = export(&model, kind, KernelFormat::Npz).unwrap();
            assert_eq!((exported.relative_error, &exported.losses[..]), (0.0, &[][..]), "{kind:?}");
            // The optics come from the file, and not from the caller.
            let elsewhere = OpticalSetup::try_new(Grid::try_new(8, 8, 4e-6).unwrap(), 633e-9, 0.1).unwrap();
            let back = import(&exported.bytes, &elsewhere).unwrap();
            assert_eq!((&back.model, back.kind, back.form), (&model, kind, KernelFormat::Npz));
            assert!(back.absent.is_empty() && back.remarks.is_empty());
        }
    }

    #[test]
    fn changed_transfer_counts_and_the_import_says_so() {
        for (model, kind) in models() {
            let back = import(&changed(&model, kind, TRANSFER, last_number_changed), &model.setup).unwrap();
            let KernelShape::Bins(bins) = &back.model.kernel else { panic!("{kind:?}: the parameters were used") };
            let (written, read) = (Transfer::of(&model).padded(), bins.at(23, 31));
            assert_eq!((bins.height_px(), bins.width_px()), (24, 32));
            assert_eq!((read.re, read.im), (written.at(23, 31).re, written.at(23, 31).im + 0.5), "{kind:?}");
            assert_eq!((&back.model.source, back.kind), (&model.source, KernelModel::Dense));
            assert_eq!((&back.model.response, back.model.gain), (&model.response, model.gain));
            assert!(back.remarks[0].contains("`transfer` was changed"), "{:?}", back.remarks);
            let lost = [ModelPart::PartialCoherence, ModelPart::VaryingTransferFunction];
            let lost: Vec<Loss> = lost.into_iter().filter(|part| part.is_in(&model)).map(Loss::Part).collect();
            assert_eq!((back.absent, back.model.coherence.is_none()), (lost, true));
        }
    }

    #[test]
    fn the_same_numbers_in_another_type_are_no_change() {
        let (model, kind) = models().remove(1);
        let as_complex128 = |file: &[u8]| {
            let budget = Budget::new(1 << 20);
            let numbers = Array::read_npy(TRANSFER, file, &budget).unwrap().numbers;
            let bytes: Vec<u8> = numbers.iter().flat_map(|&number| f64::from(number).to_le_bytes()).collect();
            array::npy("<c16", &[24, 32], &bytes)
        };
        let back = import(&changed(&model, kind, TRANSFER, as_complex128), &model.setup).unwrap();
        assert_eq!((back.model, back.kind), (model, kind));
    }

    #[test]
    fn changed_source_is_reported_and_the_parameters_count() {
        let (model, kind) = models().remove(1);
        let back = import(&changed(&model, kind, SOURCE, last_number_changed), &model.setup).unwrap();
        assert_eq!(back.model, model);
        assert!(back.remarks[0].contains("`source` was changed and is not imported"), "{:?}", back.remarks);
        let larger_gain = |_: &[u8]| array::npy("<f8", &[4], &[2.0, 0.0, 0.0, 0.0].map(f64::to_le_bytes).concat());
        let back = import(&changed(&model, kind, "photometry", larger_gain), &model.setup).unwrap();
        assert_eq!((back.model.gain, back.model.source), (2.0, model.source));
    }

    #[test]
    fn incomplete_archives_are_refused_by_name_and_foreign_ones_are_read() {
        let (model, kind) = models().remove(1);
        let files = archive::files(&write(&Transfer::of(&model), kind, &Origin::default()).unwrap()).unwrap();
        let without = |left_out: &str| {
            let kept = files.iter().filter(|(name, _)| name != left_out);
            let kept: Vec<(&str, &[u8])> = kept.map(|(name, file)| (name.as_str(), &file[..])).collect();
            import(&archive::write(&kept).unwrap(), &model.setup)
        };
        for (name, _) in files.iter().filter(|(name, _)| !name.starts_with("pitch") && name != "lightpath.npy") {
            let refused = without(name).unwrap_err().to_string();
            assert!(refused.contains(name.trim_end_matches(".npy")), "{name}: {refused}");
        }
        let foreign = without("lightpath.npy").unwrap();
        assert_eq!((foreign.kind, &foreign.model.response), (KernelModel::Dense, &model.response));
        let lost = [
            ModelPart::Source,
            ModelPart::Crosstalk,
            ModelPart::UnevenResponse,
            ModelPart::LightBlur,
            ModelPart::PartialCoherence,
            ModelPart::VaryingTransferFunction,
            ModelPart::Dust,
        ]
        .map(Loss::Part);
        assert_eq!(foreign.absent, lost);
    }
}
