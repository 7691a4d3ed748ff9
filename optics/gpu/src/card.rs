//! A graphics card: what it is, and its memory, shaders and queue.

use crate::fault::{Fault, Faults};
use crate::shaders::Shader;
use lightpath_optics::interrupt;
use std::collections::HashMap;
use std::fmt;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::yield_now;
use std::time::{Duration, Instant};
use wgpu::{BufferUsages, PollType};

/// Longest time of one submission \[s\]. The longest that was seen took a tenth of it, on a driver without a card.
const ANSWER_TIMEOUT_S: u64 = 120;
/// Time between two looks at the interrupt while a card computes.
const LOOK_INTERVAL: Duration = Duration::from_millis(20);

/// What a card says of itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CardInfo {
    /// Name of the card.
    pub name: String,
    /// Name and version of its driver.
    pub driver: String,
    /// Whether the driver computes on the processor instead of a card.
    pub is_software: bool,
    /// Largest array that a shader can read \[bytes\].
    pub array_bytes_max: u64,
}

impl fmt::Display for CardInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({})", self.name, self.driver)
    }
}

/// An opened card. Problems share it: each has its own memory, and all have the same compiled shaders.
#[derive(Debug)]
pub struct Card {
    info: CardInfo,
    device: wgpu::Device,
    queue: wgpu::Queue,
    limits: wgpu::Limits,
    pub(crate) faults: Faults,
    shaders: Mutex<HashMap<Shader, Arc<Compiled>>>,
    #[cfg(test)]
    pub(crate) planted: crate::planted::Planted,
}

/// A shader that the driver has compiled.
#[derive(Debug)]
pub(crate) struct Compiled {
    pub(crate) pipeline: wgpu::ComputePipeline,
    pub(crate) bindings: wgpu::BindGroupLayout,
    /// Whether its results have been compared with the processor.
    pub(crate) tested: AtomicBool,
}

/// Cards that the Vulkan drivers of this machine offer, in the driver's order. Empty without a driver.
#[must_use]
pub fn cards() -> Vec<CardInfo> {
    adapters().iter().map(info_of).collect()
}

fn adapters() -> Vec<wgpu::Adapter> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::VULKAN;
    descriptor.flags = wgpu::InstanceFlags::empty();
    pollster::block_on(wgpu::Instance::new(descriptor).enumerate_adapters(wgpu::Backends::VULKAN))
}

fn info_of(adapter: &wgpu::Adapter) -> CardInfo {
    let (info, limits) = (adapter.get_info(), adapter.limits());
    CardInfo {
        name: info.name,
        driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
        is_software: info.device_type == wgpu::DeviceType::Cpu,
        array_bytes_max: limits.max_storage_buffer_binding_size.min(limits.max_buffer_size),
    }
}

impl Card {
    /// Opens the card with this number in [`cards`].
    ///
    /// # Errors
    ///
    /// [`Fault`] if there is no such card, or its driver does not open it.
    pub fn open(number: usize) -> Result<Arc<Self>, Fault> {
        let adapters = adapters();
        let missing = || Fault::Missing { number, offered: adapters.len() };
        let adapter = adapters.get(number).ok_or_else(missing)?;
        // The limits of the card instead of those that every card has: half the memory of a workgroup is not enough.
        let limits = adapter.limits();
        let descriptor = wgpu::DeviceDescriptor { required_limits: limits.clone(), ..Default::default() };
        let opened = pollster::block_on(adapter.request_device(&descriptor));
        let (device, queue) = opened.map_err(|error| Fault::Refused(error.to_string()))?;
        let faults = Faults::default();
        let (of_errors, of_loss) = (faults.clone(), faults.clone());
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| of_errors.note(error.into())));
        device.set_device_lost_callback(move |_, reason| of_loss.note(Fault::Lost(reason)));
        let info = info_of(adapter);
        Ok(Arc::new(Self {
            info,
            device,
            queue,
            limits,
            faults,
            shaders: Mutex::default(),
            #[cfg(test)]
            planted: crate::planted::Planted::default(),
        }))
    }

    /// What the card says of itself.
    #[must_use]
    pub fn info(&self) -> &CardInfo {
        &self.info
    }

    /// The fault that put the card aside; `None` while it works.
    #[must_use]
    pub fn fault(&self) -> Option<Fault> {
        self.faults.first()
    }

    /// Takes the card away, as a reset of its driver does. Everything that it computes afterwards fails.
    #[cfg(test)]
    pub(crate) fn lose(&self) {
        self.device.destroy();
        self.faults.note(Fault::Lost("it was given up".to_owned()));
    }

    pub(crate) fn limits(&self) -> &wgpu::Limits {
        &self.limits
    }

    /// Runs what may fail for lack of memory or by a wrong command, and returns its error.
    fn guarded<R>(&self, run: impl FnOnce() -> R) -> Result<R, Fault> {
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let commands = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let result = run();
        let errors = [pollster::block_on(commands.pop()), pollster::block_on(memory.pop())];
        self.faults.check()?;
        errors.into_iter().flatten().next().map_or(Ok(result), |error| Err(error.into()))
    }

    /// Memory of some bytes, which are 0.
    pub(crate) fn buffer(&self, bytes: u64, usage: BufferUsages) -> Result<wgpu::Buffer, Fault> {
        #[cfg(test)]
        self.planted.allocate()?;
        // A buffer of no bytes cannot be bound.
        let size = bytes.max(16).next_multiple_of(16);
        let descriptor = wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false };
        self.guarded(|| self.device.create_buffer(&descriptor))
    }

    /// Memory that shaders read and write.
    pub(crate) fn storage(&self, bytes: u64) -> Result<wgpu::Buffer, Fault> {
        self.buffer(bytes, BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC)
    }

    /// Memory with a table.
    pub(crate) fn table<T: bytemuck::NoUninit>(&self, values: &[T]) -> Result<wgpu::Buffer, Fault> {
        let bytes: &[u8] = bytemuck::cast_slice(values);
        let buffer = self.storage(bytes.len() as u64)?;
        self.write(&buffer, bytes);
        Ok(buffer)
    }

    pub(crate) fn write(&self, buffer: &wgpu::Buffer, bytes: &[u8]) {
        self.queue.write_buffer(buffer, 0, bytes);
    }

    /// A shader as the driver compiled it, once for all problems.
    pub(crate) fn compiled(&self, shader: &Shader) -> Result<Arc<Compiled>, Fault> {
        let mut shaders = self.shaders.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(compiled) = shaders.get(shader) {
            return Ok(Arc::clone(compiled));
        }
        let compiled = Arc::new(self.guarded(|| self.compile(shader))?);
        shaders.insert(shader.clone(), Arc::clone(&compiled));
        Ok(compiled)
    }

    fn compile(&self, shader: &Shader) -> Compiled {
        let text = shader.text.as_str();
        #[cfg(test)]
        let text = self.planted.text(shader.name, text);
        let source = wgpu::ShaderSource::Wgsl(text.into());
        let name = Some(shader.name);
        let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor { label: name, source });
        let entry = |binding: u32, ty: wgpu::BufferBindingType| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
            count: None,
        };
        let slots = shader.slots.iter().map(|slot| wgpu::BufferBindingType::Storage { read_only: !slot.declared().2 });
        let all = std::iter::once(wgpu::BufferBindingType::Uniform).chain(slots);
        let entries: Vec<_> = (0..).zip(all).map(|(binding, ty)| entry(binding, ty)).collect();
        let bindings =
            self.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: name, entries: &entries });
        let layout = self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: name,
            bind_group_layouts: &[Some(&bindings)],
            immediate_size: 0,
        });
        let pipeline = self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: name,
            layout: Some(&layout),
            module: &module,
            entry_point: Some("main"),
            // No shader reads what its workgroup has not written.
            compilation_options: wgpu::PipelineCompilationOptions {
                zero_initialize_workgroup_memory: false,
                ..Default::default()
            },
            cache: None,
        });
        Compiled { pipeline, bindings, tested: AtomicBool::new(false) }
    }

    pub(crate) fn bind(
        &self,
        layout: &wgpu::BindGroupLayout,
        buffers: &[wgpu::BindingResource<'_>],
    ) -> wgpu::BindGroup {
        let entries = (0..).zip(buffers);
        let entries: Vec<_> =
            entries.map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource: resource.clone() }).collect();
        self.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
    }

    pub(crate) fn encoder(&self) -> wgpu::CommandEncoder {
        self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }

    /// Runs commands, waits for their end, and copies what they left in memory that can be mapped.
    pub(crate) fn run(
        &self,
        commands: wgpu::CommandEncoder,
        results: &mut [(&wgpu::Buffer, &mut [u8])],
    ) -> Result<(), Fault> {
        self.faults.check()?;
        let submission = self.queue.submit([commands.finish()]);
        let unmapped = Arc::new(AtomicUsize::new(results.len()));
        for (buffer, _) in &*results {
            let (faults, unmapped) = (self.faults.clone(), Arc::clone(&unmapped));
            buffer.map_async(wgpu::MapMode::Read, .., move |mapped| {
                if let Err(error) = mapped {
                    faults.note(Fault::Lost(error.to_string()));
                }
                unmapped.fetch_sub(1, Ordering::Release);
            });
        }
        self.wait(&submission, &unmapped)?;
        for (buffer, into) in results {
            let range = buffer.get_mapped_range(..).map_err(|error| Fault::Lost(error.to_string()))?;
            into.copy_from_slice(&range[..into.len()]);
            drop(range);
            buffer.unmap();
            #[cfg(test)]
            self.planted.read(into);
        }
        Ok(())
    }

    /// Waits for the end of a submission, and until what it left is mapped. That may happen on another thread, which waits
    /// for its own submission.
    fn wait(&self, submission: &wgpu::SubmissionIndex, unmapped: &AtomicUsize) -> Result<(), Fault> {
        let begin = Instant::now();
        loop {
            let waited = self
                .device
                .poll(PollType::Wait { submission_index: Some(submission.clone()), timeout: Some(LOOK_INTERVAL) });
            self.faults.check()?;
            match waited {
                Ok(_) if unmapped.load(Ordering::Acquire) == 0 => return Ok(()),
                Ok(_) => yield_now(),
                Err(wgpu::PollError::Timeout) => interrupt::check(),
                Err(error) => return Err(Fault::Refused(error.to_string())),
            }
            if begin.elapsed() > Duration::from_secs(ANSWER_TIMEOUT_S) {
                let fault = Fault::TimedOut(ANSWER_TIMEOUT_S);
                self.faults.note(fault.clone());
                return Err(fault);
            }
        }
    }
}
