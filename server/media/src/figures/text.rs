//! Text in the font that is built in for pictures.

use ab_glyph::{Font, FontRef, PxScale, ScaleFont};
use std::sync::LazyLock;

/// DejaVu Sans with Latin and Greek letters and a few symbols. The licence is in the same folder as the font file.
static FONT: LazyLock<FontRef<'static>> = LazyLock::new(|| {
    let bytes = include_bytes!("../../assets/fonts/DejaVuSans-subset.ttf");
    FontRef::try_from_slice(bytes).expect("the embedded font is whole")
});

/// Width of `text` at `size_px` \[px\].
pub(super) fn width_px(text: &str, size_px: f32) -> f32 {
    let font = FONT.as_scaled(scale(size_px));
    text.chars().map(|letter| font.h_advance(font.glyph_id(letter))).sum()
}

/// Calls `paint(x, y, coverage)` for each pixel of `text`, whose left end of the baseline is at (0, 0).
pub(super) fn draw(text: &str, size_px: f32, mut paint: impl FnMut(i32, i32, f32)) {
    let font = FONT.as_scaled(scale(size_px));
    let mut x = 0.0;
    for letter in text.chars() {
        let id = font.glyph_id(letter);
        let glyph = id.with_scale_and_position(scale(size_px), ab_glyph::point(x, 0.0));
        if let Some(outline) = FONT.outline_glyph(glyph) {
            let bounds = outline.px_bounds();
            outline.draw(|dx, dy, coverage| {
                paint(bounds.min.x as i32 + dx as i32, bounds.min.y as i32 + dy as i32, coverage.min(1.0));
            });
        }
        x += font.h_advance(id);
    }
}

/// The scale of ab_glyph for a font size. ab_glyph scales the height from the lowest to the highest letter; a font size
/// is the size of the em.
fn scale(size_px: f32) -> PxScale {
    let em = FONT.units_per_em().unwrap_or(1000.0);
    PxScale::from(size_px * FONT.height_unscaled() / em)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn font_has_every_character_of_captions() {
        for letter in ('!'..='~').chain("αλφψπΔ²³µ×±−…·→°".chars()) {
            assert_ne!(FONT.glyph_id(letter).0, 0, "{letter}");
        }
    }

    #[test]
    fn text_is_as_wide_as_its_letters() {
        assert!(width_px("mm", 14.0) > width_px("ii", 14.0));
        assert_eq!(width_px("", 14.0), 0.0);
        let mut right = 0;
        draw("dB", 14.0, |x, _, coverage| right = right.max(if coverage > 0.5 { x } else { 0 }));
        assert!((right as f32 - width_px("dB", 14.0)).abs() < 3.0);
    }
}
