//! The bytes of a picture, as a decoder reads them.

use lightpath_optics::interrupt;
use std::borrow::Cow;
use std::io::{self, BufRead, Cursor, Read, Seek, SeekFrom};

/// Bytes that a decoder gets at once. It takes about a millisecond to decode so many.
const BYTES_AT_ONCE: usize = 64 << 10;

/// The bytes of a picture. Reading them looks at the [interrupt](lightpath_optics::interrupt) of the job, because large
/// pictures take seconds.
pub(super) struct PictureBytes<'a>(Cursor<Cow<'a, [u8]>>);

impl<'a> PictureBytes<'a> {
    pub(super) fn new(bytes: impl Into<Cow<'a, [u8]>>) -> Self {
        Self(Cursor::new(bytes.into()))
    }
}

impl Read for PictureBytes<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        interrupt::check();
        let len = out.len().min(BYTES_AT_ONCE);
        self.0.read(&mut out[..len])
    }
}

impl BufRead for PictureBytes<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        interrupt::check();
        let bytes = self.0.fill_buf()?;
        Ok(&bytes[..bytes.len().min(BYTES_AT_ONCE)])
    }

    fn consume(&mut self, amount: usize) {
        self.0.consume(amount);
    }
}

impl Seek for PictureBytes<'_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.0.seek(to)
    }
}
