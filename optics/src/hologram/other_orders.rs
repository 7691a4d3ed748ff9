//! What a hologram would show on a display of the other kind: with all diffraction orders instead of the first or of
//! what a filter passes, or with the first instead of all.

use super::shown_light::light_of_frames;
use super::wanted::Wanted;
use crate::display::{Detector, DisplayModel, KernelShape, Orders};
use crate::engine::{EngineCache, EngineCore, sub_samples};
use crate::error::Result;
use crate::metrics::{Gain, ImagePair};
use crate::numerics::{Plane, SmoothField};

/// Limit on the pixels of a display for which the other kind is computed. Its transfer functions would take more memory
/// than the hologram on larger displays.
pub(crate) const OTHER_ORDERS_PIXELS_MAX: usize = 1 << 22;

/// The display with the other kind of optics. Pixels that show all orders have no gaps. `None` for a kernel with a
/// value for each frequency, which holds the optics, for very large displays, and where the other kind shows no
/// picture.
#[must_use]
pub fn with_other_orders(model: &DisplayModel) -> Option<DisplayModel> {
    let grid = model.setup.grid();
    if matches!(model.kernel, KernelShape::Bins(_)) || grid.height_px() * grid.width_px() > OTHER_ORDERS_PIXELS_MAX {
        return None;
    }
    let orders = if model.setup.orders().are_all() { Orders::First } else { Orders::SQUARE };
    let (setup, _) = model.setup.with_orders(orders).ok()?.planned().ok()?;
    // The first order has no frequencies beyond its band.
    Some(DisplayModel { setup, beyond: SmoothField::flat(0), ..model.clone() })
}

/// PSNR \[dB\] of the light of `phases`, shown one after the other and integrated over the pixels by the sub-samples of
/// an optimization. Transfer functions come from the cache.
///
/// # Errors
///
/// [`Error`](crate::Error) for phases or a target of another size than the display, or a region that leaves it.
pub fn pixel_psnr_db(
    cache: &EngineCache,
    model: &DisplayModel,
    phases: &[Plane<f32>],
    wanted: Wanted<'_>,
) -> Result<f64> {
    match model.setup.orders() {
        Orders::First | Orders::Filtered(_) => {
            let light = light_of_frames(&cache.engine(model, Detector::Pixel, None)?, phases)?;
            wanted_psnr_db(&light, wanted)
        }
        Orders::All { .. } => {
            let places = sub_samples(&model.setup, Detector::Pixel);
            let engine = cache.keeping(EngineCore::without_samples(model)?);
            let light = &engine.light_at(&places, &[phases])?[0];
            wanted_psnr_db(light, wanted)
        }
    }
}

fn wanted_psnr_db(light: &Plane<f32>, Wanted { target, region, belonging }: Wanted<'_>) -> Result<f64> {
    let pair = ImagePair::new(light, target, region, Gain::Fitted)?;
    let pair = match belonging {
        Some(belonging) => pair.only(belonging)?,
        None => pair,
    };
    Ok(-10.0 * pair.mse().log10())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::OpticalSetup;
    use crate::engine::Engine;
    use crate::hologram::initial::initial_phase;
    use crate::hologram::optimization::Optimization;
    use crate::hologram::options::{HologramMethod, HologramOptions};
    use crate::hologram::problem::HologramProblem;
    use crate::hologram::quality::quality;
    use crate::numerics::{Grid, RegionOfInterest};
    use crate::pictures_of_tests::picture;

    fn optimized(model: &DisplayModel, target: &Plane<f32>, region: RegionOfInterest) -> Plane<f32> {
        let (height_px, width_px) = (target.height_px(), target.width_px());
        let engine = Engine::new(model, Detector::Pixel, None).unwrap();
        let problem = HologramProblem::new(engine, target.clone(), region).unwrap();
        let start = initial_phase(height_px, width_px, 0.5, 4).unwrap().into_vec();
        let mut optimization =
            Optimization::start(problem, HologramOptions::new(HologramMethod::Lbfgs, 60), start).unwrap();
        while optimization.step().is_some() {}
        Plane::try_from_vec(height_px, width_px, optimization.phases().to_vec()).unwrap()
    }

    #[test]
    fn optimization_through_all_orders_gains_six_decibels() {
        // z_c is 24.9 mm along y and 39.8 mm along x. At 17.5 mm the orders overlap as they do on 640×360 px at 70 mm.
        let grid = Grid::try_new(100, 160, 8e-6).unwrap();
        let setup = OpticalSetup::try_new(grid, 515e-9, 17.5e-3).unwrap().planned().unwrap().0;
        let first = DisplayModel::ideal(setup);
        let all = with_other_orders(&first).unwrap();
        assert_eq!(with_other_orders(&all), Some(first.clone()));
        let (target, region) = (picture(100, 160, 3), RegionOfInterest::middle(&grid));
        let engine = Engine::new(&all, Detector::Pixel, None).unwrap();
        let [of_first, of_all] = [&first, &all].map(|model| {
            let phase = optimized(model, &target, region);
            let exact = quality(&engine, &phase, &target, region).unwrap().pixel.psnr_db;
            let quick = pixel_psnr_db(&EngineCache::new(0), &all, &[phase], (&target, region).into()).unwrap();
            // Four sub-samples overrate a picture that was optimized for them.
            assert!((quick - exact).abs() < 0.5 || exact > 35.0, "{quick} dB, {exact} dB");
            exact
        });
        assert!(of_all > of_first + 6.0, "{of_first} dB, {of_all} dB");
    }
}
