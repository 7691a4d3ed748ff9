//! Photographs that are not of their holograms.
//!
//! Of a photograph of another hologram the light that a model foretells knows nothing: their correlation falls far below that of
//! the other pairs, whose light is foretold about equally well. What is looked at is every pixel, through the best model at hand:
//! this is the last look at pairs, whatever was checked when they were brought together.

use crate::Error;

/// With fewer pairs than this, none can be told from the others.
const PAIRS_MIN: usize = 4;
/// Largest share of the pairs that is left out: with more of them wrong, nobody knows which ones.
const SHARE_MAX: f64 = 0.34;
/// Below this, the light that the ideal display would show has nothing to do with the photographs.
const CORRELATION_MIN: f64 = 0.05;
/// A pair whose correlation is this part of the median is hard to foretell, but not of something else.
const PART_OF_MEDIAN: f64 = 0.6;
/// Deviations from the median beyond which a pair stands apart: of normal ones, one in 50 000.
const DEVIATIONS: f64 = 6.0;

/// What is known of the display.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Knowledge {
    /// Nothing yet: light is foretold for an ideal one.
    Ideal,
    /// What the first part of learning found.
    Rough,
}

impl Knowledge {
    /// How far below the median a correlation may be, whatever the others do.
    fn tolerated(self) -> f64 {
        match self {
            Self::Ideal => 0.3,
            Self::Rough => 0.15,
        }
    }
}

/// The pairs that count, by the correlations of their photographs with the light that was foretold.
///
/// # Errors
///
/// [`Error::Unrelated`] when most of the photographs are of something else.
pub(super) fn kept(correlations: &[f64], knowledge: Knowledge) -> Result<Vec<usize>, Error> {
    let middle = median(correlations.to_vec());
    if middle < CORRELATION_MIN {
        return Err(Error::Unrelated { correlation: middle });
    }
    let all = 0..correlations.len();
    if all.len() < PAIRS_MIN {
        return Ok(all.collect());
    }
    // The median deviation of normal numbers is 0.674 of their standard deviation.
    let deviation = median(correlations.iter().map(|c| (c - middle).abs()).collect()) / 0.674;
    let lowest = (middle - knowledge.tolerated().max(DEVIATIONS * deviation)).min(PART_OF_MEDIAN * middle);
    let mut kept: Vec<usize> = all.clone().filter(|&i| correlations[i] >= lowest).collect();
    if ((all.len() - kept.len()) as f64) > SHARE_MAX * all.len() as f64 {
        kept = all.collect();
    }
    Ok(kept)
}

fn median(mut values: Vec<f64>) -> f64 {
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
    fn a_pair_far_below_the_others_is_left_out() {
        let found = kept(&[0.8, 0.75, 0.1, 0.7, 0.82, 0.78], Knowledge::Ideal).unwrap();
        assert_eq!(found, [0, 1, 3, 4, 5]);
    }

    #[test]
    fn pairs_that_differ_as_pairs_do_are_all_kept() {
        for correlations in [[0.5, 0.8, 0.6, 0.9], [0.97, 0.99, 0.7, 0.98], [0.3, 0.5, 0.2, 0.4]] {
            assert_eq!(kept(&correlations, Knowledge::Rough).unwrap(), [0, 1, 2, 3], "{correlations:?}");
        }
        assert_eq!(kept(&[0.9, 0.1], Knowledge::Rough).unwrap(), [0, 1], "of two, nobody knows which");
    }

    #[test]
    fn photographs_of_other_holograms_are_refused() {
        let error = kept(&[0.01, -0.02, 0.03, 0.0], Knowledge::Ideal).unwrap_err();
        assert!(error.to_string().contains("other holograms"), "{error}");
    }
}
