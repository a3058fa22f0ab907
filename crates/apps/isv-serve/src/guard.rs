//! Checks of who asks: browsers send along which site a page came from, and which name they reached the
//! server by.
//!
//! A page of another site must not read from a server on the user's own machine. Browsers keep it from
//! reading answers, but not from opening a WebSocket: that is what `Origin` is checked for. And a site may
//! let its own name point to the loopback address (DNS rebinding). So a server there answers to no names but
//! those of the machine itself.

use axum::http::HeaderMap;
use axum::http::header;
use axum::http::uri::Authority;
use std::fmt;
use std::net::IpAddr;
use std::str::FromStr;
use thiserror::Error;

/// A site: scheme, host and perhaps a port, as in `https://show.example`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Origin {
    text: String,
    authority: Authority,
}

/// What is no site.
#[derive(Debug, Error)]
#[error("an origin is http:// or https:// and a host, without a path, as in https://show.example")]
pub struct ParseOriginError;

impl FromStr for Origin {
    type Err = ParseOriginError;

    fn from_str(text: &str) -> Result<Self, ParseOriginError> {
        let text = text.to_ascii_lowercase();
        let (scheme, host) = text.split_once("://").ok_or(ParseOriginError)?;
        let usual_port = match scheme {
            "http" => 80,
            "https" => 443,
            _ => return Err(ParseOriginError),
        };
        if host.contains(['@', '*']) {
            return Err(ParseOriginError);
        }
        let mut authority = host.parse::<Authority>().map_err(|_| ParseOriginError)?;
        // Browsers leave it out.
        if authority.port_u16() == Some(usual_port) {
            authority = authority.host().parse().map_err(|_| ParseOriginError)?;
        }
        Ok(Self { text: format!("{scheme}://{authority}"), authority })
    }
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// Whose requests are answered.
#[derive(Clone, Debug)]
pub(crate) struct Guard {
    /// Whether the server is at a loopback address.
    pub(crate) on_loopback: bool,
    /// Sites whose pages may read, beside the server's own.
    pub(crate) allowed: Vec<Origin>,
}

impl Guard {
    /// Whether the request came by a name that this server answers to.
    pub(crate) fn knows_host(&self, headers: &HeaderMap) -> bool {
        let Some(host) = host(headers) else { return false };
        !self.on_loopback
            || is_this_machine(&host)
            || self.allowed.iter().any(|origin| origin.authority == host)
    }

    /// Whether the page that asks is one of this server or of an allowed site. What sends no origin is no browser's page.
    pub(crate) fn allows_origin(&self, headers: &HeaderMap) -> bool {
        let mut origins = headers.get_all(header::ORIGIN).iter();
        let Some(origin) = origins.next() else { return true };
        let Some(Ok(origin)) = origin.to_str().ok().map(Origin::from_str) else { return false };
        let is_own = host(headers).is_some_and(|host| origin.authority == host);
        origins.next().is_none() && (is_own || self.allowed.contains(&origin))
    }
}

/// The one `Host`, if it is one.
fn host(headers: &HeaderMap) -> Option<Authority> {
    let mut hosts = headers.get_all(header::HOST).iter();
    let host = hosts.next()?.to_str().ok().filter(|host| !host.contains('@'))?.parse().ok();
    host.filter(|_| hosts.next().is_none())
}

/// Whatever the port: a tunnel may have another one.
fn is_this_machine(host: &Authority) -> bool {
    let name = host.host();
    let bare = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name);
    name.eq_ignore_ascii_case("localhost")
        || bare.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(pairs: &[(header::HeaderName, &'static str)]) -> HeaderMap {
        let mut headers = HeaderMap::new();
        for (name, value) in pairs {
            headers.append(name, value.parse().unwrap());
        }
        headers
    }

    fn guard(on_loopback: bool) -> Guard {
        Guard { on_loopback, allowed: vec!["https://Show.example".parse().unwrap()] }
    }

    #[test]
    fn on_loopback_only_the_machine_itself_is_meant() {
        let knows = |on_loopback, host| guard(on_loopback).knows_host(&headers(&[(header::HOST, host)]));
        for host in ["localhost", "LOCALHOST:8000", "127.0.0.1:8000", "127.9.9.9", "[::1]:80", "show.example"]
        {
            assert!(knows(true, host), "{host}");
        }
        let strangers = [
            "evil.example",
            "127.0.0.1.evil.example",
            "localhost.evil.example:80",
            "192.168.1.5",
            "localhost@evil.example",
            "0.0.0.0",
            "",
        ];
        for host in strangers {
            assert!(!knows(true, host), "{host}");
        }
        assert!(knows(false, "evil.example"), "whom it reaches by which name is not known of an open server");
        assert!(!guard(true).knows_host(&headers(&[])));
        assert!(
            !guard(true).knows_host(&headers(&[(header::HOST, "localhost"), (header::HOST, "evil.example")]))
        );
    }

    #[test]
    fn pages_of_other_sites_are_told_apart() {
        let host = (header::HOST, "127.0.0.1:8000");
        let allows = |origin| guard(true).allows_origin(&headers(&[host.clone(), (header::ORIGIN, origin)]));
        for origin in ["http://127.0.0.1:8000", "https://show.example", "HTTPS://SHOW.EXAMPLE"] {
            assert!(allows(origin), "{origin}");
        }
        let strangers = [
            "http://127.0.0.1:8001",
            "http://localhost:8000",
            "https://evil.example",
            "null",
            "",
            "https://show.example.evil.example",
            "http://show.example",
            "https://show.example:8443",
            "file://",
            "http://evil@127.0.0.1:8000",
        ];
        for origin in strangers {
            assert!(!allows(origin), "{origin}");
        }
        assert!(guard(true).allows_origin(&headers(&[host])), "no browser");
    }

    #[test]
    fn origins_have_no_path() {
        for text in [
            "https://show.example/",
            "show.example",
            "ftp://show.example",
            "https://",
            "*",
            "https://*",
            "https://a b",
        ] {
            assert!(text.parse::<Origin>().is_err(), "{text}");
        }
        for (text, sent) in [
            ("https://show.example:443", "https://show.example"),
            ("http://[::1]:80", "http://[::1]"),
            ("http://show.example:443", "http://show.example:443"),
        ] {
            assert_eq!(text.parse::<Origin>().unwrap(), sent.parse().unwrap());
            assert_eq!(text.parse::<Origin>().unwrap().to_string(), sent);
        }
        assert_eq!(
            "https://Show.example:8443".parse::<Origin>().unwrap().to_string(),
            "https://show.example:8443"
        );
    }
}
