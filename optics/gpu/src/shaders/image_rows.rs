//! Passes over the rows of the image: light, its comparison with the target, and the gradient by the field.
//!
//! ```text
//! p = Σ_o k |u_o|²,   e = s q − t with q = p or √p,   L = Σ W e²
//! slope = ∂L/∂p = 2 W s e, or W s e/√p,   ∂L/∂u_o* = slope k u_o
//! ```
//!
//! W are weights whose sum over all pixels and planes is 1, s the gain, k the part of a field in the mean light.

use super::layout::Layout;
use super::slm_rows::{receive, send};
use super::{Shader, Slot, summed};
use lightpath_optics::engine::photometry::Quantity;
use std::fmt::Write as _;

/// What a pass over the rows of the image depends on.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct ImageRows {
    pub(crate) layout: Layout,
    /// Numbers of places along x and along y.
    pub(crate) places: [usize; 2],
    /// Whether each place is a light plane of its own, or the light is the sum over the places.
    pub(crate) apart: bool,
    pub(crate) compares_amplitudes: bool,
}

/// Text of `compared(light, picture, s)`: the slope, and the terms s-independent Σ W q², Σ W e q, Σ W e².
pub(crate) fn comparison(quantity: Quantity) -> String {
    let (q, slope) = match quantity {
        Quantity::Intensity => ("p", "2.0f * w * s * e"),
        Quantity::Amplitude => ("sqrt(p)", "select(0.0f, w * s * e / q, q > 0.0f)"),
    };
    format!(
        "\nstruct Compared {{ slope: f32, terms: vec4f }}\n\nfn compared(p: f32, wanted: vec2f, s: f32) -> Compared {{\n  \
         let q = {q};\n  let w = wanted.y;\n  let e = s * q - wanted.x;\n  \
         return Compared({slope}, vec4f(w * q * q, w * e * q, w * e * e, 0.0f));\n}}\n"
    )
}

impl ImageRows {
    /// Writes or adds the light.
    pub(crate) fn light(&self) -> Shader {
        let (rows, w) = (&self.layout.rows, self.layout.width_px);
        let mut main = self.begin();
        if !self.apart {
            let _ = writeln!(main, "  var light_sum: array<f32, {}>;", rows.values());
        }
        self.each_place(&mut main, |main| {
            for held in rows.first() {
                let (i, x) = (held.register, held.place());
                let value = format!("call.factor * dot(u[{i}], u[{i}])");
                if self.apart {
                    let at = format!("light[(y * {}u + place) * {w}u + {x}]", self.places());
                    let line = format!("{at} = select(0.0f, {at}, call.add == 1u) + {value};");
                    let _ = writeln!(main, "  {}", held.guarded(&line));
                } else {
                    let _ = writeln!(main, "  light_sum[{i}] += {value};");
                }
            }
        });
        if !self.apart {
            for held in rows.first() {
                let at = format!("light[y * {w}u + {}]", held.place());
                let line = format!("{at} = select(0.0f, {at}, call.add == 1u) + light_sum[{}];", held.register);
                let _ = writeln!(main, "  {}", held.guarded(&line));
            }
        }
        self.shader("light of rows", &[Slot::Light], "", main)
    }

    /// Multiplies the field by slopes, and transforms it along x: the first step of the way back.
    pub(crate) fn weigh(&self) -> Shader {
        let w = self.layout.width_px;
        let mut main = self.begin();
        self.each_place(&mut main, |main| {
            for held in self.layout.rows.first() {
                let row = if self.apart { format!("(y * {}u + place)", self.places()) } else { "y".to_owned() };
                let slope = format!("slopes[{row} * {w}u + {}]", held.place());
                let _ = writeln!(main, "  u[{0}] = u[{0}] * (call.factor * {slope});", held.register);
            }
            self.send_back(main);
        });
        self.shader("weigh rows", &[Slot::Sink, Slot::Slopes], "", main)
    }

    /// [`Self::light`], the slopes and [`Self::weigh`] in one pass, with the sums of each row, for light that needs
    /// nothing of other pixels, fields or places.
    pub(crate) fn compare(&self) -> Shader {
        let (rows, w) = (&self.layout.rows, self.layout.width_px);
        let quantity = if self.compares_amplitudes { Quantity::Amplitude } else { Quantity::Intensity };
        let mut main = self.begin();
        main.push_str("  let s = gain[0];\n  var terms_of_row = vec4f();\n");
        self.each_place(&mut main, |main| {
            for held in rows.first() {
                let i = held.register;
                let _ = writeln!(
                    main,
                    "  let of{i} = compared(call.factor * dot(u[{i}], u[{i}]), picture[y * {w}u + {}], s);",
                    held.place()
                );
                let _ = writeln!(main, "  {}", held.guarded(&format!("terms_of_row += of{i}.terms;")));
                let _ = writeln!(main, "  u[{i}] = u[{i}] * (call.factor * of{i}.slope);");
            }
            self.send_back(main);
        });
        main.push_str("  let total = summed(lid, terms_of_row);\n");
        main.push_str("  if (lid == 0u) { partials[call.partials + y] = total; }\n");
        let functions = comparison(quantity) + &summed(rows.workgroup());
        self.shader("compare rows", &[Slot::Sink, Slot::Picture, Slot::Gain, Slot::Partials], &functions, main)
    }

    /// Number of places in a pixel.
    fn places(&self) -> usize {
        self.places[0] * self.places[1]
    }

    fn begin(&self) -> String {
        format!("{}  let y = group.x;\n", self.layout.rows.places())
    }

    /// Runs lines with the field `u` of each place (`right`, `below`), number `place`.
    fn each_place(&self, main: &mut String, lines: impl Fn(&mut String)) {
        let [nx, ny] = self.places;
        let _ = writeln!(main, "  for (var place = 0u; place < {}u; place++) {{", nx * ny);
        let _ = writeln!(main, "  let right = place % {nx}u;\n  let below = place / {nx}u;");
        let _ = writeln!(main, "  var u: array<vec2f, {}>;", self.layout.rows.values());
        let lane = format!("call.source + below * {}u", self.layout.lane_len());
        let shift = format!("right * {}u", 2 * self.layout.width_px);
        receive(main, &self.layout, &lane, (nx > 1).then_some(shift.as_str()), "u");
        lines(main);
        main.push_str("  }\n");
    }

    /// Transforms `u` along x. The places along x share the lane of their place along y.
    fn send_back(&self, main: &mut String) {
        let (layout, w) = (&self.layout, self.layout.width_px);
        main.push_str("  for (var half = 0u; half < call.two; half++) {\n");
        send(main, layout, "u");
        for held in layout.rows.last() {
            let i = held.register;
            let at = format!("sink[call.sink + below * {}u + {}]", layout.lane_len(), layout.in_row(&held));
            let line = match self.places[0] {
                1 => format!("{at} = z[{i}];"),
                _ => {
                    let shift = format!("shift[right * {}u + half * {w}u + {}]", 2 * w, held.place());
                    format!("{at} = select(vec2f(), {at}, right > 0u) + times_conj(z[{i}], {shift});")
                }
            };
            let _ = writeln!(main, "    {}", held.guarded(&line));
        }
        main.push_str("  }\n");
    }

    fn shader(&self, name: &'static str, slots: &[Slot], functions: &str, main: String) -> Shader {
        let mut all = vec![Slot::Source, Slot::Turns];
        all.extend((self.places[0] > 1).then_some(Slot::Shift));
        all.extend(slots);
        let functions = self.layout.text() + &self.layout.rows.text() + functions;
        Shader::new(name, all, self.layout.rows.workgroup(), &functions, &main)
    }
}
