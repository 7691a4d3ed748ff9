//! Comparisons of the planner's choices with the alternatives, and refused setups.

use super::fields::{PITCH_M, WAVELENGTH_M, noise, relative_l2, setup, spots_over_the_band};
use crate::engine::PropagatorCore;
use crate::hologram::{HologramMethod, HologramOptions, initial_phase};
use crate::propagation::{
    ConvolutionMethod, ImageWindow, PropagationMethod, RefusalCode, WarningCode, assess, plan, plan_onto,
};
use crate::reference::{first_order_onto, rayleigh_sommerfeld_onto};
use crate::{
    Detector, DisplayModel, Engine, Error, Grid, HologramProblem, OpticalSetup, Optimization, Plane, RegionOfInterest,
};

#[test]
fn chosen_method_is_the_best_for_the_first_order() {
    for (height_px, width_px) in [(32, 32), (24, 40)] {
        for times in [0.7, 1.0, 1.3, 3.0, 8.0] {
            let setup = setup(height_px, width_px, times * setup(height_px, width_px, 1.0).critical_distance_y_m());
            let field = noise(height_px, width_px, 5);
            let expected = first_order_onto(&setup, &field, &setup.window()).unwrap();
            let error = |method: PropagationMethod| {
                let propagator = PropagatorCore::<f64>::regardless(&setup, method).unwrap();
                relative_l2(&propagator.forward(&field).unwrap(), &expected)
            };
            let chosen = plan(&setup).unwrap().method;
            let found = error(chosen);
            for other in ConvolutionMethod::ALL.into_iter().map(PropagationMethod::from) {
                assert!(other == chosen || found < 0.1 * error(other), "{height_px}×{width_px} {times} z_c: {other}");
            }
        }
    }
}

#[test]
fn chosen_method_is_accurate_for_a_sampled_field() {
    let finer = 3;
    for (height_px, width_px) in [(32, 32), (24, 40)] {
        let fine_grid = Grid::try_new(finer * height_px, finer * width_px, PITCH_M / finer as f64).unwrap();
        let (field, fine_field) =
            (spots_over_the_band(height_px, width_px, 1), spots_over_the_band(height_px, width_px, finer));
        for times in [0.7, 1.0, 1.15, 1.3, 1.7, 3.0, 8.0] {
            let z = times * setup(height_px, width_px, 1.0).critical_distance_y_m();
            let (setup, fine) =
                (setup(height_px, width_px, z), OpticalSetup::try_new(fine_grid, WAVELENGTH_M, z).unwrap());
            let expected = rayleigh_sommerfeld_onto(&fine, &fine_field, &setup.window()).unwrap();
            let error = |method| {
                let propagator = PropagatorCore::<f64>::regardless(&setup, method).unwrap();
                relative_l2(&propagator.forward(&field).unwrap(), &expected)
            };
            let found = error(plan(&setup).unwrap().method);
            // The spots hold a little light beyond the pixels' band.
            assert!(found < 0.015, "{height_px}×{width_px} {times} z_c: {found:e}");
        }
    }
}

#[test]
fn common_display_has_expected_choices_and_reports() {
    let grid = Grid::try_new(1080, 1920, 8e-6).unwrap();
    let at = |z: f64| OpticalSetup::try_new(grid, 515e-9, z).unwrap();
    for (z, method, kept_x, kept_y, warnings) in [
        (0.07, PropagationMethod::BandResponse, 1.0, 1.0, vec![]),
        (-0.15, PropagationMethod::BandResponse, 1.0, 1.0, vec![]),
        (0.275, PropagationMethod::BandResponse, 1.0, 0.976, vec![WarningCode::BandLimited]),
        (0.5, PropagationMethod::BandResponse, 0.954, 0.537, vec![WarningCode::BandLimited]),
        (
            -10.0,
            PropagationMethod::RayleighSommerfeld,
            0.0477,
            0.0268,
            vec![WarningCode::BandLimited, WarningCode::FewPoints],
        ),
    ] {
        let report = plan(&at(z)).unwrap();
        assert_eq!(report.method, method, "{z} m: {report}");
        assert!((report.band_kept_x - kept_x).abs() < 1e-3 && (report.band_kept_y - kept_y).abs() < 1e-3, "{report}");
        assert!((report.band_kept_area - kept_x * kept_y).abs() < 0.02, "{report}");
        let codes: Vec<WarningCode> = report.warnings.iter().map(|warning| warning.code).collect();
        assert_eq!(codes, warnings, "{z} m: {report}");
        assert_eq!(PropagationMethod::from(at(z).planned().unwrap().0.method()), method);
    }
    // Where the band response would take too many frequencies, the other methods take its place.
    let large = Grid::try_new(8192, 8192, 8e-6).unwrap();
    for (z, method) in [
        (0.5, PropagationMethod::BandResponse),
        (0.9, PropagationMethod::AngularSpectrum),
        (1.9, PropagationMethod::AngularSpectrum),
        (2.5, PropagationMethod::RayleighSommerfeld),
    ] {
        assert_eq!(plan(&OpticalSetup::try_new(large, 515e-9, z).unwrap()).unwrap().method, method, "{z} m");
    }
    let report = plan(&at(0.15)).unwrap();
    assert!((report.critical_distance_y_m - 0.268).abs() < 1e-3 && (report.critical_distance_x_m - 0.477).abs() < 1e-3);
    assert!((report.diffraction_angle_rad.to_degrees() - 1.8447).abs() < 1e-3);
    assert!((report.spread_m.unwrap() - 4.831e-3).abs() < 1e-6 && (report.full_cone_x_m - 5.698e-3).abs() < 1e-5);
    assert_eq!(report.full_cone_y_m, 0.0);
    assert!((report.fresnel_number - 7.68e-3_f64.powi(2) / (515e-9 * 0.15)).abs() < 1e-6);
    assert!(report.to_string().contains("268 mm along y"), "{report}");
}

#[test]
fn windows_get_suitable_method() {
    let near = setup(64, 64, 0.01);
    let zoom = ImageWindow::try_new(64, 64, 2e-6).unwrap();
    assert_eq!(plan_onto(&near, &zoom).unwrap().method, PropagationMethod::Scaled);
    assert_eq!(plan_onto(&near, &near.window()).unwrap().method, PropagationMethod::BandResponse);
    let far = setup(64, 64, 0.5);
    assert_eq!(
        plan_onto(&far, &ImageWindow::try_new(64, 64, 50e-6).unwrap()).unwrap().method,
        PropagationMethod::ScaledFresnel
    );
    let beside = near.with_centre(1e-4, 0.0).unwrap();
    assert_eq!(plan(&beside).unwrap().method, PropagationMethod::Shifted);
}

#[test]
fn invalid_methods_are_refused_with_numbers() {
    let refusal = |result: Result<_, Error>| match result {
        Err(Error::Unsuitable { code, reason, .. }) => (code, reason),
        other => panic!("{other:?}"),
    };
    let assessed = |distance_m: f64, method| refusal(assess(&setup(64, 96, distance_m), method).map(|_| ()));
    // The critical distance z_c is 15.9 mm along y and 23.9 mm along x.
    for (distance_m, method, code, numbers) in [
        (10.0, PropagationMethod::BandResponse, RefusalCode::BandLost, ["10 m", "0.229"]),
        (0.02, PropagationMethod::AngularSpectrum, RefusalCode::Aliased, ["15.9 mm", "20 mm"]),
        (0.02, PropagationMethod::FresnelTransferFunction, RefusalCode::Aliased, ["15.9 mm", "20 mm"]),
        (0.1, PropagationMethod::BandLimited, RefusalCode::BandLost, ["15.9 %", "20 %"]),
        (0.008, PropagationMethod::RayleighSommerfeld, RefusalCode::Undersampled, ["8 mm", "11.9 mm"]),
        (0.02, PropagationMethod::FresnelImpulseResponse, RefusalCode::Undersampled, ["0.597 of a cycle", "23.9 mm"]),
        (0.7, PropagationMethod::Fraunhofer, RefusalCode::NotFar, ["1.81", "700 mm"]),
        (5.0, PropagationMethod::RayleighSommerfeld, RefusalCode::BandLost, ["5 m", "0.458"]),
        (0.01, PropagationMethod::ScaledFresnel, RefusalCode::Undersampled, ["322 µm", "10 mm"]),
    ] {
        let (found, reason) = assessed(distance_m, method);
        assert_eq!(found, code, "{method} {distance_m} m: {reason}");
        assert!(numbers.iter().all(|number| reason.contains(number)), "{method} {distance_m} m: {reason}");
    }
    assert_eq!(refusal(plan(&setup(64, 96, 5.0)).map(|_| ())).0, RefusalCode::BandLost);
    assert_eq!(
        refusal(ConvolutionMethod::try_from(PropagationMethod::Scaled).map(|_| ())).0,
        RefusalCode::NoConvolution
    );
    assert_eq!(
        refusal(setup(64, 96, 0.05).with_method(ConvolutionMethod::AngularSpectrum).map(|_| ())).0,
        RefusalCode::Aliased
    );
    let steep = OpticalSetup::try_new(Grid::try_new(64, 64, 0.6e-6).unwrap(), WAVELENGTH_M, 5e-5).unwrap();
    assert_eq!(
        refusal(assess(&steep, PropagationMethod::FresnelTransferFunction).map(|_| ())).0,
        RefusalCode::NotParaxial
    );
    let near = setup(64, 64, 0.01);
    let unreachable = near.window().centred_at(5e-3, 0.0).unwrap();
    assert_eq!(refusal(plan_onto(&near, &unreachable).map(|_| ())).0, RefusalCode::WindowUnreachable);
    let endless = ImageWindow::try_new(8192, 8192, 8e-6).unwrap();
    assert_eq!(
        refusal(plan_onto(&setup(8192, 8192, 1.0), &endless.centred_at(1e-3, 0.0).unwrap()).map(|_| ())).0,
        RefusalCode::TooManyFrequencies
    );
}

fn adam(problem: HologramProblem, phase: Plane<f32>) -> Optimization {
    let options = HologramOptions::new(HologramMethod::Adam { learning_rate: 0.1 }, 60);
    Optimization::start(problem, options, phase.into_vec()).unwrap()
}

#[test]
fn holograms_do_not_depend_on_the_number_of_threads() {
    let setup = setup(61, 45, 0.02).planned().unwrap().0;
    let target = Plane::from_fn(61, 45, |y, x| ((3 * y + 5 * x) % 17) as f32 / 17.0);
    for detector in Detector::ALL {
        let on = |threads: usize| {
            rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
                let engine = Engine::new(&DisplayModel::ideal(setup), detector, None).unwrap();
                let region = RegionOfInterest::middle(&setup.grid());
                let problem = HologramProblem::new(engine, target.clone(), region).unwrap();
                let mut adam = adam(problem, initial_phase(61, 45, 1.0, 1).unwrap());
                let losses: Vec<u64> = (0..5).map(|_| adam.step().unwrap().evaluation.loss.to_bits()).collect();
                (losses, adam.phases().to_vec())
            })
        };
        let one = on(1);
        assert!(on(2) == one && on(8) == one, "{detector:?}");
    }
}

#[test]
fn holograms_can_be_optimized_through_every_convolution() {
    let grid = Grid::try_new(40, 36, PITCH_M).unwrap();
    let target = Plane::from_fn(40, 36, |y, x| if (y / 8 + x / 9) % 2 == 0 { 0.9 } else { 0.1 });
    for (method, distance_m) in [
        (ConvolutionMethod::BandResponse, 5e-3),
        (ConvolutionMethod::AngularSpectrum, 5e-3),
        (ConvolutionMethod::BandLimited, 5e-3),
        (ConvolutionMethod::Shifted, 5e-3),
        (ConvolutionMethod::FresnelTransferFunction, 5e-3),
        (ConvolutionMethod::FresnelImpulseResponse, 0.012),
        (ConvolutionMethod::RayleighSommerfeld, 0.012),
    ] {
        let setup = OpticalSetup::try_new(grid, WAVELENGTH_M, distance_m).unwrap().with_method(method).unwrap();
        let engine = Engine::new(&DisplayModel::ideal(setup), Detector::Pixel, None).unwrap();
        let problem = HologramProblem::new(engine, target.clone(), RegionOfInterest::middle(&grid)).unwrap();
        let mut adam = adam(problem, initial_phase(40, 36, 1.0, 1).unwrap());
        let losses: Vec<f64> = (0..60).map(|_| adam.step().unwrap().evaluation.loss).collect();
        assert!(losses[59] < 0.1 * losses[1], "{method}: {} to {}", losses[1], losses[59]);
    }
}
