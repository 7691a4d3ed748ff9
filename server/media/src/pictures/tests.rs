//! Tests of decoding and encoding.

use super::*;
use image::{DynamicImage, ImageFormat};
use lightpath_domain::dataset::Encoding;
use lightpath_domain::job::Fit;
use lightpath_optics::Plane;
use std::io::Cursor;

fn file(picture: impl Into<DynamicImage>, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    picture.into().write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

fn gradient() -> Plane<f32> {
    Plane::from_fn(12, 20, |y, x| (y * 20 + x) as f32 / 239.0)
}

fn message(bytes: &[u8]) -> String {
    target_intensity(bytes, Encoding::Srgb, &Placement::whole(Fit::Contain, 64, 64)).unwrap_err().to_string()
}

#[test]
fn png_files_of_both_encodings_are_read_back() {
    for (bytes, encoding) in [
        (grey_png_srgb(&gradient()).unwrap(), Encoding::Srgb),
        (grey_png_linear(&gradient()).unwrap(), Encoding::Linear),
    ] {
        let back = photograph(&bytes, encoding).unwrap();
        for (a, b) in back.values().iter().zip(gradient().values()) {
            assert!((a - b).abs() < 0.006, "{a} {b}");
        }
    }
}

#[test]
fn levels_are_read_back_unscaled() {
    for bit_depth in [1, 8, 10, 16] {
        let plane = Plane::from_fn(9, 7, |y, x| ((y * 7919 + x * 104_729) % (1 << bit_depth)) as u16);
        let png = levels_png(&plane, bit_depth).unwrap();
        assert_eq!(png[24], if bit_depth <= 8 { 8 } else { 16 });
        assert_eq!(levels(&png, bit_depth, 9, 7).unwrap(), plane);
    }
}

#[test]
fn grey_bitmaps_are_pictures_and_holograms() {
    let levels_of = |y: u32, x: u32| (31 * x + 57 * y) as u8;
    let grey = file(image::GrayImage::from_fn(9, 8, |x, y| image::Luma([levels_of(y, x)])), ImageFormat::Bmp);
    let rgb = file(image::RgbImage::from_fn(9, 8, |x, y| image::Rgb([levels_of(y, x); 3])), ImageFormat::Bmp);
    let plane = Plane::from_fn(8, 9, |y, x| u16::from(levels_of(y as u32, x as u32)));
    for bitmap in [grey, rgb] {
        assert_eq!(levels(&bitmap, 8, 8, 9).unwrap(), plane);
        assert!(matches!(levels(&bitmap, 10, 8, 9), Err(PictureError::NarrowLevels { .. })));
        let light = photograph(&bitmap, Encoding::Linear).unwrap();
        assert_eq!((light.at(7, 8), picture_size(&bitmap).unwrap()), (f32::from(plane.at(7, 8)) / 255.0, (9, 8)));
    }
    let mut colours = image::RgbImage::new(9, 8);
    colours.put_pixel(3, 3, image::Rgb([1, 2, 3]));
    let refused = levels(&file(colours, ImageFormat::Bmp), 8, 8, 9).unwrap_err().to_string();
    assert!(refused.contains("a file of colours"), "{refused}");
}

#[test]
fn bitmaps_whose_levels_would_be_scaled_are_no_holograms() {
    let mut bitmap = file(image::RgbImage::new(9, 8), ImageFormat::Bmp);
    // 5 bits a colour, without run lengths.
    bitmap[28] = 16;
    let refused = levels(&bitmap, 8, 8, 9).unwrap_err().to_string();
    assert!(refused.contains("has not 8 bits a colour"), "{refused}");
}

#[test]
fn tiff_files_of_32_bits_must_be_floats() {
    let light = image::Rgb32FImage::from_pixel(9, 8, image::Rgb([0.25, 0.25, 0.25]));
    let mut floats = file(image::DynamicImage::from(light), ImageFormat::Tiff);
    assert_eq!(photograph(&floats, Encoding::Linear).unwrap().at(7, 8), 0.25);
    // Without the tag SampleFormat the samples are whole numbers.
    let at = floats.windows(4).position(|bytes| bytes == [0x53, 0x01, 3, 0]).unwrap();
    floats[at] = 0xff;
    let refused = photograph(&floats, Encoding::Linear).unwrap_err().to_string();
    assert!(refused.contains("whole numbers of 32 bits"), "{refused}");
}

#[test]
fn holograms_are_levels_or_phases() {
    let png = levels_png(&Plane::filled(4, 6, 200), 8).unwrap();
    assert_eq!(hologram(&png, 8, 4, 6).unwrap(), Hologram::Levels(Plane::filled(4, 6, 200)));
    let phase = npy_f32(&Plane::filled(4, 6, -0.5)).unwrap();
    assert_eq!(hologram(&phase, 8, 4, 6).unwrap(), Hologram::Phase(Plane::filled(4, 6, -0.5)));
    assert!(matches!(hologram(&phase, 8, 6, 4), Err(PictureError::NotAnArray { .. })));
}

#[test]
fn files_without_valid_levels_are_refused() {
    let png = levels_png(&Plane::filled(4, 6, 200), 8).unwrap();
    assert!(matches!(levels(&png, 7, 4, 6), Err(PictureError::LevelTooHigh { level: 200, .. })));
    assert!(matches!(levels(&png, 8, 6, 4), Err(PictureError::WrongSize { .. })));
    assert!(matches!(levels_png(&Plane::filled(4, 6, 200), 7), Err(PictureError::LevelTooHigh { .. })));
    // A viewer that saves a hologram of 10 bits with 8 divides its levels by 4.
    let narrow = levels(&png, 10, 4, 6).unwrap_err().to_string();
    assert!(narrow.contains("8 bits, its largest level is 200") && narrow.contains("10 bits, 0 to 1023"), "{narrow}");
    let rgb = file(image::RgbImage::new(6, 4), ImageFormat::Png);
    assert!(matches!(levels(&rgb, 8, 4, 6), Err(PictureError::NotLevels { .. })));
    let jpeg = file(image::GrayImage::new(6, 4), ImageFormat::Jpeg);
    assert!(matches!(levels(&jpeg, 8, 4, 6), Err(PictureError::NotLevels { .. })));
}

#[test]
fn arrays_are_written_row_by_row() {
    let bytes = npy_f32(&gradient()).unwrap();
    let array = npyz::NpyFile::new(&bytes[..]).unwrap();
    assert_eq!(array.shape(), [12, 20]);
    assert_eq!(array.into_vec::<f32>().unwrap(), gradient().values());
}

#[test]
fn every_format_and_colour_gives_the_same_light() {
    let grey8 = image::GrayImage::from_pixel(16, 16, image::Luma([128]));
    let grey16 = image::ImageBuffer::from_pixel(16, 16, image::Luma([128_u16 * 257]));
    let rgb8 = image::RgbImage::from_pixel(16, 16, image::Rgb([128, 128, 128]));
    let rgb16 = image::ImageBuffer::from_pixel(16, 16, image::Rgb([128_u16 * 257; 3]));
    let files = [
        file(grey8.clone(), ImageFormat::Png),
        file(grey16.clone(), ImageFormat::Png),
        file(rgb8.clone(), ImageFormat::Png),
        file(rgb16, ImageFormat::Png),
        file(grey8.clone(), ImageFormat::Tiff),
        file(grey16, ImageFormat::Tiff),
        file(grey8, ImageFormat::Jpeg),
        file(rgb8, ImageFormat::Jpeg),
    ];
    for (i, bytes) in files.iter().enumerate() {
        let light = photograph(bytes, Encoding::Srgb).unwrap();
        assert!(light.values().iter().all(|value| (value - 0.215_86).abs() < 1e-3), "file {i}");
        let light = photograph(bytes, Encoding::Linear).unwrap();
        assert!(light.values().iter().all(|value| (value - 0.501_96).abs() < 1e-3), "file {i}");
    }
}

#[test]
fn colours_are_averaged_in_linear_light_and_transparency_is_dark() {
    let red = file(image::RgbImage::from_pixel(8, 8, image::Rgb([255, 0, 0])), ImageFormat::Png);
    assert!((photograph(&red, Encoding::Srgb).unwrap().at(3, 3) - 1.0 / 3.0).abs() < 1e-6);
    let half_clear = file(image::RgbaImage::from_pixel(8, 8, image::Rgba([255, 255, 255, 51])), ImageFormat::Png);
    assert!((photograph(&half_clear, Encoding::Srgb).unwrap().at(3, 3) - 0.2).abs() < 1e-6);
}

#[test]
fn damaged_and_foreign_files_are_refused_with_a_reason() {
    assert!(matches!(photograph(&[], Encoding::Linear), Err(PictureError::Empty)));
    assert!(message(b"Dear Sir, please find attached").contains("starts with Dear Sir"));
    let noise = image::GrayImage::from_fn(64, 64, |x, y| image::Luma([(x * 31 + y * 57 + x * y) as u8]));
    for format in [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::Tiff, ImageFormat::Bmp] {
        let whole = file(noise.clone(), format);
        assert!(target_intensity(&whole, Encoding::Srgb, &Placement::whole(Fit::Contain, 64, 64)).is_ok());
        for kept in 0..whole.len() - 12 {
            let refused = target_intensity(&whole[..kept], Encoding::Srgb, &Placement::whole(Fit::Contain, 64, 64));
            assert!(refused.is_err(), "{format:?} cut to {kept} of {} bytes", whole.len());
        }
        let message = message(&whole[..whole.len() / 2]);
        assert!(message.contains("cut off") || format == ImageFormat::Tiff, "{message}");
    }
}

#[test]
fn sizes_are_checked_before_pixels_are_read() {
    let mut huge = grey_png_linear(&gradient()).unwrap();
    huge[16..20].copy_from_slice(&60_000_u32.to_be_bytes());
    huge[20..24].copy_from_slice(&60_000_u32.to_be_bytes());
    let checksum = crc32(&huge[12..29]);
    huge[29..33].copy_from_slice(&checksum.to_be_bytes());
    assert!(message(&huge).contains("60000×60000 px, but at most 16384 px a side"), "{}", message(&huge));
    assert!(matches!(picture_size(&huge), Err(PictureError::TooLarge { .. })));
    let tiny = grey_png_linear(&Plane::filled(1, 1, 1.0)).unwrap();
    assert_eq!(message(&tiny), "the picture has 1×1 px, but must have at least 8×8 px");
    assert_eq!(picture_size(&tiny).unwrap(), (1, 1));
}

#[test]
fn recorded_orientation_is_applied() {
    let plain = file(image::GrayImage::from_fn(10, 8, |x, _| image::Luma([25 * x as u8])), ImageFormat::Jpeg);
    // An EXIF segment with the orientation "rotate by 90° clockwise".
    let exif = b"\xff\xe1\0\x22Exif\0\0MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";
    let turned = [&plain[..2], exif, &plain[2..]].concat();
    let light = photograph(&turned, Encoding::Linear).unwrap();
    assert_eq!((light.height_px(), light.width_px()), (10, 8));
    assert_eq!((picture_size(&turned).unwrap(), picture_size(&plain).unwrap()), ((8, 10), (10, 8)));
    assert!(light.at(9, 4) > 0.8 && light.at(0, 4) < 0.1, "the left side is at the top");
}

fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32| if crc & 1 == 1 { (crc >> 1) ^ 0xedb8_8320 } else { crc >> 1 };
    !bytes.iter().fold(!0, |crc, &byte| (0..8).fold(crc ^ u32::from(byte), |crc, _| step(crc)))
}
