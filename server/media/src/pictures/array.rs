//! Pictures and phases in NumPy's array files.

use super::sample_kind::SampleKind;
use super::{FILE_BYTES_MAX, PIXELS_MAX, PictureError, SIDE_PX_MAX};
use crate::npy;
use lightpath_optics::Plane;

/// The type of an array's numbers.
#[derive(Clone, Copy, Debug)]
enum Number {
    U8,
    U16,
    F32,
    F64,
}

/// An array that is a picture, whose header was read: [height, width], or [height, width, 3] with red, green and blue.
pub(super) struct ArrayPicture<'a> {
    array: npy::Array<'a>,
    number: Number,
    is_big_endian: bool,
    height_px: usize,
    pub(super) width_px: usize,
    pub(super) channels: usize,
}

impl<'a> ArrayPicture<'a> {
    /// Reads the header of a file, and checks that its numbers are there.
    pub(super) fn open(file: &'a [u8]) -> Result<Self, PictureError> {
        if file.len() > FILE_BYTES_MAX {
            return Err(PictureError::FileTooLarge { bytes: file.len() });
        }
        let refused = |actual: String| PictureError::NotAPictureArray { actual };
        let array = npy::Array::open(file).map_err(refused)?;
        let described = array.described();
        let (height, width, channels) = match *array.shape {
            [height, width] => (height, width, 1),
            [height, width, 3] => (height, width, 3),
            _ => return Err(refused(described)),
        };
        if !array.is_c_order {
            return Err(refused(format!("{described}, Fortran order")));
        }
        let (Ok(height_px), Ok(width_px)) = (u32::try_from(height), u32::try_from(width)) else {
            return Err(refused(described));
        };
        if height_px == 0 || width_px == 0 {
            return Err(PictureError::TooSmall { width_px, height_px, min_px: 1 });
        }
        if width_px.max(height_px) > SIDE_PX_MAX || u64::from(height_px) * u64::from(width_px) > PIXELS_MAX {
            return Err(PictureError::TooLarge { width_px, height_px });
        }
        let (is_big_endian, kind) = match array.kind.strip_prefix('>') {
            Some(kind) => (true, kind),
            None => (false, array.kind.trim_start_matches(['<', '|', '='])),
        };
        let (number, number_bytes) = match kind {
            "u1" => (Number::U8, 1),
            "u2" => (Number::U16, 2),
            "f4" => (Number::F32, 4),
            "f8" => (Number::F64, 8),
            _ => return Err(refused(described)),
        };
        let (height_px, width_px) = (height_px as usize, width_px as usize);
        if array.data_bytes() < height_px * width_px * channels * number_bytes {
            return Err(refused(format!("{described} that ends early")));
        }
        Ok(Self { array, number, is_big_endian, height_px, width_px, channels })
    }

    /// Columns and rows \[px\].
    pub(super) fn size_px(&self) -> (u32, u32) {
        (self.width_px as u32, self.height_px as u32)
    }

    /// Number of pixels.
    pub(super) fn pixels(&self) -> u64 {
        (self.height_px * self.width_px) as u64
    }

    /// The type of its samples.
    pub(super) fn kind(&self) -> SampleKind {
        match self.number {
            Number::U8 => SampleKind::U8,
            Number::U16 => SampleKind::U16,
            Number::F32 | Number::F64 => SampleKind::F32,
        }
    }

    /// Length of [`Self::samples`] \[bytes\].
    pub(super) fn samples_bytes(&self) -> u64 {
        self.pixels() * (self.channels * self.kind().bytes()) as u64
    }

    /// Its samples in the machine's byte order. Doubles become float32.
    pub(super) fn samples(&self) -> Vec<u8> {
        let (array, count) = (&self.array, self.height_px * self.width_px * self.channels);
        match (self.number, self.is_big_endian) {
            (Number::U8, _) => flattened(array.values(count, |byte: [u8; 1]| byte)),
            (Number::U16, false) => flattened(array.values(count, |bytes| u16::from_le_bytes(bytes).to_ne_bytes())),
            (Number::U16, true) => flattened(array.values(count, |bytes| u16::from_be_bytes(bytes).to_ne_bytes())),
            (Number::F32, false) => flattened(array.values(count, |bytes| f32::from_le_bytes(bytes).to_ne_bytes())),
            (Number::F32, true) => flattened(array.values(count, |bytes| f32::from_be_bytes(bytes).to_ne_bytes())),
            (Number::F64, false) => flattened(array.values(count, |bytes| narrowed(f64::from_le_bytes(bytes)))),
            (Number::F64, true) => flattened(array.values(count, |bytes| narrowed(f64::from_be_bytes(bytes)))),
        }
    }
}

/// Samples as bytes. The length of the file was compared before.
fn flattened<const BYTES: usize>(samples: Option<Vec<[u8; BYTES]>>) -> Vec<u8> {
    samples.unwrap_or_default().into_flattened()
}

fn narrowed(value: f64) -> [u8; 4] {
    (value as f32).to_ne_bytes()
}

/// Reads the phases \[rad\] in a .npy file: float32 or float64, C order, shape [`height_px`, `width_px`].
///
/// # Errors
///
/// [`PictureError::NotAnArray`] for a file of another kind or an array of another shape, and
/// [`PictureError::FileTooLarge`].
pub fn phase_npy(bytes: &[u8], height_px: usize, width_px: usize) -> Result<Plane<f32>, PictureError> {
    if bytes.len() > FILE_BYTES_MAX {
        return Err(PictureError::FileTooLarge { bytes: bytes.len() });
    }
    let refused = |actual: String| PictureError::NotAnArray { height_px, width_px, actual };
    let array = npy::Array::open(bytes).map_err(refused)?;
    if array.shape != [height_px as u64, width_px as u64] || !array.is_c_order {
        return Err(refused(array.described()));
    }
    let count = height_px * width_px;
    let values = match array.kind.as_str() {
        "<f4" => array.values(count, f32::from_le_bytes),
        ">f4" => array.values(count, f32::from_be_bytes),
        "<f8" => array.values(count, |bytes| f64::from_le_bytes(bytes) as f32),
        ">f8" => array.values(count, |bytes| f64::from_be_bytes(bytes) as f32),
        _ => return Err(refused(array.described())),
    };
    let values = values.ok_or_else(|| refused(format!("{} that ends early", array.described())))?;
    if values.iter().any(|value| !value.is_finite()) {
        return Err(refused("an array with values that are not finite".to_owned()));
    }
    Plane::try_from_vec(height_px, width_px, values).map_err(|error| refused(error.to_string()))
}

#[cfg(test)]
mod tests {
    use crate::pictures::{
        Channel, Placement, phase_npy, photograph, photograph_channel, picture_size, pixels, reading_bytes,
        target_intensity,
    };
    use lightpath_domain::dataset::Encoding;
    use lightpath_domain::job::Fit;

    /// A file as NumPy writes it.
    fn npy(kind: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n");
        let length = (header.len() as u16).to_le_bytes();
        [&b"\x93NUMPY\x01\x00"[..], &length, header.as_bytes(), data].concat()
    }

    fn light(file: &[u8]) -> Vec<f32> {
        photograph(file, Encoding::Linear).unwrap().into_vec()
    }

    fn refusal(file: &[u8]) -> String {
        photograph(file, Encoding::Linear).unwrap_err().to_string()
    }

    #[test]
    fn numbers_of_every_type_give_the_light_of_a_picture() {
        let fifth = [0.2_f32, 1.0];
        let words = [13107_u16, 65535];
        assert_eq!(light(&npy("|u1", "(1, 2)", &[51, 255])), fifth);
        assert_eq!(light(&npy("<u2", "(1, 2)", &words.map(u16::to_le_bytes).concat())), fifth);
        assert_eq!(light(&npy(">u2", "(1, 2)", &words.map(u16::to_be_bytes).concat())), fifth);
        assert_eq!(light(&npy("<f4", "(1, 2)", &fifth.map(f32::to_le_bytes).concat())), fifth);
        assert_eq!(light(&npy(">f4", "(1, 2)", &fifth.map(f32::to_be_bytes).concat())), fifth);
        assert_eq!(light(&npy("<f8", "(1, 2)", &fifth.map(|value| f64::from(value).to_le_bytes()).concat())), fifth);
        assert_eq!(light(&npy(">f8", "(2, 1)", &fifth.map(|value| f64::from(value).to_be_bytes()).concat())), fifth);
        let colours = npy("|u1", "(1, 1, 3)", &[255, 0, 51]);
        assert_eq!(photograph_channel(&colours, Encoding::Linear, Channel::Colour(2)).unwrap().at(0, 0), 0.2);
        assert!((light(&colours)[0] - 0.4).abs() < 1e-6);
        let srgb = photograph(&npy("<f4", "(1, 1)", &0.5_f32.to_le_bytes()), Encoding::Srgb).unwrap().at(0, 0);
        assert!((srgb - 0.214_041).abs() < 1e-5);
    }

    #[test]
    fn an_array_is_a_target_of_its_own_size() {
        let file = npy("<f4", "(9, 16)", &[0.5_f32; 144].map(f32::to_le_bytes).concat());
        assert_eq!((picture_size(&file).unwrap(), pixels(&file)), ((16, 9), 144));
        let target = target_intensity(&file, Encoding::Linear, &Placement::whole(Fit::Contain, 18, 32)).unwrap();
        assert!((target.at(9, 16) - 0.5).abs() < 1e-6);
        let small = target_intensity(
            &npy("|u1", "(2, 9)", &[1; 18]),
            Encoding::Linear,
            &Placement::whole(Fit::Contain, 18, 32),
        );
        assert_eq!(small.unwrap_err().to_string(), "the picture has 9×2 px, but must have at least 8×8 px");
        let colours = |kind: &str| reading_bytes(&npy(kind, "(9, 16, 3)", &[0; 1728]), 1);
        assert!(colours("<f4") > colours("|u1"), "floats are larger");
    }

    #[test]
    fn phases_are_floats_of_either_length() {
        let phases = [6.5_f32, -0.25];
        let files = [
            npy("<f4", "(1, 2)", &phases.map(f32::to_le_bytes).concat()),
            npy(">f4", "(1, 2)", &phases.map(f32::to_be_bytes).concat()),
            npy("<f8", "(1, 2)", &phases.map(|phase| f64::from(phase).to_le_bytes()).concat()),
            npy(">f8", "(1, 2)", &phases.map(|phase| f64::from(phase).to_be_bytes()).concat()),
        ];
        for file in files {
            assert_eq!(phase_npy(&file, 1, 2).unwrap().values(), phases);
        }
        for (kind, data, sign) in [
            ("|u1", &[0; 2][..], "must be a .npy file of float32 or float64 with shape [1, 2]"),
            ("<f8", &[0; 15], "ends early"),
            ("<f8", &[1e300_f64, 0.0].map(f64::to_le_bytes).concat(), "not finite"),
        ] {
            let refusal = phase_npy(&npy(kind, "(1, 2)", data), 1, 2).unwrap_err().to_string();
            assert!(refusal.contains(sign), "{refusal}");
        }
    }

    #[test]
    fn arrays_that_are_no_pictures_are_refused_with_what_they_are() {
        for (kind, shape, sign) in [
            ("<i4", "(1, 2)", "<i4 of shape [1, 2]"),
            ("<c8", "(1, 2)", "<c8"),
            ("|u1", "(2,)", "[2]"),
            ("|u1", "(1, 2, 4)", "[1, 2, 4]"),
            ("|u1", "(0, 2)", "2×0 px, but must have at least 1×1"),
            ("|u1", "(20000, 1)", "1×20000 px, but at most 16384"),
            ("|u1", "(10000, 10000)", "at most 16384 px a side and 67108864"),
            ("<u2", "(1, 9)", "that ends early"),
        ] {
            let message = refusal(&npy(kind, shape, &[0; 16]));
            assert!(message.contains(sign), "{kind} {shape}: {message}");
        }
        let fortran = npy("|u1", "(1, 2)", &[0; 2]);
        let fortran = String::from_utf8_lossy(&fortran).replace("'fortran_order': False", "'fortran_order': True ");
        let header = [&b"\x93NUMPY\x01\x00"[..], &fortran.as_bytes()[fortran.find("MPY").unwrap() + 5..]].concat();
        assert!(refusal(&header).contains("Fortran order"), "{}", refusal(&header));
    }

    #[test]
    fn floats_beyond_white_are_questioned() {
        let file = |values: [f32; 2]| npy("<f4", "(1, 2)", &values.map(f32::to_le_bytes).concat());
        assert_eq!(
            refusal(&file([0.0, 255.0])),
            "the picture's floats are 0 to 255, but must be 0 (black) to 1 (white); divide them by the value of white, such \
             as 255 or 65535"
        );
        assert!(refusal(&file([-0.25, 1.0])).contains("floats are -0.25 to 1"));
        assert!(refusal(&file([f32::NAN, 1.0])).contains("not a finite number, at x = 0 px, y = 0 px"));
        assert_eq!(light(&file([-1e-7, 1.000_000_1])), [0.0, 1.0]);
    }
}
