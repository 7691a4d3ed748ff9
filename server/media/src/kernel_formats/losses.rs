//! What a file form does not hold of a model.

use lightpath_optics::display::parts::InBins;
use lightpath_optics::learning::ModelPart;
use lightpath_optics::{DisplayModel, KernelShape};
use std::fmt;

/// Relative error of H that is only rounding to f32. At far distances a band limit can leave H zero outside the inner
/// half of the band.
const ROUNDING: f64 = 1e-6;

/// What a file does not hold of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Loss {
    /// A part of the display. Without a variation over the SLM the kernel on the axis remains, and without further modes
    /// of the light all of it is in one mode between them.
    Part(ModelPart),
    /// Gain and offset of the camera.
    GainAndOffset,
    /// H outside the inner half of the band along each axis: three quarters of the spectrum.
    OuterSpectrum,
    /// The series of a smooth kernel and its method. H remains as a number for each frequency.
    Parameters,
    /// The fact that the kernel was interpolated, and the photographed distances.
    Interpolation,
    /// Digits of the numbers that remain.
    Precision,
}

impl Loss {
    /// The loss with this [name](Self::name).
    #[must_use]
    pub fn parse(name: &str) -> Option<Self> {
        let others = [Self::GainAndOffset, Self::OuterSpectrum, Self::Parameters, Self::Interpolation, Self::Precision];
        let parts = ModelPart::ALL.iter().copied().map(Self::Part);
        parts.chain(others).find(|loss| loss.name() == name)
    }

    /// Name in messages.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Part(part) => part.name(),
            Self::GainAndOffset => "gain_and_offset",
            Self::OuterSpectrum => "outer_spectrum",
            Self::Parameters => "parameters",
            Self::Interpolation => "interpolation",
            Self::Precision => "precision",
        }
    }
}

/// The loss as words in a sentence.
impl fmt::Display for Loss {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Part(part) => f.write_str(&part.name().replace('_', " ")),
            Self::GainAndOffset => f.write_str("gain and offset"),
            Self::OuterSpectrum => f.write_str("H outside the inner half of the band"),
            Self::Parameters => f.write_str("parameters of the kernel"),
            Self::Interpolation => f.write_str("distances of an interpolation"),
            Self::Precision => f.write_str("digits"),
        }
    }
}

/// What a form does not hold that has nothing but H at each frequency.
pub(super) fn beside_bins() -> impl Iterator<Item = Loss> {
    let parts = ModelPart::ALL.iter().copied().filter(|part| part.in_bins() != InBins::Held);
    parts.map(Loss::Part).chain([Loss::GainAndOffset])
}

/// What the model `read` from a file lacks of `model`. `relative_error` is that of H.
pub(super) fn losses(model: &DisplayModel, read: &DisplayModel, relative_error: f64) -> Vec<Loss> {
    let is_smooth = |model: &DisplayModel| !matches!(model.kernel, KernelShape::Bins(_));
    let outside_h = |part: &ModelPart| is_smooth(read) || part.in_bins() != InBins::Held;
    let parts = ModelPart::ALL.iter().copied().filter(outside_h);
    let (lost, kept): (Vec<_>, Vec<_>) = parts.partition(|part| part.is_in(model) && !part.is_in(read));
    let camera = |model: &DisplayModel| [model.gain, model.offset];
    let camera_lost = camera(model) != [1.0, 0.0] && camera(read) == [1.0, 0.0];
    let precision_lost = relative_error > 0.0
        || kept.iter().any(|part| !part.is_same_in(model, read))
        || !camera_lost && camera(read) != camera(model);
    let (all, kept) = (bins(model), bins(read));
    let others = [
        (Loss::GainAndOffset, camera_lost),
        (Loss::OuterSpectrum, (kept.0 < all.0 || kept.1 < all.1) && relative_error > ROUNDING),
        (Loss::Parameters, is_smooth(model) && !is_smooth(read)),
        (Loss::Precision, precision_lost),
    ];
    let others = others.into_iter().filter_map(|(loss, is_lost)| is_lost.then_some(loss));
    lost.into_iter().map(Loss::Part).chain(others).collect()
}

/// Rows and columns of the padded spectrum at which a model has values of H.
fn bins(model: &DisplayModel) -> (usize, usize) {
    match &model.kernel {
        KernelShape::Bins(bins) => (bins.height_px(), bins.width_px()),
        KernelShape::Ideal | KernelShape::Smooth(_) => (model.setup.padded_height_px(), model.setup.padded_width_px()),
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::import;
    use super::super::{KernelFormat, export, export_with};
    use super::Loss::*;
    use super::*;
    use crate::kernel_file::Origin;
    use ModelPart::*;
    use lightpath_optics::{
        FurtherMode, Grid, KernelModel, OpticalSetup, PartialCoherence, Plane, SmoothField, SpatialVariation,
    };
    use num_complex::{Complex32, Complex64};

    fn setup() -> OpticalSetup {
        OpticalSetup::try_new(Grid::try_new(12, 16, 8e-6).unwrap(), 515e-9, 3e-3).unwrap()
    }

    fn field() -> SmoothField {
        SmoothField { order: 1, log_amplitude: vec![0.1, 0.2], phase: vec![0.3, -0.1] }
    }

    /// What a form loses that holds the first mode's H only.
    const BESIDE_H: [Loss; 10] = [
        Part(Source),
        Part(Crosstalk),
        Part(UnevenResponse),
        Part(LightBlur),
        Part(PartialCoherence),
        Part(VaryingTransferFunction),
        Part(Dust),
        Part(PhaseResponse),
        Part(ZeroOrder),
        GainAndOffset,
    ];
    /// The parts that the compact form does not hold.
    const NOT_COMPACT: [Loss; 4] = [Part(LightBlur), Part(PartialCoherence), Part(Ghost), Part(Dust)];

    /// A model that has everything that a form can lose.
    fn varying() -> DisplayModel {
        DisplayModel {
            kernel: KernelShape::Smooth(field()),
            variation: SpatialVariation::new([(); 5].map(|()| field())),
            source: field(),
            ghost: lightpath_optics::Ghost::of_numbers([0.1, 0.0, 2.0, 1.0, 0.5]),
            coherence: PartialCoherence::new(vec![FurtherMode { light: 0.5, errors: field() }]),
            dust: lightpath_optics::Dust::new(Plane::filled(12, 16, [50, -3])),
            response: vec![[0.1, 0.0]],
            response_variation: lightpath_optics::ResponseVariation { order: 0, coefficients: vec![0.1] },
            crosstalk: lightpath_optics::Crosstalk { ratio_x: 0.1, ratio_y: 0.02 },
            light_blur: lightpath_optics::LightBlur { ratio_x: 0.1 / 3.0, ratio_y: 0.2 },
            zero_order: Complex64::new(0.03, 0.0),
            gain: 0.7,
            ..DisplayModel::ideal(setup())
        }
    }

    #[test]
    fn each_form_names_what_it_lost() {
        let lost = |model: &DisplayModel, kind, format| export(model, kind, format).unwrap().losses;
        let array = [&BESIDE_H[..], &[Parameters, Precision]].concat();
        let published = [&BESIDE_H[..], &[OuterSpectrum, Parameters, Precision]].concat();
        for (format, losses) in [
            (KernelFormat::Safetensors, vec![]),
            (KernelFormat::Compact, [&NOT_COMPACT[..], &[Precision]].concat()),
            (KernelFormat::Npz, vec![]),
            (KernelFormat::Complex64, array.clone()),
            (KernelFormat::F16, array),
            (KernelFormat::Pt, published.clone()),
            (KernelFormat::Npy, published),
        ] {
            assert_eq!(lost(&varying(), KernelModel::Varying, format), losses, "{format:?}");
        }
        let bins = |rows, columns| {
            let at = |y: usize, x: usize| Complex32::new((y as f32).sin(), (x as f32 + 0.3).cos());
            DisplayModel {
                kernel: KernelShape::Bins(Plane::from_fn(rows, columns, at)),
                ..DisplayModel::ideal(setup())
            }
        };
        let (dense, paper) = (bins(24, 32), bins(12, 16));
        for (model, kind, format, losses) in [
            (&dense, KernelModel::Dense, KernelFormat::Complex64, vec![]),
            (&dense, KernelModel::Dense, KernelFormat::Npz, vec![]),
            (&dense, KernelModel::Dense, KernelFormat::F16, vec![Precision]),
            (&dense, KernelModel::Dense, KernelFormat::Pt, vec![OuterSpectrum, Precision]),
            (&paper, KernelModel::Paper, KernelFormat::Pt, vec![Precision]),
            (&paper, KernelModel::Paper, KernelFormat::Complex64, vec![]),
        ] {
            assert_eq!(lost(model, kind, format), losses, "{kind:?} as {format:?}");
        }
    }

    #[test]
    fn an_ideal_display_loses_only_its_parameters() {
        let smooth = DisplayModel { kernel: KernelShape::Smooth(field()), ..DisplayModel::ideal(setup()) };
        let exported = export(&smooth, KernelModel::Smooth, KernelFormat::Complex64).unwrap();
        assert_eq!(exported.losses, [Parameters, Precision]);
    }

    #[test]
    fn forms_of_whole_models_hold_the_origin_and_bundles_the_record() {
        let record = Some(serde_json::json!({ "version": 3 }));
        let origin =
            Origin { display: Some("lab".to_owned()), interpolated_from_m: vec![0.002, 0.004], record: record.clone() };
        let export = |format| export_with(&varying(), KernelModel::Varying, &origin, format).unwrap();
        for (format, record) in
            [(KernelFormat::Safetensors, None), (KernelFormat::Npz, None), (KernelFormat::Bundle, record)]
        {
            let exported = export(format);
            assert_eq!(exported.losses, [], "{format:?}");
            let back = import(&exported.bytes, &setup()).unwrap();
            assert_eq!((back.origin, back.model), (Origin { record, ..origin.clone() }, varying()), "{format:?}");
        }
        let compact = [&NOT_COMPACT[..], &[Interpolation, Precision]].concat();
        assert_eq!(export(KernelFormat::Compact).losses, compact);
    }

    #[test]
    fn imports_say_what_their_file_did_not_hold() {
        let (model, kind) = (varying(), KernelModel::Varying);
        let absent = |format| import(&export(&model, kind, format).unwrap().bytes, &setup()).unwrap().absent;
        assert_eq!(absent(KernelFormat::Complex64), BESIDE_H);
        assert_eq!(absent(KernelFormat::Pt), [&BESIDE_H[..], &[OuterSpectrum]].concat());
        for format in [KernelFormat::Safetensors, KernelFormat::Compact, KernelFormat::Npz] {
            assert_eq!(absent(format), []);
        }
    }
}
