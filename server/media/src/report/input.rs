//! The input of a report.

use super::evidence::Evidence;
use lightpath_domain::kernel::KernelVersion;
use lightpath_optics::DisplayModel;
use num_complex::Complex64;

/// The data that a report is made from.
#[derive(Debug)]
pub struct ReportInput {
    /// The version that the report describes.
    pub version: KernelVersion,
    /// The display model of that version.
    pub model: DisplayModel,
    /// Losses during learning. Empty: unknown.
    pub loss_history: Vec<f64>,
    /// Evidence from the dataset. `None`: the kernel was imported, or the dataset cannot be read any more.
    pub evidence: Option<Evidence>,
    /// Comparisons with other versions of the same kernel, newest first.
    pub other_versions: Vec<OtherVersion>,
    /// The models at all distances that were learned together, ascending. Empty: the kernel was learned at one
    /// distance.
    pub over_distance: Vec<DisplayModel>,
}

/// Comparison with another version of the same kernel. It does not hold that version's model, which may be large.
#[derive(Clone, Copy, Debug)]
pub struct OtherVersion {
    /// Number of the version.
    pub version: u32,
    /// Loss on held-out pairs. `None`: no pair was held out.
    pub test_loss: Option<f64>,
    /// Difference of its kernel from the kernel of the report.
    pub difference: KernelDifference,
}

/// Difference of two kernels H and H', with the complex factor c for which c H' is nearest to H.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KernelDifference {
    /// ‖c H' − H‖ / ‖H‖.
    pub relative: f64,
    /// Root mean square of the phase difference, weighted by the amplitude \[rad\].
    pub phase_rad: f64,
    /// |c|².
    pub gain: f64,
}

impl KernelDifference {
    /// The difference of values H and H', and the factor c.
    pub(super) fn of(values: impl Iterator<Item = (Complex64, Complex64)>) -> (Self, Complex64) {
        let values: Vec<(Complex64, Complex64)> = values.collect();
        let cross: Complex64 = values.iter().map(|(h, g)| g.conj() * h).sum();
        let energy: f64 = values.iter().map(|(_, g)| g.norm_sqr()).sum();
        let own: f64 = values.iter().map(|(h, _)| h.norm_sqr()).sum();
        if energy <= 0.0 || own <= 0.0 {
            return (Self { relative: 1.0, phase_rad: 0.0, gain: 0.0 }, Complex64::ONE);
        }
        let c = cross / energy;
        let off: f64 = values.iter().map(|(h, g)| (c * g - h).norm_sqr()).sum();
        let (phase, weight) = values.iter().fold((0.0, 0.0), |(phase, weight), (h, g)| {
            let between = (c * g).conj() * h;
            (phase + between.norm() * between.arg().powi(2), weight + between.norm())
        });
        let phase_rad = if weight > 0.0 { (phase / weight).sqrt() } else { 0.0 };
        (Self { relative: (off / own).sqrt(), phase_rad, gain: c.norm_sqr() }, c)
    }
}
