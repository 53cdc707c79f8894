//! `serve`: the page and its HTTP interface.

use std::{
    io::Write,
    net::{Ipv4Addr, SocketAddr},
    path::PathBuf,
};

use anyhow::{Context, Result};
use body_schema::server::{self, FrameAncestor, Options};
use tokio_util::sync::CancellationToken;

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Address and port to listen on; port 0 takes a free one
    #[arg(long, default_value_t = DEFAULT_ADDRESS, value_name = "ADDRESS")]
    bind: SocketAddr,
    /// Also keep every session's recording as a file in DIR [default: in memory only, to be downloaded]
    #[arg(long, value_name = "DIR")]
    data_dir: Option<PathBuf>,
    /// Let pages of ORIGIN show the explorer in a frame, as https://example.org, or `self`; repeat or separate by commas for
    /// several [default: nobody]
    #[arg(long, value_name = "ORIGIN", value_delimiter = ',', num_args = 1)]
    frame_ancestors: Vec<FrameAncestor>,
    /// Show the page with the panel in DIR, which `cargo run -p body-schema-bundle -- DIR` built
    #[arg(long, value_name = "DIR", hide = true)]
    panel_dir: Option<PathBuf>,
}

const DEFAULT_ADDRESS: SocketAddr = SocketAddr::new(std::net::IpAddr::V4(Ipv4Addr::LOCALHOST), 8080);

impl Default for Arguments {
    fn default() -> Self {
        Self { bind: DEFAULT_ADDRESS, data_dir: None, frame_ancestors: Vec::new(), panel_dir: None }
    }
}

pub fn serve(arguments: &Arguments) -> Result<()> {
    if let Some(folder) = &arguments.data_dir {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot create the folder {}", folder.display()))?;
    }
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().context("cannot start")?;
    runtime.block_on(async {
        let listener = tokio::net::TcpListener::bind(arguments.bind).await.with_context(|| {
            format!("cannot listen on {}; another program may be using it, try --bind 127.0.0.1:0", arguments.bind)
        })?;
        let address = listener.local_addr().context("cannot tell the address")?;
        let shutdown = CancellationToken::new();
        tokio::spawn(cancel_on_signal(shutdown.clone()));
        let mut out = std::io::stdout();
        writeln!(out, "body-schema is at http://{address}/ (Ctrl-C ends it)")?;
        if let Some(folder) = &arguments.data_dir {
            writeln!(out, "recordings are kept in {}", folder.display())?;
        }
        out.flush()?;
        let options = Options {
            data_dir: arguments.data_dir.clone(),
            panel_dir: arguments.panel_dir.clone(),
            frame_ancestors: arguments.frame_ancestors.clone(),
        };
        server::serve(listener, options, shutdown).await?;
        writeln!(out, "ended; every recording is complete")?;
        Ok(())
    })
}

/// Ctrl-C, and where there is one the terminate signal.
async fn cancel_on_signal(shutdown: CancellationToken) {
    #[cfg(unix)]
    {
        use tokio::signal::unix::{SignalKind, signal};
        match signal(SignalKind::terminate()) {
            Ok(mut terminate) => {
                tokio::select! {
                    _ = terminate.recv() => {}
                    _ = tokio::signal::ctrl_c() => {}
                }
            }
            Err(_) => _ = tokio::signal::ctrl_c().await,
        }
    }
    #[cfg(not(unix))]
    {
        _ = tokio::signal::ctrl_c().await;
    }
    shutdown.cancel();
}
