//! TIFF files with several pictures: the one of full resolution is read, wherever it stands in the file.
//!
//! A TIFF file is a chain of directories, one for each picture; its header points to the first. `NewSubfileType` marks
//! thumbnails and masks. The decoder reads the picture that the header points to, so it gets a header that points to the
//! only picture without such a mark.

use super::PictureError;
use super::tiff_directory::{Directory, Form};
use std::borrow::Cow;

/// Limit on the tags of all directories. A picture has some ten of them.
const TAGS_MAX: usize = 100_000;
/// Tag of the marks of a picture: bit 1 a reduced picture, bit 4 a mask.
const NEW_SUBFILE_TYPE: u16 = 254;
/// Tag of the kind of a picture in older files: 2 is a reduced picture.
const SUBFILE_TYPE: u16 = 255;
/// Tag of directories that are not in the chain. Some cameras put the picture there, and a thumbnail into the chain.
const SUB_DIRECTORIES: u16 = 330;

/// The directory of the picture of full resolution.
///
/// # Errors
///
/// [`PictureError::SeveralPictures`] for several, or for reduced ones beside others that are not read;
/// [`PictureError::Truncated`] for a file that ends in its first directory, or behind a thumbnail.
pub(super) fn full_picture(file: &[u8]) -> Result<Directory<'_>, PictureError> {
    let cut = || PictureError::Truncated { format: "TIFF" };
    let form = Form::of(file).ok_or_else(cut)?;
    let Chain { first, full, full_pictures, pictures, is_whole } = Chain::of(file, form);
    let first = first.ok_or_else(cut)?;
    if !is_whole {
        // Some writers leave chance bytes behind the only picture.
        return if is_marked(&first) { Err(cut()) } else { Ok(first) };
    }
    match (full, full_pictures, pictures) {
        (Some(one), 1, _) => Ok(one),
        (None, _, 1) if !first.has(SUB_DIRECTORIES) => Ok(first),
        _ => Err(PictureError::SeveralPictures { pictures }),
    }
}

/// What the directories of a file are. A file may have very many, so only two of them are kept.
#[derive(Default)]
struct Chain<'a> {
    first: Option<Directory<'a>>,
    /// The first one that is not marked.
    full: Option<Directory<'a>>,
    /// Number of those that are not marked.
    full_pictures: usize,
    /// Number of all.
    pictures: usize,
    /// Whether the chain has an end.
    is_whole: bool,
}

impl<'a> Chain<'a> {
    fn of(file: &'a [u8], form: Form) -> Self {
        let (mut chain, mut tags) = (Self::default(), 0);
        let mut next = first_place(file, form);
        while let Some(start) = next.filter(|&start| start != 0) {
            let Some(directory) = Directory::read(file, form, start) else { return chain };
            tags += directory.len() + 1;
            if tags > TAGS_MAX {
                return chain;
            }
            next = directory.next;
            chain.add(directory);
        }
        chain.is_whole = next.is_some();
        chain
    }

    fn add(&mut self, directory: Directory<'a>) {
        self.pictures += 1;
        if !is_marked(&directory) {
            self.full_pictures += 1;
            self.full.get_or_insert_with(|| directory.clone());
        }
        self.first.get_or_insert(directory);
    }
}

/// Place of the directory to which the header points.
fn first_place(file: &[u8], form: Form) -> Option<u64> {
    Some(form.number(file.get(form.place())?))
}

fn is_marked(directory: &Directory<'_>) -> bool {
    directory.first(NEW_SUBFILE_TYPE).is_some_and(|marks| marks & 5 != 0) || directory.first(SUBFILE_TYPE) == Some(2)
}

/// The file with a header that points to this directory.
pub(super) fn pointing_to<'a>(file: &'a [u8], directory: &Directory<'_>) -> Cow<'a, [u8]> {
    let form = directory.form();
    if first_place(file, form) == Some(directory.start) {
        return Cow::Borrowed(file);
    }
    let mut file = file.to_vec();
    let place = &mut file[form.place()];
    place.copy_from_slice(&directory.start.to_le_bytes()[..form.word]);
    if form.is_big_endian {
        place.reverse();
    }
    Cow::Owned(file)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pictures::{PictureError, photograph, picture_size, reading_bytes};
    use lightpath_domain::dataset::Encoding;

    /// A TIFF file of grey pictures of 8 bits, each with columns, rows, its only value, and its `NewSubfileType`.
    fn tiff(form: Form, pictures: &[[u16; 4]]) -> Vec<u8> {
        let Form { is_big_endian, word, count_bytes } = form;
        let number = |value: u64, bytes: usize| {
            let mut all = value.to_le_bytes()[..bytes].to_vec();
            if is_big_endian {
                all.reverse();
            }
            all
        };
        let mark = if is_big_endian { b"MM" } else { b"II" };
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
        Form { is_big_endian: false, word: 4, count_bytes: 2 },
        Form { is_big_endian: true, word: 4, count_bytes: 2 },
        Form { is_big_endian: false, word: 8, count_bytes: 8 },
        Form { is_big_endian: true, word: 8, count_bytes: 8 },
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
