//! Contact sheets: pictures in rows and columns, each with a caption.

use super::canvas::{Anchor, BLACK, Canvas, GREY, PALE, scaled_height_px};
use crate::pictures::Rectangle;
use lightpath_optics::Plane;

/// A table of pictures of equal size.
#[derive(Clone, Debug)]
pub struct ContactSheet<'a> {
    /// Title at the top of the sheet.
    pub title: &'a str,
    /// Smaller line below the title; may be empty.
    pub subtitle: &'a str,
    /// Heading of each column.
    pub columns: &'a [&'a str],
    /// The region of interest \[px of the pictures\]: outside, pictures are darkened. `None`: all of them counts.
    pub region: Option<Rectangle>,
    /// Rows from top to bottom.
    pub rows: Vec<ContactRow<'a>>,
}

/// A row of a contact sheet.
#[derive(Clone, Debug)]
pub struct ContactRow<'a> {
    /// Pictures from left to right.
    pub pictures: Vec<CaptionedPicture<'a>>,
}

/// A picture with its caption.
#[derive(Clone, Debug)]
pub struct CaptionedPicture<'a> {
    /// The picture as linear light; 1 is white.
    pub intensity: &'a Plane<f32>,
    /// Text below the picture.
    pub caption: String,
}

/// Largest width of a picture \[px\]: three pictures fit a common screen.
const PICTURE_WIDTH_PX_MAX: u32 = 480;
/// Smallest width of a picture \[px\]: the caption needs it.
const PICTURE_WIDTH_PX_MIN: u32 = 320;
const MARGIN_PX: i32 = 24;
const GAP_PX: i32 = 14;
const CAPTION_PX: i32 = 34;
const HEADER_PX: i32 = 92;
/// Size of captions and column heads \[px\].
const TEXT_PX: f32 = 15.0;

impl ContactSheet<'_> {
    /// Draws the contact sheet.
    #[must_use]
    pub fn draw(&self) -> Canvas {
        let first = self.rows.iter().flat_map(|row| &row.pictures).next();
        let width = first.map_or(PICTURE_WIDTH_PX_MIN, |picture| picture.intensity.width_px() as u32);
        let width = width.clamp(PICTURE_WIDTH_PX_MIN, PICTURE_WIDTH_PX_MAX);
        let height = first.map_or(0, |picture| scaled_height_px(picture.intensity, width));
        let (step_x, step_y) = (width as i32 + GAP_PX, height as i32 + CAPTION_PX);
        let columns = self.columns.len() as i32;
        let mut canvas = Canvas::new(
            (2 * MARGIN_PX + columns * step_x - GAP_PX).max(1) as u32,
            (HEADER_PX + self.rows.len() as i32 * step_y + MARGIN_PX / 2) as u32,
        );
        canvas.text([MARGIN_PX, 34], self.title, 20.0, BLACK, Anchor::Start);
        canvas.text([MARGIN_PX, 55], self.subtitle, 13.0, GREY, Anchor::Start);
        let left = |column: usize| MARGIN_PX + column as i32 * step_x;
        for (i, head) in self.columns.iter().enumerate() {
            canvas.text([left(i) + width as i32 / 2, HEADER_PX - 10], head, TEXT_PX, BLACK, Anchor::Middle);
        }
        for (j, row) in self.rows.iter().enumerate() {
            let top = HEADER_PX + j as i32 * step_y;
            for (i, picture) in row.pictures.iter().enumerate() {
                let drawn = canvas.light(left(i), top, width, picture.intensity);
                if let Some(region) = self.region {
                    let scale = f64::from(width) / picture.intensity.width_px() as f64;
                    canvas.darken_outside([left(i), top], [width, drawn], region, scale);
                }
                canvas.frame(left(i), top, width, drawn, PALE);
                let baseline = top + height as i32 + 20;
                canvas.text([left(i) + width as i32 / 2, baseline], &picture.caption, TEXT_PX, BLACK, Anchor::Middle);
            }
        }
        canvas
    }
}
