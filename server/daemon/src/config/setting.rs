//! The declaration of a setting, and what is derived from it.

use std::fmt::{self, Display};
use toml::Value;

/// Declares [`Config`](super::Config) with a field for each setting, its defaults, and `SETTINGS`, the list of all
/// settings.
macro_rules! settings {
    ($($(#[doc = $help:literal])+ $key:ident: $type:ty = $default:expr, $value_name:literal, $allowed:expr;)+) => {
        /// Values of all settings, each in the unit at the end of its name.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct Config {
            $($(#[doc = $help])+ pub $key: $type,)+
        }

        impl Default for Config {
            fn default() -> Self {
                Self { $($key: $default,)+ }
            }
        }

        /// All settings, in the order of the help and of the printed configuration.
        static SETTINGS: &[Setting] = &[$(Setting {
            key: stringify!($key),
            help: concat!($($help),+),
            value_name: $value_name,
            allowed: $allowed,
            fits: |value| <$type>::deserialize(value.clone()).is_ok(),
        },)+];
    };
}
pub(super) use settings;

/// The declaration of a setting, without its default.
#[derive(Debug)]
pub(super) struct Setting {
    /// Name of the setting in a file.
    pub(super) key: &'static str,
    /// Description of the setting.
    pub(super) help: &'static str,
    /// Name of the value in the help.
    pub(super) value_name: &'static str,
    pub(super) allowed: Allowed,
    /// Checks the type of a value.
    pub(super) fits: fn(&Value) -> bool,
}

/// Allowed values of a setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Allowed {
    /// Numbers between two limits, both included.
    Numbers(f64, f64),
    /// 0, or numbers between two limits, both included.
    ZeroOrNumbers(f64, f64),
    /// All values of the setting's type, described in words.
    Text(&'static str),
}

impl Display for Allowed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Numbers(least, most) => write!(f, "{least} to {most}"),
            Self::ZeroOrNumbers(least, most) => write!(f, "0, or {least:.3} to {most}"),
            Self::Text(text) => f.write_str(text),
        }
    }
}

impl Setting {
    /// Whether some values of the setting must not be printed: a URL may contain a password.
    pub(super) fn may_be_secret(&self) -> bool {
        ["SECRET", "URL"].contains(&self.value_name)
    }

    /// Whether this value of the setting must not be printed.
    pub(super) fn is_secret(&self, value: &Value) -> bool {
        match self.value_name {
            "SECRET" => true,
            "URL" => value.as_str().is_some_and(has_password),
            _ => false,
        }
    }

    /// Returns `value` if it is a number that is not allowed.
    pub(super) fn number_out_of_range(&self, value: &Value) -> Option<f64> {
        let number = value.as_float().or_else(|| value.as_integer().map(|number| number as f64))?;
        let is_allowed = match self.allowed {
            Allowed::Numbers(least, most) => (least..=most).contains(&number),
            Allowed::ZeroOrNumbers(least, most) => number == 0.0 || (least..=most).contains(&number),
            Allowed::Text(_) => true,
        };
        (!is_allowed).then_some(number)
    }

    /// Parses the text of a flag or an environment variable.
    pub(super) fn parse(&self, text: &str) -> Result<Value, String> {
        let readings = [
            (!text.is_empty()).then(|| Value::from(text)),
            text.parse().ok().map(Value::Integer),
            text.parse().ok().map(Value::Float),
            text.parse().ok().map(Value::Boolean),
        ];
        let value = readings.into_iter().flatten().find(self.fits);
        value.ok_or_else(|| format!("must be {}", self.allowed))
    }

    /// The flag and environment variable of the setting, with their help.
    pub(super) fn arg(&'static self, default: Option<&Value>) -> clap::Arg {
        let default = match default {
            Some(Value::String(text)) => format!(" [default: {text}]"),
            Some(Value::Float(number)) => format!(" [default: {number}]"),
            Some(value) => format!(" [default: {value}]"),
            None => String::new(),
        };
        let arg = clap::Arg::new(self.key)
            .long(self.key.replace('_', "-"))
            .env(format!("LIGHTPATH_{}", self.key.to_uppercase()))
            .value_name(self.value_name)
            .hide_env_values(self.may_be_secret())
            .help(format!("{}{default}", self.help.trim_start()))
            .value_parser(|text: &str| self.parse(text));
        match self.value_name {
            "BOOL" => arg.num_args(0..=1).default_missing_value("true"),
            _ => arg,
        }
    }
}

/// Whether a URL contains a password: before its host, or as a parameter.
fn has_password(url: &str) -> bool {
    let (address, parameters) = url.split_once('?').unwrap_or((url, ""));
    let host = address.split_once("://").map_or(address, |(_, rest)| rest);
    let user = host.rsplit_once('@').map_or("", |(user, _)| user);
    user.contains(':') || parameters.split('&').any(|parameter| parameter.starts_with("password="))
}
