//! Passes over the rows of the modulator: its field's spectrum along x, and what comes back to it.

use super::columns::accumulate;
use super::layout::Layout;
use super::modulator::ModulatorParts;
use super::{Shader, Slot};
use std::fmt::Write as _;

/// What leaves the rows, or takes what comes back.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Pixels {
    /// The modulator: its field leaves, and the gradient of its phases comes back.
    Modulator(ModulatorParts),
    /// A complex field.
    Field,
}

/// What a pass over the modulator's rows depends on.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct SlmRows {
    pub(crate) layout: Layout,
    pub(crate) pixels: Pixels,
    /// Whether the field has a window along x.
    pub(crate) windowed: bool,
}

impl SlmRows {
    /// Transforms the rows of the field.
    pub(crate) fn out(&self) -> Shader {
        let rows = &self.layout.rows;
        let mut main = self.begin();
        let _ = writeln!(main, "  var c: array<vec2f, {}>;", rows.values());
        for held in rows.first() {
            let (i, x) = (held.register, held.place());
            let value = match &self.pixels {
                Pixels::Modulator(_) => format!("field(y, {x})"),
                Pixels::Field => format!("field_in[y * {}u + {x}]", self.layout.width_px),
            };
            let _ = writeln!(main, "  c[{i}] = {value}{};", self.window(&x));
        }
        main.push_str("  for (var half = 0u; half < call.two; half++) {\n");
        send(&mut main, &self.layout, "c");
        for held in rows.last() {
            let (i, at) = (held.register, self.layout.in_row(&held));
            let _ = writeln!(main, "    {}", held.guarded(&format!("sink[call.sink + {at}] = z[{i}];")));
        }
        main.push_str("  }\n");
        let (mut slots, mut functions) = (vec![Slot::Sink, Slot::Turns], self.functions());
        match &self.pixels {
            Pixels::Modulator(parts) => {
                slots.extend(parts.slots());
                functions += &parts.text(self.layout.width_px);
            }
            Pixels::Field => slots.push(Slot::FieldIn),
        }
        slots.extend(self.windowed.then_some(Slot::Window));
        Shader::new("rows out", slots, rows.workgroup(), &functions, &main)
    }

    /// Transforms rows back, and writes or adds the gradient or the field.
    pub(crate) fn back(&self) -> Shader {
        let (rows, w) = (&self.layout.rows, self.layout.width_px);
        let mut main = self.begin();
        let _ = writeln!(main, "  var b: array<vec2f, {}>;", rows.values());
        receive(&mut main, &self.layout, "call.source", None, "b");
        let (mut slots, mut functions) = (vec![Slot::Source, Slot::Turns], self.functions());
        let into = match &self.pixels {
            Pixels::Modulator(parts) => {
                slots.extend(parts.slots());
                slots.push(Slot::Gradient);
                functions += &parts.text(w);
                "gradient"
            }
            Pixels::Field => {
                slots.push(Slot::FieldOut);
                "field_out"
            }
        };
        slots.extend(self.windowed.then_some(Slot::Window));
        for held in rows.first() {
            let (i, x) = (held.register, held.place());
            let b = format!("b[{i}]{}", self.window(&x));
            let value = match &self.pixels {
                Pixels::Modulator(_) => format!("phase_gradient(y, {x}, {b})"),
                Pixels::Field => b,
            };
            let zero = if into == "gradient" { "0.0f" } else { "vec2f()" };
            // With cross-talk the gradient by the shown phases has one frame of its own.
            let frame = match &self.pixels {
                Pixels::Modulator(parts) if parts.crosstalk => "0u",
                _ => "call.frame",
            };
            let at = format!("{into}[{frame} + y * {w}u + {x}]");
            let line = format!("{at} = select({zero}, {at}, call.add == 1u) + {value};");
            let _ = writeln!(main, "  {}", held.guarded(&line));
        }
        Shader::new("rows back", slots, rows.workgroup(), &functions, &main)
    }

    fn begin(&self) -> String {
        format!("{}  let y = group.x;\n", self.layout.rows.places())
    }

    fn functions(&self) -> String {
        self.layout.text() + &self.layout.rows.text()
    }

    fn window(&self, x: &str) -> String {
        if self.windowed { format!(" * window[call.window + {x}]") } else { String::new() }
    }
}

/// Transforms a row of pixels: for the odd bins, its values are turned before.
pub(crate) fn send(main: &mut String, layout: &Layout, pixels: &str) {
    for held in layout.rows.first() {
        let _ = writeln!(main, "    z[{0}] = {pixels}[{0}];", held.register);
    }
    main.push_str("    if (half == 1u) {\n");
    for held in layout.rows.first() {
        let _ = writeln!(main, "      z[{0}] = times(z[{0}], turns[{1}]);", held.register, held.place());
    }
    main.push_str("    }\n    forward(lt, cc);\n");
}

/// Transforms a row of bins back to pixels. `shift(bin)` is a factor of each bin.
pub(crate) fn receive(main: &mut String, layout: &Layout, lane: &str, shift: Option<&str>, pixels: &str) {
    main.push_str("  for (var half = 0u; half < call.two; half++) {\n");
    for held in layout.rows.last() {
        let (i, at) = (held.register, layout.in_row(&held));
        let value = format!("source[{lane} + {at}]");
        let value = match shift {
            Some(shift) => format!("times({value}, shift[{shift} + half * {}u + {}])", layout.width_px, held.place()),
            None => value,
        };
        let _ = writeln!(main, "    z[{i}] = {value};");
    }
    main.push_str("    inverse(lt, cc);\n");
    accumulate(main, pixels, layout.rows.first().iter().map(|held| (held.register, held.place())));
    main.push_str("  }\n");
}
