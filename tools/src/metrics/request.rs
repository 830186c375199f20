//! Requests for metrics and their answers: the subset of HTTP/1.1 (RFC 9110, RFC 9112) needed to read one
//! document.

use std::fmt::Write as _;

/// A parsed request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Request {
    /// The metrics.
    Metrics,
    /// Only the head of the answer with the metrics.
    Head,
    /// An invalid request: status and advice.
    Wrong(Status, &'static str),
}

/// Status of an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Status {
    Ok,
    BadRequest,
    NotFound,
    MethodNotAllowed,
    HeadTooLong,
}

impl Status {
    fn line(self) -> &'static str {
        match self {
            Self::Ok => "200 OK",
            Self::BadRequest => "400 Bad Request",
            Self::NotFound => "404 Not Found",
            Self::MethodNotAllowed => "405 Method Not Allowed",
            Self::HeadTooLong => "431 Request Header Fields Too Large",
        }
    }
}

/// The longest head of a request, bytes: Prometheus sends a few hundred.
pub(super) const LONGEST: usize = 8 * 1024;
const MOST_HEADERS: usize = 64;

/// Parses a request from the bytes received so far; `None` if it is incomplete.
pub(super) fn read(bytes: &[u8]) -> Option<Request> {
    let mut headers = [httparse::EMPTY_HEADER; MOST_HEADERS];
    let mut parsed = httparse::Request::new(&mut headers);
    match parsed.parse(bytes) {
        Ok(status) if status.is_complete() => {}
        Ok(_) if bytes.len() < LONGEST => return None,
        Ok(_) | Err(httparse::Error::TooManyHeaders) => {
            return Some(Request::Wrong(Status::HeadTooLong, "the head of the request is too long"));
        }
        Err(_) => return Some(Request::Wrong(Status::BadRequest, "this is not HTTP/1.1")),
    }
    let path = parsed.path.unwrap_or_default().split('?').next().unwrap_or_default();
    Some(match (parsed.method.unwrap_or_default(), path) {
        ("GET", "/metrics") => Request::Metrics,
        ("HEAD", "/metrics") => Request::Head,
        ("GET" | "HEAD", _) => Request::Wrong(Status::NotFound, "the metrics are at /metrics"),
        _ => Request::Wrong(Status::MethodNotAllowed, "metrics can only be read, with GET"),
    })
}

/// Returns the head of an answer whose body has this type and length.
pub(super) fn head(status: Status, content_type: &str, length: usize) -> String {
    let mut head = format!("HTTP/1.1 {}\r\n", status.line());
    if status == Status::MethodNotAllowed {
        head += "Allow: GET, HEAD\r\n";
    }
    let _ =
        write!(head, "Content-Type: {content_type}\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n");
    head
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(text: &str) -> Status {
        match read(text.as_bytes()) {
            Some(Request::Wrong(status, _)) => status,
            other => panic!("{text:?}: {other:?}"),
        }
    }

    #[test]
    fn metrics_are_requested_with_get() {
        let scrape =
            "GET /metrics HTTP/1.1\r\nHost: localhost:9464\r\nAccept: application/openmetrics-text\r\n\r\n";
        assert_eq!(read(scrape.as_bytes()), Some(Request::Metrics));
        assert_eq!(read(b"GET /metrics?format=any HTTP/1.0\r\n\r\n"), Some(Request::Metrics));
        assert_eq!(read(b"HEAD /metrics HTTP/1.1\r\n\r\n"), Some(Request::Head));
    }

    #[test]
    fn a_request_may_come_in_pieces() {
        let whole = "GET /metrics HTTP/1.1\r\nHost: a\r\n\r\n";
        for end in 0..whole.len() {
            assert_eq!(read(&whole.as_bytes()[..end]), None, "{end}");
        }
    }

    #[test]
    fn other_requests_are_refused_with_their_status() {
        assert_eq!(status("GET / HTTP/1.1\r\n\r\n"), Status::NotFound);
        assert_eq!(status("POST /metrics HTTP/1.1\r\n\r\n"), Status::MethodNotAllowed);
        assert_eq!(status("\u{1}\u{2} hello\r\n\r\n"), Status::BadRequest);
        assert_eq!(
            status(&format!("GET /metrics HTTP/1.1\r\nA: {}", "a".repeat(LONGEST))),
            Status::HeadTooLong
        );
        let many = "A: b\r\n".repeat(MOST_HEADERS + 1);
        assert_eq!(status(&format!("GET /metrics HTTP/1.1\r\n{many}\r\n")), Status::HeadTooLong);
        assert!(head(Status::MethodNotAllowed, "text/plain", 3).contains("\r\nAllow: GET, HEAD\r\n"));
    }
}
