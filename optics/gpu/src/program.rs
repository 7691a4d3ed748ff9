//! Calls of shaders, recorded once and run many times.

use crate::card::{Card, Compiled};
use crate::fault::Fault;
use crate::shaders::{Call, Shader, Slot};
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// Records calls. What is recorded between two [marks](Self::mark) is a part of the program.
#[derive(Debug)]
pub(crate) struct Recorder<'a> {
    card: &'a Card,
    drafts: Vec<Draft>,
}

#[derive(Debug)]
struct Draft {
    compiled: Arc<Compiled>,
    buffers: Vec<wgpu::Buffer>,
    groups: [u32; 2],
    call: Call,
}

/// Recorded calls, ready to run.
#[derive(Debug)]
pub(crate) struct Program {
    steps: Vec<Step>,
}

#[derive(Debug)]
struct Step {
    compiled: Arc<Compiled>,
    bound: wgpu::BindGroup,
    groups: [u32; 2],
}

impl<'a> Recorder<'a> {
    pub(crate) fn new(card: &'a Card) -> Self {
        Self { card, drafts: Vec::new() }
    }

    /// Number of calls so far.
    pub(crate) fn mark(&self) -> usize {
        self.drafts.len()
    }

    /// Records a call of a shader with a number of workgroups along x and y. `buffers` has at least what the shader
    /// needs.
    pub(crate) fn call(
        &mut self,
        shader: &Shader,
        groups: [usize; 2],
        call: Call,
        buffers: &[(Slot, &wgpu::Buffer)],
    ) -> Result<(), Fault> {
        let compiled = self.card.compiled(shader)?;
        let of_slot = |slot: &Slot| {
            let found = buffers.iter().find(|(of, _)| of == slot);
            found.map_or_else(|| unreachable!("{}: nothing is bound to {slot:?}", shader.name), |(_, buffer)| *buffer)
        };
        let buffers = shader.slots.iter().map(of_slot).cloned().collect();
        let call = Call { two: 2, ..call };
        self.drafts.push(Draft { compiled, buffers, groups: groups.map(|count| count as u32), call });
        Ok(())
    }

    /// Ends the record: writes the numbers of all calls, and binds their memory.
    pub(crate) fn finish(self) -> Result<Program, Fault> {
        let stride =
            size_of::<Call>().next_multiple_of(self.card.limits().min_uniform_buffer_offset_alignment as usize);
        let mut numbers = vec![0_u8; stride * self.drafts.len()];
        for (slot, draft) in numbers.chunks_exact_mut(stride).zip(&self.drafts) {
            slot[..size_of::<Call>()].copy_from_slice(bytemuck::bytes_of(&draft.call));
        }
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let calls = self.card.buffer(numbers.len() as u64, usage)?;
        self.card.write(&calls, &numbers);
        let step = |(i, draft): (usize, Draft)| {
            let numbers = wgpu::BufferBinding {
                buffer: &calls,
                offset: (i * stride) as u64,
                size: wgpu::BufferSize::new(size_of::<Call>() as u64),
            };
            let mut bound = vec![wgpu::BindingResource::Buffer(numbers)];
            bound.extend(draft.buffers.iter().map(wgpu::Buffer::as_entire_binding));
            let bound = self.card.bind(&draft.compiled.bindings, &bound);
            Step { compiled: draft.compiled, bound, groups: draft.groups }
        };
        Ok(Program { steps: self.drafts.into_iter().enumerate().map(step).collect() })
    }
}

impl Program {
    /// Whether all of its shaders have been compared with the processor.
    pub(crate) fn is_tested(&self) -> bool {
        self.steps.iter().all(|step| step.compiled.tested.load(Ordering::Relaxed))
    }

    pub(crate) fn mark_tested(&self) {
        self.steps.iter().for_each(|step| step.compiled.tested.store(true, Ordering::Relaxed));
    }

    /// Adds parts of the program to commands, in their order.
    pub(crate) fn encode(&self, commands: &mut wgpu::CommandEncoder, parts: &[Range<usize>]) {
        let mut pass = commands.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        for step in parts.iter().flat_map(|part| &self.steps[part.clone()]) {
            pass.set_pipeline(&step.compiled.pipeline);
            pass.set_bind_group(0, &step.bound, &[]);
            pass.dispatch_workgroups(step.groups[0], step.groups[1], 1);
        }
    }
}
