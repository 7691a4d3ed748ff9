//! Resource names: `displays/{id}`, `datasets/{id}`, `jobs/{id}`, `displays/{id}/kernels/{k}/versions/{n}`.

use lightpath_domain::kernel::KernelKey;
use lightpath_domain::units::{Distance, Wavelength};
use lightpath_service::permissions::{require_all_displays, require_display};
use lightpath_service::{Call, Field, Result, shortened};

/// Limit on the length of an id \[bytes\]: that of a DNS label, so that ids can be names of hosts and folders.
const ID_BYTES_MAX: usize = 63;

/// The id in `displays/{id}`. Refuses a display that the caller may not use.
pub(crate) fn display_id(call: &Call, field: &Field, name: &str) -> Result<String> {
    let id = checked_id(field, name, "displays")?;
    require_display(call, &id)?;
    Ok(id)
}

/// The id of the display in `displays/{id}/rig`.
pub(crate) fn rig_display(call: &Call, field: &Field, name: &str) -> Result<String> {
    let display = name.strip_suffix("/rig").ok_or_else(|| {
        field.but(format!("is {:?}", shortened(name)), "must be displays/{id}/rig, for example displays/lab-2/rig")
    });
    display_id(call, field, display?)
}

/// The id in `datasets/{id}`.
pub(crate) fn dataset_id(field: &Field, name: &str) -> Result<String> {
    checked_id(field, name, "datasets")
}

/// The id in `webhooks/{id}`.
pub(crate) fn webhook_id(field: &Field, name: &str) -> Result<String> {
    checked_id(field, name, "webhooks")
}

/// The id in `jobs/{id}`. The job need not exist.
pub(crate) fn job_id(field: &Field, name: &str) -> Result<String> {
    match name.strip_prefix("jobs/") {
        Some(id) if !id.is_empty() && id.len() <= ID_BYTES_MAX && !id.contains('/') => Ok(id.to_owned()),
        _ => Err(field.but(format!("is {:?}", shortened(name)), "must have the form jobs/{id}")),
    }
}

/// The id of the display in a filter; `None` if the filter is empty. Callers with tokens for some displays must name
/// one.
pub(crate) fn display_filter(call: &Call, field: &Field, name: &str) -> Result<Option<String>> {
    if name.is_empty() {
        require_all_displays(call, &field.to_string())?;
        return Ok(None);
    }
    display_id(call, field, name).map(Some)
}

/// The key in `displays/{id}/kernels/{wavelength}-{distance}`.
pub(crate) fn kernel_key(call: &Call, field: &Field, name: &str) -> Result<KernelKey> {
    let refusal = || {
        let form = "displays/{id}/kernels/{wavelength}-{distance}, for example displays/lab-2/kernels/515nm-150mm";
        field.but(format!("is {:?}", shortened(name)), format!("must have the form {form}"))
    };
    let (display, kernel) = name.split_once("/kernels/").ok_or_else(refusal)?;
    let (wavelength, distance) = kernel.split_once('-').ok_or_else(refusal)?;
    let key = KernelKey {
        display: display_id(call, field, display)?,
        wavelength: Wavelength::parse(wavelength).ok_or_else(refusal)?,
        distance: Distance::parse(distance).ok_or_else(refusal)?,
    };
    // Each kernel has exactly one name: `515.0nm-150mm` is not a name.
    if key.to_string() == name { Ok(key) } else { Err(refusal()) }
}

/// The key and version number in `displays/{id}/kernels/{k}/versions/{n}`.
pub(crate) fn kernel_version(call: &Call, field: &Field, name: &str) -> Result<(KernelKey, u32)> {
    numbered(call, field, name, "versions")
}

/// The kernel and the number in `displays/{id}/kernels/{k}/rollouts/{n}`.
pub(crate) fn rollout(call: &Call, field: &Field, name: &str) -> Result<(KernelKey, u32)> {
    numbered(call, field, name, "rollouts")
}

/// The kernel and the number of what belongs to it.
fn numbered(call: &Call, field: &Field, name: &str, collection: &str) -> Result<(KernelKey, u32)> {
    let parts = name.split_once(&format!("/{collection}/"));
    let numbered = parts.and_then(|(kernel, number)| Some((kernel, number.parse().ok()?)));
    let (kernel, number) = numbered.ok_or_else(|| {
        let form = format!("displays/{{id}}/kernels/{{k}}/{collection}/{{n}}");
        field.but(format!("is {:?}", shortened(name)), format!("must have the form {form}"))
    })?;
    Ok((kernel_key(call, field, kernel)?, number))
}

/// The display and the device in `displays/{id}/devices/{d}`.
pub(crate) fn device(call: &Call, field: &Field, name: &str) -> Result<(String, String)> {
    let (display, device) = name.split_once("/devices/").ok_or_else(|| {
        field.but(format!("is {:?}", shortened(name)), "must have the form displays/{id}/devices/{d}")
    })?;
    Ok((display_id(call, field, display)?, device_id(field, device)?))
}

/// Checks the id of a device. Ids are like the names of tokens, because a device is named after its token.
pub(crate) fn device_id(field: &Field, id: &str) -> Result<String> {
    if id.starts_with(['.', '-']) {
        return Err(field.but(format!("is {:?}", shortened(id)), "an id must start with a letter, a digit or '_'"));
    }
    pair_id(field, id)
}

/// Checks a name that people choose: 1 to 63 characters of a-z, 0-9 and '-', starting with a letter.
pub(crate) fn label<'a>(field: &Field, text: &'a str) -> Result<&'a str> {
    if is_label(text) {
        return Ok(text);
    }
    let rule = "1 to 63 characters of a-z, 0-9 and '-', starting with a letter";
    Err(field.but(format!("is {:?}", shortened(text)), format!("must be {rule}")))
}

fn is_label(text: &str) -> bool {
    let allowed = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'-';
    (1..=ID_BYTES_MAX).contains(&text.len()) && text.as_bytes()[0].is_ascii_lowercase() && text.bytes().all(allowed)
}

/// Checks the id of a pair: 1 to 63 characters of a-z, A-Z, 0-9, '.', '_' and '-'.
pub(crate) fn pair_id(field: &Field, id: &str) -> Result<String> {
    let allowed = |byte: u8| byte.is_ascii_alphanumeric() || b"._-".contains(&byte);
    if (1..=ID_BYTES_MAX).contains(&id.len()) && id.bytes().all(allowed) {
        return Ok(id.to_owned());
    }
    let rule = "1 to 63 characters of a-z, A-Z, 0-9, '.', '_' and '-'";
    Err(field.but(format!("is {:?}", shortened(id)), format!("must be {rule}")))
}

fn checked_id(field: &Field, name: &str, collection: &str) -> Result<String> {
    let id = name.strip_prefix(collection).and_then(|rest| rest.strip_prefix('/'));
    id.filter(|id| is_label(id)).map(ToOwned::to_owned).ok_or_else(|| {
        let rule = "with an id of 1 to 63 characters of a-z, 0-9 and '-', starting with a letter";
        field.but(format!("is {:?}", shortened(name)), format!("must be {collection}/{{id}} {rule}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernel_names_survive_parsing_and_malformed_ones_are_refused() {
        let (call, field) = (Call::without_token(), Field::new("name"));
        for name in [
            "displays/lab-2/kernels/515nm-150mm",
            "displays/a/kernels/632.8nm--12.5mm",
            "displays/a/kernels/1064nm-0.000001mm",
        ] {
            assert_eq!(kernel_key(&call, &field, name).unwrap().to_string(), name);
        }
        for bad in [
            "",
            "displays/lab-2",
            "displays/lab-2/kernels/515nm",
            "displays/lab-2/kernels/515.0nm-150mm",
            "displays/lab-2/kernels/515nm-150mm/versions/3",
            "displays/lab-2/kernels/515nm-99999mm",
            "displays/Lab/kernels/515nm-150mm",
            "displays/lab-2/kernels/-515nm-150mm",
            "displays/lab-2/kernels/nannm-150mm",
        ] {
            assert!(kernel_key(&call, &field, bad).is_err(), "{bad}");
        }
        let (key, version) = kernel_version(&call, &field, "displays/lab-2/kernels/515nm-150mm/versions/3").unwrap();
        assert_eq!((key.display.as_str(), version), ("lab-2", 3));
    }

    #[test]
    fn malformed_ids_are_refused() {
        let (call, field) = (Call::without_token(), Field::new("name"));
        assert_eq!(display_id(&call, &field, "displays/pluto-2").unwrap(), "pluto-2");
        for bad in ["pluto", "displays/", "displays/2pluto", "displays/a/b", "displays/../x", "datasets/pluto"] {
            assert!(display_id(&call, &field, bad).is_err(), "{bad}");
        }
        assert!(display_id(&call, &field, &format!("displays/{}", "a".repeat(64))).is_err());
        assert!(
            pair_id(&field, "IMG_0001.png").is_ok() && pair_id(&field, "a/b").is_err() && pair_id(&field, "").is_err()
        );
        assert!(job_id(&field, "jobs/").is_err() && job_id(&field, "0195").is_err());
        assert_eq!(job_id(&field, "jobs/0195").unwrap(), "0195");
    }
}
