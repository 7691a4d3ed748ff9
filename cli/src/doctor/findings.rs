//! The findings of `lightpath doctor`: what was measured, how good it is, and the fix.

use crate::show;
use crate::table::Facts;
use lightpath::v1;
use serde::Serialize;
use std::time::Duration;

/// Difference of the clocks above which times mean something else on the two sides \[s\].
const CLOCK_WARNING_S: f64 = 2.0;
/// Difference of the clocks above which tokens and manifests may be refused \[s\].
const CLOCK_PROBLEM_S: f64 = 60.0;
/// Latency above which lists and progress feel slow.
const LATENCY_WARNING: Duration = Duration::from_millis(200);
/// Throughput below which uploads of photographs take longer than the jobs \[bytes/s\].
const THROUGHPUT_WARNING: f64 = 1e6;
/// Narrowest terminal that shows lists with targets and quality \[characters\].
const COLUMNS_WARNING: usize = 80;

/// How good a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum State {
    Ok,
    Warning,
    Problem,
}

/// The result of one check.
#[derive(Debug, Serialize)]
pub(super) struct Finding {
    check: &'static str,
    state: State,
    text: String,
    /// What to do; empty if nothing needs to be done.
    fix: String,
}

/// The results of all checks.
#[derive(Debug, Default, Serialize)]
pub(super) struct Findings {
    checks: Vec<Finding>,
}

impl Finding {
    pub(super) fn ok(check: &'static str, text: String) -> Self {
        Self { check, state: State::Ok, text, fix: String::new() }
    }

    pub(super) fn warning(check: &'static str, text: String, fix: &str) -> Self {
        Self { check, state: State::Warning, text, fix: fix.to_owned() }
    }

    pub(super) fn problem(check: &'static str, text: String, fix: &str) -> Self {
        Self { check, state: State::Problem, text, fix: fix.to_owned() }
    }
}

impl Findings {
    pub(super) fn add(&mut self, finding: Finding) {
        self.checks.push(finding);
    }

    pub(super) fn problems(&self) -> usize {
        self.checks.iter().filter(|finding| finding.state == State::Problem).count()
    }

    /// A line for each check, and below it the fix.
    pub(super) fn text(&self) -> String {
        let mut facts = Facts::default();
        for Finding { check, state, text, fix } in &self.checks {
            let word = match state {
                State::Ok => "ok     ",
                State::Warning => "warning",
                State::Problem => "PROBLEM",
            };
            facts.add(&format!("{word}  {check}"), text.replace("\n  ", "; "));
            if !fix.is_empty() {
                facts.add("", format!("→ {fix}"));
            }
        }
        let warnings = self.checks.iter().filter(|finding| finding.state == State::Warning).count();
        let verdict = match (self.problems(), warnings) {
            (0, 0) => "all is well".to_owned(),
            (problems, warnings) => {
                format!("{}, {}", show::counted(problems, "problem"), show::counted(warnings, "warning"))
            }
        };
        format!("{}\n{verdict}", facts.text())
    }
}

/// The address: whether others on the network could read what is sent.
pub(super) fn address(url: &str) -> Finding {
    match url.starts_with("https://") {
        true => Finding::ok("TLS", "the connection is encrypted".to_owned()),
        false if super::is_local(url) => {
            Finding::ok("TLS", "not encrypted, and needs not be: the same machine".to_owned())
        }
        false => Finding::warning(
            "TLS",
            format!("{url} is not encrypted: others on the network can read the token and the pictures"),
            "let the server use TLS (lightpathd serve --tls-cert, --tls-key), and write https:// in the address",
        ),
    }
}

pub(super) fn version(server: &str, client: &str) -> Finding {
    if server == client {
        return Finding::ok("version", format!("server and client {client}"));
    }
    let text = format!("the server is {server}, this client {client}");
    Finding::warning("version", text, "install the client of the server's version")
}

pub(super) fn role(server: &v1::Server, is_local: bool) -> Finding {
    let v1::Server { token, role, displays, .. } = server;
    let valid = if displays.is_empty() { String::new() } else { format!(", valid for {}", displays.join(", ")) };
    match (token.as_str(), role.as_str()) {
        ("", _) if is_local => Finding::ok("token", "the server requires none".to_owned()),
        ("", _) => Finding::warning(
            "token",
            "the server requires none: everybody who can reach it may do everything".to_owned(),
            "create tokens with `lightpathd token create`; docs/operating.md says how",
        ),
        (token, "viewer" | "firmware") => Finding::warning(
            "token",
            format!("{token}, role {role}{valid}: it cannot submit jobs"),
            "to submit jobs, ask for a token with the role submitter",
        ),
        (token, role) => Finding::ok("token", format!("{token}, role {role}{valid}")),
    }
}

/// The difference of the clocks \[s\], known up to the duration of a call.
pub(super) fn clock(difference_s: f64, duration: Duration) -> Finding {
    let beyond_s = difference_s.abs() - duration.as_secs_f64();
    let ahead = if difference_s > 0.0 { "ahead of" } else { "behind" };
    let text = format!("the server's clock is {:.1} s {ahead} this one", difference_s.abs());
    let fix = "set both clocks by a time server (NTP)";
    match beyond_s {
        s if s > CLOCK_PROBLEM_S => Finding::problem("clock", text, fix),
        s if s > CLOCK_WARNING_S => Finding::warning("clock", text, fix),
        _ => Finding::ok("clock", format!("differs by {:.1} s", difference_s.abs())),
    }
}

pub(super) fn disk(free_bytes: u64, reserve_bytes: u64) -> Finding {
    let (free, reserve) = (show::bytes(free_bytes), show::bytes(reserve_bytes));
    let text = format!("{free} free on the server, of which {reserve} are reserved for accepted work");
    let fix = "remove files from the server's disk, or let it remove more: docs/operating.md";
    match free_bytes {
        free if free < reserve_bytes => Finding::problem("disk", format!("{text}: it accepts no new work"), fix),
        free if free / 2 < reserve_bytes => Finding::warning("disk", text, fix),
        _ => Finding::ok("disk", text),
    }
}

pub(super) fn kernels(displays: usize, kernels: usize, active: usize) -> Finding {
    let (declared, learned) = (show::counted(displays, "display"), show::counted(kernels, "kernel"));
    let text = if kernels == 0 {
        format!("{declared}, {learned}")
    } else {
        format!("{declared}, {learned}, {active} with an active version")
    };
    match (displays, kernels, active) {
        (0, ..) => Finding::warning("displays", text, "declare a display: lightpath display create --help"),
        (_, 1.., 0) => Finding::warning("displays", text, "choose a version: lightpath kernel promote --help"),
        _ => Finding::ok("displays", text),
    }
}

pub(super) fn latency(median: Duration) -> Finding {
    let text = format!("{:.1} ms for a call", median.as_secs_f64() * 1e3);
    match median > LATENCY_WARNING {
        true => Finding::warning("latency", text, "use a nearer network, or look at the server's load"),
        false => Finding::ok("latency", text),
    }
}

pub(super) fn throughput(size_bytes: u64, duration: Duration) -> Finding {
    let rate = size_bytes as f64 / duration.as_secs_f64().max(1e-6);
    let text = format!("{}/s, measured with {}", show::bytes(rate as u64), show::bytes(size_bytes));
    match rate < THROUGHPUT_WARNING {
        true => Finding::warning("upload", text, "use a faster network; large photographs take long"),
        false => Finding::ok("upload", text),
    }
}

pub(super) fn terminal(width: &str, colours: &str, is_unicode: bool, columns: Option<usize>) -> Finding {
    let charset = if is_unicode { "UTF-8" } else { "no UTF-8" };
    let text = format!("{width}, {colours}, {charset}");
    match (columns, is_unicode) {
        (Some(_), false) => Finding::warning("terminal", text, "set LANG to a UTF-8 locale, such as C.UTF-8"),
        (Some(columns), _) if columns < COLUMNS_WARNING => {
            Finding::warning("terminal", text, "widen the terminal to 80 columns or more; tables leave out columns")
        }
        _ => Finding::ok("terminal", text),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn findings_are_graded() {
        let state = |finding: Finding| finding.state;
        let ms = Duration::from_millis;
        for (finding, expected) in [
            (address("https://lab:1"), State::Ok),
            (address("http://127.0.0.1:1"), State::Ok),
            (address("http://lab:1"), State::Warning),
            (version("1.0.0", "1.0.0"), State::Ok),
            (version("1.0.0", "1.1.0"), State::Warning),
            (clock(-1.0, ms(5)), State::Ok),
            (clock(5.0, ms(5)), State::Warning),
            (clock(5.0, ms(5000)), State::Ok),
            (clock(-90.0, ms(5)), State::Problem),
            (disk(100, 200), State::Problem),
            (disk(300, 200), State::Warning),
            (disk(500, 200), State::Ok),
            (kernels(0, 0, 0), State::Warning),
            (kernels(1, 0, 0), State::Ok),
            (kernels(1, 2, 0), State::Warning),
            (latency(ms(10)), State::Ok),
            (latency(ms(300)), State::Warning),
            (throughput(4 << 20, ms(100)), State::Ok),
            (throughput(4 << 20, ms(10_000)), State::Warning),
            (terminal("", "", true, Some(80)), State::Ok),
            (terminal("", "", true, Some(60)), State::Warning),
            (terminal("", "", false, Some(80)), State::Warning),
            (terminal("", "", false, None), State::Ok),
        ] {
            let text = format!("{finding:?}");
            assert_eq!(state(finding), expected, "{text}");
        }
    }

    #[test]
    fn tokens_without_the_right_to_submit_are_named() {
        let server =
            |token: &str, role: &str| v1::Server { token: token.into(), role: role.into(), ..Default::default() };
        assert_eq!(role(&server("", "admin"), true).state, State::Ok);
        assert_eq!(role(&server("", "admin"), false).state, State::Warning);
        assert_eq!(role(&server("ada", "submitter"), false).state, State::Ok);
        let viewer = role(&server("tv", "viewer"), false);
        assert!(viewer.state == State::Warning && viewer.text.contains("cannot submit jobs"));
    }

    #[test]
    fn text_has_a_line_for_each_check_with_its_fix() {
        let mut findings = Findings::default();
        findings.add(latency(Duration::from_millis(2)));
        findings.add(disk(1_000_000, 2_000_000));
        let text = findings.text();
        assert!(text.starts_with("ok       latency  2.0 ms for a call\nPROBLEM  disk"), "{text}");
        assert!(
            text.contains("\n                  → remove files") && text.ends_with("1 problem, no warnings"),
            "{text}"
        );
        let json = serde_json::to_value(&findings).unwrap();
        assert_eq!((&json["checks"][1]["state"], &json["checks"][1]["check"]), (&"problem".into(), &"disk".into()));
    }
}
