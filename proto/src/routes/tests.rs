use super::*;

fn query(pairs: &[(&str, &str)]) -> Vec<(String, String)> {
    pairs.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect()
}

#[test]
fn paths_find_their_methods() {
    let find_method = |verb, path| find(verb, path).map(|found| found.route.method);
    assert_eq!(find_method("GET", "/v1/jobs"), Ok("/lightpath.v1.JobService/ListJobs"));
    assert_eq!(find_method("POST", "/v1/jobs/0193:cancel"), Ok("/lightpath.v1.JobService/CancelJob"));
    assert_eq!(find_method("GET", "/v1/jobs/0193/events"), Ok("/lightpath.v1.JobService/ListJobEvents"));
    assert_eq!(find_method("POST", "/v1/queue:pause"), Ok("/lightpath.v1.JobService/PauseQueue"));
    assert_eq!(find_method("GET", "/v1/displays/lab/kernels"), Ok("/lightpath.v1.KernelService/ListKernels"));
    assert_eq!(find_method("DELETE", "/v1/jobs"), Err(vec!["POST", "GET"]));
    for unknown in ["/v1", "/v1/", "/v1/jobs/", "/v1/jobs/a/b", "/v1/jobs/0193:explode", "/jobs", "", "v1/jobs"] {
        assert_eq!(find_method("GET", unknown), Err(vec![]), "{unknown}");
    }
}

#[test]
fn paths_queries_and_bodies_make_requests() {
    let encoded = |verb, path, pairs: &[(&str, &str)], body: &str| {
        find(verb, path).unwrap().request(query(pairs), body.as_bytes(), &[]).unwrap().message
    };
    let list = encoded("GET", "/v1/displays/lab/kernels", &[("pageSize", "7")], "");
    let wanted = v1::ListKernelsRequest { display: "displays/lab".into(), page_size: 7, ..Default::default() };
    assert_eq!(list, wanted.encode_to_vec());
    let list = encoded("GET", "/v1/jobs", &[("state", "running"), ("page_token", "x")], "");
    let state = v1::job::State::Running.into();
    let wanted = v1::ListJobsRequest { state, page_token: "x".into(), ..Default::default() };
    assert_eq!(list, wanted.encode_to_vec());
    let list = encoded("GET", "/v1/jobs", &[("since", "1970-01-01T01:00:02+01:00")], "");
    let since = Some(Timestamp { seconds: 2, nanos: 0 });
    assert_eq!(list, v1::ListJobsRequest { since, ..Default::default() }.encode_to_vec());
    let pause = encoded("POST", "/v1/queue:pause", &[], r#"{"reason": "laser off"}"#);
    let wanted = v1::PauseQueueRequest { reason: "laser off".into(), ..Default::default() };
    assert_eq!(pause, wanted.encode_to_vec());
    let batch = encoded("GET", "/v1/batches/night%2F3%3Ared", &[], "");
    assert_eq!(batch, v1::GetBatchRequest { batch: "night/3:red".into() }.encode_to_vec());
}

#[test]
fn updates_have_their_resource_in_the_body_and_their_mask_in_the_query() {
    let update = find("PATCH", "/v1/displays/lab").unwrap();
    let given = query(&[("updateMask", "notes, simulatedBench"), ("expectedRevision", "3")]);
    let request = update.request(given, br#"{"notes": "new lamp"}"#, &[]).unwrap();
    let display = v1::Display { name: "displays/lab".into(), notes: "new lamp".into(), ..Default::default() };
    let paths = vec!["notes".to_owned(), "simulated_bench".to_owned()];
    let wanted = v1::UpdateDisplayRequest {
        display: Some(display),
        update_mask: Some(pbjson_types::FieldMask { paths }),
        expected_revision: Some(3),
    };
    assert_eq!(request.message, wanted.encode_to_vec());
    let other = update.request(Vec::new(), br#"{"name": "displays/other"}"#, &[]).unwrap_err();
    assert!(other.to_string().contains("display.name differs from the path"), "{other}");
    assert_eq!(update.route.expected, Some(["expected_revision", "expectedRevision"]));
}

#[test]
fn reports_of_newer_devices_count_and_say_what_was_ignored() {
    let report = find("POST", "/v1/displays/lab/devices/bench-7:report").unwrap();
    let body = br#"{"kernel": "515nm-50mm", "triedVersion": 3, "self_test_loss": 0.5, "temperatureK": {"slm": 300}}"#;
    let request = report.request(query(&[]), body, &[]).unwrap();
    let wanted = v1::ReportDeviceRequest {
        name: "displays/lab/devices/bench-7".into(),
        kernel: "515nm-50mm".into(),
        tried_version: Some(3),
        self_test_loss: Some(0.5),
        ..Default::default()
    };
    assert_eq!(request, EncodedRequest { message: wanted.encode_to_vec(), ignored: vec!["temperatureK".to_owned()] });
    let wrong = report.request(query(&[]), br#"{"triedVersion": "three"}"#, &[]).unwrap_err();
    assert!(wrong.to_string().starts_with("triedVersion is wrong"), "{wrong}");
    let group = find("POST", "/v1/displays/lab/devices/bench-7:setGroup").unwrap();
    assert!(group.request(query(&[]), br#"{"groop": "first"}"#, &[]).unwrap_err().to_string().contains("groop"));
}

#[test]
fn wrong_requests_name_the_field() {
    let error = |verb, path, pairs: &[(&str, &str)], body: &str| {
        find(verb, path).unwrap().request(query(pairs), body.as_bytes(), &[]).unwrap_err().to_string()
    };
    let unknown = error("GET", "/v1/displays", &[("size", "7")], "");
    assert!(unknown.contains("size is unknown in the query; known are: pageSize, pageToken"), "{unknown}");
    assert!(error("GET", "/v1/jobs", &[("batch", "a"), ("batch", "b")], "").contains("batch stands twice"));
    let state = error("GET", "/v1/jobs", &[("state", "lost")], "");
    assert!(state.starts_with("state is wrong: ") && state.contains("STATE_LOST"), "{state}");
    let size = error("GET", "/v1/jobs", &[("pageSize", "-1")], "");
    assert_eq!(size, "pageSize is \"-1\"; it must be a whole number, 0 or more");
    let far = error("GET", "/v1/displays/lab/kernels:nearest", &[("place.distanceM", "far")], "");
    assert_eq!(far, "place.distanceM is \"far\"; it must be a number");
    let since = error("GET", "/v1/jobs", &[("since", "2h")], "");
    assert_eq!(since, "since is \"2h\"; it must be a time such as 2026-11-24T09:30:00Z");
    let iterations = error("POST", "/v1/jobs", &[], r#"{"spec": {"optimizeHologram": {"iterations": 1e99}}}"#);
    let wrong = "spec.optimizeHologram.iterations is wrong: a number that the field cannot hold; ";
    assert!(iterations.starts_with(wrong), "{iterations}");
    assert!(error("POST", "/v1/jobs", &[], "[]").contains("JSON object"));
    assert!(error("POST", "/v1/jobs", &[], r#"{"specc": {}}"#).contains("specc"));
    assert!(error("POST", "/v1/jobs/a:cancel", &[], r#"{"name": "jobs/b"}"#).contains("name differs"));
    assert!(error("GET", "/v1/jobs", &[], "{}").contains("in the query"));
}

#[test]
fn headers_give_fields_that_the_body_may_only_repeat() {
    let submit = find("POST", "/v1/jobs").unwrap();
    let field = submit.route.request_id.unwrap();
    assert_eq!(field, ["request_id", "requestId"]);
    let given = [FromHeader { header: "the header idempotency-key", field, value: "once".into() }];
    let request = |body: &[u8]| submit.request(Vec::new(), body, &given);
    let wanted = v1::SubmitJobRequest { request_id: "once".into(), ..Default::default() }.encode_to_vec();
    for body in [&b""[..], br#"{"request_id": "once"}"#, br#"{"requestId": "once"}"#] {
        assert_eq!(request(body).unwrap().message, wanted);
    }
    let twice = request(br#"{"requestId": "twice"}"#).unwrap_err().to_string();
    assert_eq!(twice, "request_id differs from the header idempotency-key; give one of them");
    let expected = |path| find("POST", path).unwrap().route.expected.map(|names| names[0]);
    assert_eq!(expected("/v1/displays/a/kernels/b:promote"), Some("expected_active_version"));
    assert_eq!(expected("/v1/displays/a/kernels/b/rollouts/1:widen"), Some("expected_revision"));
    assert_eq!(expected("/v1/jobs/a:cancel"), None);
}

#[test]
fn answers_become_json() {
    let route = find("GET", "/v1/queue").unwrap().route;
    let json = route.json(v1::Queue { queued: 3, ..Default::default() }.encode_to_vec().into()).unwrap();
    assert_eq!(serde_json::from_slice::<Value>(&json).unwrap()["queued"], "3");
    assert!(route.json(Bytes::from_static(b"\xff")).is_err());
}
