//! Valid files, and files that are damaged in many ways.

use super::{DISPLAY_PX, alone, import_within, read_within, setup};
use image::codecs::tiff::TiffEncoder;
use image::{DynamicImage, ImageFormat};
use lightpath_media::kernel_formats::{KernelFormat, export};
use lightpath_media::pictures;
use lightpath_optics::{DisplayModel, KernelModel, KernelShape, Plane, SmoothField};
use num_complex::Complex32;
use std::io::Cursor;

/// Damaged files of each valid file.
const FILES: usize = 150;
/// More memory than any of these files may take \[bytes\]: damage may make them say that they are large.
const BUDGET_BYTES: u64 = 256 << 20;

/// Numbers in a fixed order (xorshift64).
struct Random(u64);

impl Random {
    fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % end.max(1) as u64) as usize
    }
}

/// The file after one to four changes. Most are near the start, where headers are.
fn damaged(file: &[u8], random: &mut Random) -> Vec<u8> {
    let mut file = file.to_vec();
    for _ in 0..=random.below(4) {
        let reach = if random.below(3) == 0 { file.len() } else { file.len().min(200) };
        let (at, bytes) = (random.below(reach), 1 + random.below(8));
        let end = (at + bytes).min(file.len());
        match random.below(7) {
            0 => file[at..end].fill(0xff),
            1 => file[at..end].fill(0),
            2 => file[at..end].iter_mut().for_each(|byte| *byte ^= 1 << random.below(8)),
            3 => file[at..end].iter_mut().for_each(|byte| *byte = random.below(256) as u8),
            4 => drop(file.drain(at..end)),
            5 => {
                let part = file[at..(at + 40 * bytes).min(file.len())].to_vec();
                let to = random.below(file.len());
                file.splice(to..to, part);
            }
            _ => file.truncate(end + random.below(file.len())),
        }
        if file.is_empty() {
            file.push(0);
        }
    }
    file
}

fn kernels() -> Vec<(String, Vec<u8>)> {
    let mut errors = SmoothField::flat(3);
    errors.phase[1] = 0.1;
    let smooth = DisplayModel { kernel: KernelShape::Smooth(errors), ..DisplayModel::ideal(setup()) };
    let bins = Plane::from_fn(96, 128, |y, x| Complex32::new(1.0 + (y as f32).sin(), x as f32));
    let dense = DisplayModel { kernel: KernelShape::Bins(bins), ..smooth.clone() };
    let mut files = Vec::new();
    for format in KernelFormat::ALL {
        for (model, kind) in [(&smooth, KernelModel::Display), (&dense, KernelModel::Dense)] {
            if let Ok(exported) = export(model, kind, format) {
                files.push((format!("{format:?}, {kind:?}"), exported.bytes));
            }
        }
    }
    files
}

fn pictures() -> Vec<(String, Vec<u8>)> {
    let [height_px, width_px] = DISPLAY_PX;
    let plane = Plane::from_fn(height_px, width_px, |y, x| (y + x) as f32 / 120.0);
    let grey: DynamicImage = image::load_from_memory(&pictures::grey_png_linear(&plane).unwrap()).unwrap();
    let kinds = [grey.to_luma8().into(), grey.to_rgb8().into(), grey.to_luma16().into(), grey.to_rgba16().into()];
    let mut files = vec![("npy".to_owned(), pictures::npy_f32(&plane).unwrap())];
    for picture in kinds.iter().map(|kind: &DynamicImage| kind) {
        for format in [ImageFormat::Png, ImageFormat::Tiff, ImageFormat::Jpeg, ImageFormat::Bmp] {
            let mut bytes = Cursor::new(Vec::new());
            let written = match format {
                ImageFormat::Tiff => picture.write_with_encoder(TiffEncoder::new(&mut bytes)),
                _ => picture.write_to(&mut bytes, format),
            };
            if written.is_ok() {
                files.push((format!("{format:?}, {:?}", picture.color()), bytes.into_inner()));
            }
        }
    }
    files
}

#[test]
fn kernels_take_what_is_counted_whatever_is_damaged() {
    let _alone = alone();
    let mut random = Random(7);
    for (name, file) in kernels() {
        assert_eq!(import_within(&name, &file, u64::MAX), "", "{name}");
        for i in 0..FILES {
            import_within(&format!("{name}, damaged {i}"), &damaged(&file, &mut random), BUDGET_BYTES);
        }
    }
}

#[test]
fn pictures_take_what_is_counted_whatever_is_damaged() {
    let _alone = alone();
    let mut random = Random(11);
    for (name, file) in pictures() {
        assert_eq!(read_within(&name, &file, DISPLAY_PX), ["", ""], "{name}");
        for i in 0..FILES {
            read_within(&format!("{name}, damaged {i}"), &damaged(&file, &mut random), DISPLAY_PX);
        }
    }
}
