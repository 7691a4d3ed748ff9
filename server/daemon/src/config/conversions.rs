//! Conversion of settings into the types of the server's parts.

use super::{Config, ConfigError, SecretText};
use crate::database::Database;
use lightpath_api::http::Hosts;
use lightpath_api::tls::TlsFiles;
use lightpath_artifacts::{RemoteOptions, SpaceLimits};
use lightpath_domain::ability::Labels;
use lightpath_domain::origin::Origins;
use lightpath_service::{JobLimits, ManifestRules, ServiceLimits};
use lightpath_store::{ClaimLimits, QueueLimits};
use lightpath_worker::{Timeouts, WorkerConfig};
use std::time::Duration;

const MIB: f64 = 1_048_576.0;
const DAY_S: f64 = 24.0 * 3600.0;
/// Why the settings of TLS need each other.
const TLS: &str = "TLS needs both";

impl Config {
    /// Where the database is.
    ///
    /// # Errors
    ///
    /// [`ConfigError::DatabaseUrl`] if the setting names another kind of database.
    pub fn database(&self) -> Result<Database, ConfigError> {
        Database::of(&self.data_dir, self.database_url.as_ref().map(SecretText::reveal)).ok_or(ConfigError::DatabaseUrl)
    }

    /// Makes sure that other processes can share the database and the artifacts of this one.
    ///
    /// # Errors
    ///
    /// [`ConfigError::NotShared`].
    pub fn require_shared(&self, what: &'static str) -> Result<(), ConfigError> {
        let not_shared = |missing| Err(ConfigError::NotShared { what, missing });
        match (&self.database_url, &self.artifacts_url) {
            (None, _) => not_shared("database_url"),
            (Some(_), None) => not_shared("artifacts_url"),
            (Some(_), Some(_)) => Ok(()),
        }
    }

    /// The bucket of the artifacts; `None`: they are in the data folder.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Incomplete`] if a setting that belongs to the bucket is missing, or if there is no database that
    /// servers on several machines can share; [`ConfigError::ArtifactsUrl`], [`ConfigError::ArtifactsEndpoint`].
    pub fn bucket(&self) -> Result<Option<RemoteOptions>, ConfigError> {
        let Some(url) = &self.artifacts_url else {
            let given = [
                ("artifacts_endpoint", self.artifacts_endpoint.is_some()),
                ("artifacts_access_key_id", self.artifacts_access_key_id.is_some()),
                ("artifacts_secret_access_key", self.artifacts_secret_access_key.is_some()),
            ];
            return match given.into_iter().find(|(_, is_given)| *is_given) {
                Some((given, _)) => Err(incomplete(given, "artifacts_url", "it names the bucket")),
                None => Ok(None),
            };
        };
        let bucket = url.strip_prefix("s3://").and_then(|rest| rest.split('/').next());
        if bucket.is_none_or(str::is_empty) {
            return Err(ConfigError::ArtifactsUrl { url: url.clone() });
        }
        if self.database_url.is_none() {
            let reason = "servers share a bucket only with the database that says what is in it";
            return Err(incomplete("artifacts_url", "database_url", reason));
        }
        let missing = |missing| incomplete("artifacts_url", missing, "a key signs each request to the S3 store");
        let endpoint = self.artifacts_endpoint.clone();
        let allowed = ["https://", "http://"].into_iter().take(1 + usize::from(self.artifacts_allow_http));
        if let Some(url) = endpoint.clone().filter(|url| !allowed.clone().any(|scheme| url.starts_with(scheme))) {
            return Err(ConfigError::ArtifactsEndpoint { url });
        }
        Ok(Some(RemoteOptions {
            url: url.clone(),
            endpoint,
            region: self.artifacts_region.clone(),
            access_key_id: self.artifacts_access_key_id.clone().ok_or_else(|| missing("artifacts_access_key_id"))?,
            secret_access_key: self
                .artifacts_secret_access_key
                .as_ref()
                .map(|secret| secret.reveal().to_owned())
                .ok_or_else(|| missing("artifacts_secret_access_key"))?,
            allow_http: self.artifacts_allow_http,
            cache_bytes_max: bytes(self.artifacts_cache_mib_max),
        }))
    }

    /// Files for TLS; `None`: no TLS.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Incomplete`] if only one of certificate and key is given, or if client authorities are given
    /// without them.
    pub fn tls(&self) -> Result<Option<TlsFiles>, ConfigError> {
        let client_authority = self.tls_client_ca.clone();
        match (self.tls_cert.clone(), self.tls_key.clone()) {
            (Some(certificate), Some(key)) => Ok(Some(TlsFiles { certificate, key, client_authority })),
            (Some(_), None) => Err(incomplete("tls_cert", "tls_key", TLS)),
            (None, Some(_)) => Err(incomplete("tls_key", "tls_cert", TLS)),
            (None, None) if client_authority.is_some() => Err(incomplete("tls_client_ca", "tls_cert", TLS)),
            (None, None) => Ok(None),
        }
    }

    /// Labels of the workers.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Labels`] if the setting `worker_labels` is no list of labels.
    pub fn labels(&self) -> Result<Labels, ConfigError> {
        Labels::parse(&self.worker_labels).map_err(ConfigError::Labels)
    }

    /// Limit on the memory of unfinished requests and their answers \[bytes\]; 0: no limit.
    #[must_use]
    pub fn under_way_bytes_max(&self) -> u64 {
        bytes(self.under_way_mib_max)
    }

    /// Limits on the disk space that new work may use.
    #[must_use]
    pub fn space(&self) -> SpaceLimits {
        SpaceLimits { reserve_bytes: bytes(self.disk_reserve_mib), stored_bytes_max: bytes(self.stored_mib_max) }
    }

    /// Limits on what clients may use, on a machine whose speed is `work_per_s`.
    #[must_use]
    pub fn service_limits(&self, work_per_s: f64) -> ServiceLimits {
        let (queue, jobs) = (self.queue_limits(), self.job_limits(work_per_s));
        let manifests = ManifestRules {
            life_s: (self.manifest_days * DAY_S) as u32,
            poll_interval_s: self.poll_interval_s.round() as u32,
        };
        ServiceLimits { queue, jobs, computing_bytes: bytes(self.computing_mib_max), manifests }
    }

    /// The names to which the server answers, and the web pages of other sites that may call it.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Origins`] if the setting `cors_origins` is no list of origins.
    pub fn hosts(&self, tokens_required: bool) -> Result<Hosts, ConfigError> {
        let names = self.host_names.split(',').map(|name| name.trim().to_owned()).filter(|name| !name.is_empty());
        let hosts = if tokens_required { Hosts::all() } else { Hosts::only(names) };
        Ok(hosts.with_pages(Origins::parse(&self.cors_origins).map_err(ConfigError::Origins)?))
    }

    /// The origins to which webhooks may go.
    ///
    /// # Errors
    ///
    /// [`ConfigError::WebhookOrigins`] if the setting is no list of origins.
    pub fn webhook_origins(&self) -> Result<Origins, ConfigError> {
        Origins::parse(&self.webhook_origins).map_err(ConfigError::WebhookOrigins)
    }

    /// Limits on the queue and on the space of each owner.
    #[must_use]
    pub fn queue_limits(&self) -> QueueLimits {
        QueueLimits {
            queued: self.queue_limit,
            queued_per_owner: self.owner_queue_limit,
            stored_bytes_per_owner: bytes(self.owner_stored_mib_max),
        }
    }

    /// Time that running jobs and open requests have to end when the server stops.
    #[must_use]
    pub fn drain_deadline(&self) -> Duration {
        Duration::from_secs_f64(self.drain_deadline_s)
    }

    /// Limits on each job, on a machine that does `work_per_s` work each second.
    #[must_use]
    pub fn job_limits(&self, work_per_s: f64) -> JobLimits {
        let memory_bytes = bytes(self.job_memory_mib_max);
        let cache_bytes = lightpath_worker::cache_bytes_max(memory_bytes);
        JobLimits {
            memory_bytes: self.job_bytes_max(),
            cache_bytes,
            time_s: self.job_time_s_max,
            work_per_s,
            threads: self.compute_threads,
            running: self.running_limits(),
        }
    }

    fn running_limits(&self) -> ClaimLimits {
        ClaimLimits { per_owner: self.owner_running_limit, per_display: self.display_running_limit }
    }

    /// Memory for running jobs \[bytes\].
    pub(crate) fn job_bytes_max(&self) -> u64 {
        lightpath_worker::jobs_bytes_max(bytes(self.job_memory_mib_max))
    }

    /// Settings of the workers.
    #[must_use]
    pub fn workers(&self) -> WorkerConfig {
        WorkerConfig {
            workers: self.workers as usize,
            compute_threads: self.compute_threads,
            lease: Duration::from_secs_f64(self.lease_s),
            checkpoint_interval: Duration::from_secs_f64(self.checkpoint_interval_s),
            limits: self.running_limits(),
            timeouts: self.timeouts(),
            memory_bytes: bytes(self.job_memory_mib_max),
            name: self.worker_name(),
            ..WorkerConfig::default()
        }
    }

    /// Time limits of attempts.
    fn timeouts(&self) -> Timeouts {
        let limits_s = [
            ("optimize_hologram", self.optimize_timeout_s),
            ("learn_kernel", self.learn_timeout_s),
            ("simulate_capture", self.simulate_timeout_s),
            ("evaluate_kernel", self.evaluate_timeout_s),
            ("prepare_dataset", self.prepare_timeout_s),
            ("report_kernel", self.report_timeout_s),
            ("suggest_holograms", self.suggest_timeout_s),
            ("verify_hologram", self.verify_timeout_s),
        ];
        limits_s.into_iter().map(|(kind, limit_s)| (kind, limit(limit_s))).collect()
    }

    /// Name of the workers. On a database that other machines may use, people want to know which machine it was.
    fn worker_name(&self) -> String {
        let default = || match self.database_url {
            Some(_) => rustix::system::uname().nodename().to_string_lossy().into_owned(),
            None => WorkerConfig::default().name,
        };
        self.worker_name.clone().unwrap_or_else(default)
    }
}

fn incomplete(given: &'static str, missing: &'static str, reason: &'static str) -> ConfigError {
    ConfigError::Incomplete { given, missing, reason }
}

fn bytes(mib: f64) -> u64 {
    (mib * MIB) as u64
}

/// Converts a limit in days; 0 means `None`, no limit.
pub(crate) fn days(days: f64) -> Option<Duration> {
    limit(days * DAY_S)
}

/// Converts a time limit; 0 means `None`, no limit.
fn limit(seconds: f64) -> Option<Duration> {
    (seconds != 0.0).then(|| Duration::from_secs_f64(seconds))
}
