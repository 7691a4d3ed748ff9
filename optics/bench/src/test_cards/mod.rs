//! Generated target pictures for demonstrations, tests and training sets, in place of photographs.
//!
//! A card is a continuous picture that a seed determines. It is sampled several times in each pixel. The unit of
//! coordinates is half the shorter side: x to the right, y down, (0, 0) in the middle. Cards are composed in
//! *tones* from 0 to 1, as the eye sees them, and rendered as linear light, tone^2.2. Their grey levels are therefore
//! distributed like those of photographs.

mod city;
mod flower;
mod glyphs;
mod landscape;
mod leaf;
mod noise;
mod planet;
mod portrait;
mod scene;
mod sea;
mod sky;
mod spheres;
mod technical;
mod vector;

use lightpath_optics::{Error, Plane, Result, interrupt};
use rayon::prelude::*;
use scene::{Frame, Scene};

/// A kind of generated picture. Each seed gives another picture of the kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TestCard {
    /// A head with light from the side.
    Portrait,
    /// Mountains behind a lake.
    Landscape,
    /// A ringed planet among stars.
    Planet,
    /// A flower with many petals.
    Flower,
    /// Balls on a chequered floor.
    Spheres,
    /// Cumulus clouds.
    Clouds,
    /// A veined leaf.
    Leaf,
    /// A skyline at night.
    City,
    /// Waves under a low sun.
    Sea,
    /// Lines of letters that get smaller.
    EyeChart,
    /// Grey steps, ramps and discs.
    Wedges,
    /// Groups of bars that get finer.
    ResolutionBars,
    /// A star with spokes that meet in the middle.
    SiemensStar,
    /// Rings that get finer towards the edge.
    Rings,
}

impl TestCard {
    /// All cards; those that look like photographs come first.
    pub const ALL: [Self; 14] = [
        Self::Portrait,
        Self::Landscape,
        Self::Planet,
        Self::Flower,
        Self::Spheres,
        Self::Clouds,
        Self::Leaf,
        Self::City,
        Self::Sea,
        Self::EyeChart,
        Self::Wedges,
        Self::ResolutionBars,
        Self::SiemensStar,
        Self::Rings,
    ];

    /// Smallest accepted side of a card \[px\]. Smaller pictures show no detail.
    pub const SIDE_PX_MIN: usize = 32;

    /// The name of the card in lower case with hyphens, fit for a file name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Portrait => "portrait",
            Self::Landscape => "landscape",
            Self::Planet => "planet",
            Self::Flower => "flower",
            Self::Spheres => "spheres",
            Self::Clouds => "clouds",
            Self::Leaf => "leaf",
            Self::City => "city",
            Self::Sea => "sea",
            Self::EyeChart => "eye-chart",
            Self::Wedges => "wedges",
            Self::ResolutionBars => "resolution-bars",
            Self::SiemensStar => "siemens-star",
            Self::Rings => "rings",
        }
    }

    /// Renders the card as linear light in [0, 1]. The same seed gives the same picture at any size.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] for a side below [`Self::SIDE_PX_MIN`].
    ///
    /// ```
    /// use lightpath_bench::TestCard;
    /// let target_intensity = TestCard::Planet.render(96, 160, 7)?;
    /// assert_eq!((target_intensity.height_px(), target_intensity.width_px()), (96, 160));
    /// # Ok::<(), lightpath_optics::Error>(())
    /// ```
    pub fn render(self, height_px: usize, width_px: usize, seed: u64) -> Result<Plane<f32>> {
        for (name, side_px) in [("height_px", height_px), ("width_px", width_px)] {
            if side_px < Self::SIDE_PX_MIN {
                return Err(Error::OutOfRange {
                    name,
                    value: side_px as f64,
                    allowed: "at least 32 px for a test card",
                });
            }
        }
        let half_px = height_px.min(width_px) as f32 / 2.0;
        let frame =
            Frame { half_width: width_px as f32 / 2.0 / half_px, half_height: height_px as f32 / 2.0 / half_px };
        let scene = self.scene(frame, seed);
        let samples = samples_per_side(height_px.min(width_px));
        let mut light = Plane::filled(height_px, width_px, 0.0_f32);
        light.values_mut().par_chunks_mut(width_px).enumerate().for_each(|(y, row)| {
            interrupt::check();
            for (x, value) in row.iter_mut().enumerate() {
                let tones = (0..samples * samples).map(|i| {
                    let at = |pixel: usize, sample: usize| pixel as f32 + (sample as f32 + 0.5) / samples as f32;
                    let x = at(x, i % samples) / half_px - frame.half_width;
                    let y = at(y, i / samples) / half_px - frame.half_height;
                    scene(x, y).clamp(0.0, 1.0).powf(2.2)
                });
                *value = tones.sum::<f32>() / (samples * samples) as f32;
            }
        });
        Ok(light)
    }

    fn scene(self, frame: Frame, seed: u64) -> Scene {
        match self {
            Self::Portrait => portrait::portrait(seed),
            Self::Landscape => landscape::landscape(seed),
            Self::Planet => planet::planet(seed),
            Self::Flower => flower::flower(seed),
            Self::Spheres => spheres::spheres(seed),
            Self::Clouds => sky::clouds(seed),
            Self::Leaf => leaf::leaf(seed),
            Self::City => city::city(seed),
            Self::Sea => sea::sea(seed),
            Self::EyeChart => glyphs::eye_chart(frame, seed),
            Self::Wedges => technical::wedges(frame, seed),
            Self::ResolutionBars => technical::resolution_bars(frame, seed),
            Self::SiemensStar => technical::siemens_star(frame, seed),
            Self::Rings => technical::rings(seed),
        }
    }
}

/// Samples along each side of a pixel. Small pictures need more samples to look smooth, and still render fast.
fn samples_per_side(short_side_px: usize) -> usize {
    match short_side_px {
        0..=199 => 4,
        200..=599 => 3,
        _ => 2,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seed_determines_each_card_at_any_size() {
        for card in TestCard::ALL {
            for (height_px, width_px) in [(32, 32), (45, 80), (61, 33)] {
                let light = card.render(height_px, width_px, 1).unwrap();
                assert_eq!(light, card.render(height_px, width_px, 1).unwrap(), "{}", card.name());
                assert!(light.values().iter().all(|value| (0.0..=1.0).contains(value)), "{}", card.name());
                assert_ne!(light, card.render(height_px, width_px, 2).unwrap(), "{}", card.name());
            }
        }
    }

    #[test]
    fn cards_have_broad_grey_levels_and_moderate_brightness() {
        for card in TestCard::ALL {
            for seed in 0..4 {
                let light = card.render(54, 96, seed).unwrap();
                let mut values = light.values().to_vec();
                values.sort_by(f32::total_cmp);
                let mean = values.iter().sum::<f32>() / values.len() as f32;
                let spread = values[values.len() * 95 / 100] - values[values.len() * 5 / 100];
                assert!((0.04..0.7).contains(&mean), "{} {seed}: mean {mean}", card.name());
                assert!(spread > 0.2, "{} {seed}: spread {spread}", card.name());
            }
        }
    }

    #[test]
    fn a_sample_on_the_horizon_is_drawn() {
        assert!(TestCard::Spheres.render(210, 240, 3).is_ok());
    }

    #[test]
    fn too_short_side_is_refused() {
        let error = TestCard::Rings.render(31, 64, 1).unwrap_err();
        assert_eq!(error.to_string(), "height_px is 31, but must be at least 32 px for a test card");
    }
}
