//! Merges the settings of all sources and remembers the source of each value.

use super::{Config, ConfigError, SETTINGS};
use clap::parser::ValueSource;
use clap::{ArgMatches, Command};
use std::collections::BTreeMap;
use std::fmt::{self, Display};
use std::fs;
use std::path::Path;
use toml::{Table, Value};

/// Settings without a meaning for a process that only runs jobs.
const SERVER_ONLY: &[&str] = &[
    "listen",
    "tls_cert",
    "tls_key",
    "tls_client_ca",
    "require_tokens",
    "insecure",
    "calls_per_s_max",
    "under_way_mib_max",
    "computing_mib_max",
    "host_names",
    "cors_origins",
    "webhook_origins",
    "no_worker",
    "queue_limit",
    "owner_queue_limit",
    "owner_stored_mib_max",
    "job_time_s_max",
    "collect_artifacts_after_days",
    "collect_jobs_after_days",
    "manifest_days",
    "poll_interval_s",
];

/// The setting without a meaning for a server.
const WORKER_ONLY: &str = "status_listen";

/// Settings from one source: a file, or flags and environment variables. A missing value is taken from the source
/// below.
#[derive(Clone, Default)]
pub struct Settings(BTreeMap<&'static str, (Value, Origin)>);

impl fmt::Debug for Settings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // The values are left out: some are secret.
        f.debug_map().entries(self.0.iter().map(|(key, (_, origin))| (key, origin))).finish()
    }
}

/// Source of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// The built-in default.
    Default,
    /// The configuration file.
    File,
    /// An environment variable.
    Environment,
    /// A flag.
    Flag,
}

impl Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Default => "default",
            Self::File => "configuration file",
            Self::Environment => "environment",
            Self::Flag => "flag",
        })
    }
}

/// The settings in effect. They are displayed as TOML that a configuration file can contain, each line with its meaning
/// and its source.
#[derive(Clone, Debug)]
pub struct Effective {
    /// Values of the settings.
    pub config: Config,
    settings: Settings,
}

impl Settings {
    /// Reads a TOML file.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Read`]; [`ConfigError::Parse`] for invalid TOML, an unknown key or a value of the wrong type.
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        let text = fs::read_to_string(path).map_err(|source| ConfigError::Read { path: path.to_owned(), source })?;
        let problem = |error: toml::de::Error| {
            // The description quotes this line.
            let start = error.span().map_or(0, |span| text[..span.start].rfind('\n').map_or(0, |end| end + 1));
            let line = text[start..].lines().next().unwrap_or_default();
            let problem = match SETTINGS.iter().find(|setting| setting.may_be_secret() && line.contains(setting.key)) {
                Some(setting) => format!("{} must be a text in quotes", setting.key),
                None => error.to_string().trim_end().to_owned(),
            };
            ConfigError::Parse { path: path.to_owned(), problem }
        };
        Self::from_toml(&text).map_err(problem)
    }

    /// The same settings with one more, as if it were given as a flag.
    ///
    /// # Panics
    ///
    /// If there is no setting `key`.
    #[must_use]
    pub fn with(mut self, key: &str, value: &str) -> Self {
        let key = SETTINGS.iter().map(|setting| setting.key).find(|found| *found == key).expect("a setting");
        self.0.insert(key, (Value::from(value), Origin::Flag));
        self
    }

    /// Parses the text of a TOML file.
    ///
    /// # Errors
    ///
    /// An error with its line, for invalid TOML, an unknown key or a value of the wrong type.
    pub fn from_toml(text: &str) -> Result<Self, toml::de::Error> {
        let _: Config = toml::from_str(text)?;
        Ok(Self::of(toml::from_str(text)?, Origin::File))
    }

    fn defaults() -> Self {
        let table = Table::try_from(Config::default()).expect("every default can be written as TOML");
        Self::of(table, Origin::Default)
    }

    fn of(mut table: Table, origin: Origin) -> Self {
        let set = |key| Some((key, (table.remove(key)?, origin)));
        Self(SETTINGS.iter().map(|setting| setting.key).filter_map(set).collect())
    }
}

/// Flags and environment variables of some settings, for a command of the program.
macro_rules! flags {
    ($($(#[doc = $help:literal])+ $name:ident($is_wanted:expr))+) => {$(
        $(#[doc = $help])+
        #[derive(Clone, Debug, Default)]
        pub struct $name(
            /// The settings that were given.
            pub Settings,
        );

        impl clap::Args for $name {
            fn augment_args(command: Command) -> Command {
                Settings::augment_args(command, $is_wanted)
            }

            fn augment_args_for_update(command: Command) -> Command {
                Self::augment_args(command)
            }
        }

        impl clap::FromArgMatches for $name {
            fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
                Ok(Self(Settings::from_arg_matches(matches, $is_wanted)))
            }

            fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
                self.0.0.extend(Settings::from_arg_matches(matches, $is_wanted).0);
                Ok(())
            }
        }
    )+};
}

flags! {
    /// The flags of `lightpathd serve`.
    ServeFlags(|key| key != WORKER_ONLY)
    /// The flags of `lightpathd worker`.
    WorkerFlags(|key| !SERVER_ONLY.contains(&key))
    /// The flags of the bucket alone, for commands that open the data of a server.
    BucketFlags(|key| key.starts_with("artifacts_"))
}

impl Settings {
    fn augment_args(command: Command, is_wanted: fn(&str) -> bool) -> Command {
        let defaults = Self::defaults();
        let default = |key| defaults.0.get(key).map(|(value, _)| value);
        let wanted = SETTINGS.iter().filter(|setting| is_wanted(setting.key));
        command.args(wanted.map(|setting| setting.arg(default(setting.key))))
    }

    fn from_arg_matches(matches: &ArgMatches, is_wanted: fn(&str) -> bool) -> Self {
        let mut settings = Self::default();
        for key in SETTINGS.iter().map(|setting| setting.key).filter(|key| is_wanted(key)) {
            let Some(value) = matches.get_one::<Value>(key) else { continue };
            let is_environment = matches.value_source(key) == Some(ValueSource::EnvVariable);
            let origin = if is_environment { Origin::Environment } else { Origin::Flag };
            settings.0.insert(key, (value.clone(), origin));
        }
        settings
    }
}

impl Effective {
    /// Merges the sources: `given` (flags and environment) overrides `file`, and `file` overrides the defaults.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Value`] if a value is out of range, [`ConfigError::Incomplete`] if one of two settings that
    /// belong together is missing, [`ConfigError::DatabaseUrl`], [`ConfigError::Labels`]. The settings of the bucket are checked by
    /// [`Config::bucket`], because not every command that reads the file needs the bucket and its key.
    pub fn merge(given: Settings, file: Settings) -> Result<Self, ConfigError> {
        let mut settings = Settings::defaults();
        settings.0.extend(file.0);
        settings.0.extend(given.0);
        for setting in SETTINGS {
            let Some((value, origin)) = settings.0.get(setting.key) else { continue };
            if let Some(value) = setting.number_out_of_range(value) {
                let (key, allowed, origin) = (setting.key, setting.allowed, *origin);
                return Err(ConfigError::Value { key, value, allowed, origin });
            }
        }
        let values = settings.0.iter().map(|(key, (value, _))| ((*key).to_owned(), value.clone()));
        let config: Config = values.collect::<Table>().try_into().expect("the type of every value was checked");
        config.tls()?;
        config.database()?;
        config.labels()?;
        Ok(Self { config, settings })
    }
}

impl Display for Effective {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for setting in SETTINGS {
            let (key, help) = (setting.key, setting.help.trim_start());
            match self.settings.0.get(key) {
                Some((value, origin)) if setting.is_secret(value) => {
                    writeln!(f, "# {help} ({origin}, not shown)\n# {key} =")?;
                }
                Some((value, origin)) => writeln!(f, "# {help} ({origin})\n{key} = {value}")?,
                None => writeln!(f, "# {help} (not set)\n# {key} =")?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::LogFormat;
    use super::*;
    use clap::{Args, FromArgMatches};

    fn parse(arguments: &[&str], file: &str) -> Result<Effective, ConfigError> {
        let matches = ServeFlags::augment_args(Command::new("test")).get_matches_from([&["test"], arguments].concat());
        Effective::merge(ServeFlags::from_arg_matches(&matches).unwrap().0, Settings::from_toml(file).unwrap())
    }

    fn refused_flag(arguments: &[&str]) -> String {
        let command = ServeFlags::augment_args(Command::new("test"));
        command.try_get_matches_from([&["test"], arguments].concat()).unwrap_err().to_string()
    }

    #[test]
    fn flags_override_the_file_and_the_file_overrides_defaults() {
        let effective = parse(&["--workers", "2", "--lease-s", "6"], "workers = 3\nqueue_limit = 7\n").unwrap();
        assert_eq!((effective.config.workers, effective.config.queue_limit), (2, 7));
        assert_eq!(effective.config.lease_s, 6.0);
        let origin = |key| effective.settings.0[key].1;
        assert_eq!(origin("workers"), Origin::Flag);
        assert_eq!(origin("queue_limit"), Origin::File);
        assert_eq!(origin("listen"), Origin::Default);
    }

    #[test]
    fn every_setting_has_its_environment_variable() {
        let command = ServeFlags::augment_args(Command::new("test"));
        let variable =
            |flag| command.get_arguments().find(|arg| arg.get_long() == Some(flag)).unwrap().get_env().unwrap();
        assert_eq!(variable("workers"), "LIGHTPATH_WORKERS");
        assert_eq!(variable("under-way-mib-max"), "LIGHTPATH_UNDER_WAY_MIB_MAX");
        assert_eq!(command.get_arguments().count(), SETTINGS.len() - 1);
    }

    #[test]
    fn worker_has_the_settings_that_concern_it() {
        assert!(SERVER_ONLY.iter().all(|key| SETTINGS.iter().any(|setting| setting.key == *key)), "every key exists");
        let command = WorkerFlags::augment_args(Command::new("test"));
        let has = |flag| command.get_arguments().any(|argument| argument.get_long() == Some(flag));
        assert!(
            has("database-url") && has("workers") && has("status-listen") && has("lease-s") && has("worker-labels")
        );
        assert!(!has("listen") && !has("queue-limit") && !has("no-worker"));
        let given = ["test", "--status-listen", "127.0.0.1:0", "--workers", "3"];
        let flags = WorkerFlags::from_arg_matches(&command.get_matches_from(given)).unwrap();
        let config =
            Effective::merge(flags.0, Settings::from_toml("listen = \"127.0.0.1:1\"").unwrap()).unwrap().config;
        assert_eq!((config.workers, config.status_listen.unwrap().port(), config.listen.port()), (3, 0, 1));
    }

    #[test]
    fn value_of_wrong_type_is_refused_with_the_allowed_values() {
        for bad in ["7070", "localhost:7070", "127.0.0.1"] {
            assert!(refused_flag(&["--listen", bad]).contains("such as 127.0.0.1:7070"), "{bad}");
        }
        for (arguments, allowed) in [
            (["--workers", "two"], "must be 1 to 64"),
            (["--workers", "-1"], "must be 1 to 64"),
            (["--log-format", "xml"], "must be auto, text or json"),
            (["--tls-cert", ""], "must be the path of a file"),
            (["--insecure", "maybe"], "must be true or false"),
        ] {
            let message = refused_flag(&[&format!("{}={}", arguments[0], arguments[1])]);
            assert!(message.contains(allowed) && message.contains(arguments[0]), "{message}");
        }
        let effective = parse(&["--listen", "[::1]:0", "--insecure", "--log-level", "1"], "").unwrap();
        assert_eq!(effective.config.listen.port(), 0);
        assert!(effective.config.insecure && effective.config.log_level == "1");
    }

    #[test]
    fn invalid_values_are_refused_with_the_name_of_the_setting() {
        for (arguments, message) in [
            (["--workers", "0"], "workers is 0, but must be 1 to 64 (flag)"),
            (["--lease-s", "NaN"], "lease_s is NaN, but must be 0.1 to 3600 (flag)"),
            (["--queue-limit", "2000000"], "queue_limit is 2000000, but must be 1 to 1000000 (flag)"),
            (
                ["--worker-labels", "gpu,Bench"],
                "worker_labels has \"Bench\", which is no label; a label has 1 to 63 small letters, digits, '.' and '-', and \
                 begins with a letter or digit, such as gpu or bench-2",
            ),
            (["--tls-key", "key.pem"], "tls_key is set, but tls_cert is not: TLS needs both"),
        ] {
            assert_eq!(parse(&arguments, "").unwrap_err().to_string(), message);
        }
        let message = parse(&[], "collect_jobs_after_days = 0.01").unwrap_err().to_string();
        assert_eq!(message, "collect_jobs_after_days is 0.01, but must be 0, or 0.042 to 36500 (configuration file)");
    }

    const BUCKET: &str = "database_url = \"postgres://db/lightpath\"\nartifacts_url = \"s3://lab/holograms\"\n\
                          artifacts_access_key_id = \"id\"\nartifacts_secret_access_key = \"geheim\"\n";

    #[test]
    fn bucket_needs_its_database_and_its_keys() {
        let bucket = parse(&["--artifacts-cache-mib-max", "2"], BUCKET).unwrap().config.bucket().unwrap().unwrap();
        assert_eq!((bucket.url.as_str(), bucket.cache_bytes_max), ("s3://lab/holograms", 2 << 20));
        assert_eq!((bucket.access_key_id.as_str(), bucket.secret_access_key.as_str()), ("id", "geheim"));
        for (line, message) in [
            ("database_url", "artifacts_url is set, but database_url is not: servers share a bucket only with the"),
            ("artifacts_url", "artifacts_access_key_id is set, but artifacts_url is not: it names the bucket"),
            ("artifacts_access_key_id", "artifacts_url is set, but artifacts_access_key_id is not: a key signs"),
            ("artifacts_secret_access_key", "artifacts_url is set, but artifacts_secret_access_key is not: a key"),
        ] {
            let rest: String = BUCKET.split_inclusive('\n').filter(|text| !text.starts_with(line)).collect();
            let refused = parse(&[], &rest).unwrap().config.bucket().unwrap_err().to_string();
            assert!(refused.starts_with(message), "{refused}");
        }
        for (flag, value, message) in [
            (
                "--artifacts-url",
                "https://lab",
                "artifacts_url is \"https://lab\", but must be a URL such as s3://bucket",
            ),
            ("--artifacts-url", "s3:///holograms", "artifacts_url is \"s3:///holograms\", but must be"),
            ("--artifacts-endpoint", "http://s3", "artifacts_endpoint is \"http://s3\", but must begin with https://"),
        ] {
            let refused = parse(&[flag, value], BUCKET).unwrap().config.bucket().unwrap_err().to_string();
            assert!(refused.starts_with(message), "{refused}");
        }
        let allowed = ["--artifacts-endpoint", "http://s3", "--artifacts-allow-http"];
        parse(&allowed, BUCKET).unwrap().config.bucket().unwrap();
    }

    #[test]
    fn secrets_are_never_printed() {
        let effective = parse(&[], BUCKET).unwrap();
        let printed = effective.to_string();
        assert!(printed.contains("(configuration file, not shown)\n# artifacts_secret_access_key =\n"), "{printed}");
        for text in [printed, format!("{effective:?}"), format!("{:?}", effective.config.bucket())] {
            assert!(!text.contains("geheim"), "{text}");
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lightpath.toml");
        for (key, value) in [("artifacts_secret_access_key", "geheim"), ("database_url", "postgres://ada:geheim@db/x")]
        {
            fs::write(&path, format!("{key} = \"{value}\n")).unwrap();
            let message = Settings::read(&path).unwrap_err().to_string();
            assert!(message.ends_with(&format!("{key} must be a text in quotes")), "{message}");
        }
        for (url, is_shown) in [
            ("postgres://ada:geheim@db/lightpath", false),
            ("postgres://db/lightpath?user=ada&password=geheim", false),
            ("postgres://ada@db:5432/lightpath?sslmode=require", true),
        ] {
            let effective = parse(&["--database-url", url], "").unwrap();
            let printed = effective.to_string();
            assert_eq!(printed.contains(&format!("(flag)\ndatabase_url = \"{url}\"\n")), is_shown, "{printed}");
            for text in [printed, format!("{effective:?}")] {
                assert!(!text.contains("geheim"), "{text}");
            }
        }
    }

    #[test]
    fn unknown_keys_are_refused_with_their_names() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lightpath.toml");
        fs::write(&path, "wokers = 2\n").unwrap();
        let message = Settings::read(&path).unwrap_err().to_string();
        assert!(message.contains("unknown field `wokers`"), "{message}");
        assert!(matches!(Settings::read(folder.path()), Err(ConfigError::Read { .. })));
    }

    #[test]
    fn file_with_a_value_of_wrong_type_is_refused_with_its_line() {
        let message = Settings::from_toml("queue_limit = 7\nworkers = \"2\"\n").unwrap_err().to_string();
        assert!(message.contains("line 2") && message.contains("workers"), "{message}");
    }

    #[test]
    fn settings_without_sources_are_the_defaults() {
        let effective = parse(&[], "").unwrap();
        assert_eq!(effective.config, Config::default());
        assert!(effective.settings.0.values().all(|(_, origin)| *origin == Origin::Default));
    }

    #[test]
    fn printed_settings_can_be_read_again() {
        let effective = parse(&["--workers", "4", "--log-format", "json", "--stored-mib-max", "1"], "").unwrap();
        let text = effective.to_string();
        assert!(text.contains("# Number of jobs that run at the same time (flag)\nworkers = 4\n"), "{text}");
        assert!(text.contains("private key (not set)\n# tls_key =\n"), "{text}");
        let again = parse(&[], &text).unwrap();
        assert_eq!((again.config.log_format, &again.config), (LogFormat::Json, &effective.config));
    }
}
