//! Text of a discrete Fourier transform in the registers of one thread.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::fmt::Write as _;

/// Direction of a transform: the sign of its exponent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Direction {
    /// Σ_j x_j e^{−2πi jk/n}
    Forward,
    /// Σ_j x_j e^{+2πi jk/n}, without a factor
    Inverse,
}

impl Direction {
    fn sign(self) -> f64 {
        match self {
            Self::Forward => -1.0,
            Self::Inverse => 1.0,
        }
    }

    /// Function that multiplies by −i or i.
    fn quarter_turn(self) -> &'static str {
        match self {
            Self::Forward => "turned_back",
            Self::Inverse => "turned",
        }
    }
}

/// Lines of a function, with a new name for each value.
#[derive(Debug, Default)]
pub(crate) struct Lines {
    pub(crate) text: String,
    names: usize,
}

impl Lines {
    /// Adds a line.
    pub(crate) fn line(&mut self, line: &str) {
        self.text.push_str("  ");
        self.text.push_str(line);
        self.text.push('\n');
    }

    /// Adds a value, and returns its name.
    pub(crate) fn value(&mut self, expression: &str) -> String {
        self.names += 1;
        let name = format!("v{}", self.names);
        self.line(&format!("let {name} = {expression};"));
        name
    }

    /// The value times e^{i angle}.
    fn rotated(&mut self, value: &str, angle: f64) -> String {
        let quarters = angle / FRAC_PI_2;
        if (quarters - quarters.round()).abs() > 1e-9 {
            return self.value(&format!("times({value}, vec2f({}, {}))", number(angle.cos()), number(angle.sin())));
        }
        match (quarters.round() as i64).rem_euclid(4) {
            0 => value.to_owned(),
            1 => self.value(&format!("turned({value})")),
            2 => self.value(&format!("-{value}")),
            _ => self.value(&format!("turned_back({value})")),
        }
    }

    /// Transforms values in natural order.
    pub(crate) fn transform(&mut self, x: &[String], direction: Direction) -> Vec<String> {
        match x.len() {
            0 | 1 => x.to_vec(),
            2 => vec![self.value(&format!("{} + {}", x[0], x[1])), self.value(&format!("{} - {}", x[0], x[1]))],
            4 => self.transform_four(x, direction),
            3 | 5 | 7 | 11 | 13 => self.transform_prime(x, direction),
            n => self.transform_product(x, if n.is_multiple_of(4) { 4 } else { smallest_factor(n) }, direction),
        }
    }

    fn transform_four(&mut self, x: &[String], direction: Direction) -> Vec<String> {
        let a = self.value(&format!("{} + {}", x[0], x[2]));
        let b = self.value(&format!("{} - {}", x[0], x[2]));
        let c = self.value(&format!("{} + {}", x[1], x[3]));
        let d = self.value(&format!("{}({} - {})", direction.quarter_turn(), x[1], x[3]));
        [format!("{a} + {c}"), format!("{b} + {d}"), format!("{a} - {c}"), format!("{b} - {d}")]
            .map(|sum| self.value(&sum))
            .to_vec()
    }

    /// Odd primes: values of opposite places have one cosine, and opposite sines.
    fn transform_prime(&mut self, x: &[String], direction: Direction) -> Vec<String> {
        let (n, half) = (x.len(), x.len() / 2);
        let (mut sums, mut differences) = (Vec::new(), Vec::new());
        for j in 1..=half {
            sums.push(self.value(&format!("{} + {}", x[j], x[n - j])));
            differences.push(self.value(&format!("{}({} - {})", direction.quarter_turn(), x[j], x[n - j])));
        }
        let first = self.value(&format!("{} + {}", x[0], sums.join(" + ")));
        let mut y = vec![first; n];
        for k in 1..=half {
            let (mut even, mut odd) = (x[0].clone(), String::new());
            for j in 1..=half {
                let angle = TAU * (j * k % n) as f64 / n as f64;
                let _ = write!(even, " + {} * {}", sums[j - 1], number(angle.cos()));
                let plus = if j > 1 { " + " } else { "" };
                let _ = write!(odd, "{plus}{} * {}", differences[j - 1], number(angle.sin()));
            }
            let (even, odd) = (self.value(&even), self.value(&odd));
            y[k] = self.value(&format!("{even} + {odd}"));
            y[n - k] = self.value(&format!("{even} - {odd}"));
        }
        y
    }

    /// n = a·b: b transforms of a values each, turned, then a transforms of b values.
    fn transform_product(&mut self, x: &[String], a: usize, direction: Direction) -> Vec<String> {
        let (n, b) = (x.len(), x.len() / a);
        let inner: Vec<Vec<String>> = (0..b)
            .map(|j| {
                let every: Vec<_> = (0..a).map(|i| x[b * i + j].clone()).collect();
                self.transform(&every, direction)
            })
            .collect();
        let mut y = vec![String::new(); n];
        for k in 0..a {
            let turned: Vec<_> = (0..b)
                .map(|j| self.rotated(&inner[j][k], direction.sign() * TAU * (j * k) as f64 / n as f64))
                .collect();
            for (l, value) in self.transform(&turned, direction).into_iter().enumerate() {
                y[k + a * l] = value;
            }
        }
        y
    }
}

fn smallest_factor(n: usize) -> usize {
    (2..n).find(|&factor| n.is_multiple_of(factor)).unwrap_or(n)
}

/// A number as WGSL, in parentheses so that its sign may follow an operator.
pub(crate) fn number(value: f64) -> String {
    format!("({value:.9e}f)")
}
