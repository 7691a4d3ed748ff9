//! From a job's specification to the problems for the optimizer: pictures, kernels, weights and initial phases.

use super::display_setup::DisplaySetup;
use super::{JobContext, TaskError};
use lightpath_domain::dataset::Encoding;
use lightpath_domain::job::{ImagePlane, OptimizeHologram, nearest_planes, pixels_of_planes, weight_in_plane};
use lightpath_domain::units::Wavelength;
use lightpath_gpu::CardOrProcessor;
use lightpath_media::pictures::{self, Channel, Hologram, Placement};
use lightpath_optics::engine::Prepared;
use lightpath_optics::hologram::{self, HologramOptions, HologramProblem, Levels, Picture, with_other_orders};
use lightpath_optics::{DisplayModel, Engine, Plane, RegionOfInterest, ValidityReport};

/// The pictures that the hologram of one wavelength must show.
pub(super) struct HologramSetup {
    pub(super) wavelength: Wavelength,
    pub(super) display: DisplaySetup,
    pub(super) region: RegionOfInterest,
    pub(super) planes: Vec<PlaneSetup>,
    /// Index of the plane to which each pixel belongs; `None`: every pixel counts in every plane.
    pub(super) depths: Option<Plane<u8>>,
}

/// A picture and its image plane.
pub(super) struct PlaneSetup {
    pub(super) plane: ImagePlane,
    pub(super) model: DisplayModel,
    pub(super) engine: Engine,
    /// Kernel version that judges the hologram; `None`: the kernel of the hologram.
    pub(super) judging_version: Option<u32>,
    /// Loss of the kernel that judges on its test photographs; `None`: not known.
    pub(super) test_loss: Option<f64>,
    pub(super) target: Plane<f32>,
    weight: Option<Plane<f32>>,
    share: f64,
    /// Model of the display with the other kind of optics.
    pub(super) with_other_orders: Option<DisplayModel>,
    pub(super) validity: ValidityReport,
}

impl HologramSetup {
    /// Reads everything that the hologram of the `index`-th wavelength needs.
    pub(super) fn read(context: &JobContext, spec: &OptimizeHologram, index: usize) -> Result<Self, TaskError> {
        let (wavelength, channel) = (spec.wavelengths[index], channel_of(&spec.wavelengths, index));
        let display = DisplaySetup::read(context, &spec.display, wavelength, spec.planes[0].distance)?;
        let region = display.region(spec.region_of_interest)?;
        let mask = match &spec.weight_mask {
            Some(mask) => Some(fitted(context, &display, spec, mask, Encoding::Linear, Channel::Mean)?),
            None => None,
        };
        let depths = match &spec.depth_map {
            Some(map) => {
                let depth = fitted(context, &display, spec, map, Encoding::Linear, Channel::Mean)?;
                Some(nearest_planes(&depth, &spec.planes))
            }
            None => None,
        };
        let mut planes = Vec::new();
        for (p, plane) in spec.planes.iter().cloned().enumerate() {
            let here = DisplaySetup::read_with(context, &spec.display, wavelength, plane.distance, spec.propagation)?;
            let model = here.model(context, spec.kernel_versions[index][p])?;
            let engine = context.engines().engine(&model, spec.detector, here.carrier)?;
            let target = fitted(context, &display, spec, &plane.target, spec.target_encoding, channel)?;
            let (weight, share) = weight_in_plane(p, mask.as_ref(), depths.as_ref(), region);
            let share = share * plane.weight;
            let validity = here.validity_of(&model);
            let with_other_orders = with_other_orders(&model);
            let judging_version = spec.judging_version(index, p);
            let best = judging_version.or(spec.kernel_versions[index][p]);
            let test_loss = here.test_loss(context, best)?;
            planes.push(PlaneSetup {
                plane,
                model,
                engine,
                judging_version,
                test_loss,
                target,
                weight,
                share,
                with_other_orders,
                validity,
            });
        }
        Ok(Self { wavelength, display, region, planes, depths })
    }

    /// Pixels that belong to plane `p`; `None`: all of them, also if the depth map gives the plane no pixel of the region.
    pub(super) fn belonging(&self, p: usize) -> Option<Plane<bool>> {
        let depths = self.depths.as_ref()?;
        let pixels = pixels_of_planes(depths, self.planes.len(), self.region);
        (pixels[p] > 0).then(|| depths.map(|plane| usize::from(plane) == p))
    }

    /// Builds the optimization problem. Planes of a depth map without any weight are left out.
    pub(super) fn problem(
        &self,
        spec: &OptimizeHologram,
        card: Option<&CardOrProcessor>,
    ) -> Result<HologramProblem, TaskError> {
        let weighted = self.planes.iter().filter(|plane| plane.share > 0.0);
        if let Some(card) = card {
            let pictures = weighted.map(|plane| {
                let display = Prepared::new(&plane.model, spec.detector, self.display.carrier)?;
                Ok(Picture { display, target: plane.target.clone(), weight: plane.weight.clone(), share: plane.share })
            });
            let pictures = pictures.collect::<Result<_, lightpath_optics::Error>>()?;
            return Ok(HologramProblem::on(card, pictures, spec.subframes as usize, self.region, spec.loss)?);
        }
        let planes = weighted.map(|plane| hologram::ImagePlane {
            engine: plane.engine.clone(),
            target: plane.target.clone(),
            weight: plane.weight.clone(),
            share: plane.share,
        });
        Ok(HologramProblem::with_planes(planes.collect(), spec.subframes as usize, self.region, spec.loss)?)
    }

    pub(super) fn options(&self, spec: &OptimizeHologram) -> Result<HologramOptions, TaskError> {
        let mut options = HologramOptions::new(spec.method, spec.iterations);
        if spec.quantization_aware {
            options.levels = Some(Levels::new(self.display.response.clone(), self.display.carrier)?);
        }
        Ok(options)
    }

    /// Initial phases of the hologram of the `index`-th wavelength.
    pub(super) fn first_phases(
        &self,
        context: &JobContext,
        spec: &OptimizeHologram,
        index: usize,
        problem: &HologramProblem,
    ) -> Result<Vec<f32>, TaskError> {
        let given = |files: &Vec<String>| self.given_phases(context, spec, index, files);
        Ok(spec.initial_phase.try_map_given(given)?.phases(problem, &self.display.setup, spec.seed)?)
    }

    /// The phases of the subframes, below one another, from `files`: one file for each wavelength, or one for each
    /// subframe of each wavelength.
    fn given_phases(
        &self,
        context: &JobContext,
        spec: &OptimizeHologram,
        index: usize,
        files: &[String],
    ) -> Result<Plane<f32>, TaskError> {
        let (display, subframes) = (&self.display, spec.subframes as usize);
        let each = files.len() / spec.wavelengths.len();
        let size_px = [display.height_px(), display.width_px()];
        let mut phases = Vec::new();
        for file in &files[index * each..(index + 1) * each] {
            let bytes = context.read_artifact(file)?;
            let read = pictures::hologram_of_frames(&bytes, display.declared.bit_depth, subframes / each, size_px)?;
            let phase = match read {
                Hologram::Phase(phase) => phase,
                Hologram::Levels(levels) => display.without_carrier(display.response.dequantize(&levels)?),
            };
            phases.extend(phase.into_vec());
        }
        Ok(Plane::try_from_vec(subframes * size_px[0], size_px[1], phases)?)
    }
}

/// Colour channel of a wavelength. Of three wavelengths the longest shows red, the middle one green and the shortest
/// blue. Any other number of wavelengths shows the mean of the channels.
fn channel_of(wavelengths: &[Wavelength], index: usize) -> Channel {
    if wavelengths.len() != 3 {
        return Channel::Mean;
    }
    Channel::Colour(wavelengths.iter().filter(|other| **other > wavelengths[index]).count())
}

/// Indices of red, green and blue among three wavelengths; `None` for another number of wavelengths.
pub(super) fn colours(wavelengths: &[Wavelength]) -> Option<[usize; 3]> {
    if wavelengths.len() != 3 {
        return None;
    }
    let mut indices = [0, 1, 2];
    indices.sort_by_key(|index| std::cmp::Reverse(wavelengths[*index]));
    Some(indices)
}

fn fitted(
    context: &JobContext,
    display: &DisplaySetup,
    spec: &OptimizeHologram,
    digest: &str,
    encoding: Encoding,
    channel: Channel,
) -> Result<Plane<f32>, TaskError> {
    let bytes = context.read_artifact(digest)?;
    let (height_px, width_px) = (display.height_px(), display.width_px());
    let placement = Placement { fit: spec.target_fit, area: spec.filled().map(Into::into), height_px, width_px };
    Ok(pictures::target_channel(&bytes, encoding, channel, &placement)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wavelengths(nm: &[f64]) -> Vec<Wavelength> {
        nm.iter().map(|nm| Wavelength::from_m(nm * 1e-9).unwrap()).collect()
    }

    #[test]
    fn longest_of_three_wavelengths_shows_red_and_shortest_blue() {
        let three = wavelengths(&[515.0, 638.0, 450.0]);
        let channels: Vec<_> = (0..3).map(|i| channel_of(&three, i)).collect();
        assert_eq!(channels, [Channel::Colour(1), Channel::Colour(0), Channel::Colour(2)]);
        assert_eq!(colours(&three), Some([1, 0, 2]));
        assert_eq!(channel_of(&wavelengths(&[515.0]), 0), Channel::Mean);
        assert_eq!((channel_of(&wavelengths(&[515.0, 638.0]), 1), colours(&three[..2])), (Channel::Mean, None));
    }
}
