//! `serve`: the page and its HTTP interface.

use std::{
    io::Write,
    net::{Ipv4Addr, SocketAddr},
    path::PathBuf,
    sync::{Arc, OnceLock},
};

use anyhow::{Context, Result};
use body_schema::server::{FrameAncestor, HostName, Options, Server, Token, raise_descriptors};
use body_schema_scenario::Scenario;
use tokio_util::sync::CancellationToken;

use super::{
    BadInput,
    input::{load_scenario, read_text},
    limits::LimitArguments,
    logging::LoggingArguments,
    output,
    signals::{INSTANT, Interrupted, Signal, Signals},
};

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scenario and calibration files, which the page's menu has first, and which sessions can be opened with by their names
    #[arg(value_name = "FILE")]
    scenarios: Vec<String>,
    /// Address and port to listen on; port 0 takes a free one
    #[arg(long, default_value_t = DEFAULT_ADDRESS, value_name = "ADDRESS")]
    bind: SocketAddr,
    /// Keep sessions with robots elsewhere in DIR, and every other session's recording as a file there [default: the
    /// platform's folder for data of programs, without recordings]
    #[arg(long, value_name = "DIR")]
    data_dir: Option<PathBuf>,
    /// Keep nothing: sessions end with the server
    #[arg(long, conflicts_with = "data_dir")]
    ephemeral: bool,
    /// Answer only requests with the token in FILE [default: on addresses that other machines can reach a token is drawn
    /// and printed, on others none is needed]
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
    /// Answer also to NAME, beside localhost and the address that is listened on; repeat or separate by commas for several
    #[arg(long = "allow-host", value_name = "NAME", value_delimiter = ',', num_args = 1)]
    allow_hosts: Vec<HostName>,
    /// Let pages of ORIGIN show the explorer in a frame, as https://example.org, or `self`; repeat or separate by commas for
    /// several [default: nobody]
    #[arg(long, value_name = "ORIGIN", value_delimiter = ',', num_args = 1)]
    frame_ancestors: Vec<FrameAncestor>,
    /// Show the page with the panel in DIR, which `cargo run -p body-schema-bundle -- DIR` built
    #[arg(long, value_name = "DIR", hide = true)]
    panel_dir: Option<PathBuf>,
    #[command(flatten)]
    logging: LoggingArguments,
    #[command(flatten)]
    limits: LimitArguments,
}

/// The most bytes of a file with a token.
const MOST_TOKEN: u64 = 1 << 20;

const DEFAULT_ADDRESS: SocketAddr = SocketAddr::new(std::net::IpAddr::V4(Ipv4Addr::LOCALHOST), 8080);

impl Default for Arguments {
    fn default() -> Self {
        Self {
            scenarios: Vec::new(),
            bind: DEFAULT_ADDRESS,
            data_dir: None,
            ephemeral: false,
            token_file: None,
            allow_hosts: Vec::new(),
            frame_ancestors: Vec::new(),
            panel_dir: None,
            logging: LoggingArguments::default(),
            limits: LimitArguments::default(),
        }
    }
}

pub fn serve(arguments: &Arguments) -> Result<()> {
    let scenarios = arguments.scenarios.iter().map(|file| load_scenario(file)).collect::<Result<Vec<Scenario>>>()?;
    let first = scenarios.first().map(|scenario| scenario.name.clone());
    let data_dir = data_dir(arguments)?;
    let token = token(arguments)?;
    let _log = arguments.logging.begin()?;
    raise_descriptors();
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().context("cannot start")?;
    let served = runtime.block_on(async {
        let listener = tokio::net::TcpListener::bind(arguments.bind).await.with_context(|| {
            format!("cannot listen on {}; another program may be using it, try --bind 127.0.0.1:0", arguments.bind)
        })?;
        let address = listener.local_addr().context("cannot tell the address")?;
        let shutdown = CancellationToken::new();
        let ordered = end_by_signals(shutdown.clone())?;
        let options = Options {
            data_dir: data_dir.clone(),
            keep_recordings: arguments.data_dir.is_some(),
            token: token.clone(),
            allow_hosts: arguments.allow_hosts.clone(),
            panel_dir: arguments.panel_dir.clone(),
            commit: super::commit().map(ToOwned::to_owned),
            frame_ancestors: arguments.frame_ancestors.clone(),
            limits: arguments.limits.limits(),
            scenarios: scenarios.clone(),
        };
        let server = Server::new(listener, options, shutdown)?;
        let (version, folder) =
            (env!("CARGO_PKG_VERSION"), data_dir.as_deref().map(|folder| folder.display().to_string()));
        tracing::info!(version, %address, folder, needs_token = token.is_some(), "listening");
        for damage in server.damage() {
            output::tell(format_args!("warning: {damage}"));
        }
        say(format!("body-schema is at http://{address}/ (Ctrl-C ends it)"));
        if let Some(name) = &first {
            say(format!("`{name}` is at http://{address}/?scenario={name}"));
        }
        match (&data_dir, &arguments.data_dir) {
            (None, _) => say("nothing is kept: sessions end with the server".to_owned()),
            (Some(folder), None) => say(format!("sessions with robots elsewhere are kept in {}", folder.display())),
            (Some(folder), Some(_)) => {
                say(format!("recordings, and sessions with robots elsewhere, are kept in {}", folder.display()));
            }
        }
        match (&token, &arguments.token_file) {
            (None, _) => {}
            (Some(_), Some(file)) => {
                say(format!("only those who carry the token in {} are answered", file.display()));
            }
            (Some(token), None) => {
                let (token, reachable) = (token.as_str(), reachable(address));
                say("only those who carry the token are answered. Open once in each browser:".to_owned());
                say(format!("  http://{reachable}/?token={token}"));
                say(format!("Programs send the header `Authorization: Bearer {token}`"));
            }
        }
        server.run().await?;
        if let Some(&signal) = ordered.get() {
            return Err(Interrupted { signal, told: format!("ended at once, by a second {signal}") }.into());
        }
        say("ended; every recording is complete".to_owned());
        Ok(())
    });
    // Answers that nobody waits for any longer are left.
    runtime.shutdown_timeout(INSTANT);
    served
}

/// Prints a line, if standard output is open.
fn say(line: String) {
    drop(writeln!(std::io::stdout(), "{line}"));
}

/// The folder in which sessions are kept; `None` if nowhere.
fn data_dir(arguments: &Arguments) -> Result<Option<PathBuf>> {
    if arguments.ephemeral {
        return Ok(None);
    }
    let usual = || usual_data_dir().context("or keep nothing, with --ephemeral");
    arguments.data_dir.clone().map_or_else(usual, Ok).map(Some)
}

/// The platform's folder for the data of programs.
pub(super) fn usual_data_dir() -> Result<PathBuf> {
    let project = directories::ProjectDirs::from("", "", "body-schema");
    let project = project.context("this platform names no folder for data; name one with --data-dir")?;
    Ok(project.data_dir().to_owned())
}

/// The token that requests must carry; `None` if none.
fn token(arguments: &Arguments) -> Result<Option<Token>> {
    if let Some(file) = &arguments.token_file {
        let hint =
            || format!("cannot read the token in {}; name a file with one in it with --token-file", file.display());
        let text = read_text(file, MOST_TOKEN).map_err(BadInput).with_context(hint)?;
        return Ok(Some(text.trim().parse().with_context(|| format!("{} holds no token", file.display()))?));
    }
    if arguments.bind.ip().to_canonical().is_loopback() {
        return Ok(None);
    }
    Ok(Some(Token::draw().context("cannot draw a token; give one with --token-file")?))
}

/// An address that a browser on this machine can open.
fn reachable(address: SocketAddr) -> SocketAddr {
    match address.ip().is_unspecified() {
        true => SocketAddr::new(Ipv4Addr::LOCALHOST.into(), address.port()),
        false => address,
    }
}

/// Ends the server at the first signal, and the program at the second. The returned cell holds the second, if it came.
fn end_by_signals(shutdown: CancellationToken) -> Result<Arc<OnceLock<Signal>>> {
    let mut signals = Signals::new().context("cannot wait for signals")?;
    let ordered = Arc::new(OnceLock::new());
    let order = ordered.clone();
    tokio::spawn(async move {
        let first = signals.next().await;
        tracing::info!(signal = %first, "asked to end");
        shutdown.cancel();
        let second = signals.next().await;
        tracing::warn!(signal = %second, "asked to end at once");
        let signal = *order.get_or_init(|| second);
        tokio::time::sleep(INSTANT).await;
        std::process::exit(signal.exit_code().into());
    });
    Ok(ordered)
}
