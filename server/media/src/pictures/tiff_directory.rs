//! A check of a TIFF file's directory before a decoder reads it.
//!
//! The decoder makes a list of the values of each tag that it reads, of up to 32 bytes for a value of one byte. It decodes
//! a JPEG file in a strip whatever the size of that is. And strips may share their bytes, so that a small file takes
//! hours. So the directory is read here first, and such files are refused. Source: TIFF 6.0, TIFF Technical Note 2.

use super::{SIDE_PX_MAX, jpeg};

/// Largest number of tags. Cameras write some dozens.
const TAGS_MAX: u64 = 1000;
/// Largest number of values of all tags that the decoder reads: place and length of 65 536 strips or tiles, and others.
const VALUES_MAX: u64 = (2 << 16) + 4096;
/// Memory for a value while it is read \[bytes\]: as it is in the file, as a value of any type, and as a number.
const VALUE_BYTES: u64 = 96;
/// Largest number of samples of a pixel: colours, alpha, and some that are passed over.
const SAMPLES_MAX: u64 = 8;
/// The tags that the decoder reads. Texts, curves and those of programs are passed over.
const READ: [u16; 23] =
    [254, 256, 257, 258, 259, 262, 266, 273, 274, 277, 278, 279, 284, 317, 322, 323, 324, 325, 330, 338, 339, 347, 530];
/// Largest side that is looked at \[px\]; the product of two of them and all bytes of a pixel is no overflow.
const ANY_SIDE_PX_MAX: u64 = 1 << 20;
const JPEG_COMPRESSION: u64 = 7;
/// Format of samples that are floats.
const FLOATS: u64 = 3;
/// Bytes of a frame up to the size of the picture.
const FRAME_BYTES: usize = 9;
/// Marker before the pixels of a component or of all.
const START_OF_SCAN: [u8; 2] = [0xff, 0xda];
/// Largest number of scans of a JPEG file in a strip: one for each component. The decoder looks at no interrupt meanwhile.
const SCANS_MAX: usize = 4;
/// Side of the largest usual block of JPEG \[px\], in whole numbers of which a strip may be coded.
const BLOCK_PX: u64 = 16;

/// TIFF, or BigTIFF with longer numbers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Form {
    pub(super) is_big_endian: bool,
    /// Length of an offset and of the number of a tag's values \[bytes\].
    pub(super) word: usize,
    /// Length of the number of a directory's tags \[bytes\].
    pub(super) count_bytes: usize,
}

impl Form {
    /// The form of a file; `None` if it is no TIFF file.
    pub(super) fn of(file: &[u8]) -> Option<Self> {
        let is_big_endian = file.starts_with(b"MM");
        match number(file.get(2..4)?, is_big_endian) {
            42 => Some(Self { is_big_endian, word: 4, count_bytes: 2 }),
            43 => Some(Self { is_big_endian, word: 8, count_bytes: 8 }),
            _ => None,
        }
    }

    /// The number in some bytes.
    pub(super) fn number(self, digits: &[u8]) -> u64 {
        number(digits, self.is_big_endian)
    }

    /// Place of the first directory's offset in the header: behind another number as long as it.
    pub(super) fn place(self) -> std::ops::Range<usize> {
        self.word..2 * self.word
    }
}

/// The directory of a picture.
#[derive(Clone)]
pub(super) struct Directory<'a> {
    file: &'a [u8],
    form: Form,
    /// Place of the directory in the file.
    pub(super) start: u64,
    tags: Vec<Tag>,
    /// Place of the next directory, 0 behind the last one; `None` if the file ends before.
    pub(super) next: Option<u64>,
}

/// A tag, and where its values are.
#[derive(Clone)]
struct Tag {
    number: u16,
    kind: u16,
    count: u64,
    /// Place of the values in the file.
    at: usize,
}

impl<'a> Directory<'a> {
    /// Reads the directory at a place; `None` if the file ends in it. Then the decoder finds none, either.
    pub(super) fn read(file: &'a [u8], form: Form, start: u64) -> Option<Self> {
        let mut directory = Self { file, form, start, tags: Vec::new(), next: None };
        let Form { word, count_bytes, .. } = form;
        let (start, entry_bytes) = (usize::try_from(start).ok()?, 4 + 2 * word);
        let count = directory.number(start, count_bytes)?;
        for i in 0..count.min(TAGS_MAX + 1) as usize {
            let at = start.checked_add(count_bytes + i * entry_bytes)?;
            let (number, kind) = (directory.number(at, 2)? as u16, directory.number(at + 2, 2)? as u16);
            let count = directory.number(at + 4, word)?;
            let is_inside = count.saturating_mul(size_of_kind(kind)) <= word as u64;
            let place = at + 4 + word;
            let at = if is_inside { place } else { usize::try_from(directory.number(place, word)?).ok()? };
            directory.tags.push(Tag { number, kind, count, at });
        }
        let entries_bytes = usize::try_from(count).ok().and_then(|count| count.checked_mul(entry_bytes));
        let end = entries_bytes.and_then(|bytes| bytes.checked_add(start.checked_add(count_bytes)?));
        directory.next = end.and_then(|end| directory.number(end, word));
        Some(directory)
    }

    /// The form of its file.
    pub(super) fn form(&self) -> Form {
        self.form
    }

    /// Number of its tags.
    pub(super) fn len(&self) -> usize {
        self.tags.len()
    }

    /// Whether a strip or tile ends behind the end of the file.
    pub(super) fn is_cut(&self) -> bool {
        self.chunks().any(|(start, bytes)| start.saturating_add(bytes) > self.file.len() as u64)
    }

    /// Refuses a picture that would take much more memory or time than its size says.
    pub(super) fn check(&self) -> Result<(), String> {
        if self.tags.len() as u64 > TAGS_MAX {
            return Err(format!("it has more than {TAGS_MAX} tags"));
        }
        if let Some(side_px) = [256, 257].into_iter().find_map(|tag| self.first(tag).filter(|&px| px > ANY_SIDE_PX_MAX))
        {
            return Err(format!("a side of it has {side_px} px"));
        }
        for (i, tag) in self.tags.iter().enumerate().filter(|(_, tag)| tag.is_read()) {
            if self.tags[..i].iter().any(|other| other.number == tag.number) {
                return Err(format!("its tag {} stands twice", tag.number));
            }
        }
        let values = self.values_read();
        if values > VALUES_MAX {
            return Err(format!("its tags have {values} values, but at most {VALUES_MAX} are read"));
        }
        let samples = self.first(277).unwrap_or(1);
        // The decoder would take whole numbers for floats.
        if self.values(258).any(|bits| bits == 32) && self.first(339) != Some(FLOATS) {
            return Err("its samples are whole numbers of 32 bits".to_owned());
        }
        if samples > SAMPLES_MAX {
            return Err(format!("a pixel of it has {samples} samples, but at most {SAMPLES_MAX} are read"));
        }
        if let Some(side_px) = self.tile_px().into_iter().find(|&side_px| side_px > 2 * u64::from(SIDE_PX_MAX)) {
            return Err(format!("a tile of it has a side of {side_px} px"));
        }
        let packed_bytes = self.chunks().fold(0, |sum: u64, (_, bytes)| sum.saturating_add(bytes));
        if packed_bytes > self.file.len() as u64 {
            let length = self.file.len();
            return Err(format!("its strips have {packed_bytes} bytes, but the file has {length}: they overlap"));
        }
        if self.is_jpeg() { self.check_jpeg() } else { Ok(()) }
    }

    /// Memory for the directory and for JPEG files in it, besides pixels \[bytes\].
    pub(super) fn decoding_bytes(&self) -> u64 {
        let [width_px, height_px] = self.chunk_px();
        let jpeg_bytes = match self.is_jpeg() {
            true => {
                let packed_bytes = self.chunks().map(|(_, bytes)| bytes).max().unwrap_or(0);
                jpeg::decoding_bytes(width_px, height_px, 4) + 4 * width_px * height_px + 2 * packed_bytes
            }
            false => 0,
        };
        VALUE_BYTES * self.values_read() + jpeg_bytes
    }

    /// Number of values that the decoder reads.
    fn values_read(&self) -> u64 {
        let counts = self.tags.iter().filter(|tag| tag.is_read()).map(|tag| tag.count);
        counts.fold(0, u64::saturating_add)
    }

    /// Refuses JPEG files that are larger than their strip, or have several scans for each component, which take long.
    fn check_jpeg(&self) -> Result<(), String> {
        let [width_px, height_px] = self.chunk_px();
        let is_larger = |frame: &[u8]| {
            let side = |at: usize| u64::from(u16::from_be_bytes([frame[at], frame[at + 1]]));
            frame[1] > 0xc1 || side(5) > height_px || side(7) > width_px
        };
        for (start, bytes) in self.chunks() {
            // The decoder may read a little beyond the strip.
            let file = self.slice(start, bytes.saturating_add(FRAME_BYTES as u64));
            let mut frames = file.windows(FRAME_BYTES).filter(|bytes| is_frame(bytes));
            let scans = file.windows(2).filter(|bytes| *bytes == START_OF_SCAN).count();
            if scans > SCANS_MAX || frames.any(is_larger) {
                return Err(format!(
                    "a JPEG file in it is progressive, has more than {SCANS_MAX} scans, or is larger than its strip of \
                     {width_px}×{height_px} px"
                ));
            }
        }
        // The decoder puts the tables, without the two bytes at their end, before each strip.
        let tables = self.tag(347).map_or(&[][..], |tag| self.slice(tag.at as u64, tag.count));
        let ends_in_marker = tables.iter().rev().nth(2) == Some(&0xff);
        if ends_in_marker || tables.windows(2).any(is_frame) {
            return Err("its tables for JPEG hold more than tables".to_owned());
        }
        Ok(())
    }

    /// A part of the file, as far as the file has it.
    fn slice(&self, start: u64, bytes: u64) -> &'a [u8] {
        let place = |place: u64| place.min(self.file.len() as u64) as usize;
        &self.file[place(start)..place(start.saturating_add(bytes))]
    }

    fn is_jpeg(&self) -> bool {
        self.first(259) == Some(JPEG_COMPRESSION)
    }

    /// Columns and rows of a tile, or of a strip in whole blocks of JPEG \[px\].
    fn chunk_px(&self) -> [u64; 2] {
        let [width_px, height_px] = [256, 257].map(|tag| self.first(tag).unwrap_or(0));
        let strip = [width_px, self.first(278).map_or(height_px, |rows| rows.min(height_px))];
        match self.tile_px() {
            [0, 0] => strip.map(|side_px| side_px.next_multiple_of(BLOCK_PX)),
            tile => tile,
        }
    }

    /// Columns and rows of a tile \[px\]; 0 in a picture of strips.
    fn tile_px(&self) -> [u64; 2] {
        [322, 323].map(|tag| self.first(tag).unwrap_or(0))
    }

    /// Place and length of each strip or tile.
    fn chunks(&self) -> impl Iterator<Item = (u64, u64)> + '_ {
        [(273, 279), (324, 325)].into_iter().flat_map(|(places, lengths)| self.values(places).zip(self.values(lengths)))
    }

    /// Whether the directory has a tag.
    pub(super) fn has(&self, number: u16) -> bool {
        self.tag(number).is_some()
    }

    fn tag(&self, number: u16) -> Option<&Tag> {
        self.tags.iter().find(|tag| tag.number == number)
    }

    /// The first value of a tag.
    pub(super) fn first(&self, tag: u16) -> Option<u64> {
        self.values(tag).next()
    }

    fn values(&self, number: u16) -> impl Iterator<Item = u64> + '_ {
        self.tag(number).into_iter().flat_map(move |tag| {
            let bytes = size_of_kind(tag.kind) as usize;
            let value = move |i: u64| self.number(tag.at.checked_add(i as usize * bytes)?, bytes);
            (0..tag.count).map_while(value)
        })
    }

    fn number(&self, at: usize, bytes: usize) -> Option<u64> {
        Some(self.form.number(self.file.get(at..at.checked_add(bytes)?)?))
    }
}

/// The number in some bytes.
fn number(digits: &[u8], is_big_endian: bool) -> u64 {
    let next = |number: u64, &digit: &u8| number << 8 | u64::from(digit);
    if is_big_endian { digits.iter().fold(0, next) } else { digits.iter().rev().fold(0, next) }
}

impl Tag {
    /// Whether the decoder reads the values.
    fn is_read(&self) -> bool {
        READ.contains(&self.number)
    }
}

/// Bytes of a value.
fn size_of_kind(kind: u16) -> u64 {
    match kind {
        3 | 8 => 2,
        4 | 9 | 11 | 13 => 4,
        5 | 10 | 12 | 16..=18 => 8,
        _ => 1,
    }
}

/// Whether the bytes are a marker of JPEG that begins a frame, which has the size of the picture.
fn is_frame(bytes: &[u8]) -> bool {
    matches!(bytes, [0xff, 0xc0..=0xcf, ..]) && !matches!(bytes[1], 0xc4 | 0xc8 | 0xcc)
}
