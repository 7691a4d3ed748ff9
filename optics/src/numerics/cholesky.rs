//! Cholesky factorization of a symmetric positive definite matrix: A = L Lᵀ.

/// The factor L of a matrix.
#[derive(Clone, Debug)]
pub(crate) struct Cholesky {
    /// Number of rows.
    n: usize,
    /// L, row after row; what lies above the diagonal is not used.
    lower: Vec<f64>,
}

impl Cholesky {
    /// Factorizes a matrix of `n` rows, given row after row; `None` if it is not positive definite.
    pub(crate) fn of(mut matrix: Vec<f64>, n: usize) -> Option<Self> {
        for j in 0..n {
            let row_j = &mut matrix[j * n..];
            let pivot = row_j[j] - row_j[..j].iter().map(|l| l * l).sum::<f64>();
            if pivot.is_nan() || pivot <= 0.0 {
                return None;
            }
            let root = pivot.sqrt();
            row_j[j] = root;
            let (row_j, below) = row_j.split_at_mut(n);
            for row in below.chunks_exact_mut(n) {
                let done: f64 = row[..j].iter().zip(&row_j[..j]).map(|(a, b)| a * b).sum();
                row[j] = (row[j] - done) / root;
            }
        }
        Some(Self { n, lower: matrix })
    }

    /// Solves A x = `right`.
    pub(crate) fn solve(&self, mut right: Vec<f64>) -> Vec<f64> {
        let (n, lower) = (self.n, &self.lower);
        for i in 0..n {
            let done: f64 = lower[i * n..][..i].iter().zip(&right).map(|(l, x)| l * x).sum();
            right[i] = (right[i] - done) / lower[i * n + i];
        }
        for i in (0..n).rev() {
            let done: f64 = (i + 1..n).map(|k| lower[k * n + i] * right[k]).sum();
            right[i] = (right[i] - done) / lower[i * n + i];
        }
        right
    }

    /// A⁻¹, row after row.
    pub(crate) fn inverse(&self) -> Vec<f64> {
        let unit = |i: usize| (0..self.n).map(|k| f64::from(u8::from(i == k))).collect();
        (0..self.n).flat_map(|i| self.solve(unit(i))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positive_definite_systems_are_solved() {
        let matrix = vec![4.0, 2.0, 0.4, 2.0, 5.0, 1.0, 0.4, 1.0, 3.0];
        let x = [1.0, -2.0, 0.5];
        let right = matrix.chunks_exact(3).map(|row| row.iter().zip(&x).map(|(a, x)| a * x).sum()).collect();
        let factor = Cholesky::of(matrix.clone(), 3).unwrap();
        let solved = factor.solve(right);
        assert!(solved.iter().zip(&x).all(|(a, b)| (a - b).abs() < 1e-12), "{solved:?}");
        let inverse = factor.inverse();
        for (i, k) in (0..9).map(|at| (at / 3, at % 3)) {
            let product: f64 = (0..3).map(|j| matrix[3 * i + j] * inverse[3 * j + k]).sum();
            assert!((product - f64::from(u8::from(i == k))).abs() < 1e-12, "{product} at {i}, {k}");
        }
        assert!(Cholesky::of(vec![1.0, 2.0, 2.0, 1.0], 2).is_none());
    }
}
