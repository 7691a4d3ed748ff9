//! Text of the transforms of a workgroup: `forward()` and `inverse()` on the values `z` of each thread.
//!
//! A pass loads values, calls `forward()`, works on the bins, calls `inverse()`, and stores. Before `forward()` and
//! after `inverse()` a thread holds the [places of the first stage](Transform::first), between them the
//! [bins of the last](Transform::last).

use super::butterfly::{Direction, Lines};
use crate::plan::Plan;
use std::fmt::Write as _;

/// The transforms of a pass.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Transform {
    pub(crate) plan: Plan,
    /// Number of transforms that a workgroup does side by side.
    pub(crate) columns: usize,
    /// Whether threads exchange real and imaginary parts one after the other, in half the memory.
    pub(crate) split: bool,
}

/// A value that a thread holds.
#[derive(Clone, Debug)]
pub(crate) struct Held {
    /// Its index in `z`.
    pub(crate) register: usize,
    /// Variable with the place of the butterfly's first value.
    pub(crate) base: String,
    /// Distance of this value from that place.
    pub(crate) offset: usize,
    /// Whether the thread has this value; `None`: every thread has it.
    pub(crate) guard: Option<String>,
}

impl Held {
    /// Its place among all values of the transform.
    pub(crate) fn place(&self) -> String {
        format!("({} + {}u)", self.base, self.offset)
    }

    /// A line that is only run where the thread has the value.
    pub(crate) fn guarded(&self, line: &str) -> String {
        match &self.guard {
            Some(guard) => format!("if ({guard}) {{ {line} }}"),
            None => line.to_owned(),
        }
    }
}

impl Transform {
    pub(crate) fn workgroup(&self) -> usize {
        self.plan.threads * self.columns
    }

    fn words(&self) -> usize {
        if self.split { 1 } else { 2 }
    }

    /// Bytes that the threads of a workgroup share.
    pub(crate) fn shared_bytes(&self) -> usize {
        4 * self.words() * self.plan.shared_len(self.columns, self.words())
    }

    /// Number of values that a thread holds.
    pub(crate) fn values(&self) -> usize {
        self.plan.values()
    }

    /// Values before `forward()` and after `inverse()`.
    pub(crate) fn first(&self) -> Vec<Held> {
        self.held(0, "first")
    }

    /// Bins behind `forward()` and before `inverse()`.
    pub(crate) fn last(&self) -> Vec<Held> {
        self.held(self.plan.radices.len() - 1, "last")
    }

    fn held(&self, stage: usize, name: &str) -> Vec<Held> {
        let (r, n) = (self.plan.radices[stage], self.plan.butterflies(stage));
        let of_round = |round: usize| {
            (0..r).map(move |j| Held {
                register: round * r + j,
                base: format!("{name}{round}"),
                offset: j * n,
                guard: guard(&self.plan, stage, round),
            })
        };
        (0..self.plan.rounds(stage)).flat_map(of_round).collect()
    }

    /// Names of places, for the beginning of a pass: the thread `lt` of a transform, and its butterflies.
    pub(crate) fn places(&self) -> String {
        let mut text = format!("  let cc = lid % {0}u;\n  let lt = lid / {0}u;\n", self.columns);
        for (stage, name) in [(0, "first"), (self.plan.radices.len() - 1, "last")] {
            for round in 0..self.plan.rounds(stage) {
                let _ = writeln!(text, "  let {name}{round} = {};", butterfly(&self.plan, stage, round));
            }
        }
        text
    }

    /// The memory of the transforms and their two functions. The turns are in `turns`.
    pub(crate) fn text(&self) -> String {
        let shared = self.plan.shared_len(self.columns, self.words());
        let mut text = format!("var<private> z: array<vec2f, {}>;\n", self.values());
        if shared > 0 {
            let kind = if self.split { "f32" } else { "vec2f" };
            let _ = writeln!(text, "var<workgroup> shared_values: array<{kind}, {shared}>;");
        }
        for (name, plan, direction) in
            [("forward", self.plan.clone(), Direction::Forward), ("inverse", self.plan.reversed(), Direction::Inverse)]
        {
            let _ = write!(text, "\nfn {name}(lt: u32, cc: u32) {{\n{}}}\n", self.stages(&plan, direction));
        }
        text
    }

    fn stages(&self, plan: &Plan, direction: Direction) -> String {
        let mut lines = Lines::default();
        for i in 0..plan.radices.len() {
            for round in 0..plan.rounds(i) {
                let r = plan.radices[i];
                let mut x: Vec<_> = (0..r).map(|j| lines.value(&format!("z[{}]", round * r + j))).collect();
                if i > 0 {
                    turn(&mut lines, plan, (i, round), direction, &mut x);
                }
                for (k, y) in lines.transform(&x, direction).iter().enumerate() {
                    lines.line(&format!("z[{}] = {y};", round * r + k));
                }
            }
            if i + 1 < plan.radices.len() {
                self.exchange(&mut lines, plan, i);
            }
        }
        lines.text
    }

    /// Hands the values of stage `i` to the threads of the next.
    fn exchange(&self, lines: &mut Lines, plan: &Plan, i: usize) {
        let (s, r, next, columns) = (plan.stride(i), plan.radices[i], plan.radices[i + 1], self.columns);
        let padding = plan.padding(i, columns, self.words());
        let block = s * r;
        let written: Vec<_> = (0..plan.rounds(i))
            .map(|round| {
                let b = lines.value(&butterfly(plan, i, round));
                lines.value(&format!("({b} + ({b} / {s}u) * {}u) * {columns}u + cc", block + padding - s))
            })
            .collect();
        let read: Vec<_> = (0..plan.rounds(i + 1))
            .map(|round| {
                let b = lines.value(&butterfly(plan, i + 1, round));
                lines.value(&format!("({b} + ({b} / {block}u) * {padding}u) * {columns}u + cc"))
            })
            .collect();
        let step = (plan.n / next + padding * plan.n / (next * block)) * columns;
        for part in if self.split { &[".x", ".y"][..] } else { &[""] } {
            lines.line("workgroupBarrier();");
            for (round, at) in written.iter().enumerate() {
                let guard = guard(plan, i, round);
                guard.iter().for_each(|guard| lines.line(&format!("if ({guard}) {{")));
                for k in 0..r {
                    lines.line(&format!("shared_values[{at} + {}u] = z[{}]{part};", k * s * columns, round * r + k));
                }
                guard.iter().for_each(|_| lines.line("}"));
            }
            lines.line("workgroupBarrier();");
            // The imaginary parts are still in `z` when the real parts are exchanged.
            let into = if *part == ".x" { format!("real{i}") } else { "z".to_owned() };
            if *part == ".x" {
                lines.line(&format!("var {into}: array<f32, {}>;", self.values()));
            }
            for (round, at) in read.iter().enumerate() {
                for j in 0..next {
                    let (register, value) = (round * next + j, format!("shared_values[{at} + {}u]", j * step));
                    let value = if *part == ".y" { format!("vec2f(real{i}[{register}], {value})") } else { value };
                    lines.line(&format!("{into}[{register}] = {value};"));
                }
            }
        }
    }
}

/// Multiplies the inputs of a butterfly by the powers of its turn. Powers are made from the second and fourth power, so
/// that few of them are alive at a time.
fn turn(lines: &mut Lines, plan: &Plan, (i, round): (usize, usize), direction: Direction, x: &mut [String]) {
    let times = if direction == Direction::Forward { "times" } else { "times_conj" };
    let at = plan.turns_at(direction == Direction::Inverse, i);
    let first = lines.value(&format!("turns[{at}u + {} % {}u]", butterfly(plan, i, round), plan.stride(i)));
    let mut powers = vec![String::new(), first.clone()];
    let (mut fourth, mut multiple) = (String::new(), String::new());
    for (j, x) in x.iter_mut().enumerate().skip(1) {
        let power = match (j, j % 4) {
            (1, _) => first.clone(),
            (2 | 3, _) => {
                powers.push(lines.value(&format!("times({}, {first})", powers[j - 1])));
                powers[j].clone()
            }
            (_, 0) => {
                multiple = match multiple.is_empty() {
                    true => lines.value(&format!("times({0}, {0})", powers[2])),
                    false => lines.value(&format!("times({multiple}, {fourth})")),
                };
                if fourth.is_empty() {
                    fourth.clone_from(&multiple);
                }
                multiple.clone()
            }
            (_, rest) => lines.value(&format!("times({multiple}, {})", powers[rest])),
        };
        *x = lines.value(&format!("{times}({x}, {power})"));
    }
}

/// Butterfly of a thread in a round of a stage. Threads without one repeat the last.
fn butterfly(plan: &Plan, stage: usize, round: usize) -> String {
    let (n, first) = (plan.butterflies(stage), round * plan.threads);
    if first + plan.threads > n { format!("min(lt + {first}u, {}u)", n - 1) } else { format!("(lt + {first}u)") }
}

/// Whether a thread has a butterfly in a round of a stage; `None`: every thread has one.
fn guard(plan: &Plan, stage: usize, round: usize) -> Option<String> {
    let (n, first) = (plan.butterflies(stage), round * plan.threads);
    (first + plan.threads > n).then(|| format!("lt + {first}u < {n}u"))
}
