//! The stored JSON form of specifications and results: its words, and that values survive writing and reading.
#![allow(clippy::unwrap_used)] // tests may unwrap

use lightpath_optics::engine::photometry::Quantity;
use lightpath_optics::hologram::{DetectorQuality, HologramMethod, InitialPhase, Loss, Quality};
use lightpath_optics::learning::KernelModel;
use lightpath_optics::metrics::Gain;
use lightpath_optics::propagation::{ConvolutionMethod, PropagationMethod, RefusalCode, WarningCode, plan};
use lightpath_optics::{
    Carrier, Detector, FilterShape, Grid, OpticalSetup, OrderFilter, Orders, RegionOfInterest, ValidityReport,
};
use serde::{Serialize, de::DeserializeOwned};
use serde_json::{json, to_value};
use std::fmt::Debug;

/// Checks that the value is written as this JSON and that the JSON is read as the value.
fn check_stored<T: Serialize + DeserializeOwned + PartialEq + Debug>(value: T, json: serde_json::Value) {
    assert_eq!(to_value(&value).unwrap(), json);
    assert_eq!(serde_json::from_value::<T>(json).unwrap(), value);
}

/// Checks that each value is stored as its word; `words` lists the words in the order of the values.
fn check_words<T: Serialize + DeserializeOwned + PartialEq + Debug>(values: impl IntoIterator<Item = T>, words: &str) {
    let words: Vec<&str> = words.split_whitespace().collect();
    let values: Vec<T> = values.into_iter().collect();
    assert_eq!(values.len(), words.len());
    values.into_iter().zip(words).for_each(|(value, word)| check_stored(value, json!(word)));
}

#[test]
fn enumerations_are_stored_as_words() {
    check_words(
        PropagationMethod::ALL,
        "band_response all_orders angular_spectrum band_limited band_extended rayleigh_sommerfeld fresnel_transfer_function \
         fresnel_impulse_response shifted scaled scaled_fresnel fraunhofer",
    );
    check_words(
        ConvolutionMethod::ALL,
        "band_response all_orders angular_spectrum band_limited rayleigh_sommerfeld fresnel_transfer_function \
         fresnel_impulse_response shifted",
    );
    check_words(Detector::ALL, "point pixel supersampled");
    check_words(KernelModel::ALL, "paper dense smooth display varying");
    check_words([Carrier::HalfOrderX, Carrier::HalfOrderY], "half_order_x half_order_y");
    check_words([Quantity::Intensity, Quantity::Amplitude], "intensity amplitude");
    check_words(
        [HologramMethod::Lbfgs, HologramMethod::GerchbergSaxton, HologramMethod::WeightedGerchbergSaxton],
        "lbfgs gerchberg_saxton weighted_gerchberg_saxton",
    );
    check_words([HologramMethod::DoublePhase], "double_phase");
    check_stored(HologramMethod::Adam { learning_rate: 0.1 }, json!({"adam": {"learning_rate": 0.1}}));
    check_stored(Orders::First, json!("first"));
    let iris = OrderFilter {
        shape: FilterShape::Ellipse,
        centre_x: -0.25,
        centre_y: 0.125,
        ..OrderFilter::rectangle(0.5, 0.75)
    };
    let stored = json!({"shape": "ellipse", "width": 0.5, "height": 0.75, "centre_x": -0.25, "centre_y": 0.125});
    check_stored(Orders::Filtered(iris), json!({"filtered": stored}));
    let gaps = Orders::All { fill_factor_x: 0.875, fill_factor_y: 0.75 };
    check_stored(gaps, json!({"all": {"fill_factor_x": 0.875, "fill_factor_y": 0.75}}));
    check_stored(Gain::Fitted, json!("fitted"));
    check_stored(Gain::Given(0.5), json!({"given": 0.5}));
    check_stored(RefusalCode::NotParaxial, json!("NOT_PARAXIAL"));
    for code in [
        WarningCode::BandLimited,
        WarningCode::SharpBandLimit,
        WarningCode::WrapAround,
        WarningCode::KernelWrapAround,
        WarningCode::ShortImpulseResponse,
        WarningCode::FewPoints,
        WarningCode::Paraxial,
        WarningCode::Evanescent,
    ] {
        check_stored(code, json!(code.as_str()));
    }
}

#[test]
fn structures_are_stored_with_their_field_names() {
    check_stored::<InitialPhase<String>>(
        InitialPhase::Random { range_rad: 1.5 },
        json!({"random": {"range_rad": 1.5}}),
    );
    check_stored::<InitialPhase<String>>(
        InitialPhase::Quadratic { focal_length_m: None },
        json!({"quadratic": {"focal_length_m": null}}),
    );
    check_stored::<InitialPhase<String>>(InitialPhase::Given("file".into()), json!({"given": "file"}));
    check_stored(
        Loss::default(),
        json!({"quantity": "intensity", "total_variation": 0.0, "speckle": 0.0, "speckle_block_px": 8}),
    );
    let region = RegionOfInterest::middle(&Grid::try_new(20, 30, 8e-6).unwrap());
    check_stored(region, json!({"x_px": 3, "y_px": 2, "width_px": 24, "height_px": 16}));
    let metrics = DetectorQuality {
        psnr_db: 30.5,
        ssim: Some(0.75),
        ms_ssim: None,
        diffraction_efficiency: 0.5,
        frame_efficiency: 0.625,
        speckle_contrast: None,
    };
    let json = json!({
        "psnr_db": 30.5, "ssim": 0.75, "ms_ssim": null, "diffraction_efficiency": 0.5, "frame_efficiency": 0.625,
        "speckle_contrast": null,
    });
    check_stored(
        Quality { point: metrics, pixel: metrics, supersampled: metrics },
        json!({"point": json, "pixel": json, "supersampled": json}),
    );
}

#[test]
fn validity_reports_survive_round_trip() {
    let grid = Grid::try_new(64, 96, 8e-6).unwrap();
    for (pitch_m, distance_m) in [(8e-6, 0.05), (0.2e-6, 1e-5)] {
        let grid = Grid::try_new(grid.height_px(), grid.width_px(), pitch_m).unwrap();
        let report = plan(&OpticalSetup::try_new(grid, 515e-9, distance_m).unwrap()).unwrap();
        assert_eq!(report.spread_m.is_none(), pitch_m < 0.25e-6);
        assert!(!report.warnings.is_empty());
        let json = serde_json::to_string(&report).unwrap();
        assert_eq!(serde_json::from_str::<ValidityReport>(&json).unwrap(), report);
    }
    let json = to_value(plan(&OpticalSetup::try_new(grid, 515e-9, 0.005).unwrap()).unwrap()).unwrap();
    assert_eq!(json["method"], "band_response");
    assert_eq!(json["window"]["width_px"], 96);
    assert_eq!(json["window"]["centre_y_m"], 0.0);
}
