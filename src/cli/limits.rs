//! The limits of a server, as arguments.

use std::time::Duration;

use body_schema::server::Limits;
use clap::builder::RangedU64ValueParser;

#[derive(Debug, Default, clap::Args)]
#[command(next_help_heading = "Limits")]
pub struct LimitArguments {
    /// Connections; never more than half of the descriptors that the process may open [default: 512]
    #[arg(long, value_name = "N", value_parser = count())]
    max_connections: Option<usize>,
    /// Streams that follow one session: events, growing recordings, WebSockets [default: 64]
    #[arg(long, value_name = "N", value_parser = count())]
    max_streams_per_session: Option<usize>,
    /// Sessions in memory, and as many again with robots elsewhere [default: 32]
    #[arg(long, value_name = "N", value_parser = count())]
    max_sessions: Option<usize>,
    /// Sessions with robots elsewhere that are kept [default: 10000]
    #[arg(long, value_name = "N", value_parser = count())]
    max_stored_sessions: Option<usize>,
    /// Size of the file in which they are kept, MiB [default: 8192]
    #[arg(long, value_name = "MIB", value_parser = mebibytes())]
    max_stored: Option<usize>,
    /// Size of all recordings that are kept as files together, MiB [default: 32768]
    #[arg(long, value_name = "MIB", value_parser = mebibytes())]
    max_recordings: Option<usize>,
    /// Joints that move of a robot elsewhere, never more than 40 [default: 40]
    #[arg(long, value_name = "N", value_parser = count())]
    max_joints: Option<usize>,
    /// Targets of a robot elsewhere, never more than 16 [default: 16]
    #[arg(long, value_name = "N", value_parser = count())]
    max_targets: Option<usize>,
    /// Evaluations of the criterion for each movement of a robot elsewhere, never more than 100000 [default: 100000]
    #[arg(long, value_name = "N", value_parser = count())]
    max_evaluations: Option<usize>,
    /// Steps of a session [default: 100000]
    #[arg(long, value_name = "N", value_parser = steps())]
    max_steps: Option<u64>,
    /// Steps of one request [default: 1000]
    #[arg(long, value_name = "N", value_parser = steps())]
    max_steps_per_request: Option<u64>,
    /// Memory for reports and recordings of all sessions, MiB [default: 2048]
    #[arg(long, value_name = "MIB", value_parser = mebibytes())]
    max_memory: Option<usize>,
    /// Body of a request, KiB [default: 64]
    #[arg(long, value_name = "KIB", value_parser = kibibytes())]
    max_body: Option<usize>,
    /// Head of a request, KiB [default: 32]
    #[arg(long, value_name = "KIB", value_parser = kibibytes())]
    max_header: Option<usize>,
    /// Seconds that the head of a request may take to come [default: 10]
    #[arg(long, value_name = "S", value_parser = seconds)]
    header_timeout: Option<Duration>,
    /// Seconds that its body may take [default: 30]
    #[arg(long, value_name = "S", value_parser = seconds)]
    body_timeout: Option<Duration>,
    /// Seconds that a connection may wait for its next request [default: 60]
    #[arg(long, value_name = "S", value_parser = seconds)]
    idle_timeout: Option<Duration>,
    /// Seconds that a client may take nothing of what is sent to it [default: 30]
    #[arg(long, value_name = "S", value_parser = seconds)]
    write_timeout: Option<Duration>,
    /// Seconds without a request or anyone who watches, after which a session may have to make room [default: 900]
    #[arg(long, value_name = "S", value_parser = seconds)]
    session_idle: Option<Duration>,
}

impl LimitArguments {
    pub fn limits(&self) -> Limits {
        let usual = Limits::default();
        let count = |given: Option<usize>, usual: usize| given.unwrap_or(usual);
        let size =
            |given: Option<usize>, unit: usize, usual: usize| given.map_or(usual, |given| given.saturating_mul(unit));
        let bytes =
            |given: Option<usize>, usual: u64| given.map_or(usual, |given| (given as u64).saturating_mul(1 << 20));
        Limits {
            connections: count(self.max_connections, usual.connections),
            streams_per_session: count(self.max_streams_per_session, usual.streams_per_session),
            sessions: count(self.max_sessions, usual.sessions),
            stored_sessions: count(self.max_stored_sessions, usual.stored_sessions),
            stored_bytes: bytes(self.max_stored, usual.stored_bytes),
            recordings_bytes: bytes(self.max_recordings, usual.recordings_bytes),
            joints: count(self.max_joints, usual.joints).min(usual.joints),
            targets: count(self.max_targets, usual.targets).min(usual.targets),
            evaluations: count(self.max_evaluations, usual.evaluations).min(usual.evaluations),
            steps_per_session: self.max_steps.unwrap_or(usual.steps_per_session),
            steps_per_request: self.max_steps_per_request.unwrap_or(usual.steps_per_request),
            memory_bytes: size(self.max_memory, 1 << 20, usual.memory_bytes),
            body_bytes: size(self.max_body, 1 << 10, usual.body_bytes),
            header_bytes: size(self.max_header, 1 << 10, usual.header_bytes),
            header_timeout: self.header_timeout.unwrap_or(usual.header_timeout),
            body_timeout: self.body_timeout.unwrap_or(usual.body_timeout),
            idle_timeout: self.idle_timeout.unwrap_or(usual.idle_timeout),
            write_timeout: self.write_timeout.unwrap_or(usual.write_timeout),
            idle_after: self.session_idle.unwrap_or(usual.idle_after),
            ..usual
        }
    }
}

/// A parser of counts, with a maximum beyond what a machine can have: more is a slip of the finger.
fn count() -> RangedU64ValueParser<usize> {
    RangedU64ValueParser::new().range(1..=1_000_000)
}

/// 16 TiB at most.
fn mebibytes() -> RangedU64ValueParser<usize> {
    RangedU64ValueParser::new().range(1..=1 << 24)
}

/// 1 GiB at most: it is held in memory.
fn kibibytes() -> RangedU64ValueParser<usize> {
    RangedU64ValueParser::new().range(1..=1 << 20)
}

fn steps() -> RangedU64ValueParser {
    RangedU64ValueParser::new().range(1..=super::MOST_STEPS)
}

/// Parses seconds, at most a day: more is meant as something else.
fn seconds(text: &str) -> Result<Duration, String> {
    const DAY_S: f64 = 24.0 * 3600.0;
    let seconds: Option<f64> = text.parse().ok().filter(|seconds| *seconds > 0.0 && *seconds <= DAY_S);
    seconds.map(Duration::from_secs_f64).ok_or_else(|| format!("not a number of seconds above 0, at most {DAY_S}"))
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Debug, Parser)]
    struct Program {
        #[command(flatten)]
        limits: LimitArguments,
    }

    fn limits(arguments: &[&str]) -> Result<Limits, clap::Error> {
        Program::try_parse_from([&["program"][..], arguments].concat()).map(|program| program.limits.limits())
    }

    #[test]
    fn what_is_not_given_is_as_usual() {
        assert_eq!(limits(&[]).expect("none"), Limits::default());
        let some = limits(&["--max-memory", "3", "--header-timeout", "0.5", "--max-sessions", "4"]).expect("three");
        let (memory_bytes, header_timeout, sessions) = (3 << 20, Duration::from_millis(500), 4);
        assert_eq!(some, Limits { memory_bytes, header_timeout, sessions, ..Limits::default() });
    }

    #[test]
    fn nothing_and_nonsense_are_refused() {
        for (option, value) in [
            ("--max-connections", "0"),
            ("--max-steps", "0"),
            ("--max-body", "-1"),
            ("--max-sessions", "18446744073709551615"),
            ("--max-memory", "18446744073709551615"),
            ("--max-steps", "1000000001"),
            ("--idle-timeout", "0"),
            ("--idle-timeout", "nan"),
            ("--write-timeout", "1e300"),
        ] {
            limits(&[option, value]).expect_err(option);
        }
    }
}
