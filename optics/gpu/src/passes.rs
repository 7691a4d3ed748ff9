//! Records the passes of a problem: light, slopes, and the way back.

use crate::card::Card;
use crate::display::{CROSSTALK_TAPS, DisplayTables, LIGHT_BLUR_TAPS, ModeTables};
use crate::fault::Fault;
use crate::memory::Memory;
use crate::program::Recorder;
use crate::shaders::image_rows::ImageRows;
use crate::shaders::pixels::{self, AxisBlur};
use crate::shaders::slm_rows::{Pixels, SlmRows};
use crate::shaders::{Call, Shader, Slot};
use crate::shape::{Sent, Shape};
use std::ops::Range;

/// What a pass needs of a picture.
#[derive(Debug)]
pub(crate) struct PictureTables {
    pub(crate) display: DisplayTables,
    /// Target and weight of each pixel.
    pub(crate) picture: wgpu::Buffer,
    /// Light planes, the mean over the frames.
    pub(crate) light: wgpu::Buffer,
}

/// Where the way back ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum End<'a> {
    /// In the gradient of the phases.
    Gradient,
    /// In a field of all frames.
    Field(&'a wgpu::Buffer),
}

/// Records passes of a problem.
#[derive(Debug)]
pub(crate) struct Passes<'a> {
    pub(crate) recorder: Recorder<'a>,
    pub(crate) shape: &'a Shape,
    pub(crate) memory: &'a Memory,
    pub(crate) pictures: &'a [PictureTables],
}

impl<'a> Passes<'a> {
    pub(crate) fn new(card: &'a Card, shape: &'a Shape, memory: &'a Memory, pictures: &'a [PictureTables]) -> Self {
        Self { recorder: Recorder::new(card), shape, memory, pictures }
    }

    pub(crate) fn into_recorder(self) -> Recorder<'a> {
        self.recorder
    }

    /// Records passes, and returns their range.
    pub(crate) fn part(&mut self, record: impl FnOnce(&mut Self) -> Result<(), Fault>) -> Result<Range<usize>, Fault> {
        let begin = self.recorder.mark();
        record(self)?;
        Ok(begin..self.recorder.mark())
    }

    /// The light of a picture: the sum over modes, the mean over frames, blurred.
    pub(crate) fn light(&mut self, picture: usize) -> Result<(), Fault> {
        let of = &self.pictures[picture];
        let shader = self.image_rows().light();
        for sent in self.shape.fields_of(picture, of.display.modes.len()) {
            self.send(sent)?;
            let call = Call {
                add: u32::from(sent.mode + sent.frame > 0),
                factor: self.factor(&of.display.modes[sent.mode]),
                ..Call::default()
            };
            let buffers = [
                (Slot::Source, &self.memory.image),
                (Slot::Turns, &self.memory.turns[0]),
                (Slot::Shift, &self.memory.shifts[0]),
                (Slot::Light, &of.light),
            ];
            self.recorder.call(&shader, [self.shape.size.height_px, 1], call, &buffers)?;
        }
        if let Some(taps) = &of.display.blur {
            let blur = self.light_blur();
            self.blur(blur, taps, &of.light, &self.memory.spare)?;
            self.blur(AxisBlur { along_y: true, ..blur }, taps, &self.memory.spare, &of.light)?;
        }
        Ok(())
    }

    /// The slopes of the loss by a picture's light, and the sums of its rows.
    pub(crate) fn slopes(&mut self, picture: usize) -> Result<(), Fault> {
        let size = self.shape.size;
        let shader = pixels::slopes(size.width_px, self.shape.light_planes(), self.shape.quantity);
        let buffers = [
            (Slot::LightIn, &self.pictures[picture].light),
            (Slot::Picture, &self.pictures[picture].picture),
            (Slot::Gain, &self.memory.gain),
            (Slot::SlopesOut, &self.memory.slopes),
            (Slot::Partials, &self.memory.partials),
        ];
        let call = Call { partials: (picture * size.height_px) as u32, ..Call::default() };
        self.recorder.call(&shader, [size.height_px, 1], call, &buffers)
    }

    /// The gain that fits best, from the sums of all rows.
    pub(crate) fn fit_gain(&mut self) -> Result<(), Fault> {
        let buffers = [(Slot::PartialsIn, &self.memory.partials), (Slot::GainOut, &self.memory.gain)];
        self.recorder.call(&pixels::fit_gain(), [1, 1], Call::default(), &buffers)
    }

    /// The way back of a picture's slopes.
    pub(crate) fn back(&mut self, picture: usize, end: End<'_>) -> Result<(), Fault> {
        let of = &self.pictures[picture];
        if let Some(taps) = &of.display.blur {
            let blur = self.light_blur();
            let (slopes, spare) = (&self.memory.slopes, &self.memory.spare);
            self.spread(AxisBlur { along_y: true, ..blur }, taps, (slopes, spare), Call::default())?;
            self.spread(blur, taps, (spare, slopes), Call::default())?;
        }
        let shader = self.image_rows().weigh();
        for sent in self.shape.fields_of(picture, of.display.modes.len()) {
            if !self.keeps_field() {
                self.send(sent)?;
            }
            let buffers = [
                (Slot::Source, &self.memory.image),
                (Slot::Sink, &self.memory.slm),
                (Slot::Turns, &self.memory.turns[0]),
                (Slot::Shift, &self.memory.shifts[0]),
                (Slot::Slopes, &self.memory.slopes),
            ];
            let call = Call { factor: self.factor(&of.display.modes[sent.mode]), ..Call::default() };
            self.recorder.call(&shader, [self.shape.size.height_px, 1], call, &buffers)?;
            self.send_back(sent, end)?;
        }
        Ok(())
    }

    /// Light, slopes and the way back in fused passes, for a problem with a [single comparison](Self::is_simple).
    pub(crate) fn evaluate_simply(&mut self) -> Result<(), Fault> {
        let (of, sent) = (&self.pictures[0], Sent { picture: 0, mode: 0, frame: 0 });
        self.send(sent)?;
        let buffers = [
            (Slot::Source, &self.memory.image),
            (Slot::Sink, &self.memory.slm),
            (Slot::Turns, &self.memory.turns[0]),
            (Slot::Shift, &self.memory.shifts[0]),
            (Slot::Picture, &of.picture),
            (Slot::Gain, &self.memory.gain),
            (Slot::Partials, &self.memory.partials),
        ];
        let call = Call { factor: self.factor(&of.display.modes[0]), ..Call::default() };
        let shader = self.image_rows().compare();
        self.recorder.call(&shader, [self.shape.size.height_px, 1], call, &buffers)?;
        self.send_back(sent, End::Gradient)
    }

    /// Whether the light of each place can be compared as soon as it is known.
    pub(crate) fn is_simple(&self) -> bool {
        self.keeps_field()
            && self.pictures[0].display.blur.is_none()
            && self.shape.light_planes() == self.shape.places[0] * self.shape.places[1]
    }

    /// Whether there is a single field, which is still in memory when its way back begins.
    fn keeps_field(&self) -> bool {
        self.pictures.len() * self.pictures[0].display.modes.len() * self.shape.size.frames == 1
    }

    /// Part of a field's light at a place in the mean light.
    fn factor(&self, mode: &ModeTables) -> f32 {
        let places = self.shape.places[0] * self.shape.places[1] / self.shape.light_planes();
        (mode.share / (self.shape.size.frames * places) as f64) as f32
    }

    fn image_rows(&self) -> ImageRows {
        self.shape.image_rows()
    }

    fn light_blur(&self) -> AxisBlur {
        self.shape.blur(self.shape.light_planes(), LIGHT_BLUR_TAPS)
    }

    /// From the phases to the half-transformed field in the image plane.
    fn send(&mut self, sent: Sent) -> Result<(), Fault> {
        let (shape, memory) = (self.shape, self.memory);
        let display = &self.pictures[sent.picture].display;
        let mode = &display.modes[sent.mode];
        self.show(sent)?;
        let rows = SlmRows {
            layout: shape.layout.clone(),
            pixels: Pixels::Modulator(display.parts.clone()),
            windowed: mode.windows.is_some(),
        };
        let shader = rows.out();
        for i in 0..mode.per_axis() {
            let call = Call {
                sink: shape.lane(i),
                window: (i * shape.size.width_px) as u32,
                frame: shape.frame(sent.frame),
                ..Call::default()
            };
            let mut buffers = self.modulator(display);
            buffers.extend([(Slot::Sink, &memory.slm), (Slot::Turns, &memory.turns[0])]);
            buffers.extend(mode.windows.iter().map(|[along_x, _]| (Slot::Window, along_x)));
            self.recorder.call(&shader, [shape.size.height_px, 1], call, &buffers)?;
        }
        let shader = shape.columns(mode.windows.is_some()).there();
        let n = mode.per_axis();
        for (at, transfer) in mode.transfers.iter().enumerate() {
            let call = Call {
                add: u32::from(at > 0),
                source: shape.lane(at % n),
                window: (at / n * shape.size.height_px) as u32,
                ..Call::default()
            };
            let buffers = self.column_buffers(mode, transfer, [&memory.slm, &memory.image]);
            self.recorder.call(&shader, [shape.layout.column_groups(), 1], call, &buffers)?;
        }
        Ok(())
    }

    /// From the half-transformed field that comes back from the image plane to the phases or the modulator's field.
    fn send_back(&mut self, sent: Sent, end: End<'_>) -> Result<(), Fault> {
        let windowed = self.pictures[sent.picture].display.modes[sent.mode].windows.is_some();
        self.send_back_through(&self.shape.columns(windowed).back(), sent, end)
    }

    /// [`Self::send_back`] with the pass over columns that leads from the detector's places to the modulator.
    pub(crate) fn send_back_through(&mut self, columns: &Shader, sent: Sent, end: End<'_>) -> Result<(), Fault> {
        let (shape, memory) = (self.shape, self.memory);
        let display = &self.pictures[sent.picture].display;
        let mode = &display.modes[sent.mode];
        let spreads = display.crosstalk.is_some() && end == End::Gradient;
        let pixels = match end {
            End::Gradient => Pixels::Modulator(display.parts.clone()),
            End::Field(_) => Pixels::Field,
        };
        let rows = SlmRows { layout: shape.layout.clone(), pixels, windowed: mode.windows.is_some() }.back();
        let (n, is_first) = (mode.per_axis(), sent.picture + sent.mode == 0);
        for i in 0..n {
            for j in 0..n {
                let call = Call { add: u32::from(j > 0), window: (j * shape.size.height_px) as u32, ..Call::default() };
                let buffers = self.column_buffers(mode, &mode.transfers[j * n + i], [&memory.slm, &memory.image]);
                self.recorder.call(columns, [shape.layout.column_groups(), 1], call, &buffers)?;
            }
            let call = Call {
                add: u32::from(i > 0 || !(is_first || spreads)),
                window: (i * shape.size.width_px) as u32,
                frame: shape.frame(sent.frame),
                ..Call::default()
            };
            let mut buffers = self.modulator(display);
            buffers.extend([(Slot::Source, &memory.image), (Slot::Turns, &memory.turns[0])]);
            buffers.push((Slot::Gradient, if spreads { &memory.by_shown } else { &memory.gradient }));
            buffers.extend(mode.windows.iter().map(|[along_x, _]| (Slot::Window, along_x)));
            if let End::Field(field) = end {
                buffers.push((Slot::FieldOut, field));
            }
            self.recorder.call(&rows, [shape.size.height_px, 1], call, &buffers)?;
        }
        if let (true, Some(taps)) = (spreads, &display.crosstalk) {
            let blur = shape.blur(1, CROSSTALK_TAPS);
            let (by_shown, spare) = (&memory.by_shown, &memory.spare);
            self.spread(AxisBlur { along_y: true, ..blur }, taps, (by_shown, spare), Call::default())?;
            let call = Call { add: u32::from(!is_first), frame: shape.frame(sent.frame), ..Call::default() };
            self.spread(blur, taps, (spare, &memory.gradient), call)?;
        }
        Ok(())
    }

    /// The shown phases, where they differ from the displayed ones.
    fn show(&mut self, sent: Sent) -> Result<(), Fault> {
        let (shape, memory) = (self.shape, self.memory);
        let display = &self.pictures[sent.picture].display;
        if !display.parts.wraps() {
            return Ok(());
        }
        let shader = pixels::wrap(shape.size.width_px, display.parts.grating);
        let call = Call { frame: shape.frame(sent.frame), ..Call::default() };
        let buffers = [(Slot::Phase, &memory.phase), (Slot::ValuesOut, &memory.shown)];
        self.recorder.call(&shader, shape.pixel_groups(1), call, &buffers)?;
        if let Some(taps) = &display.crosstalk {
            let blur = shape.blur(1, CROSSTALK_TAPS);
            self.blur(blur, taps, &memory.shown, &memory.spare)?;
            self.blur(AxisBlur { along_y: true, ..blur }, taps, &memory.spare, &memory.shown)?;
        }
        Ok(())
    }

    fn blur(
        &mut self,
        blur: AxisBlur,
        taps: &wgpu::Buffer,
        from: &wgpu::Buffer,
        to: &wgpu::Buffer,
    ) -> Result<(), Fault> {
        let buffers = [(Slot::Taps, taps), (Slot::ValuesIn, from), (Slot::ValuesOut, to)];
        self.recorder.call(&blur.there(), self.shape.pixel_groups(blur.planes), Call::default(), &buffers)
    }

    fn spread(
        &mut self,
        blur: AxisBlur,
        taps: &wgpu::Buffer,
        (from, to): (&wgpu::Buffer, &wgpu::Buffer),
        call: Call,
    ) -> Result<(), Fault> {
        let buffers = [(Slot::Taps, taps), (Slot::ValuesIn, from), (Slot::ValuesOut, to)];
        self.recorder.call(&blur.back(), self.shape.pixel_groups(blur.planes), call, &buffers)
    }

    fn modulator(&self, display: &'a DisplayTables) -> Vec<(Slot, &'a wgpu::Buffer)> {
        let phase = if display.parts.wraps() { &self.memory.shown } else { &self.memory.phase };
        let mut buffers = vec![(Slot::Phase, phase), (Slot::Modulator, &display.numbers)];
        buffers.extend(display.lit.iter().map(|lit| (Slot::Lit, lit)));
        buffers.extend(display.phase_gain.iter().map(|gain| (Slot::PhaseGain, gain)));
        buffers
    }

    fn column_buffers(
        &self,
        mode: &'a ModeTables,
        transfer: &'a wgpu::Buffer,
        [source, sink]: [&'a wgpu::Buffer; 2],
    ) -> Vec<(Slot, &'a wgpu::Buffer)> {
        let mut buffers = vec![
            (Slot::Source, source),
            (Slot::Sink, sink),
            (Slot::Turns, &self.memory.turns[1]),
            (Slot::Shift, &self.memory.shifts[1]),
            (Slot::Transfer, transfer),
        ];
        buffers.extend(mode.windows.iter().map(|[_, along_y]| (Slot::Window, along_y)));
        buffers
    }
}
