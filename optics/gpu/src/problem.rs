//! A hologram's problem in a card's memory.

use crate::card::Card;
use crate::display::DisplayTables;
use crate::fault::Fault;
use crate::memory::{Memory, Needs, PARTIAL_BYTES};
use crate::passes::{End, Passes, PictureTables};
use crate::program::Program;
use crate::shape::Shape;
use crate::sizes::{Workgroups, layout};
use crate::tables;
use lightpath_optics::engine::Prepared;
use lightpath_optics::engine::photometry::Quantity;
use lightpath_optics::hologram::{Evaluation, Loss, Picture, ProblemSize};
use lightpath_optics::metrics::Gain;
use lightpath_optics::{Plane, RegionOfInterest};
use std::ops::Range;
use std::sync::Arc;

/// Why a card does not take a problem.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Refusal {
    /// The card does not compute this.
    NotComputed(&'static str),
    /// The card failed.
    Fault(Fault),
}

impl From<Fault> for Refusal {
    fn from(fault: Fault) -> Self {
        Self::Fault(fault)
    }
}

/// A problem on a card. Every call may fail, and then tells nothing.
#[derive(Debug)]
pub(crate) struct CardProblem {
    pub(crate) card: Arc<Card>,
    pub(crate) shape: Shape,
    pub(crate) memory: Memory,
    pub(crate) pictures: Vec<PictureTables>,
    /// What each picture is compared with.
    pub(crate) compared: Vec<Compared>,
    program: Program,
    parts: Parts,
}

/// A picture as it is compared: its quantity and the weight of each pixel.
#[derive(Debug)]
pub(crate) struct Compared {
    /// t or √t, and W: the weights of all pixels, light planes and pictures add up to 1.
    pub(crate) pixels: Vec<[f32; 2]>,
    /// Σ w over the region.
    pub(crate) weight_sum: f64,
    /// w of each pixel; `None`: 1 everywhere.
    pub(crate) weight: Option<Plane<f32>>,
    /// Share of the picture; the shares of all pictures add up to 1.
    pub(crate) share: f64,
}

/// Parts of the program.
#[derive(Debug)]
struct Parts {
    /// Light of each picture.
    lights: Vec<Range<usize>>,
    /// Slopes and sums of each picture.
    slopes: Vec<Range<usize>>,
    fit_gain: Range<usize>,
    /// Way back of each picture.
    backs: Vec<Range<usize>>,
    /// Everything at once, where the problem is simple enough.
    simple: Option<Range<usize>>,
}

impl CardProblem {
    pub(crate) fn new(
        card: &Arc<Card>,
        pictures: &[Picture<'_>],
        frames: usize,
        region: RegionOfInterest,
        loss: &Loss,
    ) -> Result<Self, Refusal> {
        let (shape, places) = shape_of(card, pictures, frames, loss)?;
        let lanes = |display: &Prepared<'_>| display.modes().map(|mode| mode.transfers().len().isqrt()).max();
        let lanes = pictures.iter().filter_map(|picture| lanes(&picture.display)).max().unwrap_or(1);
        if Memory::array_bytes_max(&shape, lanes) > card.info().array_bytes_max {
            return Err(Refusal::NotComputed("the display needs a larger array than the graphics card reads"));
        }
        if shape.size.parameters().max(lanes * shape.layout.lane_len()) > u32::MAX as usize {
            return Err(Refusal::NotComputed("the display has more pixels than a graphics card counts"));
        }
        let rows = shape.size.height_px * shape.light_planes().max(frames);
        if rows > card.limits().max_compute_workgroups_per_dimension as usize {
            return Err(Refusal::NotComputed("the problem has more rows than a graphics card takes in one pass"));
        }
        let shares: f64 = pictures.iter().map(|picture| picture.share).sum();
        let compared: Vec<_> =
            pictures.iter().map(|picture| Compared::new(picture, &shape, region, picture.share / shares)).collect();
        let tables = pictures.iter().zip(&compared).map(|(picture, compared)| {
            Ok(PictureTables {
                display: DisplayTables::new(card, &picture.display, &shape.layout)?,
                picture: card.table(&compared.pixels)?,
                light: card.storage(4 * shape.light_len() as u64)?,
            })
        });
        let tables: Vec<_> = tables.collect::<Result<_, Fault>>()?;
        let any = |of: fn(&DisplayTables) -> bool| tables.iter().any(|picture| of(&picture.display));
        let needs = Needs {
            lanes,
            wraps: any(|display| display.parts.wraps()),
            crosstalk: any(|display| display.parts.crosstalk),
            blurs: any(|display| display.blur.is_some()),
        };
        let memory = Memory::new(card, &shape, &places, needs)?;
        let (program, parts) = record(card, &shape, &memory, &tables)?;
        Ok(Self { card: Arc::clone(card), shape, memory, pictures: tables, compared, program, parts })
    }

    /// Whether all shaders of the problem have been compared with the processor.
    pub(crate) fn is_tested(&self) -> bool {
        self.program.is_tested()
    }

    pub(crate) fn mark_tested(&self) {
        self.program.mark_tested();
    }

    pub(crate) fn evaluate(&self, phase: &[f32], gain: Gain, gradient: &mut [f32]) -> Result<Evaluation, Fault> {
        let Parts { lights, slopes, fit_gain, backs, simple } = &self.parts;
        let way_back = || slopes.iter().zip(backs).flat_map(|(slopes, back)| [slopes.clone(), back.clone()]);
        let parts: Vec<_> = match (gain, simple) {
            (Gain::Given(_), Some(simple)) => vec![simple.clone()],
            (Gain::Given(_), None) => lights.iter().cloned().chain(way_back()).collect(),
            (Gain::Fitted, _) => {
                let fit = std::iter::once(fit_gain.clone());
                lights.iter().chain(slopes).cloned().chain(fit).chain(way_back()).collect()
            }
        };
        self.compute(phase, gain, &parts, Some(gradient))
    }

    pub(crate) fn measure(&self, phase: &[f32], gain: f64) -> Result<Evaluation, Fault> {
        let parts: Vec<_> = self.parts.lights.iter().chain(&self.parts.slopes).cloned().collect();
        self.compute(phase, Gain::Given(gain), &parts, None)
    }

    /// Light planes of the first picture.
    pub(crate) fn light(&self, phase: &[f32]) -> Result<Vec<f32>, Fault> {
        self.lights(phase, 1).map(|mut lights| lights.swap_remove(0))
    }

    /// Light planes of the first `count` pictures.
    pub(crate) fn lights(&self, phase: &[f32], count: usize) -> Result<Vec<Vec<f32>>, Fault> {
        self.card.write(&self.memory.phase, bytemuck::cast_slice(phase));
        let bytes = 4 * self.shape.light_len() as u64;
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let out: Vec<_> = (0..count).map(|_| self.card.buffer(bytes, usage)).collect::<Result<_, _>>()?;
        let mut commands = self.card.encoder();
        self.program.encode(&mut commands, &self.parts.lights[..count]);
        for (picture, out) in self.pictures.iter().zip(&out) {
            commands.copy_buffer_to_buffer(&picture.light, 0, out, 0, bytes);
        }
        let mut lights = vec![vec![0.0_f32; self.shape.light_len()]; count];
        let mut results: Vec<_> =
            out.iter().zip(&mut lights).map(|(out, light)| (out, bytemuck::cast_slice_mut(light))).collect();
        self.card.run(commands, &mut results)?;
        drop(results);
        Ok(lights)
    }

    /// Runs parts of the program, and reads the sums, and the gradient if it is wanted.
    fn compute(
        &self,
        phase: &[f32],
        gain: Gain,
        parts: &[Range<usize>],
        gradient: Option<&mut [f32]>,
    ) -> Result<Evaluation, Fault> {
        let Memory { partials, gain: gain_buffer, gradient: by_phase, gradient_out, sums_out, .. } = &self.memory;
        let given = match gain {
            Gain::Given(gain) => gain as f32,
            Gain::Fitted => 0.0,
        };
        self.card.write(&self.memory.phase, bytemuck::cast_slice(phase));
        self.card.write(gain_buffer, bytemuck::bytes_of(&[given, 0.0, 0.0, 0.0]));
        let mut commands = self.card.encoder();
        self.program.encode(&mut commands, parts);
        let rows = self.shape.size.planes * self.shape.size.height_px;
        let bytes = (PARTIAL_BYTES * rows) as u64;
        commands.copy_buffer_to_buffer(partials, 0, sums_out, 0, bytes);
        commands.copy_buffer_to_buffer(gain_buffer, 0, sums_out, bytes, PARTIAL_BYTES as u64);
        let mut sums = vec![[0.0_f32; 4]; rows + 1];
        let mut results = vec![(sums_out, bytemuck::cast_slice_mut(&mut sums))];
        if let Some(gradient) = gradient {
            commands.copy_buffer_to_buffer(by_phase, 0, gradient_out, 0, size_of_val(gradient) as u64);
            results.push((gradient_out, bytemuck::cast_slice_mut(gradient)));
        }
        self.card.run(commands, &mut results)?;
        drop(results);
        Ok(evaluation(&sums[..rows], sums[rows][0], gain))
    }
}

/// Loss and gain from the sums of all rows, Σ W q², Σ W e q and Σ W e² at the gain s.
///
/// ```text
/// L(s*) = Σ W e² − (Σ W e q)² / Σ W q²,   s* = s − Σ W e q / Σ W q²
/// ```
///
/// Near the best gain nothing cancels here.
pub(crate) fn evaluation(rows: &[[f32; 4]], s: f32, gain: Gain) -> Evaluation {
    let sum = |term: usize| rows.iter().map(|row| f64::from(row[term])).sum::<f64>();
    let (qq, eq, ee) = (sum(0), sum(1), sum(2));
    let (best_gain, best_loss) = match qq > 0.0 {
        true => (f64::from(s) - eq / qq, (ee - eq * eq / qq).max(0.0)),
        false => (0.0, ee),
    };
    let loss = match gain {
        Gain::Given(_) => ee,
        Gain::Fitted => best_loss,
    };
    Evaluation { loss, best_gain, best_loss }
}

fn shape_of(
    card: &Card,
    pictures: &[Picture<'_>],
    frames: usize,
    loss: &Loss,
) -> Result<(Shape, [Vec<f64>; 2]), Refusal> {
    let first = &pictures[0].display;
    if pictures.iter().any(|picture| picture.display.shows_all_orders()) {
        return Err(Refusal::NotComputed("graphics cards do not compute displays that show all orders"));
    }
    if loss.total_variation > 0.0 || loss.speckle > 0.0 {
        return Err(Refusal::NotComputed("graphics cards do not compute total variation and speckle"));
    }
    let (height_px, width_px) = (first.height_px(), first.width_px());
    let layout = layout(height_px, width_px, Workgroups::from(card.limits())).ok_or(Refusal::NotComputed(
        "graphics cards compute displays whose sides are products of 2, 3, 5, 7, 11 and 13 and fit their workgroups",
    ))?;
    let places = tables::places(first);
    let shape = Shape {
        size: ProblemSize { planes: pictures.len(), frames, height_px, width_px },
        layout,
        detector: first.detector(),
        places: places.each_ref().map(Vec::len),
        quantity: loss.quantity,
    };
    Ok((shape, places))
}

impl Compared {
    fn new(picture: &Picture<'_>, shape: &Shape, region: RegionOfInterest, share: f64) -> Self {
        let width_px = shape.size.width_px;
        let weight = |y: usize, x: usize| -> f64 {
            let inside = region.columns(y).is_some_and(|columns| columns.contains(&x));
            let weight = picture.weight.as_ref().map_or(1.0, |weight| f64::from(weight.at(y, x)));
            if inside { weight } else { 0.0 }
        };
        let places = || (0..shape.size.height_px).flat_map(|y| (0..width_px).map(move |x| (y, x)));
        let weight_sum: f64 = places().map(|(y, x)| weight(y, x)).sum();
        let scale = share / (weight_sum * shape.light_planes() as f64);
        let quantity = |light: f32| match shape.quantity {
            Quantity::Intensity => light,
            Quantity::Amplitude => light.sqrt(),
        };
        let pixel = |(y, x)| [quantity(picture.target.at(y, x)), (scale * weight(y, x)) as f32];
        Self { pixels: places().map(pixel).collect(), weight_sum, weight: picture.weight.clone(), share }
    }
}

fn record(card: &Card, shape: &Shape, memory: &Memory, pictures: &[PictureTables]) -> Result<(Program, Parts), Fault> {
    let mut passes = Passes::new(card, shape, memory, pictures);
    let all = 0..pictures.len();
    let lights = all.clone().map(|p| passes.part(|passes| passes.light(p))).collect::<Result<_, _>>()?;
    let slopes = all.clone().map(|p| passes.part(|passes| passes.slopes(p))).collect::<Result<_, _>>()?;
    let fit_gain = passes.part(Passes::fit_gain)?;
    let backs = all.map(|p| passes.part(|passes| passes.back(p, End::Gradient))).collect::<Result<_, _>>()?;
    let simple = passes.is_simple().then(|| passes.part(Passes::evaluate_simply)).transpose()?;
    Ok((passes.into_recorder().finish()?, Parts { lights, slopes, fit_gain, backs, simple }))
}
