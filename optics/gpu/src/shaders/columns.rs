//! Passes over columns: the field's way from the modulator to the image plane, and back.
//!
//! ```text
//! there:  u_o = F⁻¹[ e^{i2πf·o} H · F[ ℓ c ] ]          for each place o along y
//! back:   c   = ℓ F⁻¹[ H* Σ_o e^{−i2πf·o} F[ u_o ] ]
//! ```

use super::layout::Layout;
use super::{Shader, Slot};
use std::fmt::Write as _;

/// What a pass over columns depends on.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Columns {
    pub(crate) layout: Layout,
    /// Number of places along y: 1, which is the pixel's middle, or 2.
    pub(crate) places: usize,
    /// Whether the modulator's field has a window along y.
    pub(crate) windowed: bool,
}

impl Columns {
    /// The way to the image plane.
    pub(crate) fn there(&self) -> Shader {
        let (layout, values) = (&self.layout, self.layout.columns.values());
        let mut main = self.begin();
        for place in 0..self.places {
            let _ = writeln!(main, "  var sum{place}: array<vec2f, {values}>;");
        }
        main.push_str("  for (var half = 0u; half < call.two; half++) {\n");
        self.load(&mut main, "call.source", self.windowed);
        main.push_str("    forward(lt, cc);\n");
        self.multiply(&mut main, "times");
        if self.places == 1 {
            main.push_str("    inverse(lt, cc);\n");
            self.accumulate(&mut main, "sum0");
        } else {
            let _ = writeln!(main, "    let spectrum = z;\n    for (var o = 0u; o < {}u; o++) {{", self.places);
            for held in layout.columns.last() {
                let (i, shift) = (held.register, self.shift(&held.place()));
                let _ = writeln!(main, "    z[{i}] = times(spectrum[{i}], {shift});");
            }
            main.push_str("    inverse(lt, cc);\n");
            for place in 0..self.places {
                let _ = writeln!(main, "    if (o == {place}u) {{");
                self.accumulate(&mut main, &format!("sum{place}"));
                main.push_str("    }\n");
            }
            main.push_str("    }\n");
        }
        main.push_str("  }\n");
        for place in 0..self.places {
            self.store(&mut main, &format!("sum{place}"), place * layout.lane_len(), false);
        }
        self.shader("columns there", main)
    }

    /// The way back: the adjoint.
    pub(crate) fn back(&self) -> Shader {
        let (layout, values) = (&self.layout, self.layout.columns.values());
        let mut main = self.begin();
        let _ = writeln!(main, "  var sum: array<vec2f, {values}>;");
        main.push_str("  for (var half = 0u; half < call.two; half++) {\n");
        if self.places == 1 {
            self.load(&mut main, "call.source", false);
            main.push_str("    forward(lt, cc);\n");
        } else {
            let _ = writeln!(main, "    var spectrum: array<vec2f, {values}>;");
            let _ = writeln!(main, "    for (var o = 0u; o < {}u; o++) {{", self.places);
            self.load(&mut main, &format!("call.source + o * {}u", layout.lane_len()), false);
            main.push_str("    forward(lt, cc);\n");
            for held in layout.columns.last() {
                let (i, shift) = (held.register, self.shift(&held.place()));
                let _ = writeln!(main, "    spectrum[{i}] += times_conj(z[{i}], {shift});");
            }
            main.push_str("    }\n    z = spectrum;\n");
        }
        self.multiply(&mut main, "times_conj");
        main.push_str("    inverse(lt, cc);\n");
        self.accumulate(&mut main, "sum");
        main.push_str("  }\n");
        self.store(&mut main, "sum", 0, self.windowed);
        self.shader("columns back", main)
    }

    fn shader(&self, name: &'static str, main: String) -> Shader {
        let layout = &self.layout;
        let mut slots = vec![Slot::Source, Slot::Sink, Slot::Turns, Slot::Transfer];
        slots.extend((self.places > 1).then_some(Slot::Shift));
        slots.extend(self.windowed.then_some(Slot::Window));
        let functions = layout.text() + &layout.columns.text();
        Shader::new(name, slots, layout.columns.workgroup(), &functions, &main)
    }

    fn begin(&self) -> String {
        let columns = self.layout.columns.columns;
        format!("{}  let x = group.x * {columns}u + cc;\n", self.layout.columns.places())
    }

    /// Loads a column, and turns it for the odd bins.
    fn load(&self, main: &mut String, lane: &str, windowed: bool) {
        for held in self.layout.columns.first() {
            let (i, at) = (held.register, self.layout.in_column(&held));
            let window = if windowed { format!(" * window[call.window + {}]", held.place()) } else { String::new() };
            let _ = writeln!(main, "    z[{i}] = source[{lane} + {at}]{window};");
        }
        main.push_str("    if (half == 1u) {\n");
        for held in self.layout.columns.first() {
            let i = held.register;
            let _ = writeln!(main, "      z[{i}] = times(z[{i}], turns[{}]);", held.place());
        }
        main.push_str("    }\n");
    }

    fn multiply(&self, main: &mut String, times: &str) {
        for held in self.layout.columns.last() {
            let (i, at) = (held.register, self.layout.in_transfer(&held));
            let _ = writeln!(main, "    z[{i}] = {times}(z[{i}], transfer[{at}]);");
        }
    }

    fn shift(&self, bin: &str) -> String {
        let h = self.layout.height_px;
        format!("shift[o * {}u + half * {h}u + {bin}]", 2 * h)
    }

    /// Adds one half's values, the odd ones turned back.
    fn accumulate(&self, main: &mut String, sum: &str) {
        accumulate(main, sum, self.layout.columns.first().iter().map(|held| (held.register, held.place())));
    }

    fn store(&self, main: &mut String, sum: &str, lane: usize, windowed: bool) {
        main.push_str("  if (call.add == 1u) {\n");
        for plus in ["+", ""] {
            for held in self.layout.columns.first() {
                let (i, at) = (held.register, self.layout.in_column(&held));
                let window =
                    if windowed { format!(" * window[call.window + {}]", held.place()) } else { String::new() };
                let line = format!("sink[call.sink + {lane}u + {at}] {plus}= {sum}[{i}]{window};");
                let _ = writeln!(main, "    {}", held.guarded(&line));
            }
            main.push_str(if plus == "+" { "  } else {\n" } else { "  }\n" });
        }
    }
}

/// Adds the values `z` of one half to `sum`, the odd ones turned back.
pub(crate) fn accumulate(main: &mut String, sum: &str, values: impl Iterator<Item = (usize, String)> + Clone) {
    main.push_str("    if (half == 0u) {\n");
    for (i, _) in values.clone() {
        let _ = writeln!(main, "      {sum}[{i}] = z[{i}];");
    }
    main.push_str("    } else {\n");
    for (i, place) in values {
        let _ = writeln!(main, "      {sum}[{i}] += times_conj(z[{i}], turns[{place}]);");
    }
    main.push_str("    }\n");
}
