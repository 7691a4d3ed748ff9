//! Memory of the machine, for the default of the memory for jobs.

use std::fs;
use std::path::PathBuf;

const MIB: f64 = 1_048_576.0;
/// Memory that is assumed where it cannot be read \[MiB\]: half of that of a small server.
const UNKNOWN_MIB: f64 = 4096.0;
/// Memory that is left to the server and the system where there is enough \[MiB\].
const REST_MIB: f64 = 1024.0;
/// Part of the memory that is left to the server and the system.
const REST_PART: f64 = 0.25;

/// Memory for jobs \[MiB\]: three quarters of all memory, at least 1 GiB less than all, but at least half of it.
pub(super) fn for_jobs_mib() -> f64 {
    of_all_mib(all_mib().unwrap_or(UNKNOWN_MIB)).round()
}

fn of_all_mib(all_mib: f64) -> f64 {
    all_mib - (REST_PART * all_mib).max(REST_MIB).min(all_mib / 2.0)
}

/// Memory of the machine, or the limit of the process's control group if it is lower \[MiB\]. `None`: the system has no
/// `/proc`.
fn all_mib() -> Option<f64> {
    let machine = fs::read_to_string("/proc/meminfo").ok().and_then(|text| total_mib(&text));
    [machine].into_iter().chain(groups().into_iter().map(|file| limit_mib(&file))).flatten().reduce(f64::min)
}

/// `MemTotal` of `/proc/meminfo` \[MiB\].
fn total_mib(meminfo: &str) -> Option<f64> {
    let kib = meminfo.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    Some(kib.trim().trim_end_matches("kB").trim().parse::<f64>().ok()? / 1024.0)
}

/// Files with the limits of the process's control group and of the groups above it, in both versions of Linux.
fn groups() -> Vec<PathBuf> {
    let own = fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    let mut files = Vec::new();
    for line in own.lines() {
        let mut parts = line.splitn(3, ':').skip(1);
        let (Some(controllers), Some(path)) = (parts.next(), parts.next()) else { continue };
        let (root, name) = match controllers {
            "" => ("/sys/fs/cgroup", "memory.max"),
            "memory" => ("/sys/fs/cgroup/memory", "memory.limit_in_bytes"),
            _ => continue,
        };
        let group = PathBuf::from(root).join(path.trim_start_matches('/'));
        files.extend(group.ancestors().take_while(|above| above.starts_with(root)).map(|above| above.join(name)));
    }
    files
}

/// Limit in a file of a control group \[MiB\]; `None`: there is no limit.
fn limit_mib(file: &PathBuf) -> Option<f64> {
    Some(fs::read_to_string(file).ok()?.trim().parse::<u64>().ok()? as f64 / MIB)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jobs_get_three_quarters_of_large_machines_and_half_of_small_ones() {
        assert_eq!([512.0, 2048.0, 3072.0, 16_384.0].map(of_all_mib), [256.0, 1024.0, 2048.0, 12_288.0]);
    }

    #[test]
    fn memory_is_read_from_meminfo_and_groups() {
        assert_eq!(total_mib("MemFree: 1 kB\nMemTotal:       24576 kB\n"), Some(24.0));
        assert_eq!(total_mib("MemTotal: many\n"), None);
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("memory.max");
        for (text, expected) in [("max\n", None), ("1073741824\n", Some(1024.0))] {
            fs::write(&file, text).unwrap();
            assert_eq!(limit_mib(&file), expected);
        }
        assert_eq!(limit_mib(&folder.path().join("missing")), None);
    }
}
