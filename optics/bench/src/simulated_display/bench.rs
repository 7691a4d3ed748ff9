//! Properties of a simulated bench.

use super::modes;
use lightpath_optics::{Error, Result};
use serde::{Deserialize, Serialize};

/// Properties of a simulated bench. A property that is left out has the value of [`Self::FAIR`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SimulatedBench {
    /// Seed of the random numbers. The same seed and properties give the same bench.
    pub seed: u64,
    /// Scale of every optical imperfection, 0 to 4. 1 is a display in need of alignment, 0 a perfect one.
    pub strength: f64,
    /// Standard deviation of the camera's read noise, as a part of its full scale, 0 to 0.1.
    pub camera_noise: f64,
    /// Largest shift of the camera in x and in y \[px\], 0 to 4.
    pub misalignment_px: f64,
    /// Rotation of the camera about the middle of the image \[rad\], −0.175 to 0.175, which is 10°.
    pub rotation_rad: f64,
    /// Standard deviation of the blur by the camera's lens \[px\], 0 to 4.
    pub blur_px: f64,
    /// Number of electrons of a camera pixel at full scale, which determines the shot noise, 0 to 10⁷. With 0 the shot
    /// noise at full scale equals the read noise, so the total noise there is √2 times that of a dark pixel.
    pub full_well_electrons: f64,
    /// Nonlinearity c of the camera's response, −0.3 to 0.3: light I in full scales gives the signal I + c·I·(1 − I).
    /// The largest deviation is c/4 of full scale, at half of it. The linearity error of EMVA Standard 1288 (Release
    /// 4.0 Linear, 2021) is such a deviation from a straight line: that of machine vision cameras is below some
    /// percent, so c is within ±0.1. Pictures for viewing have the curve of sRGB (IEC 61966-2-1), far beyond this
    /// range.
    pub camera_nonlinearity: f64,
    /// Contrast of a fixed speckle pattern from dust and coatings, 0 to 0.5.
    pub speckle_contrast: f64,
    /// Cross-talk of the modulator: standard deviation of the blur of its phase along x \[px\], 0 to 2. The phase is
    /// blurred after it is wrapped, as fringing fields blur it, so jumps from 2π to 0 become slopes.
    pub crosstalk_px: f64,
    /// Cross-talk along y \[px\], 0 to 2. Liquid crystals blur more along one axis (S. Moser, M. Ritsch-Marte and G.
    /// Thalhammer, Optics Express 27, 25046 (2019)).
    pub crosstalk_y_px: f64,
    /// Height of the modulator's uneven surface from peak to valley \[waves\], 0 to 8.
    pub surface_waves: f64,
    /// Largest relative change of the modulator's phase over its area, 0 to 0.5.
    pub response_variation: f64,
    /// Contrast of a fixed structure of dust and fringes in the amplitude of the light on the modulator, 0 to 0.5.
    pub dust_contrast: f64,
    /// Light of a ghost: a shifted and defocused second image, as a part of the image's light, 0 to 0.3.
    pub ghost_share: f64,
    /// Angular width of the source as the modulator sees it \[rad\], 0 to 0.005. The light of different directions does
    /// not interfere.
    pub source_angle_rad: f64,
    /// Width of the source's line, full width at half maximum, as a part of its wavelength, 0 to 0.1: below 0.001 for
    /// a laser diode, 0.03 to 0.06 for an LED.
    pub bandwidth: f64,
    /// Distortion by the camera's lens: displacement of the image's corner, as a part of its distance from the middle,
    /// −0.1 to
    /// 0.1.
    pub distortion: f64,
    /// Part of the light that the camera's lens loses at the image's corner, 0 to 0.9.
    pub vignetting: f64,
    /// Flicker of the modulator: relative amplitude by which its phase swings while the shutter is open, 0 to 0.5.
    pub flicker: f64,
    /// Drift of the image in an hour \[px\], 0 to 100.
    pub drift_px_per_hour: f64,
    /// Part of its light that the source loses in an hour, 0 to 1.
    pub dimming_per_hour: f64,
    /// Angle between the camera's rail and the optical axis \[rad\], 0 to 0.0875, which is 5°. The image moves sideways
    /// by tan of the angle times the distance.
    pub rail_tilt_rad: f64,
    /// Distance for which the aberrations are drawn, 0 to 10 m. At other distances, the part of their aperture that the
    /// light fills is proportional to the distance. With 0 the aberrations are the same at all distances.
    pub aberrations_at_m: f64,
    /// Size of the aberrations that depend on the position on the modulator: the largest phase that they add to any
    /// pixel's light at the corner of the band, 0 to 6 rad.
    pub field_aberration_rad: f64,
}

impl SimulatedBench {
    /// A display in need of alignment, with a good camera in the right place.
    pub const FAIR: Self = Self {
        seed: 0,
        strength: 1.0,
        camera_noise: 0.003,
        misalignment_px: 0.0,
        rotation_rad: 0.0,
        blur_px: 0.0,
        full_well_electrons: 0.0,
        camera_nonlinearity: 0.0,
        speckle_contrast: 0.0,
        crosstalk_px: 0.0,
        crosstalk_y_px: 0.0,
        surface_waves: 0.0,
        response_variation: 0.0,
        dust_contrast: 0.0,
        ghost_share: 0.0,
        source_angle_rad: 0.0,
        bandwidth: 0.0,
        distortion: 0.0,
        vignetting: 0.0,
        flicker: 0.0,
        drift_px_per_hour: 0.0,
        dimming_per_hour: 0.0,
        rail_tilt_rad: 0.0,
        aberrations_at_m: 0.0,
        field_aberration_rad: 0.0,
    };

    /// A display like that of the paper (Kavaklı, Ürey and Akşit 2022), as far as its published photographs show:
    /// holograms made as the paper made them give photographs with a similar PSNR and speckle contrast. What the
    /// photographs can not tell apart has values from the literature: surface and cross-talk of a liquid crystal on
    /// silicon, see the other fields, and a laser.
    pub const LIKE_THE_PAPER: Self = Self {
        seed: 2022,
        strength: 1.0,
        camera_noise: 0.01,
        misalignment_px: 0.5,
        rotation_rad: 0.05_f64.to_radians(),
        blur_px: 0.5,
        full_well_electrons: 10_000.0,
        crosstalk_px: 0.35,
        crosstalk_y_px: 0.25,
        surface_waves: 1.0,
        response_variation: 0.05,
        dust_contrast: 0.1,
        ghost_share: 0.02,
        flicker: 0.03,
        ..Self::FAIR
    };

    /// For each property: its name, its value, its least and largest allowed value, and the allowed range in words.
    #[must_use]
    pub fn ranges(&self) -> [(&'static str, f64, f64, f64, &'static str); 24] {
        [
            ("strength", self.strength, 0.0, 4.0, "0 to 4"),
            ("camera_noise", self.camera_noise, 0.0, 0.1, "0 to 0.1"),
            ("misalignment_px", self.misalignment_px, 0.0, 4.0, "0 to 4 px"),
            ("rotation_rad", self.rotation_rad, -0.175, 0.175, "-0.175 to 0.175 rad, which is 10°"),
            ("blur_px", self.blur_px, 0.0, 4.0, "0 to 4 px"),
            ("full_well_electrons", self.full_well_electrons, 0.0, 1e7, "0 to 10000000"),
            ("camera_nonlinearity", self.camera_nonlinearity, -0.3, 0.3, "-0.3 to 0.3"),
            ("speckle_contrast", self.speckle_contrast, 0.0, 0.5, "0 to 0.5"),
            ("crosstalk_px", self.crosstalk_px, 0.0, 2.0, "0 to 2 px"),
            ("crosstalk_y_px", self.crosstalk_y_px, 0.0, 2.0, "0 to 2 px"),
            ("surface_waves", self.surface_waves, 0.0, 8.0, "0 to 8 waves"),
            ("response_variation", self.response_variation, 0.0, 0.5, "0 to 0.5"),
            ("dust_contrast", self.dust_contrast, 0.0, 0.5, "0 to 0.5"),
            ("ghost_share", self.ghost_share, 0.0, 0.3, "0 to 0.3"),
            ("source_angle_rad", self.source_angle_rad, 0.0, 5e-3, "0 to 0.005 rad"),
            ("bandwidth", self.bandwidth, 0.0, 0.1, "0 to 0.1"),
            ("distortion", self.distortion, -0.1, 0.1, "-0.1 to 0.1"),
            ("vignetting", self.vignetting, 0.0, 0.9, "0 to 0.9"),
            ("flicker", self.flicker, 0.0, 0.5, "0 to 0.5"),
            ("drift_px_per_hour", self.drift_px_per_hour, 0.0, 100.0, "0 to 100 px"),
            ("dimming_per_hour", self.dimming_per_hour, 0.0, 1.0, "0 to 1"),
            ("rail_tilt_rad", self.rail_tilt_rad, 0.0, 0.0875, "0 to 0.0875 rad, which is 5°"),
            ("aberrations_at_m", self.aberrations_at_m, 0.0, 10.0, "0 to 10 m"),
            ("field_aberration_rad", self.field_aberration_rad, 0.0, 6.0, "0 to 6 rad"),
        ]
    }

    /// Number of modes of light that do not interfere. Each takes a transfer function, and an image for each
    /// photograph.
    #[must_use]
    pub fn modes(&self) -> usize {
        modes::draw(self.seed, self.source_angle_rad, self.bandwidth, self.ghost_share).len()
    }

    /// # Errors
    ///
    /// [`Error::OutOfRange`] for a property outside its range.
    pub fn validate(&self) -> Result<()> {
        for (name, value, least, most, allowed) in self.ranges() {
            if !(least..=most).contains(&value) {
                return Err(Error::OutOfRange { name, value, allowed });
            }
        }
        Ok(())
    }
}

impl Default for SimulatedBench {
    fn default() -> Self {
        Self::FAIR
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn missing_bench_properties_have_defaults_and_unknown_ones_are_refused() {
        let bench = SimulatedBench { seed: 7, ..SimulatedBench::FAIR };
        let stored = json!({
            "seed": 7, "strength": 1.0, "camera_noise": 0.003, "misalignment_px": 0.0, "rotation_rad": 0.0,
            "blur_px": 0.0, "full_well_electrons": 0.0, "speckle_contrast": 0.0, "crosstalk_px": 0.0, "flicker": 0.0,
            "drift_px_per_hour": 0.0, "dimming_per_hour": 0.0, "rail_tilt_rad": 0.0, "aberrations_at_m": 0.0,
            "field_aberration_rad": 0.0, "crosstalk_y_px": 0.0, "surface_waves": 0.0, "response_variation": 0.0,
            "dust_contrast": 0.0, "ghost_share": 0.0, "source_angle_rad": 0.0, "bandwidth": 0.0, "distortion": 0.0,
            "vignetting": 0.0, "camera_nonlinearity": 0.0,
        });
        assert_eq!(serde_json::to_value(bench).unwrap(), stored);
        assert_eq!(serde_json::from_value::<SimulatedBench>(stored).unwrap(), bench);
        let drawn: SimulatedBench = serde_json::from_value(json!({"seed": 3, "blur_px": 0.5})).unwrap();
        assert_eq!(drawn, SimulatedBench { seed: 3, blur_px: 0.5, ..SimulatedBench::FAIR });
        assert!(serde_json::from_value::<SimulatedBench>(json!({"blur": 0.5})).is_err());
    }
}
