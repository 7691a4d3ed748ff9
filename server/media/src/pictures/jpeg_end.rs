//! Detects truncated JPEG files. The decoder itself fills missing pixels with grey and reports no error.

/// Whether the end-of-image marker follows the segments. Markers inside a segment do not count: a thumbnail has one
/// too.
pub(super) fn has_end_of_image(jpeg: &[u8]) -> bool {
    const RESTARTS: std::ops::RangeInclusive<u8> = 0xd0..=0xd7;
    let mut at = 2; // after the start-of-image marker
    loop {
        // Skip entropy-coded data and fill bytes up to the next marker.
        let Some(distance) = jpeg.get(at..).and_then(|rest| rest.iter().position(|&byte| byte == 0xff)) else {
            return false;
        };
        at += distance + 1;
        match jpeg.get(at) {
            None => return false,
            Some(0xd9) => return true,
            Some(0xff) => {}
            Some(0x00 | 0x01) => at += 1,
            Some(marker) if RESTARTS.contains(marker) => at += 1,
            Some(_) => match jpeg.get(at + 1..at + 3) {
                Some(&[high, low]) => at += 1 + usize::from(u16::from_be_bytes([high, low])),
                _ => return false,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::has_end_of_image;

    #[test]
    fn markers_inside_segments_do_not_count() {
        let with_thumbnail = [0xff, 0xd8, 0xff, 0xe1, 0, 6, 0xff, 0xd8, 0xff, 0xd9, 0xff, 0xda, 0, 2, 1, 0xff, 0, 3];
        assert!(!has_end_of_image(&with_thumbnail));
        let mut whole = with_thumbnail.to_vec();
        whole.extend([0xff, 0xd3, 7, 0xff, 0xff, 0xd9, 1, 2]);
        assert!(has_end_of_image(&whole));
        assert!(!has_end_of_image(&[0xff]));
    }
}
