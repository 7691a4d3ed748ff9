//! One setting: what follows from its declaration.

use std::fmt::{self, Display};
use toml::Value;

/// Declares [`Config`](super::Config) with a field for each setting, the defaults, and `SETTINGS`, the list of them all.
macro_rules! settings {
    ($($(#[doc = $help:literal])+ $key:ident: $type:ty = $default:expr, $value_name:literal, $allowed:expr;)+) => {
        /// The value of each setting, in the unit that its name ends with.
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

        /// All settings, in the order in which help and file tell of them.
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

/// What the declaration of a setting says, apart from its default.
#[derive(Debug)]
pub(super) struct Setting {
    /// Its name in a file.
    pub(super) key: &'static str,
    /// What it means.
    pub(super) help: &'static str,
    /// What the help calls its value.
    pub(super) value_name: &'static str,
    pub(super) allowed: Allowed,
    /// Whether a value has the right type.
    pub(super) fits: fn(&Value) -> bool,
}

/// The values that a setting may have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Allowed {
    /// From the first to the second.
    Numbers(f64, f64),
    /// 0, or from the first to the second.
    ZeroOrNumbers(f64, f64),
    /// What the type allows, in words.
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
    /// The number that is not allowed, if `value` is one.
    pub(super) fn number_out_of_range(&self, value: &Value) -> Option<f64> {
        let number = value.as_float().or_else(|| value.as_integer().map(|number| number as f64))?;
        let is_allowed = match self.allowed {
            Allowed::Numbers(least, most) => (least..=most).contains(&number),
            Allowed::ZeroOrNumbers(least, most) => number == 0.0 || (least..=most).contains(&number),
            Allowed::Text(_) => true,
        };
        (!is_allowed).then_some(number)
    }

    /// Reads the text of a flag or of an environment variable.
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

    /// Its flag and environment variable, with their help.
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
            .help(format!("{}{default}", self.help.trim_start()))
            .value_parser(|text: &str| self.parse(text));
        match self.value_name {
            "BOOL" => arg.num_args(0..=1).default_missing_value("true"),
            _ => arg,
        }
    }
}
