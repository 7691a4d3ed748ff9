//! Rounds of Gerchberg–Saxton, and fields that targets send back. The transforms run on the card; weights, gains and
//! the step from a field to its phase are numbers of pixels, which the host computes from the light.

use crate::fault::Fault;
use crate::passes::{End, Passes};
use crate::problem::{CardProblem, Compared};
use crate::program::Program;
use crate::shaders::columns::Columns;
use crate::shaders::slm_rows::{Pixels, SlmRows};
use crate::shaders::{Call, Slot};
use crate::shape::Sent;
use lightpath_optics::Plane;
use lightpath_optics::engine::Slm;
use lightpath_optics::engine::photometry::Quantity;
use lightpath_optics::hologram::{Evaluation, subtract_excess};
use num_complex::Complex32;
use std::ops::Range;

/// Largest weight of a target amplitude; the smallest is its inverse. A dark spot must not draw all of the light.
const WEIGHT_MAX: f32 = 3.0;

/// Programs of projections, and the field at their end.
#[derive(Debug)]
pub(crate) struct Projection {
    field: wgpu::Buffer,
    field_out: wgpu::Buffer,
    program: Program,
    /// Way back of each picture's slopes.
    backs: Vec<Range<usize>>,
    /// Way back of each picture's amplitudes, which are in `image`.
    targets: Vec<Range<usize>>,
    image: wgpu::Buffer,
}

/// One round of Gerchberg–Saxton.
#[derive(Debug)]
pub(crate) struct Round {
    /// Evaluation of the phase before the round.
    pub(crate) evaluation: Evaluation,
    /// The next phase.
    pub(crate) phase: Vec<f32>,
    /// The next W√t of each picture.
    pub(crate) wanted: Vec<Plane<f32>>,
}

impl Projection {
    pub(crate) fn new(problem: &CardProblem) -> Result<Self, Fault> {
        let CardProblem { card, shape, memory, pictures, .. } = problem;
        let bytes = 8 * shape.size.parameters() as u64;
        let field = card.storage(bytes)?;
        let image = card.storage(8 * shape.size.frame_len() as u64)?;
        let field_out = card.buffer(bytes, wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST)?;
        let mut passes = Passes::new(card, shape, memory, pictures);
        let all = 0..pictures.len();
        let backs = all.clone().map(|p| passes.part(|passes| passes.back(p, End::Field(&field))));
        let backs = backs.collect::<Result<_, _>>()?;
        let targets = all.map(|p| passes.part(|passes| passes.target(p, &image, &field))).collect::<Result<_, _>>()?;
        let program = passes.into_recorder().finish()?;
        Ok(Self { field, field_out, program, backs, targets, image })
    }
}

impl Projection {
    pub(crate) fn is_tested(&self) -> bool {
        self.program.is_tested()
    }

    pub(crate) fn mark_tested(&self) {
        self.program.mark_tested();
    }
}

impl Passes<'_> {
    /// The way back of a field of pixels' middles in the image plane, in the display's first mode.
    fn target(&mut self, picture: usize, image: &wgpu::Buffer, end: &wgpu::Buffer) -> Result<(), Fault> {
        let (layout, height_px) = (self.shape.layout.clone(), self.shape.size.height_px);
        let rows = SlmRows { layout, pixels: Pixels::Field, windowed: false }.out();
        let buffers = [(Slot::Sink, &self.memory.slm), (Slot::Turns, &self.memory.turns[0]), (Slot::FieldIn, image)];
        self.recorder.call(&rows, [height_px, 1], Call::default(), &buffers)?;
        let mode = &self.pictures[picture].display.modes[0];
        let to_middles =
            Columns { layout: self.shape.layout.clone(), places: 1, windowed: mode.windows.is_some() }.back();
        self.send_back_through(&to_middles, Sent { picture, mode: 0, frame: 0 }, End::Field(end))
    }
}

impl CardProblem {
    /// Target amplitudes √t of each picture.
    pub(crate) fn target_amplitudes(&self) -> Vec<Plane<f32>> {
        self.compared.iter().map(|compared| self.plane(|i| self.amplitude(compared, i))).collect()
    }

    fn plane(&self, mut value: impl FnMut(usize) -> f32) -> Plane<f32> {
        let (height_px, width_px) = (self.shape.size.height_px, self.shape.size.width_px);
        Plane::from_fn(height_px, width_px, |y, x| value(y * width_px + x))
    }

    fn amplitude(&self, compared: &Compared, i: usize) -> f32 {
        let quantity = compared.pixels[i][0];
        match self.shape.quantity {
            Quantity::Intensity => quantity.sqrt(),
            Quantity::Amplitude => quantity,
        }
    }

    /// See [`Project::back_propagated`](lightpath_optics::hologram::Project::back_propagated).
    pub(crate) fn back_propagated(
        &self,
        projection: &Projection,
        image_phase: &[f32],
    ) -> Result<Vec<Complex32>, Fault> {
        let frame_len = self.shape.size.frame_len();
        let mut field = vec![Complex32::ZERO; frame_len];
        for (p, compared) in self.compared.iter().enumerate() {
            let share = compared.share as f32;
            let counted = |i: usize| share * compared.weight.as_ref().map_or(1.0, |weight| weight.values()[i]);
            let image: Vec<[f32; 2]> = (0..frame_len)
                .map(|i| {
                    let c = Complex32::from_polar(self.amplitude(compared, i) * counted(i), image_phase[i]);
                    [c.re, c.im]
                })
                .collect();
            self.card.write(&projection.image, bytemuck::cast_slice(&image));
            let is_last = p + 1 == self.compared.len();
            self.run_part(projection, &projection.targets[p], is_last.then_some(&mut field))?;
        }
        Ok(field)
    }

    /// One round of Gerchberg–Saxton, see [`Project::project`](lightpath_optics::hologram::Project::project): returns
    /// what it changes.
    pub(crate) fn project(
        &self,
        projection: &Projection,
        slm: &Slm<f32>,
        phase: &[f32],
        wanted: &[Plane<f32>],
        weighted: bool,
    ) -> Result<Round, Fault> {
        let evaluation = self.measure(phase, 1.0)?;
        let lights = self.lights(phase, self.compared.len())?;
        let mut wanted = wanted.to_vec();
        if weighted {
            let gain = self.amplitude_gain(&lights, &self.target_amplitudes());
            for ((compared, lights), wanted) in self.compared.iter().zip(&lights).zip(&mut wanted) {
                self.raise(compared, lights, gain as f32, wanted);
            }
        }
        let gain = self.amplitude_gain(&lights, &wanted) as f32;
        let mut excess = vec![Complex32::ZERO; self.shape.size.parameters()];
        for (p, wanted) in wanted.iter().enumerate() {
            let slopes = self.relative_excess(&self.compared[p], &lights[p], wanted, gain);
            self.card.write(&self.memory.slopes, bytemuck::cast_slice(&slopes));
            let is_last = p + 1 == lights.len();
            self.run_part(projection, &projection.backs[p], is_last.then_some(&mut excess))?;
        }
        let mut next = phase.to_vec();
        subtract_excess(slm, self.shape.size.frame_len(), &excess, &mut next);
        Ok(Round { evaluation, phase: next, wanted })
    }

    /// Runs a part of a projection, and reads the field if it is wanted.
    fn run_part(
        &self,
        projection: &Projection,
        part: &Range<usize>,
        field: Option<&mut Vec<Complex32>>,
    ) -> Result<(), Fault> {
        let mut commands = self.card.encoder();
        projection.program.encode(&mut commands, std::slice::from_ref(part));
        let Some(field) = field else { return self.card.run(commands, &mut []) };
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(field.as_mut_slice());
        commands.copy_buffer_to_buffer(&projection.field, 0, &projection.field_out, 0, bytes.len() as u64);
        self.card.run(commands, &mut [(&projection.field_out, bytes)])
    }

    /// Light of each light plane at pixel `i`.
    fn lights_at<'a>(&self, lights: &'a [f32], i: usize) -> impl Iterator<Item = f32> + 'a {
        let (planes, width_px) = (self.shape.light_planes(), self.shape.size.width_px);
        let (y, x) = (i / width_px, i % width_px);
        (0..planes).map(move |plane| lights[(y * planes + plane) * width_px + x])
    }

    /// The gain with the least Σ W (s √p − `amplitudes`)².
    fn amplitude_gain(&self, lights: &[Vec<f32>], amplitudes: &[Plane<f32>]) -> f64 {
        let (mut pp, mut tp) = (0.0, 0.0);
        for ((compared, lights), amplitudes) in self.compared.iter().zip(lights).zip(amplitudes) {
            for (i, ([_, weight], &amplitude)) in compared.pixels.iter().zip(amplitudes.values()).enumerate() {
                for light in self.lights_at(lights, i) {
                    let (weight, light) = (f64::from(*weight), f64::from(light));
                    pp += weight * light;
                    tp += weight * light.sqrt() * f64::from(amplitude);
                }
            }
        }
        if pp > 0.0 { tp / pp } else { 0.0 }
    }

    /// W ← W · √t / (s√p), within its limits.
    fn raise(&self, compared: &Compared, lights: &[f32], gain: f32, wanted: &mut Plane<f32>) {
        let share = 1.0 / self.shape.light_planes() as f32;
        for (i, wanted) in wanted.values_mut().iter_mut().enumerate() {
            let target = self.amplitude(compared, i);
            if target > 0.0 {
                let shown = gain * (share * self.lights_at(lights, i).sum::<f32>()).sqrt();
                let least = target / WEIGHT_MAX;
                *wanted = (*wanted * target / shown.max(least)).clamp(least, WEIGHT_MAX * target);
            }
        }
    }

    /// w · ( 1 − W√t / (s√p) ) as slopes of the light, 0 where there is none.
    fn relative_excess(&self, compared: &Compared, lights: &[f32], wanted: &Plane<f32>, gain: f32) -> Vec<f32> {
        let (planes, width_px) = (self.shape.light_planes(), self.shape.size.width_px);
        // W has the sum of the weights in its divisor, and a field its frame's part of the mean light in its factor.
        let scale = (compared.weight_sum * self.shape.size.frames as f64) as f32;
        let mut slopes = vec![0.0; lights.len()];
        for (row, (slopes, lights)) in slopes.chunks_exact_mut(width_px).zip(lights.chunks_exact(width_px)).enumerate()
        {
            let first = row / planes * width_px;
            for (x, (slope, &light)) in slopes.iter_mut().zip(lights).enumerate() {
                let root = light.sqrt();
                if root > 0.0 {
                    let excess = 1.0 - wanted.values()[first + x] / (gain * root);
                    *slope = compared.pixels[first + x][1] * scale * excess;
                }
            }
        }
        slopes
    }
}
