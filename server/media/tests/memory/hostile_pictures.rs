//! Picture files that were made to take much memory or time.

use super::{DISPLAY_PX, alone, read_within};
use flate2::Compression;
use flate2::write::ZlibEncoder;
use image::codecs::jpeg::JpegEncoder;
use image::{DynamicImage, GrayImage, RgbImage};
use lightpath_media::pictures::grey_png_linear;
use lightpath_optics::Plane;
use lightpath_optics::interrupt::{Interrupt, Interrupted};
use std::io::Write as _;
use std::time::{Duration, Instant};

fn deflated(content: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(content).unwrap();
    encoder.finish().unwrap()
}

fn chunk(name: &[u8; 4], content: &[u8]) -> Vec<u8> {
    let mut crc = flate2::Crc::new();
    crc.update(name);
    crc.update(content);
    [&(content.len() as u32).to_be_bytes()[..], name, content, &crc.sum().to_be_bytes()].concat()
}

/// A PNG of zeros with further chunks before its pixels.
fn png([width_px, height_px]: [u32; 2], [bits, colour, interlaced]: [u8; 3], more: &[Vec<u8>]) -> Vec<u8> {
    let samples = [1, 0, 3, 1, 2, 0, 4][usize::from(colour)];
    let row_bytes = |px: u32| if px == 0 { 0 } else { 1 + (px as usize * samples * usize::from(bits)).div_ceil(8) };
    let passes: &[[u32; 4]] = match interlaced {
        0 => &[[0, 0, 1, 1]],
        _ => &[[0, 0, 8, 8], [4, 0, 8, 8], [0, 4, 4, 8], [2, 0, 4, 4], [0, 2, 2, 4], [1, 0, 2, 2], [0, 1, 1, 2]],
    };
    let pass_bytes = |&[x, y, dx, dy]: &[u32; 4]| {
        let side = |side: u32, start: u32, step: u32| side.saturating_sub(start).div_ceil(step);
        row_bytes(side(width_px, x, dx)) * side(height_px, y, dy) as usize
    };
    let mut header = [width_px.to_be_bytes(), height_px.to_be_bytes()].concat();
    header.extend([bits, colour, 0, 0, interlaced]);
    let pixels = deflated(&vec![0; passes.iter().map(pass_bytes).sum()]);
    let chunks = [chunk(b"IHDR", &header), more.concat(), chunk(b"IDAT", &pixels), chunk(b"IEND", b"")];
    [b"\x89PNG\r\n\x1a\n", &chunks.concat()[..]].concat()
}

#[test]
fn profiles_and_texts_of_png_are_not_unpacked() {
    let _alone = alone();
    let much = deflated(&vec![b' '; 64 << 20]);
    assert!(much.len() < 100_000);
    let with = |head: &[u8]| [head, &much].concat();
    let more = [
        chunk(b"iCCP", &with(b"profile\0\0")),
        chunk(b"zTXt", &with(b"Raw profile type iptc\0\0")),
        chunk(b"iTXt", &with(b"XML:com.adobe.xmp\0\x01\0\0\0")),
        chunk(b"tEXt", &vec![b' '; 8 << 20]),
        chunk(b"eXIf", &vec![b' '; 8 << 20]),
        chunk(b"teST", &vec![b' '; 8 << 20]),
    ];
    for (i, chunk) in more.iter().enumerate() {
        let file = png([64, 48], [8, 0, 0], std::slice::from_ref(chunk));
        assert_eq!(read_within(&format!("chunk {i}"), &file, DISPLAY_PX), ["", ""], "chunk {i}");
    }
    let palette = png([64, 48], [8, 3, 0], &[chunk(b"PLTE", &vec![0; 3 << 20])]);
    assert!(read_within("a large palette", &palette, DISPLAY_PX)[0].contains("damaged"));
}

#[test]
fn every_kind_of_png_takes_what_is_counted() {
    let _alone = alone();
    for [bits, colour] in [[1, 0], [8, 0], [16, 0], [1, 3], [8, 3], [8, 2], [16, 2], [8, 4], [16, 6]] {
        let palette: &[Vec<u8>] = &[chunk(b"PLTE", &[7; 6]), chunk(b"tRNS", &[7; 2])];
        for (interlaced, size_px) in [(0, [500, 300]), (1, [500, 300]), (0, [16_384, 9]), (1, [9, 16_384])] {
            let file = png(size_px, [bits, colour, interlaced], if colour == 3 { palette } else { &[] });
            let name = format!("{bits} bits, colour {colour}, interlaced {interlaced}, {size_px:?}");
            assert_eq!(read_within(&name, &file, DISPLAY_PX), ["", ""], "{name}");
        }
    }
}

#[test]
fn resampling_has_no_large_intermediate() {
    let _alone = alone();
    let (wide, high) = ([9, 16_384], [16_384, 9]);
    for (size_px, display_px) in [(wide, high), (high, wide), (high, [300, 500]), (wide, [300, 500])] {
        let file = grey_png_linear(&Plane::filled(size_px[0], size_px[1], 0.5)).unwrap();
        let name = format!("{size_px:?} to {display_px:?}");
        assert_eq!(read_within(&name, &file, display_px), ["", ""], "{name}");
    }
}

/// Tables of a JPEG file, and its coded pixels.
fn jpeg_parts() -> (Vec<u8>, Vec<u8>) {
    let picture = RgbImage::from_fn(64, 48, |x, y| image::Rgb([x as u8, y as u8, (x * y) as u8]));
    let mut file = Vec::new();
    JpegEncoder::new(&mut file).encode_image(&picture).unwrap();
    let (mut at, mut tables) = (2, Vec::new());
    loop {
        let end = at + 2 + usize::from(u16::from_be_bytes([file[at + 2], file[at + 3]]));
        match file[at + 1] {
            0xdb | 0xc4 => tables.extend(&file[at..end]),
            0xda => return (tables, file[end..].to_vec()),
            _ => {}
        }
        at = end;
    }
}

/// A JPEG file of any size, kind and sampling. It has `scans` scans, each with the pixels of a small picture.
fn jpeg(marker: u8, [width_px, height_px]: [u16; 2], sampling: &[u8], scans: usize) -> Vec<u8> {
    let (tables, pixels) = jpeg_parts();
    let components = sampling.len() as u8;
    let mut frame = vec![0xff, marker, 0, 8 + 3 * components, 8];
    frame.extend([height_px.to_be_bytes(), width_px.to_be_bytes()].concat());
    frame.push(components);
    (1..).zip(sampling).for_each(|(number, &sampling)| frame.extend([number, sampling, u8::from(number > 1)]));
    let (last, coded) = if marker == 0xc2 { (0, components) } else { (63, components) };
    let mut scan = vec![0xff, 0xda, 0, 6 + 2 * coded, coded];
    (1..=coded).for_each(|number| scan.extend([number, if number > 1 { 0x11 } else { 0 }]));
    scan.extend([0, last, 0]);
    let coded = [&scan, &pixels[..pixels.len() - 2]].concat();
    [&[0xff, 0xd8][..], &tables, &frame, &coded.repeat(scans), &[0xff, 0xd9]].concat()
}

#[test]
fn every_kind_of_jpeg_takes_what_is_counted() {
    let _alone = alone();
    let samplings: [&[u8]; 8] = [
        &[0x11],
        &[0x44],
        &[0x11, 0x11, 0x11],
        &[0x22, 0x11, 0x11],
        &[0x11, 0x44, 0x11],
        &[0x41, 0x14, 0x11],
        &[0x11, 0x11, 0x11, 0x11],
        &[0x22, 0x11, 0x11, 0x44],
    ];
    let mut read = 0;
    for marker in [0xc0, 0xc1, 0xc2] {
        for sampling in samplings {
            for size_px in [[64, 48], [500, 300], [4096, 9], [9, 4096]] {
                let name = format!("marker {marker:x}, sampling {sampling:x?}, {size_px:?}");
                let [target, _] = read_within(&name, &jpeg(marker, size_px, sampling, 1), DISPLAY_PX);
                read += usize::from(target.is_empty());
            }
        }
    }
    assert!(read > 30, "only {read} were read");
}

#[test]
fn reading_a_jpeg_ends_with_its_interrupt() {
    let _alone = alone();
    let file = jpeg(0xc2, [8192, 8192], &[0x11, 0x11, 0x11], 90);
    let interrupt = Interrupt::default();
    let raised = interrupt.clone();
    let raise = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(300));
        raised.raise();
    });
    let began = Instant::now();
    let read = interrupt
        .run(|| lightpath_media::pictures::photograph(&file, lightpath_domain::dataset::Encoding::Srgb).is_ok());
    let took = began.elapsed();
    raise.join().unwrap();
    assert_eq!(read, Err(Interrupted), "{took:?}");
}

/// A TIFF file, whose directory comes first, with tags (number, type, values) and the content behind it.
fn tiff(is_big: bool, tags: &[(u16, u16, Vec<u32>)], content: &[u8]) -> Vec<u8> {
    let word =
        |number: u64| if is_big { number.to_le_bytes().to_vec() } else { (number as u32).to_le_bytes().to_vec() };
    let mut file = if is_big { b"II\x2b\0\x08\0\0\0".to_vec() } else { b"II\x2a\0".to_vec() };
    file.extend(word(if is_big { 16 } else { 8 }));
    let count = tags.len() as u16;
    file.extend(if is_big { u64::from(count).to_le_bytes().to_vec() } else { count.to_le_bytes().to_vec() });
    let word_bytes = word(0).len();
    let place = file.len() + tags.len() * (4 + 2 * word_bytes) + word_bytes;
    let mut values_behind = Vec::new();
    for (number, kind, values) in tags {
        let of_value =
            |value: &u32| if *kind == 3 { value.to_le_bytes()[..2].to_vec() } else { value.to_le_bytes().to_vec() };
        let mut bytes: Vec<u8> = values.iter().flat_map(of_value).collect();
        file.extend([number.to_le_bytes(), kind.to_le_bytes()].concat());
        file.extend(word(values.len() as u64));
        if bytes.len() <= word_bytes {
            bytes.resize(word_bytes, 0);
            file.extend(bytes);
        } else {
            file.extend(word((place + values_behind.len()) as u64));
            values_behind.extend(bytes);
        }
    }
    file.extend(word(0));
    file.extend(&values_behind);
    assert!(file.len() <= CONTENT_AT);
    file.resize(CONTENT_AT, 0);
    [&file, content].concat()
}

/// Place of the content in these files.
const CONTENT_AT: usize = 1 << 20;

/// Tags of a grey picture with strips of `rows` rows.
fn strips(
    [width_px, height_px]: [u32; 2],
    compression: u32,
    rows: u32,
    [places, lengths]: [Vec<u32>; 2],
) -> Vec<(u16, u16, Vec<u32>)> {
    vec![
        (256, 4, vec![width_px]),
        (257, 4, vec![height_px]),
        (258, 3, vec![8]),
        (259, 3, vec![compression]),
        (262, 3, vec![1]),
        (273, 4, places),
        (277, 3, vec![1]),
        (278, 4, vec![rows]),
        (279, 4, lengths),
    ]
}

fn grey_jpeg() -> Vec<u8> {
    let mut file = Vec::new();
    JpegEncoder::new(&mut file)
        .encode_image(&DynamicImage::from(GrayImage::from_pixel(16, 16, image::Luma([90]))))
        .unwrap();
    file
}

#[test]
fn jpeg_in_tiff_has_the_limits_of_both() {
    let _alone = alone();
    let at = CONTENT_AT as u32;
    let one = |file: &[u8]| [vec![at], vec![file.len() as u32]];
    for is_big in [false, true] {
        let good = grey_jpeg();
        let file = tiff(is_big, &strips([16, 16], 7, 16, one(&good)), &good);
        assert_eq!(read_within("a good strip", &file, DISPLAY_PX), ["", ""]);
        for hostile in [
            jpeg(0xc0, [16_384, 16_384], &[0x11], 1),
            jpeg(0xc2, [16, 16], &[0x11], 1),
            jpeg(0xc0, [16, 16], &[0x11], 5),
        ] {
            let file = tiff(is_big, &strips([16, 16], 7, 16, one(&hostile)), &hostile);
            let [message, _] = read_within("a huge strip", &file, DISPLAY_PX);
            assert!(
                message.contains("progressive, has more than 4 scans, or is larger than its strip of 16×16 px"),
                "{message}"
            );
        }
        let shared = [vec![at; 8192], vec![good.len() as u32; 8192]];
        let file = tiff(is_big, &strips([16, 8192], 7, 1, shared), &good);
        let [message, _] = read_within("shared strips", &file, DISPLAY_PX);
        assert!(message.contains("they overlap"), "{message}");
        // A strip that goes on beyond the end of the file, and tables that begin a frame.
        let hostile = jpeg(0xc0, [16_384, 16_384], &[0x11], 1);
        let beyond = tiff(is_big, &strips([16, 16], 7, 16, [vec![at], vec![at]]), &hostile);
        let [message, _] = read_within("a strip beyond the end", &beyond, DISPLAY_PX);
        assert!(message.contains("was cut off"), "{message}");
        for tables in [&hostile[..], &[0xff, 0xd8, 0, 0, 0, 0, 0xff, 0, 0]] {
            let mut tags = strips([16, 16], 7, 16, one(&good));
            tags.push((347, 4, vec![0; 2]));
            let mut file = tiff(is_big, &tags, &good);
            let entry = file.windows(4).position(|bytes| bytes == [0x5b, 1, 4, 0]).unwrap();
            // The values become the bytes behind the content.
            let (word, behind) = (if is_big { 8 } else { 4 }, file.len() as u32);
            file[entry + 2] = 7;
            file[entry + 4..entry + 8].copy_from_slice(&(tables.len() as u32).to_le_bytes());
            file[entry + 4 + word..entry + 8 + word].copy_from_slice(&behind.to_le_bytes());
            file[entry + 8 + word..entry + 4 + 2 * word].fill(0);
            file.extend(tables);
            let [message, _] = read_within("tables", &file, DISPLAY_PX);
            assert!(message.contains("more than tables"), "{message}");
        }
    }
}

#[test]
fn directories_of_tiff_are_small() {
    let _alone = alone();
    let pixels = vec![7; 64 * 48];
    let one = || [vec![CONTENT_AT as u32], vec![pixels.len() as u32]];
    for is_big in [false, true] {
        let plain = || strips([64, 48], 1, 48, one());
        assert_eq!(read_within("a good file", &tiff(is_big, &plain(), &pixels), DISPLAY_PX), ["", ""]);
        let with = |number: u16, kind: u16, values: Vec<u32>| {
            let mut tags = plain();
            tags.retain(|(other, ..)| *other != number);
            tags.push((number, kind, values));
            tags.sort_unstable_by_key(|(number, ..)| *number);
            tiff(is_big, &tags, &pixels)
        };
        for (number, values, reason) in [
            (277, vec![65_535], "65535 samples"),
            (322, vec![u32::MAX], "a tile of it has a side of 4294967295 px"),
            (256, vec![60_000], "at most 16384"),
        ] {
            let [message, _] = read_within("a wrong tag", &with(number, 4, values), DISPLAY_PX);
            assert!(message.contains(reason), "{message}");
        }
        let mut many = with(339, 3, vec![1, 1, 1]);
        let entry = many.windows(4).position(|bytes| bytes == [0x53, 1, 3, 0]).unwrap();
        many[entry + 4..entry + 8].copy_from_slice(&40_000_000_u32.to_le_bytes());
        many.resize(CONTENT_AT + (80 << 20), 1);
        let [message, _] = read_within("many values", &many, DISPLAY_PX);
        assert!(message.contains("at most 135168 are read"), "{message}");
        let rows = [vec![CONTENT_AT as u32; 65_000], vec![1; 65_000]];
        read_within("as many values as are read", &tiff(is_big, &strips([16, 9000], 1, 1, rows), &[0]), DISPLAY_PX);
        let mut twice = plain();
        twice.push((279, 4, vec![5]));
        let [message, _] = read_within("a tag twice", &tiff(is_big, &twice, &pixels), DISPLAY_PX);
        assert!(message.contains("tag 279 stands twice"), "{message}");
    }
}

#[test]
fn arrays_take_what_is_counted() {
    let _alone = alone();
    let array = |descr: &str, shape: &str, bytes: usize| {
        let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n");
        let head = [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes()].concat();
        [head, vec![0; bytes]].concat()
    };
    for (descr, value_bytes) in [("|u1", 1), ("<u2", 2), ("<f4", 4), ("<f8", 8)] {
        let [_, photo] = read_within(descr, &array(descr, "(1000, 1500)", 1_500_000 * value_bytes), DISPLAY_PX);
        assert_eq!(photo, "", "{descr}");
        for shape in ["(1099511627776, 1099511627776)", "(16384, 4096)", "(1000, 1500)"] {
            let [_, photo] = read_within(descr, &array(descr, shape, 1_000_000), DISPLAY_PX);
            assert!(photo.contains("a picture in a .npy file must be"), "{descr} {shape}: {photo}");
        }
    }
}
