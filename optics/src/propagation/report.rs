//! Reports of how valid a method is for a setup, in numbers.

use super::quantity::{digits, length, percent};
use super::scaled::spread_m;
use super::scaled_fresnel::farthest_m;
use super::shifted::{frequency_landing_at, landing_m};
use super::{fraunhofer, fresnel_transfer_function};
use crate::display::{DisplayModel, ImageWindow, KernelShape, OpticalSetup};
use crate::propagation_method::PropagationMethod;
use serde::{Deserialize, Serialize};
use std::fmt;

/// A propagation method for a setup, its quality there, and warnings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ValidityReport {
    /// The method that the report is about.
    pub method: PropagationMethod,
    /// Why this method was chosen, as text for people.
    pub explanation: String,
    /// Positions of the samples of the image.
    pub window: ImageWindow,
    /// Critical distance z_c = 2·width·Δ²/λ along x \[m\]. Up to z_c the padded frame samples the whole band.
    pub critical_distance_x_m: f64,
    /// Critical distance z_c = 2·height·Δ²/λ along y \[m\].
    pub critical_distance_y_m: f64,
    /// Part of the pixels' band along fx whose light lands in the window, 0 to 1.
    pub band_kept_x: f64,
    /// Part of the pixels' band along fy whose light lands in the window, 0 to 1.
    pub band_kept_y: f64,
    /// Part of the area of the pixels' band (fx, fy) whose light lands in the window, 0 to 1.
    pub band_kept_area: f64,
    /// Fresnel number a²/(λz), with a half of the display's longer side. Below 1 the image is in the far field.
    pub fresnel_number: f64,
    /// Steepest angle θ at which the pixels send light \[rad\]: sin θ = λ/2Δ. It is π/2 for pixels finer than λ/2.
    pub diffraction_angle_rad: f64,
    /// Sideways distance |z| tan θ that the steepest light moves \[m\]. `None`: θ = π/2, and the distance has no bound.
    pub spread_m: Option<f64>,
    /// Width \[m\] of the middle region of the image whose points receive light at every angle that the pixels send. 0:
    /// the image has no such point.
    pub full_cone_x_m: f64,
    /// Height \[m\] of the middle region of the image whose points receive light at every angle that the pixels send.
    /// 0: the image has no such point.
    pub full_cone_y_m: f64,
    /// Largest phase error of a paraxial method \[rad\]; 0 for methods that are not paraxial.
    pub neglected_phase_rad: f64,
    /// Limitations of the method for this setup.
    pub warnings: Vec<PropagationWarning>,
}

/// A limitation of a method for a setup.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PropagationWarning {
    /// The kind of limitation, for programs.
    pub code: WarningCode,
    /// The limitation in words, with numbers.
    pub text: String,
}

/// The kinds of limitation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
pub enum WarningCode {
    /// Part of the light misses the window. The image lacks the finest details.
    BandLimited,
    /// The sharp ends of the band limit cause ringing in the image.
    SharpBandLimit,
    /// Light that leaves the padded frame comes back into it.
    WrapAround,
    /// The errors of a learned kernel act on the padded frame, into which a little light comes back.
    KernelWrapAround,
    /// The impulse response fades out before the end of the frame.
    ShortImpulseResponse,
    /// The window resolves few points.
    FewPoints,
    /// The phase of a paraxial method has an error.
    Paraxial,
    /// The pixels are finer than half a wavelength. Part of their light does not propagate.
    Evanescent,
}

impl WarningCode {
    /// The stable name of the code, in capitals.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::BandLimited => "BAND_LIMITED",
            Self::SharpBandLimit => "SHARP_BAND_LIMIT",
            Self::WrapAround => "WRAP_AROUND",
            Self::KernelWrapAround => "KERNEL_WRAP_AROUND",
            Self::ShortImpulseResponse => "SHORT_IMPULSE_RESPONSE",
            Self::FewPoints => "FEW_POINTS",
            Self::Paraxial => "PARAXIAL",
            Self::Evanescent => "EVANESCENT",
        }
    }
}

impl fmt::Display for ValidityReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}: {}", self.method, self.explanation)?;
        let (x_m, y_m) = (length(self.critical_distance_x_m), length(self.critical_distance_y_m));
        writeln!(f, "critical distance {x_m} along x, {y_m} along y; Fresnel number {}", digits(self.fresnel_number))?;
        let [x, y, area] = [self.band_kept_x, self.band_kept_y, self.band_kept_area].map(percent);
        write!(f, "band in the image {x} along x, {y} along y, {area} in all")?;
        for warning in &self.warnings {
            write!(f, "\nwarning {}: {}", warning.code.as_str(), warning.text)?;
        }
        Ok(())
    }
}

/// Largest phase error without a warning \[rad\]: smaller errors are invisible in images.
const NEGLECTED_PHASE_RAD_MAX: f64 = 0.1;
/// Fewest resolved points along a side without a warning. With fewer points the image shows hardly any detail.
const FEW_POINTS: f64 = 32.0;

impl ValidityReport {
    /// The report of `method`, with its warnings.
    pub(super) fn new(
        setup: &OpticalSetup,
        method: PropagationMethod,
        window: ImageWindow,
        explanation: String,
    ) -> Self {
        let (grid, wavelength_m, z) = (setup.grid(), setup.wavelength_m(), setup.distance_m().abs());
        let pitch_m = grid.pixel_pitch_m();
        let [side_x_m, side_y_m] = [grid.width_px(), grid.height_px()].map(|px| px as f64 * pitch_m);
        let spread_m = spread_m(pitch_m, wavelength_m, z);
        let band = Band::new(setup, &window);
        let mut report = Self {
            method,
            explanation,
            window,
            critical_distance_x_m: setup.critical_distance_x_m(),
            critical_distance_y_m: setup.critical_distance_y_m(),
            band_kept_x: band.kept_x,
            band_kept_y: band.kept_y,
            band_kept_area: band.kept_area(setup),
            fresnel_number: (0.5 * side_x_m.max(side_y_m)).powi(2) / (wavelength_m * z),
            diffraction_angle_rad: (0.5 * wavelength_m / pitch_m).min(1.0).asin(),
            spread_m: spread_m.is_finite().then_some(spread_m),
            full_cone_x_m: (side_x_m - 2.0 * spread_m).max(0.0),
            full_cone_y_m: (side_y_m - 2.0 * spread_m).max(0.0),
            neglected_phase_rad: neglected_phase_rad(setup, method, &window),
            warnings: Vec::new(),
        };
        report.warn(setup);
        report.warn_of_wrap_around();
        report
    }

    /// Number of points that the window resolves along x and along y.
    #[must_use]
    pub fn resolved_points(&self, setup: &OpticalSetup) -> (f64, f64) {
        let pitch_m = setup.grid().pixel_pitch_m();
        let points = |kept: f64, side_px: usize, window_pitch_m: f64| {
            side_px as f64 * (window_pitch_m / pitch_m * kept).min(1.0)
        };
        let window = &self.window;
        (
            points(self.band_kept_x, window.width_px(), window.pitch_x_m()),
            points(self.band_kept_y, window.height_px(), window.pitch_y_m()),
        )
    }

    /// The report for light through the kernel of `model`. The errors of a smooth kernel that is the same over the whole
    /// SLM, on a display that shows one order, are exact; those of other kernels act on the padded frame.
    #[must_use]
    pub fn through_kernel_of(mut self, model: &DisplayModel) -> Self {
        let acts_on_frame = match model.kernel {
            KernelShape::Ideal => false,
            KernelShape::Smooth(_) => !model.variation.is_none() || model.setup.orders().are_all(),
            KernelShape::Bins(_) => true,
        };
        if acts_on_frame {
            let text = "the engine multiplies this kernel on the padded frame, where a little light comes back into the \
                        image: simulated qualities above 35 dB may be several dB higher than the real ones; rely on the \
                        second opinion";
            self.warnings.push(PropagationWarning { code: WarningCode::KernelWrapAround, text: text.to_owned() });
        }
        self
    }

    /// Warns of light that comes back into the frame.
    fn warn_of_wrap_around(&mut self) {
        use PropagationMethod::{AngularSpectrum, BandLimited, FresnelTransferFunction};
        if matches!(self.method, AngularSpectrum | BandLimited | FresnelTransferFunction) {
            let text = "a little light that leaves the padded frame comes back into it: the simulated quality is a few dB \
                        higher than the real one; the band response has no such error";
            self.warnings.push(PropagationWarning { code: WarningCode::WrapAround, text: text.to_owned() });
        }
    }

    fn warn(&mut self, setup: &OpticalSetup) {
        let pitch_m = setup.grid().pixel_pitch_m();
        let (kept_x, kept_y) = (self.band_kept_x, self.band_kept_y);
        let mut warn = |code, text| self.warnings.push(PropagationWarning { code, text });
        if kept_x.min(kept_y) < 0.999 {
            let [detail_x, detail_y] = [kept_x, kept_y].map(|kept| length(pitch_m / kept));
            warn(
                WarningCode::BandLimited,
                format!(
                    "of the band, {} along x and {} along y land in the image: no detail there is finer than \
                     {detail_x} along x, {detail_y} along y",
                    percent(kept_x),
                    percent(kept_y)
                ),
            );
            if matches!(self.method, PropagationMethod::BandLimited | PropagationMethod::Shifted) {
                let text =
                    "the sharp band limit causes ringing at the sides of the image; the band response or a scaled window \
                     avoids it"
                        .to_owned();
                warn(WarningCode::SharpBandLimit, text);
            }
        }
        let farther_m = self.critical_distance_x_m.max(self.critical_distance_y_m);
        if self.method == PropagationMethod::RayleighSommerfeld && setup.distance_m().abs() < farther_m {
            let text = format!(
                "at distances below {} the ends of the impulse response would alias, so it fades out beyond {} from \
                 its middle",
                length(farther_m),
                length(self.spread_m.unwrap_or(f64::INFINITY))
            );
            warn(WarningCode::ShortImpulseResponse, text);
        }
        if self.neglected_phase_rad > NEGLECTED_PHASE_RAD_MAX {
            let text = format!(
                "the phase of the steepest light has an error of up to {} rad",
                digits(self.neglected_phase_rad)
            );
            warn(WarningCode::Paraxial, text);
        }
        if setup.wavelength_m() >= 2.0 * pitch_m {
            let text = format!(
                "pixels of {} are finer than half of the wavelength {}: part of their light does not propagate",
                length(pitch_m),
                length(setup.wavelength_m())
            );
            warn(WarningCode::Evanescent, text);
        }
        let (points_x, points_y) = self.resolved_points(setup);
        if points_x.min(self.window.width_px() as f64) < FEW_POINTS.min(self.window.width_px() as f64)
            || points_y < FEW_POINTS.min(self.window.height_px() as f64)
        {
            let text = format!("the window resolves about {}×{} points", digits(points_x), digits(points_y));
            self.warnings.push(PropagationWarning { code: WarningCode::FewPoints, text });
        }
    }
}

/// The part of the pixels' band whose light lands in a window.
#[derive(Debug)]
pub(super) struct Band {
    /// Half the sum of the sides of display and window, along x and y \[m\]. Light that moves sideways by more than
    /// this from the window's offset misses the window.
    apart_m: (f64, f64),
    centre_m: (f64, f64),
    pub(super) kept_x: f64,
    pub(super) kept_y: f64,
}

impl Band {
    pub(super) fn new(setup: &OpticalSetup, window: &ImageWindow) -> Self {
        let (grid, nyquist) = (setup.grid(), 0.5 / setup.grid().pixel_pitch_m());
        let apart_m = |side_px: usize, window_px: usize, window_pitch_m: f64| {
            0.5 * (side_px as f64 * grid.pixel_pitch_m() + window_px as f64 * window_pitch_m)
        };
        let kept = |apart_m: f64, centre_m: f64| {
            let end =
                |x_m: f64| frequency_landing_at(x_m, setup.wavelength_m(), setup.distance_m()).clamp(-nyquist, nyquist);
            (end(centre_m + apart_m) - end(centre_m - apart_m)) / (2.0 * nyquist)
        };
        let apart_x_m = apart_m(grid.width_px(), window.width_px(), window.pitch_x_m());
        let apart_y_m = apart_m(grid.height_px(), window.height_px(), window.pitch_y_m());
        Self {
            apart_m: (apart_x_m, apart_y_m),
            centre_m: (window.centre_x_m(), window.centre_y_m()),
            kept_x: kept(apart_x_m, window.centre_x_m()),
            kept_y: kept(apart_y_m, window.centre_y_m()),
        }
    }

    /// Part of the band's area that lands in the window, counted at the middles of the cells of a mesh.
    fn kept_area(&self, setup: &OpticalSetup) -> f64 {
        const MESH: usize = 128;
        let nyquist = 0.5 / setup.grid().pixel_pitch_m();
        let f = |i: usize| ((2 * i + 1) as f64 / MESH as f64 - 1.0) * nyquist;
        let lands = |&(u, v): &(usize, usize)| {
            landing_m(f(u), f(v), setup.wavelength_m(), setup.distance_m()).is_some_and(|(x_m, y_m)| {
                (x_m - self.centre_m.0).abs() <= self.apart_m.0 && (y_m - self.centre_m.1).abs() <= self.apart_m.1
            })
        };
        let mesh = (0..MESH).flat_map(|v| (0..MESH).map(move |u| (u, v)));
        mesh.filter(lands).count() as f64 / (MESH * MESH) as f64
    }
}

/// Largest phase error \[rad\] of `method` for light that lands in the window.
pub(super) fn neglected_phase_rad(setup: &OpticalSetup, method: PropagationMethod, window: &ImageWindow) -> f64 {
    let (wavelength_m, z) = (setup.wavelength_m(), setup.distance_m().abs());
    // 2π(√(ρ² + z²) − z − ρ²/2z)/λ at the point of the window that is farthest from a pixel.
    let of_paraboloid = || {
        let (x_m, y_m) = farthest_m(setup, window);
        let rho =
            x_m.hypot(y_m).min(spread_m(setup.grid().pixel_pitch_m(), wavelength_m, z) * std::f64::consts::SQRT_2);
        let squared = rho * rho;
        let sum = (squared + z * z).sqrt() + z;
        std::f64::consts::TAU / wavelength_m * squared * (sum - 2.0 * z) / (2.0 * z * sum)
    };
    match method {
        PropagationMethod::FresnelTransferFunction => {
            let nyquist = 0.5 / setup.grid().pixel_pitch_m();
            let band = Band::new(setup, window);
            let steepest = (nyquist * band.kept_x).hypot(nyquist * band.kept_y);
            fresnel_transfer_function::neglected_phase_rad(steepest, wavelength_m, z)
        }
        PropagationMethod::FresnelImpulseResponse | PropagationMethod::ScaledFresnel => of_paraboloid(),
        PropagationMethod::Fraunhofer => fraunhofer::neglected_phase_rad(setup),
        PropagationMethod::BandResponse
        | PropagationMethod::AllOrders
        | PropagationMethod::AngularSpectrum
        | PropagationMethod::BandLimited
        | PropagationMethod::Shifted
        | PropagationMethod::RayleighSommerfeld
        | PropagationMethod::BandExtended
        | PropagationMethod::Scaled => 0.0,
    }
}
