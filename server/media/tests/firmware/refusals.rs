//! Files that every decoder must refuse, as changes of the vectors' files, with the reason.

use crate::import;
use crate::kernels;
use lightpath_media::kernel_formats::compact;
use lightpath_optics::{ConvolutionMethod, Grid, OpticalSetup};
use std::fs;
use std::path::Path;

/// A change of a file's bytes.
enum Edit {
    /// The file gets this length; zeros follow its old end.
    Length(usize),
    /// Bytes from an offset on.
    Bytes(usize, Vec<u8>),
}

/// A file that must be refused.
struct Refusal {
    file: &'static str,
    reason: &'static str,
    /// Whether the changed file gets a right checksum.
    renewed: bool,
    edits: Vec<Edit>,
}

/// A kernel of version 3 with all parts: K = 5, S = 4, R = 3, W = 2, V = 2.
const EVERYTHING: &str = "everything.lpk";
const EVERYTHING_BYTES: usize = 60 + 4 * (2 * 20 + 2 * 14 + 6 + 2 + 6 + 50) + 4;
/// Offset of its phase response.
const RESPONSE: usize = 60 + 4 * (2 * 20 + 2 * 14);
/// Offset of its cross-talk.
const CROSSTALK: usize = RESPONSE + 4 * 6;
/// A kernel of version 1.
const PLAIN: &str = "display.lpk";
/// A kernel of version 2.
const VARYING: &str = "varying.lpk";
const ARRAY: &str = "array.npy";
/// Bytes of the array's header with all before it, then the bytes of 24 rows of 32 values.
const ARRAY_HEADER: usize = 128;
const ARRAY_BYTES: usize = ARRAY_HEADER + 24 * 32 * 4;

fn bytes(at: usize, bytes: &[u8]) -> Edit {
    Edit::Bytes(at, bytes.to_vec())
}

fn sealed(file: &'static str, reason: &'static str, edit: Edit) -> Refusal {
    Refusal { file, reason, renewed: true, edits: vec![edit] }
}

fn kept(file: &'static str, reason: &'static str, edit: Edit) -> Refusal {
    Refusal { file, reason, renewed: false, edits: vec![edit] }
}

/// Refusals by the header's bytes.
fn of_header() -> Vec<Refusal> {
    let long = EVERYTHING_BYTES + 8;
    let harmonics = vec![bytes(8, &[9]), Edit::Length(EVERYTHING_BYTES + 6 * 8)];
    vec![
        kept(EVERYTHING, "not_a_kernel", Edit::Length(0)),
        kept(EVERYTHING, "not_a_kernel", Edit::Length(63)),
        sealed(EVERYTHING, "not_a_kernel", bytes(3, b"c")),
        sealed(EVERYTHING, "unknown_version", bytes(4, &[0])),
        sealed(EVERYTHING, "unknown_version", bytes(4, &[4])),
        sealed(EVERYTHING, "wrong_response_order", bytes(11, &[14])),
        sealed(PLAIN, "wrong_response_order", bytes(11, &[1])),
        sealed(VARYING, "wrong_response_order", bytes(11, &[1])),
        sealed(EVERYTHING, "wrong_order", bytes(6, &[13])),
        sealed(EVERYTHING, "wrong_order", bytes(7, &[13])),
        sealed(EVERYTHING, "wrong_variation_order", bytes(10, &[9])),
        sealed(PLAIN, "wrong_variation_order", bytes(10, &[1])),
        sealed(VARYING, "wrong_variation_order", bytes(10, &[0])),
        sealed(EVERYTHING, "wrong_length", bytes(6, &[4])),
        sealed(EVERYTHING, "wrong_length", bytes(8, &[200])),
        sealed(EVERYTHING, "wrong_length", Edit::Length(EVERYTHING_BYTES - 1)),
        sealed(EVERYTHING, "wrong_length", Edit::Length(long)),
        kept(EVERYTHING, "wrong_checksum", bytes(EVERYTHING_BYTES - 1, &[0x5a])),
        kept(EVERYTHING, "wrong_checksum", bytes(100, &[0x5a])),
        sealed(EVERYTHING, "unknown_model", bytes(5, &[2])),
        sealed(EVERYTHING, "unknown_model", bytes(5, &[6])),
        sealed(EVERYTHING, "unknown_method", bytes(9, &[6])),
        Refusal { file: EVERYTHING, reason: "too_many_harmonics", renewed: true, edits: harmonics },
    ]
}

/// Refusals by sides and lengths.
fn of_optics() -> Vec<Refusal> {
    let mut refusals = Vec::new();
    for side in [0, 16_385, u32::MAX] {
        for at in [12, 16] {
            refusals.push(sealed(EVERYTHING, "wrong_side", bytes(at, &side.to_le_bytes())));
        }
    }
    let lengths: [(usize, &'static str, &[f64]); 3] = [
        (20, "wrong_pitch", &[9.9e-9, 1.1e-2, -8e-6, f64::NAN, f64::INFINITY]),
        (28, "wrong_wavelength", &[99e-9, 10.1e-6, -515e-9, f64::NAN]),
        (36, "wrong_distance", &[0.0, -0.0, 10.1, -10.1, f64::NAN]),
    ];
    for (at, reason, wrong) in lengths {
        refusals.extend(wrong.iter().map(|length_m| sealed(EVERYTHING, reason, bytes(at, &length_m.to_le_bytes()))));
    }
    // Pixels of half a wavelength, and light that spreads over more than 2²⁷ frequencies.
    let fine = bytes(20, &(515e-9_f64 / 2.0).to_le_bytes());
    let far = vec![bytes(20, &1e-6_f64.to_le_bytes()), bytes(36, &10.0_f64.to_le_bytes())];
    refusals.push(sealed(PLAIN, "too_many_frequencies", fine));
    refusals.push(Refusal { file: PLAIN, reason: "too_many_frequencies", renewed: true, edits: far });
    refusals
}

/// Refusals by the numbers after the header, of every part.
fn of_numbers() -> Vec<Refusal> {
    let last = EVERYTHING_BYTES - 8;
    let places = [44, 48, 52, 56, 60, 140, 220, 276, RESPONSE, CROSSTALK, CROSSTALK + 8, last];
    let mut refusals = Vec::new();
    for (i, at) in places.into_iter().enumerate() {
        let wrong = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][i % 3];
        refusals.push(sealed(EVERYTHING, "number_not_finite", bytes(at, &wrong.to_le_bytes())));
    }
    for at in [CROSSTALK, CROSSTALK + 4] {
        for wrong in [0.600_001_f32, -0.01] {
            refusals.push(sealed(EVERYTHING, "wrong_crosstalk", bytes(at, &wrong.to_le_bytes())));
        }
    }
    refusals
}

/// Refusals of an array. Lightpath itself reads more arrays than it writes.
fn of_array() -> Vec<Refusal> {
    let at = |part: &str| HEADER.find(part).unwrap() + 10;
    vec![
        kept(ARRAY, "f16_not_an_array", bytes(0, &[0x92])),
        kept(ARRAY, "f16_not_an_array", bytes(6, &[2])),
        kept(ARRAY, "f16_wrong_header", bytes(8, &[0, 0])),
        kept(ARRAY, "f16_wrong_header", bytes(8, &[0x01, 0x02])),
        kept(ARRAY, "f16_wrong_header", bytes(8, &[117])),
        kept(ARRAY, "f16_wrong_header", bytes(at("<f2"), b">f2")),
        kept(ARRAY, "f16_wrong_header", bytes(at("<f2"), b"<f4")),
        kept(ARRAY, "f16_wrong_header", bytes(at("False"), b"True ")),
        kept(ARRAY, "f16_wrong_header", bytes(at(", 2)"), b", 3)")),
        kept(ARRAY, "f16_wrong_header", bytes(ARRAY_HEADER - 2, b",")),
        kept(ARRAY, "f16_wrong_header", bytes(ARRAY_HEADER - 1, b" ")),
        kept(ARRAY, "f16_wrong_shape", bytes(at("24, "), b"23, ")),
        kept(ARRAY, "f16_wrong_shape", bytes(at("24, "), b"04, ")),
        kept(ARRAY, "f16_wrong_shape", bytes(at("24, "), b"0, ")),
        kept(ARRAY, "f16_wrong_shape", bytes(at("24, 32"), b"999990")),
        kept(ARRAY, "f16_row_too_long", bytes(at("32, "), b"98, ")),
        kept(ARRAY, "value_not_finite", bytes(ARRAY_HEADER + 100, &[0x00, 0x7c])),
        kept(ARRAY, "value_not_finite", bytes(ARRAY_BYTES - 2, &[0x01, 0xfe])),
        kept(ARRAY, "f16_cut", Edit::Length(0)),
        kept(ARRAY, "f16_cut", Edit::Length(60)),
        kept(ARRAY, "f16_cut", Edit::Length(ARRAY_BYTES - 1)),
        kept(ARRAY, "f16_cut", bytes(at("24, "), b"26, ")),
        kept(ARRAY, "f16_too_long", Edit::Length(ARRAY_BYTES + 1)),
        kept(ARRAY, "f16_too_long", bytes(at("24, "), b"22, ")),
    ]
}

/// The header of [`ARRAY`], which begins at byte 10.
const HEADER: &str = "{'descr': '<f2', 'fortran_order': False, 'shape': (24, 32, 2), }";

fn all() -> Vec<Refusal> {
    [of_header(), of_optics(), of_numbers(), of_array()].into_iter().flatten().collect()
}

/// The list as text: file, reason, checksum, changes.
fn list() -> String {
    let mut text = "# Files that a decoder must refuse. docs/compact-kernel.md describes the columns.\n".to_owned();
    for refusal in all() {
        let checksum = if refusal.renewed { "renewed" } else { "kept" };
        text.push_str(&format!("{} {} {checksum}", refusal.file, refusal.reason));
        for edit in refusal.edits {
            match edit {
                Edit::Length(length) => text.push_str(&format!(" length={length}")),
                Edit::Bytes(at, bytes) => {
                    let digits: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
                    text.push_str(&format!(" {at}={digits}"));
                }
            }
        }
        text.push('\n');
    }
    text
}

/// Writes the list.
pub(crate) fn write(folder: &Path) {
    fs::write(folder.join("refusals.txt"), list()).unwrap();
}

/// Compares the committed list with that of this code.
pub(crate) fn compare(folder: &Path) {
    let committed = fs::read_to_string(folder.join("refusals.txt")).unwrap();
    assert_eq!(committed, list(), "refusals.txt; {} writes a new one", crate::WRITE);
    assert_eq!(fs::read(folder.join(EVERYTHING)).unwrap().len(), EVERYTHING_BYTES);
    assert_eq!(fs::read(folder.join(ARRAY)).unwrap().len(), ARRAY_BYTES);
}

/// Writes the right checksum of a compact kernel into its last bytes.
pub(crate) fn renew_checksum(file: &mut [u8]) {
    let Some(content) = file.len().checked_sub(4) else { return };
    let mut crc = u32::MAX;
    for &byte in &file[..content] {
        crc ^= u32::from(byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 };
        }
    }
    file[content..].copy_from_slice(&(!crc).to_le_bytes());
}

fn changed(folder: &Path, refusal: &Refusal) -> Vec<u8> {
    let mut file = fs::read(folder.join(refusal.file)).unwrap();
    for edit in &refusal.edits {
        match edit {
            Edit::Length(length) => file.resize(*length, 0),
            Edit::Bytes(at, bytes) => file[*at..*at + bytes.len()].copy_from_slice(bytes),
        }
    }
    if refusal.renewed {
        renew_checksum(&mut file);
    }
    file
}

/// Lightpath refuses each of them, too: kernels when it reads them, displays without a band response when it plans, and
/// arrays that are cut, too long or not finite.
pub(crate) fn check(folder: &Path) {
    let setup = kernels::arrays()[0].model.setup;
    for refusal in all() {
        let file = changed(folder, &refusal);
        let (name, reason) = (refusal.file, refusal.reason);
        match reason {
            "too_many_frequencies" => {
                let (model, _) = compact::decode(&file).unwrap();
                assert!(model.setup.with_method(ConvolutionMethod::BandResponse).is_err(), "{name}: {reason}");
            }
            _ if name == ARRAY => {
                let is_stricter = ["f16_wrong_header", "f16_wrong_shape", "f16_not_an_array"].contains(&reason);
                assert!(is_stricter || import(&file, &setup).is_err(), "{name}: {reason}");
            }
            _ => assert!(compact::decode(&file).is_err(), "{name}: {reason}"),
        }
    }
    // A whole kernel is not refused.
    let grid = Grid::try_new(12, 16, 8e-6).unwrap();
    assert!(
        import(&fs::read(folder.join(EVERYTHING)).unwrap(), &OpticalSetup::try_new(grid, 515e-9, 1.0).unwrap()).is_ok()
    );
}
