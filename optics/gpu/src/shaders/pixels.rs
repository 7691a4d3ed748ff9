//! Passes over pixels without a transform: wrapped phases, blurs, slopes of the loss, and the gain.

use super::image_rows::comparison;
use super::modulator::Grating;
use super::{Shader, Slot, summed};
use lightpath_optics::engine::photometry::Quantity;

/// Threads of a workgroup.
const THREADS: usize = 64;

/// Number of workgroups along a row.
pub(crate) fn groups(width_px: usize) -> usize {
    width_px.div_ceil(THREADS)
}

/// Text that ends threads beyond the row's end. Group x is a part of row y.
fn pixel(width_px: usize) -> String {
    format!("  let x = group.x * {THREADS}u + lid;\n  let y = group.y;\n  if (x >= {width_px}u) {{ return; }}\n")
}

/// Adds the grating to the phases of a frame, and wraps them to 0 … 2π.
pub(crate) fn wrap(width_px: usize, grating: Grating) -> Shader {
    let main = format!(
        "{}  let i = y * {width_px}u + x;\n  let turn = 6.28318530717959f;\n  \
         let shown = phase[call.frame + i] + select(0.0f, 3.14159265358979f, {});\n  \
         values_out[i] = shown - turn * floor(shown / turn);\n",
        pixel(width_px),
        grating.odd()
    );
    Shader::new("wrap phases", vec![Slot::Phase, Slot::ValuesOut], THREADS, "", &main)
}

/// A blur of planes of pixels along one axis, or its adjoint. Row y of each plane follows row y of the plane before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct AxisBlur {
    pub(crate) height_px: usize,
    pub(crate) width_px: usize,
    pub(crate) planes: usize,
    /// Number of weights, which is odd.
    pub(crate) taps: usize,
    pub(crate) along_y: bool,
}

impl AxisBlur {
    /// Line with the number `n` of pixels along the axis, the pixel's own place `at`, and function `from(i)`.
    fn axis(self) -> String {
        let Self { height_px, width_px, planes, .. } = self;
        let (n, at, line, step) = match self.along_y {
            false => (width_px, "x".to_owned(), format!("y * {width_px}u"), 1),
            true => {
                let row = planes * width_px;
                (height_px, format!("y / {planes}u"), format!("(y % {planes}u) * {width_px}u + x"), row)
            }
        };
        format!("  let n = {n}i;\n  let at = i32({at});\n  let line = {line};\n  let step = {step}u;\n")
    }

    /// First weight of the axis: those along x come first.
    fn first_tap(self) -> usize {
        if self.along_y { self.taps } else { 0 }
    }

    /// Σ_k K_k v(i + k); beyond the edge the values of the edge continue.
    pub(crate) fn there(self) -> Shader {
        let (reach, first, taps) = (self.taps / 2, self.first_tap(), self.taps);
        let main = format!(
            "{}{}  var sum = 0.0f;\n  for (var k = 0i; k < {taps}i; k++) {{\n    \
             let near = u32(clamp(at + k - {reach}i, 0i, n - 1i));\n    \
             sum += taps[{first}u + u32(k)] * values_in[line + near * step];\n  }}\n  \
             values_out[line + u32(at) * step] = sum;\n",
            pixel(self.width_px),
            self.axis()
        );
        Shader::new("blur", vec![Slot::Taps, Slot::ValuesIn, Slot::ValuesOut], THREADS, "", &main)
    }

    /// The adjoint: a pixel takes what it gave, and one at the edge also what its continuation gave.
    pub(crate) fn back(self) -> Shader {
        let (reach, first, taps) = (self.taps / 2, self.first_tap(), self.taps);
        let main = format!(
            "{}{}  var sum = 0.0f;\n  for (var k = 0i; k < {taps}i; k++) {{\n    let weight = taps[{first}u + u32(k)];\n    \
             let to = at + {reach}i - k;\n    if (to >= 0i && to < n) {{ sum += weight * values_in[line + u32(to) * step]; }}\n    \
             for (var beyond = 1i; beyond <= {reach}i; beyond++) {{\n      \
             let before = {reach}i - k - beyond;\n      \
             if (at == 0i && before >= 0i && before < n) {{ sum += weight * values_in[line + u32(before) * step]; }}\n      \
             let behind = n - 1i + beyond + {reach}i - k;\n      \
             if (at == n - 1i && behind >= 0i && behind < n) {{ sum += weight * values_in[line + u32(behind) * step]; }}\n    \
             }}\n  }}\n  let out = call.frame + line + u32(at) * step;\n  \
             values_out[out] = select(0.0f, values_out[out], call.add == 1u) + sum;\n",
            pixel(self.width_px),
            self.axis()
        );
        Shader::new("spread", vec![Slot::Taps, Slot::ValuesIn, Slot::ValuesOut], THREADS, "", &main)
    }
}

/// Slopes of the loss by the light of all planes of a row, with the row's sums. Group x is a row.
pub(crate) fn slopes(width_px: usize, planes: usize, quantity: Quantity) -> Shader {
    let main = format!(
        "  let y = group.x;\n  let s = gain[0];\n  var terms_of_row = vec4f();\n  \
         for (var i = lid; i < {0}u; i += {THREADS}u) {{\n    \
         let result = compared(light_in[y * {0}u + i], picture[y * {width_px}u + i % {width_px}u], s);\n    \
         slopes_out[y * {0}u + i] = result.slope;\n    terms_of_row += result.terms;\n  }}\n  \
         let total = summed(lid, terms_of_row);\n  if (lid == 0u) {{ partials[call.partials + y] = total; }}\n",
        planes * width_px
    );
    let slots = vec![Slot::LightIn, Slot::Picture, Slot::Gain, Slot::SlopesOut, Slot::Partials];
    Shader::new("slopes", slots, THREADS, &(comparison(quantity) + &summed(THREADS)), &main)
}

/// The sums of all rows in their order, and the gain that fits best, as text with `total` and `best` in thread 0.
const TOTAL: &str = "  var terms_of_rows = vec4f();
  for (var i = lid; i < arrayLength(&partials_in); i += 64u) { terms_of_rows += partials_in[i]; }
  let total = summed(lid, terms_of_rows);
  let s = gain_out[0];
  let best = select(0.0f, s - total.y / total.x, total.x > 0.0f);
";

/// The gain that fits best. One group.
pub(crate) fn fit_gain() -> Shader {
    let main = format!("{TOTAL}  if (lid == 0u) {{ gain_out[0] = best; }}\n");
    Shader::new("fit gain", vec![Slot::PartialsIn, Slot::GainOut], THREADS, &summed(THREADS), &main)
}

/// Ends the evaluation of a step of Adam: notes its sums with its gain, and sets the gain of the next step. One group.
pub(crate) fn end_evaluation() -> Shader {
    let main = format!(
        "{TOTAL}  if (lid == 0u) {{\n    let step = u32(gain_out[1]);\n    history[step] = vec4f(total.xyz, s);\n    \
         gain_out[0] = best;\n    gain_out[1] = f32(step + 1u);\n  }}\n"
    );
    let slots = vec![Slot::PartialsIn, Slot::GainOut, Slot::History];
    Shader::new("end evaluation", slots, THREADS, &summed(THREADS), &main)
}

/// A step of Adam along the gradient, which is multiplied by the number of phases. Row y is one of all frames.
///
/// ```text
/// m ← β₁m + (1−β₁)g,  v ← β₂v + (1−β₂)g²,  φ ← φ − f₁ m / (√(f₂ v) + ε)
/// ```
pub(crate) fn adam(width_px: usize, phases: usize) -> Shader {
    let main = format!(
        "{}  let i = y * {width_px}u + x;\n  let f = factors[u32(gain_in[1]) - 1u];\n  \
         let g = gradient_in[i] * {phases}.0f;\n  \
         let m = vec2f(0.9f * moments[i].x + 0.1f * g, 0.999f * moments[i].y + 0.001f * g * g);\n  moments[i] = m;\n  \
         phase_out[i] -= f.x * m.x / (sqrt(f.y * m.y) + 1e-8f);\n",
        pixel(width_px)
    );
    let slots = vec![Slot::GainIn, Slot::Factors, Slot::GradientIn, Slot::Moments, Slot::PhaseOut];
    Shader::new("adam", slots, THREADS, "", &main)
}
