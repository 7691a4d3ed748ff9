//! What a photograph of a hologram is expected to show, with the error of the model that predicts it.
//!
//! A hologram that was optimized through a model is judged too well by that model: the optimization uses every error of the
//! model, and a photograph has these errors and the camera's noise besides. Test photographs say how large they are.
//!
//! ```text
//! e = e_p + g² L,   PSNR = −10 log₁₀ e,   σ = s g² L / e
//! ```
//!
//! e_p is the mean squared error of the prediction against the target (light, peak 1), L the loss of the test photographs
//! (mean squared error, 1 at the camera's full scale), g the factor from a photograph with their exposure to the target.
//! The errors of the prediction and of the model add up as if they were independent. s was measured on simulated benches:
//! `docs/decisions/0091-expected-in-a-photograph.md`.

use serde::{Deserialize, Serialize};

/// Root mean square difference s between the PSNR of photographs and of this rule, where the error of the model decides
/// \[dB\].
const MODEL_ERROR_STD_DB: f64 = 1.5;

/// The PSNR that a photograph is expected to have, after its black level is subtracted, with the best gain.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExpectedPsnr {
    /// The PSNR \[dB\].
    pub psnr_db: f64,
    /// One standard deviation \[dB\].
    pub std_db: f64,
}

impl ExpectedPsnr {
    /// The PSNR of a photograph for that of a prediction \[dB\], the loss of the model on its test photographs, and the
    /// factor from a photograph to the target.
    #[must_use]
    pub fn of(predicted_db: f64, test_loss: f64, gain: f64) -> Self {
        let of_model = gain * gain * test_loss;
        let error = 10.0_f64.powf(-predicted_db / 10.0) + of_model;
        Self { psnr_db: -10.0 * error.log10(), std_db: MODEL_ERROR_STD_DB * of_model / error }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_larger_error_decides_and_only_that_of_the_model_is_uncertain() {
        let certain = ExpectedPsnr::of(20.0, 1e-8, 2.0);
        assert!((certain.psnr_db - 20.0).abs() < 1e-4 && certain.std_db < 1e-4, "{certain:?}");
        let uncertain = ExpectedPsnr::of(80.0, 2.5e-4, 2.0);
        assert!((uncertain.psnr_db - 30.0).abs() < 1e-3, "{uncertain:?}");
        assert!((uncertain.std_db - MODEL_ERROR_STD_DB).abs() < 1e-3, "{uncertain:?}");
        let both = ExpectedPsnr::of(30.0, 1e-3, 1.0);
        assert!(
            (both.psnr_db - 26.99).abs() < 0.01 && (both.std_db - MODEL_ERROR_STD_DB / 2.0).abs() < 1e-9,
            "{both:?}"
        );
    }
}
