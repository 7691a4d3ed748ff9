//! Steps of Adam without the host: phases and moments stay in the card's memory, a hundred steps a submission.

use crate::fault::Fault;
use crate::passes::{End, Passes};
use crate::problem::{CardProblem, evaluation};
use crate::program::Program;
use crate::shaders::{Call, Slot, pixels};
use lightpath_optics::hologram::{AdamState, Evaluation};
use lightpath_optics::metrics::Gain;
use std::ops::Range;
use wgpu::BufferUsages;

/// Steps of one submission. Between two the host looks at the interrupt.
const STEPS: usize = 100;
/// β₁ and β₂, which the shader has, too.
const BETAS: [f64; 2] = [0.9, 0.999];

/// The program of a step, and its memory.
#[derive(Debug)]
pub(crate) struct AdamRun {
    program: Program,
    step: Range<usize>,
    moments: wgpu::Buffer,
    factors: wgpu::Buffer,
    history: wgpu::Buffer,
    /// Phases, moments, gain and history, for the host.
    out: [wgpu::Buffer; 4],
}

impl AdamRun {
    pub(crate) fn new(problem: &CardProblem) -> Result<Self, Fault> {
        let CardProblem { card, shape, memory, pictures, .. } = problem;
        let (size, width_px) = (shape.size, shape.size.width_px);
        let moments = card.storage(8 * size.parameters() as u64)?;
        let factors = card.storage(8 * STEPS as u64)?;
        let history = card.storage(16 * STEPS as u64)?;
        let out = |bytes: usize| card.buffer(bytes as u64, BufferUsages::MAP_READ | BufferUsages::COPY_DST);
        let out = [out(4 * size.parameters())?, out(8 * size.parameters())?, out(16)?, out(16 * STEPS)?];
        let mut passes = Passes::new(card, shape, memory, pictures);
        let step = passes.part(|passes| {
            passes.evaluate()?;
            let sums = [(Slot::PartialsIn, &memory.partials), (Slot::GainOut, &memory.gain), (Slot::History, &history)];
            passes.recorder.call(&pixels::end_evaluation(), [1, 1], Call::default(), &sums)?;
            let buffers = [
                (Slot::GainIn, &memory.gain),
                (Slot::Factors, &factors),
                (Slot::GradientIn, &memory.gradient),
                (Slot::Moments, &moments),
                (Slot::PhaseOut, &memory.phase),
            ];
            let shader = pixels::adam(width_px, size.parameters());
            passes.recorder.call(&shader, shape.pixel_groups(size.frames), Call::default(), &buffers)
        })?;
        let program = passes.into_recorder().finish()?;
        Ok(Self { program, step, moments, factors, history, out })
    }

    pub(crate) fn is_tested(&self) -> bool {
        self.program.is_tested()
    }

    pub(crate) fn mark_tested(&self) {
        self.program.mark_tested();
    }
}

impl Passes<'_> {
    /// An evaluation at the gain that is in memory.
    fn evaluate(&mut self) -> Result<(), Fault> {
        if self.is_simple() {
            return self.evaluate_simply();
        }
        let all = 0..self.pictures.len();
        all.clone().try_for_each(|picture| self.light(picture))?;
        all.clone().try_for_each(|picture| {
            self.slopes(picture)?;
            self.back(picture, End::Gradient)
        })
    }
}

/// Factors f₁ = η/(1−β₁ⁿ) and f₂ = 1/(1−β₂ⁿ) of step n.
fn factors(learning_rate: f64, n: u32) -> [f32; 2] {
    let [first, second] = BETAS.map(|beta| 1.0 / (1.0 - beta.powi(n as i32)));
    [(learning_rate * first) as f32, second as f32]
}

impl CardProblem {
    /// Steps of Adam from a state: the state behind them, and the evaluation before each. The gain of a step comes from
    /// the card also where a call begins, so that the steps do not depend on how they are divided among calls.
    pub(crate) fn adam_steps(
        &self,
        run: &AdamRun,
        state: &AdamState,
        learning_rate: f64,
        steps: u32,
    ) -> Result<(AdamState, Vec<Evaluation>), Fault> {
        let (card, memory) = (&self.card, &self.memory);
        let moments: Vec<[f32; 2]> =
            state.first_moment.iter().zip(&state.second_moment).map(|(&m, &v)| [m, v]).collect();
        card.write(&memory.phase, bytemuck::cast_slice(&state.phase));
        card.write(&run.moments, bytemuck::cast_slice(&moments));
        let (mut state, mut moments, mut evaluations) = (state.clone(), moments, Vec::new());
        let end = state.iteration + steps;
        while state.iteration < end {
            let count = (end - state.iteration).min(STEPS as u32);
            let of_steps: Vec<_> = (1..=count).map(|step| factors(learning_rate, state.iteration + step)).collect();
            card.write(&run.factors, bytemuck::cast_slice(&of_steps));
            card.write(&memory.gain, bytemuck::bytes_of(&[state.gain as f32, 0.0, 0.0, 0.0]));
            let mut commands = card.encoder();
            run.program.encode(&mut commands, &vec![run.step.clone(); count as usize]);
            let is_last = state.iteration + count == end;
            let [phase_out, moments_out, gain_out, history_out] = &run.out;
            let (mut gain, mut history) = ([0.0_f32; 4], vec![[0.0_f32; 4]; count as usize]);
            commands.copy_buffer_to_buffer(&memory.gain, 0, gain_out, 0, 16);
            commands.copy_buffer_to_buffer(&run.history, 0, history_out, 0, 16 * u64::from(count));
            let mut results: Vec<(&wgpu::Buffer, &mut [u8])> = vec![
                (gain_out, bytemuck::cast_slice_mut(&mut gain)),
                (history_out, bytemuck::cast_slice_mut(&mut history)),
            ];
            if is_last {
                commands.copy_buffer_to_buffer(&memory.phase, 0, phase_out, 0, size_of_val(&*state.phase) as u64);
                commands.copy_buffer_to_buffer(&run.moments, 0, moments_out, 0, size_of_val(&*moments) as u64);
                results.push((phase_out, bytemuck::cast_slice_mut(&mut state.phase)));
                results.push((moments_out, bytemuck::cast_slice_mut(&mut moments)));
            }
            card.run(commands, &mut results)?;
            drop(results);
            evaluations.extend(history.iter().map(|sums| evaluation(&[*sums], sums[3], Gain::Given(1.0))));
            (state.iteration, state.gain) = (state.iteration + count, f64::from(gain[0]));
        }
        (state.first_moment, state.second_moment) = moments.iter().map(|[m, v]| (*m, *v)).unzip();
        Ok((state, evaluations))
    }
}

#[cfg(test)]
mod tests {
    use crate::GpuBackend;
    use crate::fault_tests::{card, problem};
    use lightpath_optics::engine::EngineCache;
    use lightpath_optics::hologram::AdamState;
    use std::sync::Arc;

    #[test]
    fn steps_have_the_same_bits_in_every_run_and_in_any_number_of_calls() {
        let backend = GpuBackend::new(card(), Arc::new(EngineCache::new(1 << 20)));
        let run = |calls: &[u32]| {
            let mut body = problem(&backend);
            let phase: Vec<f32> = (0..body.size().parameters()).map(|i| (0.7 * i as f32).sin()).collect();
            let (mut state, mut gradient, mut losses) = (AdamState::new(phase.clone(), 1.0), phase, Vec::new());
            for &steps in calls {
                body.adam_steps(&mut state, 0.1, steps, &mut gradient, &mut |step| losses.push(step.loss));
            }
            (state, losses)
        };
        let (state, losses) = run(&[130]);
        assert!(losses.len() == 130 && losses[129] < 0.5 * losses[0], "{losses:?}");
        for calls in [&[130][..], &[1, 2, 100, 27]] {
            assert_eq!(run(calls), (state.clone(), losses.clone()), "{calls:?}");
        }
        // Two jobs share a card.
        std::thread::scope(|scope| {
            let both = [(); 2].map(|()| scope.spawn(|| run(&[100, 30])));
            for one in both {
                assert_eq!(one.join().unwrap(), (state.clone(), losses.clone()));
            }
        });
        assert_eq!(backend.computed().processor_because, None);
    }
}
