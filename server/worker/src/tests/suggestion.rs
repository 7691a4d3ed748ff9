//! Tests of jobs that suggest holograms to photograph, on a small simulated display.

use super::super::*;
use super::bench::DISTANCE;
use super::whole_loop::{Lab, learn, threads};
use lightpath_domain::job::{
    FailureReason, JobResult, JobSpec, JobState, LearnResult, SuggestHolograms, SuggestResult,
};
use lightpath_domain::kernel::{KernelKey, KernelModel};
use lightpath_fixtures::WAVELENGTH;
use lightpath_media::pictures;
use lightpath_optics::learning::ModelPart;

fn suggest(version: u32, holograms: u32) -> JobSpec {
    let kernel = KernelKey { display: "lab".to_owned(), wavelength: WAVELENGTH, distance: DISTANCE };
    JobSpec::SuggestHolograms(SuggestHolograms { kernel, version, holograms, seed: 5 })
}

/// A lab with a kernel, learned from photographs of holograms that all start from random phases within 1 rad.
async fn lab_with_kernel() -> (Lab, LearnResult) {
    let lab = Lab::new().await;
    lab.dataset(8).await;
    match lab.run_job("learn", learn(KernelModel::Display, 1, 8)).await {
        JobResult::LearnKernel(learned) => (lab, learned),
        other => panic!("{other:?}"),
    }
}

async fn suggested(lab: &Lab, request_id: &str, compute_threads: usize) -> SuggestResult {
    let id = lab.bench.submit(request_id, suggest(1, 2), 1).await;
    let job = lab.run_until(threads(compute_threads), &id, |job| job.state.has_ended()).await;
    let progress = job.progress.expect("the job has progress");
    assert!(progress.steps_total > 0 && progress.step == progress.steps_total, "{progress:?}");
    match job.result {
        Some(JobResult::SuggestHolograms(suggestions)) => suggestions,
        other => panic!("{other:?}, {:?}", job.error),
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn suggested_holograms_can_be_shown_and_tell_more_than_the_others() {
    let (lab, learned) = lab_with_kernel().await;
    let crosstalk = learned.parts.iter().find(|strength| strength.part == ModelPart::Crosstalk).unwrap();
    let could_hide = crosstalk.measures.iter().all(|measure| measure.hidden.is_some_and(|sigma_px| sigma_px > 0.0));
    assert!(crosstalk.measures.len() == 2 && could_hide, "{crosstalk:?}");
    let suggestions = suggested(&lab, "suggest", 2).await;
    let [first, second] = &suggestions.holograms[..] else { panic!("{suggestions:?}") };
    assert!(first.error_db < 0.0 && second.error_db < first.error_db && first.part_db < 0.0, "{suggestions:?}");
    assert!(suggestions.worth_photographs > 2.0 && first.pattern != second.pattern, "{suggestions:?}");
    let file = lab.bench.artifacts.read_all(&first.pattern).await.unwrap();
    assert!(pictures::levels(&file, 8, lab.height_px, lab.width_px).is_ok());
    lab.photograph("photo of the suggestion", &first.pattern).await;
    assert_eq!(suggested(&lab, "again, on one thread", 1).await, suggestions);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn suggestion_needs_the_dataset_of_the_kernel() {
    let (lab, _) = lab_with_kernel().await;
    lab.bench.store.delete_dataset("photos", 9).await.unwrap();
    let id = lab.bench.submit("suggest", suggest(1, 2), 3).await;
    let job = lab.run_until(threads(1), &id, |job| job.state.has_ended()).await;
    let error = job.error.unwrap();
    assert_eq!((job.state, job.attempt, error.reason), (JobState::Failed, 1, FailureReason::DatasetDeleted));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn cancelled_suggestion_stops_without_a_result() {
    let (lab, _) = lab_with_kernel().await;
    // The job is cancelled before its work begins, so that the first check stops it.
    let wait = |job: &Job, context: &JobContext| {
        while context.should_stop().is_none() {
            std::thread::yield_now();
        }
        OpticsTask.run(job, context)
    };
    let working = lab.bench.start(threads(2), wait);
    let id = lab.bench.submit("suggest", suggest(1, 2), 3).await;
    lab.bench.until(&id, |job| job.state == JobState::Running).await;
    lab.bench.store.cancel(&id, 4).await.unwrap();
    let job = lab.bench.ended(&id).await;
    assert_eq!((job.state, job.result), (JobState::Cancelled, None));
    working.stop().await;
}
