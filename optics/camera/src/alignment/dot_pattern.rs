//! Which dots of the grid are large, so that a photograph of them shows how the camera stands.
//!
//! ```text
//! A · · A · · ·      + is the middle of the grid. No turn, no mirror image and no shift of the six large dots brings
//! · · · · · · A      more than two of them together again.
//! · · · · · · ·
//! · · · + · · ·
//! A · · · · · ·
//! · · · · · A ·
//! · · A · · · ·
//! ```
//!
//! They lie away from the middle, where a display's undiffracted light may make a spot, and from the rim, which a
//! photograph may cut off.

/// Column and row of a dot, counted from the middle of the grid or from anywhere.
pub(super) type Place = (i32, i32);

/// Radius of a large dot relative to the other dots.
pub(super) const LARGE: f64 = 1.7;

/// The large dots that are displayed.
pub(super) const MARKS: [Place; 6] = [(-3, -3), (0, -3), (3, -2), (-3, 1), (2, 2), (-1, 3)];

/// The large dots of older calibration holograms, which people may have on their displays: an L.
const OLDER_MARKS: [Place; 3] = [(-1, 0), (1, 0), (-1, 1)];

/// The sets of large dots that a photograph may show.
pub(super) const PATTERNS: [&[Place]; 2] = [&MARKS, &OLDER_MARKS];

/// One of the eight ways in which a camera may stand: turned by quarter turns, and mirrored or not. The steps in the
/// display's grid that go with a step to the photograph's next column, and to its next row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Orientation {
    along_column: Place,
    along_row: Place,
}

impl Orientation {
    pub(super) fn all() -> impl Iterator<Item = Self> {
        let turns = [(1, 0), (0, 1), (-1, 0), (0, -1)];
        turns
            .into_iter()
            .flat_map(|(x, y)| [(-y, x), (y, -x)].map(|along_row| Self { along_column: (x, y), along_row }))
    }

    /// The step in the display's grid.
    pub(super) fn apply(self, (column, row): Place) -> Place {
        let (a, b) = (self.along_column, self.along_row);
        (a.0 * column + b.0 * row, a.1 * column + b.1 * row)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::{HashMap, HashSet};

    /// Most large dots that a turn, mirror image or shift of one pattern puts on those of another.
    fn together(a: &[Place], b: &[Place]) -> usize {
        let mut most = 0;
        for orientation in Orientation::all() {
            let mut shifts: HashMap<Place, usize> = HashMap::new();
            for (&p, q) in a.iter().flat_map(|p| b.iter().map(move |&q| (p, orientation.apply(q)))) {
                *shifts.entry((p.0 - q.0, p.1 - q.1)).or_default() += 1;
            }
            if a == b && orientation.apply((1, 2)) == (1, 2) {
                shifts.remove(&(0, 0));
            }
            most = most.max(shifts.into_values().max().unwrap());
        }
        most
    }

    #[test]
    fn patterns_are_unlike_all_their_images_and_each_other() {
        assert_eq!(Orientation::all().map(|o| (o.apply((1, 0)), o.apply((0, 1)))).collect::<HashSet<_>>().len(), 8);
        assert_eq!(together(&MARKS, &MARKS), 2);
        assert_eq!(together(&OLDER_MARKS, &OLDER_MARKS), 2);
        assert_eq!(together(&MARKS, &OLDER_MARKS), 1);
        assert!(MARKS.iter().all(|(x, y)| x.abs().max(y.abs()) >= 2), "a spot in the middle hides none");
    }
}
