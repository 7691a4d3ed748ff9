//! Judges the holograms of a job by an independent model.

use crate::hologram_setup::HologramSetup;
use crate::{JobContext, TaskError, TaskOutput};
use lightpath_domain::job::{
    FailureReason, HologramResult, JobEffect, JobResult, JobSpec, OptimizeHologram, PlaneOpinion, Progress,
    VerifyHologram, VerifyResult, WavelengthResult,
};
use lightpath_domain::units::Distance;
use lightpath_optics::hologram::{ShownLight, Wanted};
use lightpath_optics::second_opinion::{Effort, SecondOpinion};
use lightpath_optics::{Detector, Plane};

pub(super) fn run(context: &JobContext, spec: &VerifyHologram) -> Result<TaskOutput, TaskError> {
    let job = context.wait(context.store().job(&spec.job))?;
    let (JobSpec::OptimizeHologram(request), Some(JobResult::OptimizeHologram(hologram))) = (job.spec, job.result)
    else {
        let message = format!("jobs/{} has no holograms", spec.job);
        return Err(TaskError::permanent(FailureReason::InvalidInput, message));
    };
    let mut verification =
        Verification { context, request: &request, planes: Vec::new(), done: 0, steps: steps(&hologram) };
    for (index, wavelength) in hologram.wavelengths.iter().enumerate() {
        verification.judge(index, wavelength)?;
    }
    let result = VerifyResult { planes: verification.planes };
    Ok(TaskOutput { result: JobResult::VerifyHologram(result), effect: JobEffect::None })
}

/// Number of judgements: one for each picture and detector.
fn steps(hologram: &HologramResult) -> u32 {
    let pictures: usize = hologram.wavelengths.iter().map(|wavelength| wavelength.planes.len()).sum();
    (pictures * Detector::ALL.len()) as u32
}

struct Verification<'a> {
    context: &'a JobContext,
    request: &'a OptimizeHologram,
    planes: Vec<PlaneOpinion>,
    done: u32,
    steps: u32,
}

impl Verification<'_> {
    /// Judges the pictures of the hologram of one wavelength.
    fn judge(&mut self, index: usize, hologram: &WavelengthResult) -> Result<(), TaskError> {
        self.report()?;
        let setup = HologramSetup::read(self.context, self.request, index)?;
        let displayed = |levels: &str| -> Result<Plane<f32>, TaskError> {
            let phase = setup.display.displayed_phase(&self.context.read_artifact(levels)?)?;
            Ok(setup.display.without_carrier(phase))
        };
        let phases: Vec<_> =
            hologram.subframes.iter().map(|subframe| displayed(&subframe.pattern)).collect::<Result<_, TaskError>>()?;
        for (p, plane) in setup.planes.iter().enumerate() {
            let belonging = setup.belonging(p);
            let wanted = Wanted { target: &plane.target, region: setup.region, belonging: belonging.as_ref() };
            let shown = ShownLight::of_frames(&plane.engine, &phases)?;
            let mut opinions = Vec::with_capacity(Detector::ALL.len());
            for detector in Detector::ALL {
                let opinion = SecondOpinion::of(
                    (&plane.model, setup.display.carrier),
                    &phases,
                    &shown,
                    detector,
                    wanted,
                    Effort::THOROUGH,
                )?;
                opinions.push(opinion.ok_or_else(|| no_opinion(plane.plane.distance))?);
                self.done += 1;
                self.report()?;
            }
            let [point, pixel, supersampled] = opinions[..] else { continue };
            self.planes.push(PlaneOpinion {
                wavelength: setup.wavelength,
                distance: plane.plane.distance,
                opinions: [point, pixel, supersampled],
            });
        }
        Ok(())
    }

    fn report(&self) -> Result<(), TaskError> {
        let (step, steps_total) = (self.done, self.steps);
        self.context.report(Progress { stage: "verify".to_owned(), step, steps_total, loss: None, eta_s: None })
    }
}

fn no_opinion(distance: Distance) -> TaskError {
    let message = format!(
        "the independent model cannot judge the picture at {distance}: it has no kernels that vary over the SLM or have a \
         value for each frequency, and no displays that need more than 2^34 frequencies"
    );
    TaskError::permanent(FailureReason::NotVerifiable, message)
}
