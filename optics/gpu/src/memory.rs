//! A problem's memory on a card.

use crate::card::Card;
use crate::fault::Fault;
use crate::shape::Shape;
use crate::tables;
use wgpu::BufferUsages;

/// Arrays that all passes of a problem share.
#[derive(Debug)]
pub(crate) struct Memory {
    /// Half-transformed fields: those that leave the modulator, and those that come back from the image plane.
    pub(crate) slm: wgpu::Buffer,
    /// Half-transformed fields: those in the image plane, and the one that comes back to the modulator.
    pub(crate) image: wgpu::Buffer,
    /// Turns of the transforms along x and along y.
    pub(crate) turns: [wgpu::Buffer; 2],
    /// Turns to the places in a pixel along x and along y.
    pub(crate) shifts: [wgpu::Buffer; 2],
    pub(crate) phase: wgpu::Buffer,
    pub(crate) gradient: wgpu::Buffer,
    /// Phases of a frame that the modulator shows.
    pub(crate) shown: wgpu::Buffer,
    /// Gradient by the shown phases of a frame.
    pub(crate) by_shown: wgpu::Buffer,
    /// Slopes of a picture's loss by its light.
    pub(crate) slopes: wgpu::Buffer,
    /// Values between the two axes of a blur.
    pub(crate) spare: wgpu::Buffer,
    /// Sums of the rows of all pictures.
    pub(crate) partials: wgpu::Buffer,
    pub(crate) gain: wgpu::Buffer,
    /// The gradient, for the host.
    pub(crate) gradient_out: wgpu::Buffer,
    /// The sums, then the gain, for the host.
    pub(crate) sums_out: wgpu::Buffer,
}

/// Which of the memory a problem needs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Needs {
    /// Number of half-transformed fields that leave the modulator together.
    pub(crate) lanes: usize,
    /// Whether shown phases differ from displayed ones.
    pub(crate) wraps: bool,
    /// Whether the modulator has cross-talk.
    pub(crate) crosstalk: bool,
    /// Whether the light blurs.
    pub(crate) blurs: bool,
}

/// Bytes of the sums of a row.
pub(crate) const PARTIAL_BYTES: usize = 16;

impl Memory {
    pub(crate) fn new(card: &Card, shape: &Shape, places: &[Vec<f64>; 2], needs: Needs) -> Result<Self, Fault> {
        let (size, layout) = (shape.size, &shape.layout);
        let f32s = |count: usize| card.storage(4 * count as u64);
        let only = |needed: bool, count: usize| f32s(if needed { count } else { 0 });
        let lanes = needs.lanes.max(shape.places[1]);
        let field = || card.storage(8 * (lanes * layout.lane_len()) as u64);
        let out = |bytes: usize| card.buffer(bytes as u64, BufferUsages::MAP_READ | BufferUsages::COPY_DST);
        let spare = match (needs.blurs, needs.crosstalk) {
            (true, _) => shape.light_len().max(size.frame_len()),
            (false, crosstalk) => {
                if crosstalk {
                    size.frame_len()
                } else {
                    0
                }
            }
        };
        let partials = PARTIAL_BYTES * size.planes * size.height_px;
        Ok(Self {
            slm: field()?,
            image: field()?,
            turns: [card.table(&layout.rows.plan.turns())?, card.table(&layout.columns.plan.turns())?],
            shifts: [
                card.table(&tables::shifts(&places[0], size.width_px))?,
                card.table(&tables::shifts(&places[1], size.height_px))?,
            ],
            phase: f32s(size.parameters())?,
            gradient: f32s(size.parameters())?,
            shown: only(needs.wraps, size.frame_len())?,
            by_shown: only(needs.crosstalk, size.frame_len())?,
            slopes: f32s(shape.light_len())?,
            spare: f32s(spare)?,
            partials: card.storage(partials as u64)?,
            gain: f32s(4)?,
            gradient_out: out(4 * size.parameters())?,
            sums_out: out(partials + PARTIAL_BYTES)?,
        })
    }

    /// Largest of the arrays that shaders read \[bytes\], beside transfer functions.
    pub(crate) fn array_bytes_max(shape: &Shape, lanes: usize) -> u64 {
        let transfer = 8 * 4 * shape.size.frame_len();
        let field = 8 * lanes.max(shape.places[1]) * shape.layout.lane_len();
        transfer.max(field).max(8 * shape.size.parameters()).max(4 * shape.light_len()) as u64
    }
}
