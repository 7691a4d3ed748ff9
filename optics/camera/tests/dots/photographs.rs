//! Photographs that were refused or misread: of older dots, whose three large ones are near the middle, on displays that
//! other programs simulated.

use crate::camera::{apply, inverse};
use lightpath_camera::alignment::{CameraMap, DotGrid};
use lightpath_optics::Plane;
use std::path::Path;

/// The map that is found in a photograph in `tests/dots/photographs`, of a display with these rows and columns.
fn found(name: &str, display_px: [usize; 2]) -> CameraMap {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/dots/photographs").join(name);
    let picture = image::open(path).unwrap().into_luma8();
    let [height_px, width_px] = [picture.height() as usize, picture.width() as usize];
    let levels = picture.pixels().map(|pixel| f32::from(pixel.0[0]) / 255.0).collect();
    let photo = Plane::try_from_vec(height_px, width_px, levels).unwrap();
    let grid = DotGrid::of_display(display_px[0], display_px[1]).unwrap();
    let dots = grid.find(&photo).unwrap_or_else(|error| panic!("{name}: {error}")).dots;
    CameraMap::from_points(&dots, display_px, [height_px, width_px]).unwrap().map
}

/// Largest distance between a map and the expected one, in the middle and at the rim of the dots.
fn most_off(map: &CameraMap, display_px: [usize; 2], expected: impl Fn([f64; 2]) -> [f64; 2]) -> f64 {
    let [h, w] = display_px.map(|side| side as f64 - 1.0);
    let places = [[0.5, 0.5], [0.15, 0.15], [0.85, 0.15], [0.15, 0.85], [0.85, 0.85]];
    let off = |[x, y]: [f64; 2]| {
        let place = [x * w, y * h];
        let (found, truth) = (map.apply(place), expected(place));
        (found[0] - truth[0]).hypot(found[1] - truth[1])
    };
    places.into_iter().map(off).fold(0.0, f64::max)
}

#[test]
fn dots_with_speckle_of_an_aberrated_display_are_recognized() {
    // The displays themselves move their light by up to a pixel, which no photograph of dots tells from the camera.
    let size = [360, 640];
    let in_place = most_off(&found("aberrated-camera-in-place.png", size), size, |place| place);
    assert!(in_place < 1.2, "{in_place} px");
    let back = [0.990_074_882, 0.006_912_139, 4.930, -0.006_912_139, 0.990_074_882, 1.990, 0.0, 0.0, 1.0];
    let turned = most_off(&found("aberrated-camera-turned.png", size), size, |place| apply(&inverse(&back), place));
    assert!(turned < 1.2, "{turned} px");
}

#[test]
fn spots_of_undiffracted_light_change_nothing() {
    let size = [180, 320];
    let clean = found("clean.png", size);
    // The camera is turned by 4°, with two of its pixels for one of the display.
    let ([x, y], [right, below]) = (clean.apply([159.5, 89.5]), clean.apply([259.5, 89.5]));
    assert!((x - 399.5).abs() < 2.0 && (y - 299.5).abs() < 2.0, "{x} {y}");
    let turn = (below - y).atan2(right - x).to_degrees();
    assert!((turn + 4.0).abs() < 0.3, "{turn}°");
    for name in ["spot.png", "faint-spot.png", "spot-right-of-middle.png"] {
        let off = most_off(&found(name, size), size, |place| clean.apply(place));
        assert!(off < 0.2, "{name}: {off} px");
    }
}
