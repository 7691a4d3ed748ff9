//! The chunks of a PNG file that its pixels need.
//!
//! A decoder also reads colour profiles and texts, which may be compressed: some hundred kilobytes unpack to as many
//! megabytes. Nothing here uses them, so the decoder does not get them.

use std::borrow::Cow;

const SIGNATURE_BYTES: usize = 8;
/// Bytes of a chunk besides its content: length, type and checksum.
const FRAME_BYTES: usize = 12;
/// Largest content of a chunk without pixels \[bytes\]. A palette has 768; the orientation is in some hundred bytes of EXIF.
const CONTENT_BYTES_MAX: usize = 64 << 10;

/// The file without the chunks that its pixels do not need. A file that ends early ends early afterwards, too.
pub(super) fn needed(file: &[u8]) -> Cow<'_, [u8]> {
    let mut kept = Vec::new();
    let (mut at, mut copied) = (SIGNATURE_BYTES, 0);
    while let Some((length, name)) = head(file, at) {
        let end = at.saturating_add(FRAME_BYTES + length);
        if !is_needed(name, length) {
            // One allocation suffices: the result is never longer than the file.
            kept.reserve_exact(if kept.is_empty() { file.len() } else { 0 });
            kept.extend_from_slice(&file[copied..at]);
            copied = end.min(file.len());
        }
        at = end;
    }
    if copied == 0 {
        return Cow::Borrowed(file);
    }
    kept.extend_from_slice(&file[copied..]);
    Cow::Owned(kept)
}

/// Length and type of the chunk at a place.
fn head(file: &[u8], at: usize) -> Option<(usize, [u8; 4])> {
    let (length, rest) = file.get(at..)?.split_first_chunk()?;
    Some((u32::from_be_bytes(*length) as usize, *rest.first_chunk()?))
}

fn is_needed(name: [u8; 4], length: usize) -> bool {
    match &name {
        b"IDAT" => true,
        // A capital letter says that a decoder must know the chunk.
        b"tRNS" | b"eXIf" | [b'A'..=b'Z', ..] => length <= CONTENT_BYTES_MAX,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chunk(name: &[u8; 4], content: &[u8]) -> Vec<u8> {
        [&(content.len() as u32).to_be_bytes()[..], name, content, &[0; 4]].concat()
    }

    #[test]
    fn only_chunks_of_the_pixels_are_kept() {
        let (signature, header, pixels) =
            (vec![7; SIGNATURE_BYTES], chunk(b"IHDR", &[1; 13]), chunk(b"IDAT", &[2; 50]));
        let plain = [signature.clone(), header.clone(), pixels.clone()].concat();
        assert!(matches!(needed(&plain), Cow::Borrowed(_)));
        let (profile, text, palette) = (chunk(b"iCCP", b"x"), chunk(b"zTXt", b"y"), chunk(b"PLTE", &[0; 70_000]));
        let full = [signature, profile.clone(), header, text, palette, pixels, profile].concat();
        assert_eq!(needed(&full), plain);
        for end in 0..full.len() {
            let kept = needed(&full[..end]);
            // A chunk without its whole head is not known to be needed or not.
            assert!(plain.starts_with(&kept[..kept.len().saturating_sub(7)]), "cut at {end}");
        }
    }
}
