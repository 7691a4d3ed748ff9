//! Numbers of the rig's file within their ranges. An error names the field and what it may be.

pub(crate) fn whole(name: &str, value: u32, least: u32, most: u32) -> Result<(), String> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(format!("{name} is {value}: it must be {least} to {most}"))
}

pub(crate) fn number(name: &str, value: f64, least: f64, most: f64) -> Result<(), String> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(format!("{name} is {value}: it must be {least} to {most}"))
}
