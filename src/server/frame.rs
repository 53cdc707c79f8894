//! The origins that may show the page in a frame.

use std::{fmt, str::FromStr};

/// An origin whose pages may embed the explorer, as `frame-ancestors` takes it: `https://example.org`, with a port if it has
/// one, `https://*.example.org` for all hosts below, or `'self'`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameAncestor(String);

/// Why a text is no [`FrameAncestor`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{0}` is not an origin that may embed the page; write scheme and host alone, as https://example.org or \
     http://localhost:3000, https://*.example.org for all hosts below, or self for pages of this server"
)]
pub struct NoOrigin(String);

impl FrameAncestor {
    /// As it stands in the header.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for FrameAncestor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl FromStr for FrameAncestor {
    type Err = NoOrigin;

    fn from_str(text: &str) -> Result<Self, NoOrigin> {
        let no_origin = || NoOrigin(text.to_owned());
        if matches!(text, "self" | "'self'") {
            return Ok(Self("'self'".to_owned()));
        }
        let origin = text.strip_suffix('/').unwrap_or(text).to_ascii_lowercase();
        let (scheme, authority) = origin.split_once("://").ok_or_else(no_origin)?;
        let (host, port) = match authority.rsplit_once(':') {
            Some((host, port)) if !port.contains(']') => (host, Some(port)),
            _ => (authority, None),
        };
        let port_is_valid = port.is_none_or(|port| port == "*" || port.parse::<u16>().is_ok_and(|port| port > 0));
        if matches!(scheme, "http" | "https") && port_is_valid && is_host(host) {
            Ok(Self(origin))
        } else {
            Err(no_origin())
        }
    }
}

/// A name, an IPv4 address, an IPv6 address in brackets, or all names below one.
fn is_host(host: &str) -> bool {
    if let Some(address) = host.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
        return address.parse::<std::net::Ipv6Addr>().is_ok();
    }
    let name = host.strip_prefix("*.").unwrap_or(host);
    let is_label = |label: &str| {
        !label.is_empty()
            && label.chars().all(|c| c.is_ascii_alphanumeric() || c == '-')
            && !label.starts_with('-')
            && !label.ends_with('-')
    };
    name.split('.').all(is_label)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn origins_are_scheme_and_host_and_nothing_else() {
        for (text, origin) in [
            ("https://example.org", "https://example.org"),
            ("https://Example.ORG/", "https://example.org"),
            ("http://localhost:3000", "http://localhost:3000"),
            ("http://127.0.0.1:80", "http://127.0.0.1:80"),
            ("http://[::1]:8080", "http://[::1]:8080"),
            ("https://*.example.org", "https://*.example.org"),
            ("self", "'self'"),
        ] {
            assert_eq!(text.parse::<FrameAncestor>().map(|origin| origin.to_string()), Ok(origin.to_owned()));
        }
        for text in [
            "",
            "*",
            "example.org",
            "https://",
            "https://*",
            "https:example.org",
            "ftp://example.org",
            "https://a/b",
            "https://a; script-src *",
            "https://a b",
            "https://a:0",
            "https://a:x",
            "https://-a",
            "https://a..b",
            "https://a@b",
            "https://a?b",
            "https://a,https://b",
            "'none'",
            "https://\u{e4}.org",
        ] {
            assert!(text.parse::<FrameAncestor>().is_err(), "{text}");
        }
    }
}
