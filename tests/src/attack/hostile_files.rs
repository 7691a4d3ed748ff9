//! Small files that would take much memory if they were unpacked without a limit.

use flate2::Compression;
use flate2::write::{DeflateEncoder, ZlibEncoder};
use image::{ExtendedColorType, ImageEncoder as _, codecs::png::PngEncoder};
use std::io::Write as _;

/// Size of what is in the files when it is unpacked \[bytes\].
const UNPACKED_BYTES: usize = 64 << 20;
/// Entries of an archive.
const ENTRIES: u16 = 60;
/// Dimensions of an array.
const DIMENSIONS: usize = 200_000;

fn png(width_px: u32, height_px: u32, colour: ExtendedColorType, samples: &[u8]) -> Vec<u8> {
    let mut file = Vec::new();
    PngEncoder::new(&mut file).write_image(samples, width_px, height_px, colour).unwrap();
    file
}

fn black_png(width_px: u32, height_px: u32) -> Vec<u8> {
    png(width_px, height_px, ExtendedColorType::L8, &vec![0; (width_px * height_px) as usize])
}

/// A picture with `side_px`² pixels of 16 bits, some of which have light.
pub(super) fn large_picture(side_px: u32) -> Vec<u8> {
    let mut pixels = vec![0_u8; 2 * (side_px as usize).pow(2)];
    pixels[1000..2000].fill(200);
    png(side_px, side_px, ExtendedColorType::L16, &pixels)
}

/// Files that attackers send.
pub(super) struct HostileFiles {
    /// A picture of 64×64 px with a large colour profile.
    pub(super) profile: Vec<u8>,
    /// Pictures of one row, and of one column.
    pub(super) thin: [Vec<u8>; 2],
    /// An `.npz` archive with many entries that share one deflated array of zeros.
    pub(super) archive: Vec<u8>,
    /// A safetensors file whose header has an array of very many dimensions.
    pub(super) header: Vec<u8>,
}

impl HostileFiles {
    pub(super) fn make() -> Self {
        Self {
            profile: picture_with_profile(),
            thin: thin_pictures(),
            archive: shared_archive(),
            header: long_header(),
        }
    }
}

fn picture_with_profile() -> Vec<u8> {
    let file = black_png(64, 64);
    let mut profile = ZlibEncoder::new(b"profile\0\0".to_vec(), Compression::best());
    profile.write_all(&vec![b' '; UNPACKED_BYTES]).unwrap();
    let content = [b"iCCP", &profile.finish().unwrap()[..]].concat();
    let mut crc = flate2::Crc::new();
    crc.update(&content);
    let length = (content.len() as u32 - 4).to_be_bytes();
    // The signature and the header have 33 bytes.
    [&file[..33], &length, &content, &crc.sum().to_be_bytes(), &file[33..]].concat()
}

fn thin_pictures() -> [Vec<u8>; 2] {
    [black_png(16_384, 1), black_png(1, 16_384)]
}

fn shared_archive() -> Vec<u8> {
    let header = format!("{{'descr': '<c8', 'fortran_order': False, 'shape': ({}, 1024), }}", UNPACKED_BYTES >> 13);
    let mut array = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    array.extend(format!("{header:<117}\n").bytes());
    array.resize(array.len() + UNPACKED_BYTES, 0);
    let mut crc = flate2::Crc::new();
    crc.update(&array);
    let mut packed = DeflateEncoder::new(Vec::new(), Compression::best());
    packed.write_all(&array).unwrap();
    let packed = packed.finish().unwrap();
    let described = |name: &str| {
        let mut head = vec![20, 0, 0, 0, 8, 0, 0, 0, 0x21, 0];
        for number in [crc.sum(), packed.len() as u32, array.len() as u32] {
            head.extend(number.to_le_bytes());
        }
        head.extend((name.len() as u16).to_le_bytes());
        [head, vec![0, 0]].concat()
    };
    let mut file = [b"PK\x03\x04", &described("x00.npy")[..], b"x00.npy", &packed].concat();
    let start = file.len() as u32;
    for entry in 0..ENTRIES {
        let name = format!("x{entry:02}.npy");
        file.extend([b"PK\x01\x02\x14\x00", &described(&name)[..], &[0; 14], name.as_bytes()].concat());
    }
    let length = (file.len() as u32 - start).to_le_bytes();
    file.extend([b"PK\x05\x06\0\0\0\0", &ENTRIES.to_le_bytes()[..], &ENTRIES.to_le_bytes(), &length].concat());
    [file, start.to_le_bytes().to_vec(), vec![0, 0]].concat()
}

fn long_header() -> Vec<u8> {
    let shape = vec!["1"; DIMENSIONS].join(",");
    let header = format!("{{\"kernel\":{{\"dtype\":\"F32\",\"shape\":[{shape}],\"data_offsets\":[0,4]}}}}");
    [&(header.len() as u64).to_le_bytes()[..], header.as_bytes(), &[0; 4]].concat()
}
