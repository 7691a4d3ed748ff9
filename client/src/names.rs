//! Resource names of the API.

/// Returns `displays/{id}`. An `id` that is already such a name is returned unchanged.
#[must_use]
pub fn display(id: &str) -> String {
    with_collection("displays", id)
}

/// Returns `datasets/{id}`. An `id` that is already such a name is returned unchanged.
#[must_use]
pub fn dataset(id: &str) -> String {
    with_collection("datasets", id)
}

/// Returns `jobs/{id}`. An `id` that is already such a name is returned unchanged.
#[must_use]
pub fn job(id: &str) -> String {
    with_collection("jobs", id)
}

/// Returns `{kernel}/versions/{version}`.
#[must_use]
pub fn kernel_version(kernel: &str, version: u32) -> String {
    format!("{kernel}/versions/{version}")
}

/// Returns the name of the kernel of which this is the name of a version: `displays/{id}/kernels/{k}`.
#[must_use]
pub fn kernel_of(version: &str) -> &str {
    version.split_once("/versions/").map_or(version, |(kernel, _)| kernel)
}

/// Returns `{kernel}/rollouts/{number}`.
#[must_use]
pub fn rollout(kernel: &str, number: u32) -> String {
    format!("{kernel}/rollouts/{number}")
}

/// Returns `displays/{display}/devices/{device}`. A `device_id` that is already such a name is returned unchanged.
#[must_use]
pub fn device(display_id: &str, device_id: &str) -> String {
    if device_id.contains('/') { device_id.to_owned() } else { format!("{}/devices/{device_id}", display(display_id)) }
}

/// Returns `webhooks/{id}`. An `id` that is already such a name is returned unchanged.
#[must_use]
pub fn webhook(id: &str) -> String {
    with_collection("webhooks", id)
}

/// Returns the last part of a name: the id.
#[must_use]
pub fn id(name: &str) -> &str {
    name.rsplit('/').next().unwrap_or(name)
}

fn with_collection(collection: &str, id: &str) -> String {
    let is_name = id.strip_prefix(collection).is_some_and(|rest| rest.starts_with('/'));
    if is_name { id.to_owned() } else { format!("{collection}/{id}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_have_the_form_of_the_api() {
        assert_eq!(display("lab-2"), "displays/lab-2");
        assert_eq!(display("displays/lab-2"), "displays/lab-2");
        assert_eq!(job("jobs-1"), "jobs/jobs-1");
        assert_eq!(kernel_version("displays/a/kernels/k", 3), "displays/a/kernels/k/versions/3");
        assert_eq!(kernel_of("displays/a/kernels/k/versions/3"), "displays/a/kernels/k");
        assert_eq!(id("displays/a/kernels/k/versions/3"), "3");
    }
}
