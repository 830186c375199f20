//! The head of a request: HTTP for the page, or the beginning of a WebSocket.

use super::files::{FILES, File};

/// The longest head of a request, bytes.
pub(super) const LONGEST: usize = 16 * 1024;
const MOST_HEADERS: usize = 64;

/// A parsed request.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Asked {
    /// Sends a file of the page; only the header if `body` is `false`.
    File {
        /// The file.
        file: &'static File,
        /// `false` for a HEAD request.
        body: bool,
    },
    /// A WebSocket of a viewer.
    WebSocket {
        /// The token in its address, if there is one.
        token: Option<String>,
    },
    /// Another request: a status and advice.
    Wrong(Status, &'static str),
}

/// Status of an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Status {
    Ok,
    BadRequest,
    Forbidden,
    NotFound,
    MethodNotAllowed,
    HeadTooLong,
}

impl Status {
    fn line(self) -> &'static str {
        match self {
            Self::Ok => "200 OK",
            Self::BadRequest => "400 Bad Request",
            Self::Forbidden => "403 Forbidden",
            Self::NotFound => "404 Not Found",
            Self::MethodNotAllowed => "405 Method Not Allowed",
            Self::HeadTooLong => "431 Request Header Fields Too Large",
        }
    }
}

/// Parses a request from the bytes so far; `None` if it is incomplete.
pub(super) fn read(bytes: &[u8]) -> Option<Asked> {
    let mut headers = [httparse::EMPTY_HEADER; MOST_HEADERS];
    let mut parsed = httparse::Request::new(&mut headers);
    match parsed.parse(bytes) {
        Ok(status) if status.is_complete() => {}
        Ok(_) if bytes.len() < LONGEST => return None,
        Ok(_) | Err(httparse::Error::TooManyHeaders) => {
            return Some(Asked::Wrong(Status::HeadTooLong, "the head of the request is too long"));
        }
        Err(_) => return Some(Asked::Wrong(Status::BadRequest, "this is not HTTP/1.1")),
    }
    let method = parsed.method.unwrap_or_default();
    let target = parsed.path.unwrap_or_default();
    let header = |name: &str| {
        let found = parsed.headers.iter().find(|header| header.name.eq_ignore_ascii_case(name))?;
        core::str::from_utf8(found.value).ok()
    };
    // Reject DNS rebinding: a foreign page whose host name resolves to this machine.
    if !header("host").is_some_and(is_loopback) {
        return Some(Asked::Wrong(Status::Forbidden, "the viewer serves localhost alone; use an SSH tunnel"));
    }
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
    if header("upgrade").is_some_and(|value| value.eq_ignore_ascii_case("websocket")) {
        return Some(Asked::WebSocket { token: token_of(query) });
    }
    Some(match method {
        "GET" | "HEAD" => match FILES.iter().find(|file| file.path == path) {
            Some(file) => Asked::File { file, body: method == "GET" },
            None => Asked::Wrong(Status::NotFound, "the page is at /"),
        },
        _ => Asked::Wrong(Status::MethodNotAllowed, "the page can only be read, with GET"),
    })
}

/// Returns the value of `token` in a query.
fn token_of(query: &str) -> Option<String> {
    let pairs = query.split('&').filter_map(|pair| pair.split_once('='));
    pairs.filter(|(name, _)| *name == "token").map(|(_, value)| value.to_string()).next()
}

/// Returns `true` if a `Host` names the loopback interface.
fn is_loopback(host: &str) -> bool {
    let name = match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => name,
        _ => host,
    };
    ["localhost", "127.0.0.1", "[::1]"].contains(&name)
}

/// Returns the head of an answer whose body has this type and length.
pub(super) fn head(status: Status, content_type: &str, length: usize) -> String {
    let allow = if status == Status::MethodNotAllowed { "Allow: GET, HEAD\r\n" } else { "" };
    format!(
        "HTTP/1.1 {}\r\n{allow}Content-Type: {content_type}\r\nContent-Length: {length}\r\nCache-Control: no-cache\r\n\
         Content-Security-Policy: default-src 'self'; connect-src 'self' ws:; img-src 'self' data: blob:; \
         style-src 'self' 'unsafe-inline'\r\nX-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\n\
         Connection: close\r\n\r\n",
        status.line()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(text: &str) -> Status {
        match read(text.as_bytes()) {
            Some(Asked::Wrong(status, _)) => status,
            other => panic!("{text:?}: {other:?}"),
        }
    }

    fn path(text: &str) -> (&'static str, bool) {
        match read(text.as_bytes()) {
            Some(Asked::File { file, body }) => (file.path, body),
            other => panic!("{text:?}: {other:?}"),
        }
    }

    #[test]
    fn page_and_files_are_served_for_get() {
        assert_eq!(path("GET / HTTP/1.1\r\nHost: localhost:8765\r\n\r\n"), ("/", true));
        assert_eq!(path("GET /?token=a HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"), ("/", true));
        assert_eq!(path("HEAD /page.js HTTP/1.1\r\nHost: [::1]:8765\r\n\r\n"), ("/page.js", false));
    }

    #[test]
    fn a_request_may_come_in_pieces() {
        let whole = "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n";
        for end in 0..whole.len() {
            assert_eq!(read(&whole.as_bytes()[..end]), None, "{end}");
        }
    }

    #[test]
    fn a_websocket_may_carry_a_token() {
        let upgrade = "Host: localhost:8765\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\r\n";
        for (target, token) in [("/", None), ("/?token=k7", Some("k7")), ("/x?a=b&token=k7", Some("k7"))] {
            let asked = read(format!("GET {target} HTTP/1.1\r\n{upgrade}").as_bytes());
            assert_eq!(asked, Some(Asked::WebSocket { token: token.map(str::to_string) }), "{target}");
        }
    }

    #[test]
    fn another_host_another_method_and_another_path_are_refused() {
        assert_eq!(status("GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n"), Status::Forbidden);
        assert_eq!(status("GET / HTTP/1.1\r\n\r\n"), Status::Forbidden);
        assert_eq!(status("GET /etc/passwd HTTP/1.1\r\nHost: localhost\r\n\r\n"), Status::NotFound);
        assert_eq!(status("GET /../lib.rs HTTP/1.1\r\nHost: localhost\r\n\r\n"), Status::NotFound);
        assert_eq!(status("POST / HTTP/1.1\r\nHost: localhost\r\n\r\n"), Status::MethodNotAllowed);
        assert_eq!(status("\x16\x03\x01\r\n\r\n"), Status::BadRequest);
        let long = format!("GET / HTTP/1.1\r\nX: {}\r\n", "a".repeat(LONGEST));
        assert_eq!(status(&long), Status::HeadTooLong);
    }
}
