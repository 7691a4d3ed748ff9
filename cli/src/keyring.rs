//! The commands `lightpath keyring …`.

use super::failure::Failure;
use super::session::Session;
use clap::{Args, Subcommand};
use lightpath::v1;
use lightpath_manifest::{SignedKeyring, SigningKey, Time};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// Commands for the keys that sign manifests.
#[derive(Debug, Subcommand)]
pub(crate) enum KeyringCommand {
    /// Print the server's keyring: the keys that may sign manifests, signed by a root key
    Show,
    Sign(Sign),
}

/// Add the signature of a root key to a keyring, without a server.
///
/// `lightpathd key draft` prints the keyring to sign, and `lightpathd key install` takes the signed one.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  openssl genpkey -algorithm ed25519 -out root.pem
  lightpath keyring sign keyring.txt --key root.pem")]
pub(crate) struct Sign {
    /// Add the signature to this file
    #[arg(value_name = "FILE")]
    file: PathBuf,

    /// Sign with the private key in this PEM file
    #[arg(long, value_name = "FILE")]
    key: PathBuf,
}

impl KeyringCommand {
    pub(crate) async fn run(self, session: &Session) -> Result<(), Failure> {
        match self {
            Self::Show => {
                let keyring = session.client.get_keyring(v1::GetKeyringRequest {}).await?;
                session.print(&keyring, |keyring| keyring.document.trim_end().to_owned())
            }
            Self::Sign(sign) => sign.run(),
        }
    }
}

impl Sign {
    fn run(&self) -> Result<(), Failure> {
        let key = SigningKey::from_pem(&read(&self.key)?)
            .map_err(|error| Failure::Refused(format!("{}: {error}", self.key.display())))?;
        let signed = signed(&read(&self.file)?, &key)
            .map_err(|problem| Failure::Refused(format!("{}: {problem}", self.file.display())))?;
        std::fs::write(&self.file, signed).map_err(|error| file_failure("write", &self.file, &error))?;
        writeln!(std::io::stdout(), "signed {} with {}", self.file.display(), key.public()).map_err(Failure::Output)
    }
}

/// The keyring with one more signature.
fn signed(text: &str, key: &SigningKey) -> Result<String, String> {
    let begin =
        if text.starts_with("signature ") { 0 } else { text.find("\nsignature ").map_or(text.len(), |at| at + 1) };
    let (body, signatures) = text.split_at(begin);
    let all = format!("{body}{signatures}signature {} {}\n", key.public(), key.sign(body.as_bytes()));
    SignedKeyring::parse(all.as_bytes()).map_err(|error| format!("the file is no keyring: {error}"))?;
    Ok(all)
}

/// The present time.
///
/// # Panics
///
/// Never before the year 9999.
pub(super) fn now() -> Time {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs();
    let last = Time::parse("9999-12-31T23:59:59Z");
    i64::try_from(since).ok().and_then(Time::from_unix_s).or(last).unwrap_or_else(|| unreachable!("the form is right"))
}

fn read(path: &Path) -> Result<String, Failure> {
    std::fs::read_to_string(path).map_err(|error| file_failure("read", path, &error))
}

fn file_failure(action: &str, path: &Path, error: &std::io::Error) -> Failure {
    Failure::Refused(format!("could not {action} {}: {error}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_manifest::{Keyring, Trust};

    #[test]
    fn second_root_key_signs_what_the_first_one_signed() {
        let (first, second) = (SigningKey::from_seed([1; 32]), SigningKey::from_seed([2; 32]));
        let time = |text| Time::parse(text).unwrap();
        let keyring = Keyring {
            version: 2,
            issued: time("2026-11-01T00:00:00Z"),
            expires: time("2026-12-01T00:00:00Z"),
            roots: vec![second.public()],
            keys: vec![],
            revoked: vec![],
        };
        let both = signed(&keyring.signed(&[&first]), &second).unwrap();
        for root in [&first, &second] {
            let trust = Trust::Roots(vec![root.public()]);
            assert_eq!(trust.renew(both.as_bytes(), time("2026-11-20T00:00:00Z")), Ok(keyring.clone()));
        }
        assert_eq!(signed(&keyring.body(), &first).unwrap(), keyring.signed(&[&first]));
        assert!(signed("x 1\n", &first).unwrap_err().contains("no keyring"));
    }
}
