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

/// Returns the name of a kernel, for example `displays/{id}/kernels/515nm-150mm`.
///
/// As on the server, the wavelength is rounded to whole picometres and the distance to whole nanometres.
#[must_use]
pub fn kernel(display_id: &str, wavelength_m: f64, distance_m: f64) -> String {
    let wavelength = whole_and_rest((wavelength_m * 1e12).round() as i64, 1_000);
    let distance = whole_and_rest((distance_m * 1e9).round() as i64, 1_000_000);
    format!("{}/kernels/{wavelength}nm-{distance}mm", display(display_id))
}

/// Returns `{kernel}/versions/{version}`.
#[must_use]
pub fn kernel_version(kernel: &str, version: u32) -> String {
    format!("{kernel}/versions/{version}")
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

fn whole_and_rest(value: i64, per_unit: u64) -> String {
    let sign = if value < 0 { "-" } else { "" };
    let (whole, rest) = (value.unsigned_abs() / per_unit, value.unsigned_abs() % per_unit);
    if rest == 0 {
        return format!("{sign}{whole}");
    }
    let digits = per_unit.ilog10() as usize;
    let fraction = format!("{rest:0digits$}");
    format!("{sign}{whole}.{}", fraction.trim_end_matches('0'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_have_the_form_of_the_api() {
        assert_eq!(display("lab-2"), "displays/lab-2");
        assert_eq!(display("displays/lab-2"), "displays/lab-2");
        assert_eq!(job("jobs-1"), "jobs/jobs-1");
        assert_eq!(kernel("lab-2", 515e-9, 0.15), "displays/lab-2/kernels/515nm-150mm");
        assert_eq!(kernel("lab-2", 632.8e-9, -0.0125), "displays/lab-2/kernels/632.8nm--12.5mm");
        assert_eq!(kernel_version("displays/a/kernels/k", 3), "displays/a/kernels/k/versions/3");
        assert_eq!(id("displays/a/kernels/k/versions/3"), "3");
    }
}
