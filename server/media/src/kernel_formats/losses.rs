//! What a file form does not hold of a model.

use lightpath_optics::{DisplayModel, KernelShape};
use std::fmt;

/// Relative error of H that is only rounding to f32. At far distances a band limit can leave H zero outside the inner
/// half of the band.
const ROUNDING: f64 = 1e-6;

/// A part of a model that a file does not hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Loss {
    /// The source profile.
    Source,
    /// Dust and fringes in the light on the SLM.
    Dust,
    /// A ghost. Forms with H at each frequency hold it as a part of H.
    Ghost,
    /// The further modes of partially coherent light. All light is in one mode between them.
    Coherence,
    /// The phase response of the SLM.
    PhaseResponse,
    /// The variation of the phase response over the SLM.
    ResponseVariation,
    /// Cross-talk between neighbouring pixels of the SLM.
    Crosstalk,
    /// The blur of the light.
    LightBlur,
    /// The undiffracted light.
    ZeroOrder,
    /// Gain and offset of the camera.
    GainAndOffset,
    /// The variation of the kernel over the SLM. H on the axis remains.
    Variation,
    /// H outside the inner half of the band along each axis: three quarters of the spectrum.
    OuterSpectrum,
    /// The series of a smooth kernel and its method. H remains as a number for each frequency.
    Parameters,
    /// The fact that the kernel was interpolated, and the photographed distances.
    Interpolation,
    /// Digits of the numbers that remain.
    Precision,
}

/// The part as words in a sentence.
impl fmt::Display for Loss {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Source => "source",
            Self::Dust => "dust",
            Self::Ghost => "ghost",
            Self::Coherence => "further modes of the light",
            Self::PhaseResponse => "phase response",
            Self::ResponseVariation => "variation of the phase response",
            Self::Crosstalk => "cross-talk",
            Self::LightBlur => "blur of the light",
            Self::ZeroOrder => "zero order",
            Self::GainAndOffset => "gain and offset",
            Self::Variation => "variation over the SLM",
            Self::OuterSpectrum => "H outside the inner half of the band",
            Self::Parameters => "parameters of the kernel",
            Self::Interpolation => "distances of an interpolation",
            Self::Precision => "digits",
        })
    }
}

/// The parts of `model` that the model `read` from a file lacks. `relative_error` is that of H.
pub(super) fn losses(model: &DisplayModel, read: &DisplayModel, relative_error: f64) -> Vec<Loss> {
    let source_lost = !model.source.is_flat() && read.source.is_flat();
    let dust_lost = !model.dust.is_none() && read.dust.is_none();
    let holds_all_h = matches!(read.kernel, KernelShape::Bins(_));
    let ghost_lost = !model.ghost.is_none() && read.ghost.is_none() && !holds_all_h;
    let coherence_lost = !model.coherence.is_none() && read.coherence.is_none();
    let is_linear = |model: &DisplayModel| model.response.as_flattened().iter().all(|&harmonic| harmonic == 0.0);
    let response_lost = !is_linear(model) && is_linear(read);
    let variation_lost = !model.response_variation.is_none() && read.response_variation.is_none();
    let crosstalk_lost = !model.crosstalk.is_none() && read.crosstalk.is_none();
    let light_blur_lost = !model.light_blur.is_none() && read.light_blur.is_none();
    let zero_order_lost = model.zero_order.norm_sqr() > 0.0 && read.zero_order.norm_sqr() == 0.0;
    let camera = |model: &DisplayModel| [model.gain, model.offset];
    let camera_lost = camera(model) != [1.0, 0.0] && camera(read) == [1.0, 0.0];
    let precision_lost = relative_error > 0.0
        || !source_lost && read.source != model.source
        || !coherence_lost && read.coherence != model.coherence
        || !ghost_lost && !holds_all_h && read.ghost != model.ghost
        || !dust_lost && read.dust != model.dust
        || !response_lost && read.response != model.response
        || !variation_lost && read.response_variation != model.response_variation
        || !crosstalk_lost && read.crosstalk != model.crosstalk
        || !light_blur_lost && read.light_blur != model.light_blur
        || !zero_order_lost && read.zero_order != model.zero_order
        || !camera_lost && camera(read) != camera(model);
    let is_smooth = |model: &DisplayModel| !matches!(model.kernel, KernelShape::Bins(_));
    let (all, kept) = (bins(model), bins(read));
    [
        (Loss::Source, source_lost),
        (Loss::Dust, dust_lost),
        (Loss::Ghost, ghost_lost),
        (Loss::Coherence, coherence_lost),
        (Loss::PhaseResponse, response_lost),
        (Loss::ResponseVariation, variation_lost),
        (Loss::Crosstalk, crosstalk_lost),
        (Loss::LightBlur, light_blur_lost),
        (Loss::ZeroOrder, zero_order_lost),
        (Loss::GainAndOffset, camera_lost),
        (Loss::Variation, !model.variation.is_none() && read.variation.is_none()),
        (Loss::OuterSpectrum, (kept.0 < all.0 || kept.1 < all.1) && relative_error > ROUNDING),
        (Loss::Parameters, is_smooth(model) && !is_smooth(read)),
        (Loss::Precision, precision_lost),
    ]
    .into_iter()
    .filter_map(|(loss, is_lost)| is_lost.then_some(loss))
    .collect()
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
    use super::super::{KernelFormat, export, export_with, import};
    use super::Loss::*;
    use super::*;
    use crate::kernel_file::Origin;
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
    const PARTS: [Loss; 10] = [
        Source,
        Dust,
        Coherence,
        PhaseResponse,
        ResponseVariation,
        Crosstalk,
        LightBlur,
        ZeroOrder,
        GainAndOffset,
        Variation,
    ];

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
        let array = [&PARTS[..], &[Parameters, Precision]].concat();
        let published = [&PARTS[..], &[OuterSpectrum, Parameters, Precision]].concat();
        for (format, losses) in [
            (KernelFormat::Safetensors, vec![]),
            (KernelFormat::Compact, vec![Dust, Ghost, Coherence, LightBlur, Precision]),
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
        assert_eq!(export(KernelFormat::Compact).losses, [Dust, Ghost, Coherence, LightBlur, Interpolation, Precision]);
    }

    #[test]
    fn imports_say_what_their_file_did_not_hold() {
        let (model, kind) = (varying(), KernelModel::Varying);
        let absent = |format| import(&export(&model, kind, format).unwrap().bytes, &setup()).unwrap().absent;
        assert_eq!(absent(KernelFormat::Complex64), PARTS);
        assert_eq!(absent(KernelFormat::Pt), [&PARTS[..], &[OuterSpectrum]].concat());
        for format in [KernelFormat::Safetensors, KernelFormat::Compact, KernelFormat::Npz] {
            assert_eq!(absent(format), []);
        }
    }
}
