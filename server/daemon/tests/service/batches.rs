//! Jobs that are submitted with one call.

use crate::jobs::{optimize, picture};
use crate::serving::{Serving, expect};
use lightpath_proto::v1::{self, job_spec};
use tonic::Code;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn jobs_are_accepted_together_or_not_at_all_and_every_wrong_field_is_named() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    serving.jobs().pause_queue(v1::PauseQueueRequest::default()).await.unwrap();
    let target = serving.upload(&picture()).await;
    let request = |id: &str, target: &str, distance_m: f64| {
        let mut spec = optimize(target);
        spec.planes[0].place = Some(v1::Place::at_m(distance_m));
        let spec = Some(v1::JobSpec { kind: Some(job_spec::Kind::OptimizeHologram(spec)) });
        v1::SubmitJobRequest { spec, request_id: id.into(), ..Default::default() }
    };
    let submit = async |requests: &[v1::SubmitJobRequest]| {
        let request = v1::SubmitJobsRequest { requests: requests.to_vec() };
        serving.jobs().submit_jobs(request).await.map(|answer| answer.into_inner().jobs)
    };
    let count = async || {
        let list = v1::ListJobsRequest::default();
        serving.jobs().list_jobs(list).await.unwrap().into_inner().jobs.len()
    };
    let good = [request("a", &target, 0.01), request("b", &target, 0.02)];
    let bad = [good[0].clone(), request("x", &target, 99.0), request("y", "no-digest", 0.01)];
    let refused = submit(&bad).await.unwrap_err();
    let wrong =
        ["requests[1].spec.optimize_hologram.planes[0].place", "requests[2].spec.optimize_hologram.planes[0].target"];
    assert!(wrong.iter().all(|field| refused.message().contains(field)), "{}", refused.message());
    expect(submit(&[]).await, Code::InvalidArgument, "requests has 0 jobs, but must have 1 to 200");
    // The store refuses the second, and forgets the first.
    let other = request("a", &target, 0.02);
    expect(submit(&[good[0].clone(), other]).await, Code::AlreadyExists, "request_id \"a\" already exists");
    assert_eq!(count().await, 0, "no job of a refused call was accepted");
    let jobs = submit(&good).await.unwrap();
    assert_eq!(jobs.iter().map(|job| job.request_id.as_str()).collect::<Vec<_>>(), ["a", "b"]);
    let again = submit(&good).await.unwrap();
    assert!(again.iter().zip(&jobs).all(|(again, first)| again.name == first.name), "{again:?}");
    assert_eq!(count().await, 2);
}
