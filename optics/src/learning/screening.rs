//! Leaves out pairs whose photographs do not show their holograms.
//!
//! If a photograph shows another hologram, it hardly correlates with the light that a model predicts: its correlation
//! is far below that of the other pairs, which are predicted about equally well. Every pixel is compared, with the best
//! model available. This is the last check of the pairs, after any checks made when they were collected.

use crate::error::Error;

/// Fewest pairs among which an outlier can be recognized; fewer pairs are all kept.
const PAIRS_MIN: usize = 4;
/// Largest share of the pairs that is left out. With a larger share of outliers it is unclear which pairs are wrong,
/// and all are kept.
const SHARE_MAX: f64 = 0.34;
/// Least median correlation. Below it, the photographs have nothing to do with the predicted light.
const CORRELATION_MIN: f64 = 0.05;
/// A pair whose correlation is at least this part of the median is always kept: it is hard to predict, but not wrong.
const PART_OF_MEDIAN: f64 = 0.6;
/// Number of standard deviations below the median beyond which a pair is an outlier. A normally distributed number
/// deviates so far with a probability of 2e-9, to either side.
const DEVIATIONS: f64 = 6.0;

/// Display model that predicts the light when pairs are screened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Predictor {
    /// The ideal display, because nothing has been learned yet.
    Ideal,
    /// A rough model of the display: the result of Adam, or the model of a warm start.
    Rough,
}

impl Predictor {
    /// Deviation below the median that is always allowed, even if the other correlations scatter less.
    fn deviation_allowed(self) -> f64 {
        match self {
            Self::Ideal => 0.3,
            Self::Rough => 0.15,
        }
    }
}

/// Indices of the pairs to keep, given the correlation of each photograph with the predicted light.
///
/// # Errors
///
/// [`Error::Unrelated`] when the median correlation is too low: most photographs do not show their holograms.
pub(super) fn pairs_to_keep(correlations: &[f64], predictor: Predictor) -> Result<Vec<usize>, Error> {
    let middle = median(correlations.to_vec());
    if middle < CORRELATION_MIN {
        return Err(Error::Unrelated { correlation: middle });
    }
    let all = 0..correlations.len();
    if all.len() < PAIRS_MIN {
        return Ok(all.collect());
    }
    // The median absolute deviation of normally distributed numbers is 0.674 of their standard deviation.
    let deviation = median(correlations.iter().map(|c| (c - middle).abs()).collect()) / 0.674;
    let lowest = (middle - predictor.deviation_allowed().max(DEVIATIONS * deviation)).min(PART_OF_MEDIAN * middle);
    let mut kept: Vec<usize> = all.clone().filter(|&i| correlations[i] >= lowest).collect();
    if ((all.len() - kept.len()) as f64) > SHARE_MAX * all.len() as f64 {
        kept = all.collect();
    }
    Ok(kept)
}

/// The median; 0 without values.
pub(super) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let half = values.len() / 2;
    match values.len() {
        0 => 0.0,
        len if len % 2 == 1 => values[half],
        _ => (values[half - 1] + values[half]) / 2.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pair_with_far_lower_correlation_is_left_out() {
        let found = pairs_to_keep(&[0.8, 0.75, 0.1, 0.7, 0.82, 0.78], Predictor::Ideal).unwrap();
        assert_eq!(found, [0, 1, 3, 4, 5]);
    }

    #[test]
    fn pairs_with_ordinary_scatter_are_all_kept() {
        for correlations in [[0.5, 0.8, 0.6, 0.9], [0.97, 0.99, 0.7, 0.98], [0.3, 0.5, 0.2, 0.4]] {
            assert_eq!(pairs_to_keep(&correlations, Predictor::Rough).unwrap(), [0, 1, 2, 3], "{correlations:?}");
        }
        assert_eq!(
            pairs_to_keep(&[0.9, 0.1], Predictor::Rough).unwrap(),
            [0, 1],
            "two pairs are too few to recognize an outlier"
        );
    }

    #[test]
    fn photographs_of_other_holograms_are_refused() {
        let error = pairs_to_keep(&[0.01, -0.02, 0.03, 0.0], Predictor::Ideal).unwrap_err();
        assert!(error.to_string().contains("do not match their holograms"), "{error}");
    }
}
