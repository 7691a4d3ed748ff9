//! The settings in effect, as a file that sets them.

use super::{Config, Effective, LogFormat};
use std::fmt;
use std::time::Duration;
use toml::Value;

/// TOML that a configuration file can hold, each line with what it means and where it came from.
impl fmt::Display for Effective {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (key, value, meaning) in settings(&self.config) {
            let origin = self.origins.iter().find(|(name, _)| *name == key);
            let origin = origin.map(|(_, origin)| origin.to_string()).unwrap_or_default();
            writeln!(f, "# {meaning} ({origin})\n{key} = {value}")?;
        }
        Ok(())
    }
}

fn settings(config: &Config) -> Vec<(&'static str, Value, &'static str)> {
    let count = |value: usize| Value::Integer(i64::try_from(value).unwrap_or(i64::MAX));
    let seconds = |value: Duration| Value::Float(value.as_secs_f64());
    let timeout = |value: Option<Duration>| seconds(value.unwrap_or_default());
    let mib = |bytes: u64| Value::Integer(i64::try_from(bytes >> 20).unwrap_or(i64::MAX));
    let days = |age: Option<Duration>| Value::Float(age.map_or(0.0, |age| age.as_secs_f64() / (24.0 * 3600.0)));
    let log_format = match config.log_format {
        LogFormat::Auto => "auto",
        LogFormat::Text => "text",
        LogFormat::Json => "json",
    };
    let path = |path: &std::path::Path| Value::from(path.display().to_string());
    let mut settings = vec![
        ("data_dir", Value::from(config.data_dir.display().to_string()), "folder of database and artifacts"),
        ("listen", Value::from(config.listen.to_string()), "address and port of gRPC and HTTP"),
        ("workers", count(config.workers as usize), "jobs that run at once"),
        ("compute_threads", count(config.compute_threads), "threads that one job computes on"),
        ("lease_s", seconds(config.lease), "a worker silent for this long loses its job [s]"),
        ("checkpoint_interval_s", seconds(config.checkpoint_interval), "how often a running job saves its state [s]"),
        ("queue_limit", count(config.queue_limit as usize), "jobs that may wait"),
        ("owner_queue_limit", count(config.owner_queue_limit as usize), "jobs of one owner that may wait; 0: no limit"),
        ("owner_stored_mib_max", mib(config.owner_stored_bytes_max), "space of one owner [MiB]; 0: no limit"),
        ("owner_running_limit", count(config.running.per_owner as usize), "jobs of one owner at once; 0: no limit"),
        (
            "display_running_limit",
            count(config.running.per_display as usize),
            "jobs on one display at once; 0: no limit",
        ),
        ("optimize_timeout_s", timeout(config.timeouts.optimize), "longest attempt at a hologram [s]; 0: no limit"),
        ("learn_timeout_s", timeout(config.timeouts.learn), "longest attempt at learning [s]; 0: no limit"),
        ("simulate_timeout_s", timeout(config.timeouts.simulate), "longest attempt at a capture [s]; 0: no limit"),
        ("evaluate_timeout_s", timeout(config.timeouts.evaluate), "longest attempt at evaluating [s]; 0: no limit"),
        ("disk_reserve_mib", mib(config.space.reserve_bytes), "space that only accepted work may use [MiB]"),
        ("stored_mib_max", mib(config.space.stored_bytes_max), "space of all artifacts together [MiB]; 0: no limit"),
        (
            "collect_artifacts_after_days",
            days(config.retention.artifacts),
            "unreferenced artifacts go after [d]; 0: never",
        ),
        ("collect_jobs_after_days", days(config.retention.jobs), "ended jobs go after [d]; 0: never"),
        ("drain_deadline_s", seconds(config.drain_deadline), "time to end jobs and requests when stopping [s]"),
        ("log_format", Value::from(log_format), "auto, text or json"),
        ("log_level", Value::from(config.log_level.as_str()), "what is logged"),
        (
            "calls_per_s_max",
            count(config.calls_per_s_max as usize),
            "calls a second of each token or address; 0: no limit",
        ),
        ("under_way_mib_max", mib(config.under_way_bytes_max), "memory of requests and answers [MiB]; 0: no limit"),
        ("require_tokens", Value::from(config.require_tokens), "calls from this machine need a token, too"),
        ("insecure", Value::from(config.insecure), "others may connect without TLS and tokens"),
    ];
    if let Some(tls) = &config.tls {
        settings.push(("tls_cert", path(&tls.certificate), "PEM file of the certificate"));
        settings.push(("tls_key", path(&tls.key), "PEM file of its private key"));
        if let Some(authority) = &tls.client_authority {
            settings.push(("tls_client_ca", path(authority), "PEM file of the authorities of client certificates"));
        }
    }
    settings
}

#[cfg(test)]
mod tests {
    use super::super::Settings;
    use super::*;

    #[test]
    fn what_is_printed_sets_the_same() {
        let given = Settings { workers: Some(4), log_format: Some(LogFormat::Json), ..Settings::default() };
        let effective = Effective::merge(given, None, Settings::default()).unwrap();
        let text = effective.to_string();
        assert!(text.contains("# jobs that run at once (flag)\nworkers = 4\n"), "{text}");
        let again = Effective::merge(Settings::default(), None, toml::from_str(&text).unwrap()).unwrap();
        assert_eq!(again.config, effective.config);
    }
}
