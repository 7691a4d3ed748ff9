//! Linear least squares with a few unknowns.

/// Normal equations Aᵀ W A x = Aᵀ W b of a few unknowns, built from rows of A.
#[derive(Clone, Debug)]
pub struct NormalEquations<const N: usize> {
    matrix: [[f64; N]; N],
    right: [f64; N],
}

/// Smallest pivot relative to the largest entry. With a smaller pivot the equations have no unique solution.
const PIVOT_MIN: f64 = 1e-12;

impl<const N: usize> NormalEquations<N> {
    /// No equations.
    #[must_use]
    pub fn none() -> Self {
        Self { matrix: [[0.0; N]; N], right: [0.0; N] }
    }

    /// Adds the equation `row · x = value` with a weight.
    pub fn add(&mut self, row: &[f64; N], value: f64, weight: f64) {
        for (i, a) in row.iter().enumerate() {
            for (j, b) in row.iter().enumerate() {
                self.matrix[i][j] += weight * a * b;
            }
            self.right[i] += weight * a * value;
        }
    }

    /// Whether any equation contains an unknown.
    pub fn contains(&self, unknown: usize) -> bool {
        self.matrix[unknown][unknown] > 0.0
    }

    /// Adds all equations of another system.
    pub fn add_all(&mut self, other: &Self) {
        for (row, others) in self.matrix.iter_mut().zip(&other.matrix) {
            row.iter_mut().zip(others).for_each(|(entry, other)| *entry += other);
        }
        self.right.iter_mut().zip(&other.right).for_each(|(entry, other)| *entry += other);
    }

    /// The system that keeps the first `count` unknowns nearer to 0: their diagonal entries are 1 + `damping` times as
    /// large (Marquardt 1963). Unknowns that no equation contains become 0.
    pub fn damped(mut self, count: usize, damping: f64) -> Self {
        for i in 0..N {
            let entry = &mut self.matrix[i][i];
            if *entry == 0.0 {
                *entry = 1.0;
            } else if i < count {
                *entry *= 1.0 + damping;
            }
        }
        self
    }

    /// Entry of the inverse of Aᵀ W A on the diagonal: the variance of an unknown if every equation of weight 1 has
    /// variance 1. `None` if the equations have no unique solution.
    pub fn inverse_at(&self, unknown: usize) -> Option<f64> {
        let mut unit = Self { right: [0.0; N], ..self.clone() };
        unit.right[unknown] = 1.0;
        Some(unit.solve()?[unknown])
    }

    /// Solves the equations by Gaussian elimination with partial pivoting; `None` if they have no unique solution.
    pub fn solve(mut self) -> Option<[f64; N]> {
        let largest = self.matrix.as_flattened().iter().fold(0.0_f64, |most, entry| most.max(entry.abs()));
        for column in 0..N {
            let pivot =
                (column..N).max_by(|&a, &b| self.matrix[a][column].abs().total_cmp(&self.matrix[b][column].abs()))?;
            // This also refuses NaN.
            if self.matrix[pivot][column].abs() <= PIVOT_MIN * largest || !largest.is_finite() || largest == 0.0 {
                return None;
            }
            self.matrix.swap(column, pivot);
            self.right.swap(column, pivot);
            for row in column + 1..N {
                let factor = self.matrix[row][column] / self.matrix[column][column];
                for k in column..N {
                    self.matrix[row][k] -= factor * self.matrix[column][k];
                }
                self.right[row] -= factor * self.right[column];
            }
        }
        let mut solution = [0.0; N];
        for row in (0..N).rev() {
            let known: f64 = (row + 1..N).map(|k| self.matrix[row][k] * solution[k]).sum();
            solution[row] = (self.right[row] - known) / self.matrix[row][row];
        }
        solution.iter().all(|value| value.is_finite()).then_some(solution)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn consistent_system_is_solved_and_singular_system_refused() {
        let truth = [1.5, -2.0, 0.25];
        let rows = [[1.0, 2.0, 3.0], [0.0, 1.0, -1.0], [4.0, 0.5, 0.0], [1.0, 1.0, 1.0]];
        let mut equations = NormalEquations::none();
        for row in &rows {
            equations.add(row, row.iter().zip(truth).map(|(a, x)| a * x).sum(), 0.7);
        }
        let solution = equations.solve().unwrap();
        assert!(solution.iter().zip(truth).all(|(a, b)| (a - b).abs() < 1e-12), "{solution:?}");
        let mut equations = NormalEquations::none();
        for _ in 0..4 {
            equations.add(&[1.0, 1.0], 1.0, 1.0);
            equations.add(&[1.0, -1.0], 1.0, 1.0);
        }
        assert!((equations.inverse_at(1).unwrap() - 0.125).abs() < 1e-12);
        let mut equations = NormalEquations::none();
        equations.add(&[1.0, 1.0], 1.0, 1.0);
        assert_eq!(equations.solve(), None);
    }
}
