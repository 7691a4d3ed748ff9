//! TIFF files with several pictures: the one of full resolution is read, wherever it stands in the file.
//!
//! A TIFF file is a chain of directories, one for each picture; its header points to the first. `NewSubfileType` marks
//! thumbnails and masks. The decoder reads the picture that the header points to, so it gets a header that points to the
//! only picture without such a mark.

use std::io::{self, BufRead, Read, Seek, SeekFrom};

/// Length of the header of BigTIFF, which is longer than that of TIFF \[bytes\].
const HEADER_BYTES: usize = 16;
/// Limit on the entries of all directories. A picture has some ten of them.
const ENTRIES_MAX: u64 = 100_000;
/// Tag of the marks of a picture.
const NEW_SUBFILE_TYPE: u16 = 254;
/// Tag of the kind of a picture in older files.
const SUBFILE_TYPE: u16 = 255;
/// Tag of directories that are not in the chain. Some cameras put the picture there, and a thumbnail into the chain.
const SUB_DIRECTORIES: u16 = 330;

/// A file has several pictures of full resolution, or only reduced ones beside others that are not read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SeveralPictures {
    pub(super) pictures: usize,
}

/// A picture file whose header points to its picture of full resolution.
#[derive(Debug)]
pub(super) struct AtPicture<R> {
    source: R,
    header: Vec<u8>,
    position: u64,
    /// Whether the source stands somewhere else, because the header was read instead of it.
    is_elsewhere: bool,
}

/// Points a TIFF file to its picture of full resolution. Any other file stays as it is.
///
/// # Errors
///
/// An error of reading; also for a chain of directories that is damaged behind a thumbnail.
pub(super) fn at_full_picture<R: BufRead + Seek>(mut source: R) -> io::Result<Result<AtPicture<R>, SeveralPictures>> {
    source.rewind()?;
    let mut header = Vec::with_capacity(HEADER_BYTES);
    source.by_ref().take(HEADER_BYTES as u64).read_to_end(&mut header)?;
    if let Some(form) = Form::of(&header) {
        let mut pictures = Vec::new();
        match form.read_pictures(&mut source, &header, &mut pictures) {
            Ok(()) => match full_picture(&pictures) {
                Ok(offset) => form.point(&mut header, offset),
                Err(several) => return Ok(Err(several)),
            },
            Err(error) if pictures.first().is_some_and(|first| first.is_marked) => return Err(error),
            // Some writers leave chance bytes behind the only picture.
            Err(_) => {}
        }
    }
    Ok(Ok(AtPicture { source, header, position: 0, is_elsewhere: true }))
}

impl<R> AtPicture<R> {
    /// The header, which points to the picture.
    pub(super) fn header(&self) -> &[u8] {
        &self.header
    }
}

/// Offset of the picture without a mark, or of a first picture that stands alone.
fn full_picture(pictures: &[Directory]) -> Result<u64, SeveralPictures> {
    let mut full = pictures.iter().filter(|picture| !picture.is_marked);
    match (full.next(), full.next(), pictures) {
        (Some(one), None, _) => Ok(one.offset),
        (None, _, [alone]) if !alone.has_others => Ok(alone.offset),
        _ => Err(SeveralPictures { pictures: pictures.len() }),
    }
}

/// Byte order of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ByteOrder {
    Little,
    Big,
}

/// What a directory says of its picture.
#[derive(Clone, Copy, Debug)]
struct Directory {
    offset: u64,
    is_marked: bool,
    has_others: bool,
}

impl ByteOrder {
    /// The number in some bytes.
    fn number(self, bytes: &[u8]) -> u64 {
        let join = |number: u64, byte: &u8| number << 8 | u64::from(*byte);
        match self {
            Self::Little => bytes.iter().rev().fold(0, join),
            Self::Big => bytes.iter().fold(0, join),
        }
    }
}

/// TIFF, or BigTIFF with longer numbers.
#[derive(Clone, Copy, Debug)]
struct Form {
    order: ByteOrder,
    /// Length of an offset and of the number of a tag's values \[bytes\].
    word: usize,
    /// Length of the number of a directory's entries \[bytes\].
    count_bytes: usize,
}

impl Form {
    fn of(header: &[u8]) -> Option<Self> {
        let (order, version) = match *header {
            [b'I', b'I', low, high, ..] => (ByteOrder::Little, u16::from_le_bytes([low, high])),
            [b'M', b'M', high, low, ..] => (ByteOrder::Big, u16::from_be_bytes([high, low])),
            _ => return None,
        };
        match version {
            42 if header.len() >= 8 => Some(Self { order, word: 4, count_bytes: 2 }),
            43 if header.len() == HEADER_BYTES => Some(Self { order, word: 8, count_bytes: 8 }),
            _ => None,
        }
    }

    /// Place of the offset in the header: behind another number as long as it.
    fn place(self) -> std::ops::Range<usize> {
        self.word..2 * self.word
    }

    /// Makes the header point to a directory.
    fn point(self, header: &mut [u8], offset: u64) {
        let place = &mut header[self.place()];
        place.copy_from_slice(&offset.to_le_bytes()[..self.word]);
        if self.order == ByteOrder::Big {
            place.reverse();
        }
    }

    /// Adds the directories of a file, in their order.
    fn read_pictures(
        self,
        source: &mut (impl Read + Seek),
        header: &[u8],
        pictures: &mut Vec<Directory>,
    ) -> io::Result<()> {
        let (mut offset, mut entries) = (self.order.number(&header[self.place()]), 0_u64);
        while offset != 0 {
            source.seek(SeekFrom::Start(offset))?;
            let count = self.read(source, self.count_bytes)?;
            entries = entries.saturating_add(count).saturating_add(1);
            if entries > ENTRIES_MAX {
                return Err(io::ErrorKind::InvalidData.into());
            }
            pictures.push(self.directory(source, offset, count)?);
            offset = self.read(source, self.word)?;
        }
        Ok(())
    }

    fn directory(self, source: &mut impl Read, offset: u64, count: u64) -> io::Result<Directory> {
        const SHORT: u64 = 3;
        const LONG: u64 = 4;
        let mut directory = Directory { offset, is_marked: false, has_others: false };
        for _ in 0..count {
            let (tag, kind) = (self.read(source, 2)?, self.read(source, 2)?);
            self.read(source, self.word)?;
            let mut value = [0; 8];
            source.read_exact(&mut value[..self.word])?;
            let value = self.order.number(match kind {
                SHORT => &value[..2],
                LONG => &value[..4],
                _ => &value[..self.word],
            });
            match tag as u16 {
                // Bits: 1 a reduced picture, 4 a mask.
                NEW_SUBFILE_TYPE => directory.is_marked |= value & 5 != 0,
                SUBFILE_TYPE => directory.is_marked |= value == 2,
                SUB_DIRECTORIES => directory.has_others = true,
                _ => {}
            }
        }
        Ok(directory)
    }

    fn read(self, source: &mut impl Read, length: usize) -> io::Result<u64> {
        let mut bytes = [0; 8];
        source.read_exact(&mut bytes[..length])?;
        Ok(self.order.number(&bytes[..length]))
    }
}

impl<R: BufRead + Seek> Read for AtPicture<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let bytes = self.fill_buf()?;
        let length = bytes.len().min(out.len());
        out[..length].copy_from_slice(&bytes[..length]);
        self.consume(length);
        Ok(length)
    }
}

impl<R: BufRead + Seek> BufRead for AtPicture<R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        let at = usize::try_from(self.position).unwrap_or(usize::MAX);
        if at < self.header.len() {
            return Ok(&self.header[at..]);
        }
        if self.is_elsewhere {
            self.source.seek(SeekFrom::Start(self.position))?;
            self.is_elsewhere = false;
        }
        self.source.fill_buf()
    }

    fn consume(&mut self, amount: usize) {
        if self.is_elsewhere {
            self.position += (amount as u64).min((self.header.len() as u64).saturating_sub(self.position));
        } else {
            self.source.consume(amount);
            self.position += amount as u64;
        }
    }
}

impl<R: Seek> Seek for AtPicture<R> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.position = match to {
            SeekFrom::Start(position) => position,
            SeekFrom::Current(by) => {
                let position = self.position.checked_add_signed(by);
                position.ok_or_else(|| io::Error::from(io::ErrorKind::InvalidInput))?
            }
            SeekFrom::End(_) => self.source.seek(to)?,
        };
        self.is_elsewhere = true;
        Ok(self.position)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pictures::{PictureError, photograph, picture_size, reading_bytes};
    use lightpath_domain::dataset::Encoding;

    /// A TIFF file of grey pictures of 8 bits, each with columns, rows, its only value, and its `NewSubfileType`.
    fn tiff(form: Form, pictures: &[[u16; 4]]) -> Vec<u8> {
        let Form { order, word, count_bytes } = form;
        let number = |value: u64, bytes: usize| {
            let mut all = value.to_le_bytes()[..bytes].to_vec();
            if order == ByteOrder::Big {
                all.reverse();
            }
            all
        };
        let mark = if order == ByteOrder::Big { b"MM" } else { b"II" };
        let mut file = match word {
            4 => [&mark[..], &number(42, 2), &number(0, 4)].concat(),
            _ => [&mark[..], &number(43, 2), &number(8, 2), &number(0, 2), &number(0, 8)].concat(),
        };
        let mut link = word;
        for &[width, height, value, marks] in pictures {
            let [w, h] = [width, height].map(u64::from);
            let data = file.len() as u64;
            file.extend(vec![value as u8; (w * h) as usize]);
            let at = number(file.len() as u64, word);
            file[link..link + word].copy_from_slice(&at);
            let size = [(256, w), (257, h), (258, 8), (259, 1), (262, 1)];
            let strip = [(273, data), (277, 1), (278, h), (279, w * h)];
            file.extend(number(10, count_bytes));
            for (tag, value) in [(254, marks.into())].into_iter().chain(size).chain(strip) {
                file.extend([number(tag, 2), number(4, 2), number(1, word), number(value, 4)].concat());
                file.extend(vec![0; word - 4]);
            }
            link = file.len();
            file.extend(number(0, word));
        }
        file
    }

    const FORMS: [Form; 4] = [
        Form { order: ByteOrder::Little, word: 4, count_bytes: 2 },
        Form { order: ByteOrder::Big, word: 4, count_bytes: 2 },
        Form { order: ByteOrder::Little, word: 8, count_bytes: 8 },
        Form { order: ByteOrder::Big, word: 8, count_bytes: 8 },
    ];

    fn refused(file: &[u8]) -> usize {
        match photograph(file, Encoding::Linear) {
            Err(PictureError::SeveralPictures { pictures }) => pictures,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn picture_of_full_resolution_is_read_wherever_it_stands() {
        let [thumbnail, mask, picture] = [[8, 4, 10, 1], [80, 40, 255, 4], [80, 40, 51, 0]];
        for form in FORMS {
            for pictures in [&[thumbnail, picture][..], &[picture, thumbnail], &[picture], &[thumbnail, mask, picture]]
            {
                let file = tiff(form, pictures);
                let light = photograph(&file, Encoding::Linear).unwrap();
                assert_eq!((light.width_px(), light.height_px(), light.at(39, 79)), (80, 40, 0.2), "{form:?}");
                assert_eq!(picture_size(&file).unwrap(), (80, 40));
                let alone = tiff(form, &[picture]);
                let memory = |file: &[u8]| reading_bytes(file, 1) - 2 * file.len() as u64;
                assert_eq!(memory(&file), memory(&alone), "the memory is that of the picture");
            }
            // A thumbnail alone is the only picture that there is.
            assert_eq!(picture_size(&tiff(form, &[thumbnail])).unwrap(), (8, 4));
        }
    }

    #[test]
    fn stacks_of_pictures_are_refused_with_their_number() {
        let [thumbnail, picture] = [[8, 4, 10, 1], [80, 40, 51, 0]];
        for form in FORMS {
            assert_eq!(refused(&tiff(form, &[picture, picture, picture])), 3);
            assert_eq!(refused(&tiff(form, &[thumbnail, picture, picture])), 3);
        }
    }

    #[test]
    fn cut_and_circular_files_are_refused() {
        for form in FORMS {
            let file = tiff(form, &[[8, 4, 10, 1], [80, 40, 51, 0]]);
            for kept in 0..file.len() {
                assert!(photograph(&file[..kept], Encoding::Linear).is_err(), "cut to {kept} of {}", file.len());
            }
            let mut circle = file.clone();
            let end = circle.len();
            circle.copy_within(form.place(), end - form.word);
            // The chain has no end. The decoder reads the first picture or refuses the file; it comes to an end.
            let _ = photograph(&circle, Encoding::Linear);
        }
    }
}
