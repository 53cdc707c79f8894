//! Authentication: a server that others can reach answers requests with its token, under names that are its own.
//!
//! Programs carry the token in `Authorization: Bearer`. A browser is opened once at `/?token=…`, which puts a pass into a cookie that
//! scripts cannot read and other sites cannot send. The pass is valid for this server alone, and the page is then opened without the
//! token in its address, so that a copied link never holds it.

use std::{fmt, net::SocketAddr, str::FromStr};

use axum::{
    extract::Request,
    http::{HeaderMap, HeaderValue, Method, StatusCode, header},
    response::{IntoResponse, Response},
};
use sha2::{Digest, Sha256};
use subtle::ConstantTimeEq;

use super::problem::{Kind, Problem};

/// The token that requests must carry.
#[derive(Clone, PartialEq, Eq)]
pub struct Token(String);

/// Why a text is no [`Token`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a token has {LEAST} to {MOST} letters, digits and -._~; make one with `openssl rand -hex 32`")]
pub struct NoToken;

/// The least length of a token; a shorter one could be guessed.
const LEAST: usize = 16;
const MOST: usize = 200;
/// The random bytes of a drawn token.
const DRAWN: usize = 32;
/// How long a browser keeps its pass, seconds: a year.
const KEPT_S: u64 = 365 * 24 * 3600;

impl Token {
    /// Draws a new token.
    ///
    /// # Errors
    ///
    /// The system's error if it has no random numbers.
    pub fn draw() -> Result<Self, getrandom::Error> {
        let mut bytes = [0; DRAWN];
        getrandom::fill(&mut bytes)?;
        Ok(Self(bytes.iter().map(|byte| format!("{byte:02x}")).collect()))
    }

    /// The token itself.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// Compares in constant time, which tells nothing of how much is right.
    fn is(&self, given: &str) -> bool {
        self.0.as_bytes().ct_eq(given.as_bytes()).into()
    }
}

impl FromStr for Token {
    type Err = NoToken;

    fn from_str(text: &str) -> Result<Self, NoToken> {
        let is_plain = text.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-._~".contains(&byte));
        if is_plain && (LEAST..=MOST).contains(&text.len()) { Ok(Self(text.to_owned())) } else { Err(NoToken) }
    }
}

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Token(…)")
    }
}

/// A further name of the server, beside those that it always has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HostName(String);

/// Why a text is no [`HostName`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no host name; write the name or the address alone, without scheme and port, as lab.example.org")]
pub struct NoHostName(String);

impl FromStr for HostName {
    type Err = NoHostName;

    fn from_str(text: &str) -> Result<Self, NoHostName> {
        let is_name = |byte: u8| byte.is_ascii_alphanumeric() || b"-.".contains(&byte);
        let bare = text.trim_matches(['[', ']']);
        let is_address = bare.parse::<std::net::IpAddr>().is_ok();
        if is_address || (!text.is_empty() && text.bytes().all(is_name)) {
            Ok(Self(bare.to_ascii_lowercase()))
        } else {
            Err(NoHostName(text.to_owned()))
        }
    }
}

/// The address at which a connection came in.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reached(Option<SocketAddr>);

impl Reached {
    pub(super) fn at(address: Option<SocketAddr>) -> Self {
        Self(address)
    }
}

/// The authentication of requests.
pub(super) struct Authentication {
    token: Option<Token>,
    /// The name of the cookie: cookies are shared among ports, so each server has its own name.
    cookie: String,
    hosts: Vec<HostName>,
}

impl Authentication {
    pub(super) fn new(token: Option<Token>, hosts: Vec<HostName>, port: u16) -> Self {
        Self { token, hosts, cookie: format!("body-schema-{port}") }
    }

    /// Whether a host is this server: a name of this machine, the address at which it was reached, or an allowed name. Any
    /// other name may belong to a page that made it point here.
    pub(super) fn are_meant_by(&self, host: &str, reached: Option<Reached>) -> bool {
        let name = name_of(host);
        let is_reached = || {
            let reached = reached.and_then(|Reached(address)| address)?.ip().to_canonical();
            Some(name.parse::<std::net::IpAddr>().ok()?.to_canonical() == reached)
        };
        is_local(&name) || self.hosts.iter().any(|HostName(allowed)| *allowed == name) || is_reached() == Some(true)
    }

    /// The answer to a request without the token; `None` for a request that may go on.
    pub(super) fn turn_away(&self, request: &Request) -> Option<Response> {
        let headers = request.headers();
        let Some(token) = &self.token else {
            let is_page = request.method() == Method::GET && request.uri().path() == "/";
            let brought = request.uri().query().filter(|_| is_page).and_then(query_token);
            return brought.map(|(_, rest)| to_page(&rest));
        };
        let is_known = bearer(headers).is_some_and(|given| token.is(given)) || self.has_cookie(token, headers);
        let brought = (request.method() == Method::GET && request.uri().path() == "/")
            .then(|| request.uri().query().and_then(query_token))
            .flatten();
        Some(match brought {
            Some((given, rest)) if token.is(given) => self.keep(token, &rest, headers),
            // Whatever it is, it is not to stay in the address.
            Some((_, rest)) if is_known => to_page(&rest),
            _ if is_known => return None,
            _ => {
                let detail = "send the token that the server printed when it started, or that of its --token-file, as \
                              `Authorization: Bearer TOKEN`; a browser is opened once at /?token=TOKEN";
                Problem::new(Kind::NoToken, detail).field("Authorization").into_response()
            }
        })
    }

    fn has_cookie(&self, token: &Token, headers: &HeaderMap) -> bool {
        let lines = headers.get_all(header::COOKIE).into_iter().filter_map(|value| value.to_str().ok());
        let pairs = lines.flat_map(|line| line.split(';')).filter_map(|pair| pair.trim().split_once('='));
        let mut given = pairs.filter(|(name, _)| *name == self.cookie).map(|(_, value)| value);
        let right = self.pass(token);
        given.any(|given| right.as_bytes().ct_eq(given.as_bytes()).into())
    }

    /// The pass that a browser is given in place of the token: its reader can neither use it at another server nor derive the
    /// token.
    fn pass(&self, token: &Token) -> String {
        let mut hash = Sha256::new();
        for part in ["body-schema cookie", &self.cookie, token.as_str()] {
            hash.update((part.len() as u64).to_be_bytes());
            hash.update(part);
        }
        hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
    }

    /// A response that lets the browser keep a pass, and go to the page.
    fn keep(&self, token: &Token, rest: &str, headers: &HeaderMap) -> Response {
        let is_encrypted = headers.get("x-forwarded-proto").is_some_and(|scheme| scheme == "https");
        let secure = if is_encrypted { "; Secure" } else { "" };
        let (Self { cookie, .. }, pass) = (self, self.pass(token));
        let cookie = format!("{cookie}={pass}; Path=/; Max-Age={KEPT_S}; HttpOnly; SameSite=Strict{secure}");
        let mut response = to_page(rest);
        response.headers_mut().extend(HeaderValue::from_str(&cookie).map(|value| (header::SET_COOKIE, value)));
        response
    }
}

/// A redirection to the page, with the rest of a query.
fn to_page(rest: &str) -> Response {
    let location = if rest.is_empty() { "/".to_owned() } else { format!("/?{rest}") };
    let mut response = StatusCode::SEE_OTHER.into_response();
    // It is of visible characters, as the address that was asked for is.
    response.headers_mut().extend(HeaderValue::from_str(&location).map(|value| (header::LOCATION, value)));
    response
}

fn bearer(headers: &HeaderMap) -> Option<&str> {
    let (scheme, token) = headers.get(header::AUTHORIZATION)?.to_str().ok()?.split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then(|| token.trim())
}

/// The token in a query, and the rest of it.
fn query_token(query: &str) -> Option<(&str, String)> {
    let token = query.split('&').find_map(|pair| pair.strip_prefix("token="))?;
    let rest: Vec<&str> = query.split('&').filter(|pair| !pair.starts_with("token=")).collect();
    Some((token, rest.join("&")))
}

/// A host without its port and brackets.
fn name_of(host: &str) -> String {
    let name = match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => name,
        _ => host,
    };
    name.trim_matches(['[', ']']).to_ascii_lowercase()
}

fn is_local(name: &str) -> bool {
    name == "localhost"
        || name.ends_with(".localhost")
        || name.parse::<std::net::IpAddr>().is_ok_and(|address| address.is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn allowing(hosts: &[&str]) -> Authentication {
        let hosts = hosts.iter().map(|host| host.parse().expect("a name")).collect();
        Authentication::new(None, hosts, 8080)
    }

    #[test]
    fn only_names_of_this_machine_are_local() {
        let none = allowing(&[]);
        for host in ["localhost", "localhost:8080", "LOCALHOST:1", "127.0.0.1:80", "127.1.2.3", "[::1]:8080", "[::1]"] {
            assert!(none.are_meant_by(host, None), "{host}");
        }
        for host in
            ["", "example.org", "example.org:8080", "127.0.0.1.example.org", "localhost.example.org", "10.0.0.1"]
        {
            assert!(!none.are_meant_by(host, None), "{host}");
        }
    }

    #[test]
    fn a_server_is_meant_by_the_address_at_which_it_was_reached_and_by_allowed_names() {
        let some = allowing(&["Lab.example.org", "10.0.0.9"]);
        let reached = |address: &str| Some(Reached(Some(address.parse().expect("an address"))));
        assert!(some.are_meant_by("10.0.0.1:8080", reached("10.0.0.1:8080")));
        assert!(some.are_meant_by("10.0.0.1", reached("[::ffff:10.0.0.1]:80")));
        assert!(some.are_meant_by("[fd00::1]:8080", reached("[fd00::1]:8080")));
        assert!(!some.are_meant_by("10.0.0.2:8080", reached("10.0.0.1:8080")));
        assert!(some.are_meant_by("lab.EXAMPLE.org:80", None) && some.are_meant_by("10.0.0.9", None));
        assert!(!some.are_meant_by("other.example.org", reached("10.0.0.1:8080")));
        for text in ["", "http://a", "a:80", "a/b", "a b"] {
            assert!(text.parse::<HostName>().is_err(), "{text}");
        }
    }

    #[test]
    fn tokens_are_long_plain_and_not_shown() {
        let (first, second) = (Token::draw().expect("one"), Token::draw().expect("another"));
        assert!(first != second && first.as_str().len() == 2 * DRAWN && first.as_str().parse() == Ok(first.clone()));
        assert!(first.is(first.as_str()) && !first.is(second.as_str()) && !first.is("") && !first.is(&first.0[1..]));
        assert!(!format!("{first:?}").contains(first.as_str()));
        for text in ["", "short", "with spaces in the midst", "semicolons;are;not;plain"] {
            assert!(text.parse::<Token>().is_err(), "{text}");
        }
    }

    #[test]
    fn a_query_gives_its_token_away_and_keeps_the_rest() {
        assert_eq!(query_token("token=a"), Some(("a", String::new())));
        assert_eq!(query_token("v=1&token=a&seed=2"), Some(("a", "v=1&seed=2".to_owned())));
        assert_eq!(query_token("tokens=a"), None);
    }
}
