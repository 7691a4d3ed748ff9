//! Text of the modulator: the field that leaves a pixel, and the gradient of its phase.
//!
//! ```text
//! c(x, y) = k(x, y) · a(x, y) · ( e^{i r(ψ)} + z₀ ),   r(ψ) = (1 + v(x, y)) ψ + Σ_k ( a_k sin kψ + b_k cos kψ )
//! ```

use super::Slot;
use lightpath_optics::Carrier;
use std::fmt::Write as _;

/// Which parts a modulator has.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct ModulatorParts {
    /// Number of harmonics of the phase response.
    pub(crate) harmonics: usize,
    /// Whether the light on the modulator differs from 1, or there is dust.
    pub(crate) lit: bool,
    /// Whether the response varies over the pixels.
    pub(crate) uneven: bool,
    /// Whether cross-talk blurs the phases.
    pub(crate) crosstalk: bool,
    pub(crate) grating: Grating,
}

/// The carrier's grating.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Grating {
    None,
    AlongX,
    AlongY,
}

impl From<Option<Carrier>> for Grating {
    fn from(carrier: Option<Carrier>) -> Self {
        match carrier {
            None => Self::None,
            Some(Carrier::HalfOrderX) => Self::AlongX,
            Some(Carrier::HalfOrderY) => Self::AlongY,
        }
    }
}

impl Grating {
    /// Whether the grating adds π, for text with `y` and `x`.
    pub(crate) fn odd(self) -> &'static str {
        match self {
            Self::None => "false",
            Self::AlongX => "(x & 1u) == 1u",
            Self::AlongY => "(y & 1u) == 1u",
        }
    }
}

impl ModulatorParts {
    /// Whether the shown phases differ from the displayed ones: they are wrapped with the grating, before they blur or
    /// before their gain varies.
    pub(crate) fn wraps(&self) -> bool {
        self.crosstalk || self.uneven
    }

    /// What the text reads.
    pub(crate) fn slots(&self) -> Vec<Slot> {
        let mut slots = vec![Slot::Phase, Slot::Modulator];
        slots.extend(self.lit.then_some(Slot::Lit));
        slots.extend(self.uneven.then_some(Slot::PhaseGain));
        slots
    }

    /// Functions `field(y, x)`, and `phase_gradient(y, x, b)` for b = ∂L/∂c*.
    pub(crate) fn text(&self, width_px: usize) -> String {
        let mut text = String::from("\nstruct Response { modulated: vec2f, slope: f32, sign: f32 }\n");
        let _ = write!(text, "\nfn respond(y: u32, x: u32) -> Response {{\n  let i = y * {width_px}u + x;\n");
        let first = if self.wraps() { "0u" } else { "call.frame" };
        let _ = writeln!(text, "  var shown = phase[{first} + i];");
        let _ = writeln!(text, "  let odd = {};", self.grating.odd());
        if !self.wraps() {
            text.push_str("  shown += select(0.0f, 3.14159265358979f, odd);\n");
        }
        text.push_str("  let sign = select(1.0f, -1.0f, odd);\n  let turn = cis(shown);\n");
        if self.harmonics == 0 && !self.uneven {
            text.push_str("  return Response(turn, 1.0f, sign);\n}\n");
        } else {
            let gain = if self.uneven { "phase_gain[i]" } else { "1.0f" };
            let _ = writeln!(text, "  var slope = {gain};\n  var response = shown * slope;\n  var power = turn;");
            for k in 1..=self.harmonics {
                let _ = writeln!(
                    text,
                    "  response += modulator[{k}].x * power.y + modulator[{k}].y * power.x;\n  slope += {k}.0f * \
                     (modulator[{k}].x * power.x - modulator[{k}].y * power.y);\n  power = times(power, turn);"
                );
            }
            text.push_str("  return Response(cis(response), slope, sign);\n}\n");
        }
        let lit = |value: &str| match self.lit {
            true => format!("times({value}, lit[y * {width_px}u + x])"),
            false => value.to_owned(),
        };
        let light =
            if self.lit { format!("times_conj(lit[y * {width_px}u + x], b)") } else { "vec2f(b.x, -b.y)".into() };
        let _ = write!(
            text,
            "\nfn field(y: u32, x: u32) -> vec2f {{\n  let r = respond(y, x);\n  return {};\n}}\n\
             \nfn phase_gradient(y: u32, x: u32, b: vec2f) -> f32 {{\n  let r = respond(y, x);\n  let light = {light};\n  \
             return -2.0f * r.sign * r.slope * (light.x * r.modulated.y + light.y * r.modulated.x);\n}}\n",
            lit("(r.sign * (r.modulated + modulator[0]))"),
        );
        text
    }
}
