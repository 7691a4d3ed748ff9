//! Shaders, made from the sizes of a problem.
//!
//! ```text
//! modulator -> rows out -> columns -> image rows (light, loss, gradient) -> columns back -> rows back -> gradient
//! ```
//!
//! A field is stored half transformed, along x only: row y, bins of the padded width, the even ones first. Each pass
//! transforms in registers and shared memory what it needs, so the padded field is never stored. Even and odd bins go
//! through one real loop, whose count the compiler does not know: it would put both into one long text, which takes half
//! as many registers again, and registers limit how many threads a card runs.

pub(crate) mod butterfly;
pub(crate) mod columns;
pub(crate) mod image_rows;
pub(crate) mod layout;
pub(crate) mod modulator;
pub(crate) mod pixels;
pub(crate) mod slm_rows;
pub(crate) mod transform;

use std::fmt::Write as _;

/// What a shader reads or writes beside the numbers of its call.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Slot {
    /// Half-transformed field that is read.
    Source,
    /// Half-transformed field that is written.
    Sink,
    /// Turns of the transforms.
    Turns,
    /// Transfer function.
    Transfer,
    /// Turns e^{i2πf·o} to the places in a pixel, along one axis.
    Shift,
    /// Windows of local kernels along one axis.
    Window,
    /// Phases \[rad\].
    Phase,
    /// Complex field of pixels that is read.
    FieldIn,
    /// Complex field of pixels that is written.
    FieldOut,
    /// Light on the modulator, with dust.
    Lit,
    /// Factor of the phase at each pixel.
    PhaseGain,
    /// Undiffracted light, then the harmonics of the phase response.
    Modulator,
    /// Light of pixels that is written or added to.
    Light,
    /// Light of pixels that is read.
    LightIn,
    /// Target and weight of each pixel.
    Picture,
    /// Slopes of the loss by the light that are read.
    Slopes,
    /// Slopes of the loss by the light that are written.
    SlopesOut,
    /// Sums of each row.
    Partials,
    /// Sums of each row that are read.
    PartialsIn,
    /// The gain.
    Gain,
    /// The gain that is written.
    GainOut,
    /// Gradient that is written or added to.
    Gradient,
    /// The gain, and the number of steps of Adam so far.
    GainIn,
    /// Sums of each step of Adam.
    History,
    /// Factors of each step of Adam.
    Factors,
    /// Phases that are written.
    PhaseOut,
    /// Moments of Adam, first and second.
    Moments,
    /// Gradient that is read.
    GradientIn,
    /// Weights of a blur.
    Taps,
    /// Numbers of pixels that are read.
    ValuesIn,
    /// Numbers of pixels that are written or added to.
    ValuesOut,
}

impl Slot {
    /// Name in a shader, type of the elements, and whether the shader writes them.
    pub(crate) fn declared(self) -> (&'static str, &'static str, bool) {
        match self {
            Self::Source => ("source", "vec2f", false),
            Self::Sink => ("sink", "vec2f", true),
            Self::Turns => ("turns", "vec2f", false),
            Self::Transfer => ("transfer", "vec2f", false),
            Self::Shift => ("shift", "vec2f", false),
            Self::Window => ("window", "f32", false),
            Self::Phase => ("phase", "f32", false),
            Self::FieldIn => ("field_in", "vec2f", false),
            Self::FieldOut => ("field_out", "vec2f", true),
            Self::Lit => ("lit", "vec2f", false),
            Self::PhaseGain => ("phase_gain", "f32", false),
            Self::Modulator => ("modulator", "vec2f", false),
            Self::Light => ("light", "f32", true),
            Self::LightIn => ("light_in", "f32", false),
            Self::Picture => ("picture", "vec2f", false),
            Self::Slopes => ("slopes", "f32", false),
            Self::SlopesOut => ("slopes_out", "f32", true),
            Self::Partials => ("partials", "vec4f", true),
            Self::PartialsIn => ("partials_in", "vec4f", false),
            Self::Gain => ("gain", "f32", false),
            Self::GainOut => ("gain_out", "f32", true),
            Self::Gradient => ("gradient", "f32", true),
            Self::GainIn => ("gain_in", "f32", false),
            Self::History => ("history", "vec4f", true),
            Self::Factors => ("factors", "vec2f", false),
            Self::PhaseOut => ("phase_out", "f32", true),
            Self::Moments => ("moments", "vec2f", true),
            Self::GradientIn => ("gradient_in", "f32", false),
            Self::Taps => ("taps", "f32", false),
            Self::ValuesIn => ("values_in", "f32", false),
            Self::ValuesOut => ("values_out", "f32", true),
        }
    }
}

/// A shader: its text, and what is bound to it after the numbers of its call.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Shader {
    pub(crate) name: &'static str,
    pub(crate) text: String,
    pub(crate) slots: Vec<Slot>,
}

/// Numbers of one call of a shader, as [`CALL`] declares them.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct Call {
    /// 2: the number of halves of a spectrum. A number that the compiler does not know.
    pub(crate) two: u32,
    /// 1: adds to what is there; 0: overwrites it.
    pub(crate) add: u32,
    /// First value of [`Slot::Source`].
    pub(crate) source: u32,
    /// First value of [`Slot::Sink`].
    pub(crate) sink: u32,
    /// First factor of the window.
    pub(crate) window: u32,
    /// First pixel of the frame in what belongs to all frames.
    pub(crate) frame: u32,
    /// First row of the plane's partial sums.
    pub(crate) partials: u32,
    /// Factor of the light.
    pub(crate) factor: f32,
}

const CALL: &str = "struct Call {
  two: u32,
  add: u32,
  source: u32,
  sink: u32,
  window: u32,
  frame: u32,
  partials: u32,
  factor: f32,
}
@group(0) @binding(0) var<uniform> call: Call;
";

impl Shader {
    /// A shader from the text of its functions and of its main function, run by workgroups of a number of threads.
    pub(crate) fn new(name: &'static str, slots: Vec<Slot>, threads: usize, functions: &str, main: &str) -> Self {
        let mut text = String::from(CALL);
        for (i, slot) in slots.iter().enumerate() {
            let (name, kind, written) = slot.declared();
            let access = if written { "read_write" } else { "read" };
            let _ = writeln!(text, "@group(0) @binding({}) var<storage, {access}> {name}: array<{kind}>;", i + 1);
        }
        text.push_str(include_str!("prelude.wgsl"));
        text.push_str(functions);
        let _ = write!(
            text,
            "\n@compute @workgroup_size({threads})\nfn main(@builtin(local_invocation_index) lid: u32, \
             @builtin(workgroup_id) group: vec3u) {{\n{main}}}\n"
        );
        Self { name, text, slots }
    }
}

/// A sum over the threads of a workgroup in a fixed order: `summed(lid, value)`, valid in thread 0.
pub(crate) fn summed(threads: usize) -> String {
    let mut text = format!(
        "\nvar<workgroup> terms: array<vec4f, {threads}>;\n\nfn summed(lid: u32, value: vec4f) -> vec4f {{\n  \
         terms[lid] = value;\n  workgroupBarrier();\n"
    );
    let mut half = threads.next_power_of_two() / 2;
    while half > 0 {
        let _ = writeln!(
            text,
            "  if (lid < {half}u && lid + {half}u < {threads}u) {{ terms[lid] += terms[lid + {half}u]; }}\n  \
             workgroupBarrier();"
        );
        half /= 2;
    }
    text.push_str("  return terms[0];\n}\n");
    text
}
