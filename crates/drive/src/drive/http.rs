//! Requests of a browser, with bounds on everything that they may send.

use std::io::{self, Read, Write};
use std::time::{Duration, Instant};

/// Longest head of a request.
const HEAD: usize = 16 * 1024;
/// Longest body.
const BODY: usize = 64 * 1024;
/// Most header lines.
const HEADERS: usize = 64;
/// Time in which a request must be here, however slowly it comes.
const PATIENCE: Duration = Duration::from_secs(5);

/// Request of a browser.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct HttpRequest {
    /// `GET` or `POST`.
    pub(super) method: String,
    /// Path with its query.
    pub(super) path: String,
    pub(super) host: Option<String>,
    pub(super) origin: Option<String>,
    pub(super) content_type: Option<String>,
    pub(super) body: Vec<u8>,
}

/// Reason why a request is refused, with the status of the answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct RefusedRequest(pub(super) u16, pub(super) &'static str);

const TOO_LONG: RefusedRequest = RefusedRequest(413, "the request is too long");
const NO_REQUEST: RefusedRequest = RefusedRequest(400, "this is no request of a browser");
const TOO_SLOW: RefusedRequest = RefusedRequest(408, "the request did not arrive in time");

/// Reads a request. `Ok(None)`: the other side closed before it sent anything.
///
/// The stream must have a read timeout, which is the longest wait for a byte.
pub(super) fn read(stream: &mut impl Read) -> Result<Option<HttpRequest>, RefusedRequest> {
    let begun = Instant::now();
    let mut bytes = Vec::new();
    loop {
        let mut headers = [httparse::EMPTY_HEADER; HEADERS];
        let mut head = httparse::Request::new(&mut headers);
        // Parsed anew with each part, which costs little for heads of this
        // size.
        match head.parse(&bytes).map_err(|_| NO_REQUEST)? {
            httparse::Status::Complete(length) => {
                let mut request = HttpRequest::of(&head)?;
                // Checked before any byte of the body is waited for.
                let wanted = body_length(&head)?;
                let mut body = bytes[length..].to_vec();
                while body.len() < wanted {
                    if more(stream, &mut body, begun)? == 0 {
                        return Err(NO_REQUEST);
                    }
                }
                // Bytes behind the body would be a second request, which the
                // closing answer refuses.
                body.truncate(wanted);
                request.body = body;
                return Ok(Some(request));
            }
            httparse::Status::Partial if bytes.len() >= HEAD => return Err(TOO_LONG),
            httparse::Status::Partial => {}
        }
        if more(stream, &mut bytes, begun)? == 0 {
            return if bytes.is_empty() {
                Ok(None)
            } else {
                Err(NO_REQUEST)
            };
        }
    }
}

/// Appends what has arrived, and returns its length.
fn more(
    stream: &mut impl Read,
    bytes: &mut Vec<u8>,
    begun: Instant,
) -> Result<usize, RefusedRequest> {
    // The timeout of the stream is per byte, and a byte every few seconds
    // would last for ever.
    if begun.elapsed() > PATIENCE {
        return Err(TOO_SLOW);
    }
    let mut part = [0; 4096];
    loop {
        match stream.read(&mut part) {
            Ok(length) => {
                bytes.extend_from_slice(&part[..length]);
                return Ok(length);
            }
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(_) => return Err(TOO_SLOW),
        }
    }
}

fn body_length(head: &httparse::Request<'_, '_>) -> Result<usize, RefusedRequest> {
    let named = |name: &str| {
        let mut headers = head.headers.iter();
        headers.find(|it| it.name.eq_ignore_ascii_case(name))
    };
    // Two ways to state a length are how requests are smuggled.
    if named("transfer-encoding").is_some() {
        return Err(NO_REQUEST);
    }
    let Some(length) = named("content-length") else {
        return Ok(0);
    };
    let text = std::str::from_utf8(length.value).map_err(|_| NO_REQUEST)?;
    match text.trim().parse::<usize>() {
        Ok(length) if length <= BODY => Ok(length),
        Ok(_) => Err(TOO_LONG),
        Err(_) => Err(NO_REQUEST),
    }
}

impl HttpRequest {
    fn of(head: &httparse::Request<'_, '_>) -> Result<HttpRequest, RefusedRequest> {
        let header = |name: &str| {
            let mut headers = head.headers.iter();
            let found = headers.find(|it| it.name.eq_ignore_ascii_case(name))?;
            // A header that is no text counts as missing, which the checks
            // refuse.
            std::str::from_utf8(found.value).ok().map(str::to_owned)
        };
        let (Some(method), Some(path)) = (head.method, head.path) else {
            return Err(NO_REQUEST);
        };
        Ok(HttpRequest {
            method: method.to_owned(),
            path: path.to_owned(),
            host: header("host"),
            origin: header("origin"),
            content_type: header("content-type"),
            body: Vec::new(),
        })
    }
}

/// Headers of every answer: nothing is stored, framed, sniffed or passed on, and the page may
/// load its own files only.
const SAFE: &str = "Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\n\
     Referrer-Policy: no-referrer\r\nCross-Origin-Resource-Policy: same-origin\r\n\
     Content-Security-Policy: default-src 'self'; img-src data:; frame-ancestors 'none'; base-uri 'none'\r\n\
     Connection: close\r\n";

/// Writes an answer with a body.
pub(super) fn answer(
    stream: &mut impl Write,
    status: u16,
    content_type: &str,
    body: &[u8],
) -> io::Result<()> {
    let head = format!(
        "HTTP/1.1 {status} {}\r\nContent-Type: {content_type}\r\nContent-Length: {}\r\n{SAFE}\r\n",
        reason(status),
        body.len()
    );
    stream.write_all(head.as_bytes())?;
    stream.write_all(body)?;
    stream.flush()
}

/// Writes the head of a stream of events.
pub(super) fn begin_events(stream: &mut impl Write) -> io::Result<()> {
    let head = format!("HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\n{SAFE}\r\n");
    stream.write_all(head.as_bytes())?;
    stream.flush()
}

fn reason(status: u16) -> &'static str {
    match status {
        200 => "OK",
        204 => "No Content",
        403 => "Forbidden",
        404 => "Not Found",
        405 => "Method Not Allowed",
        408 => "Request Timeout",
        413 => "Content Too Large",
        429 => "Too Many Requests",
        503 => "Service Unavailable",
        _ => "Bad Request",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Result<Option<HttpRequest>, RefusedRequest> {
        read(&mut text.as_bytes())
    }

    #[test]
    fn a_request_has_its_path_headers_and_body() {
        let text = "POST /x/do HTTP/1.1\r\nhost: 127.0.0.1:1\r\nContent-Length: 2\r\n\
                    Origin: http://a\r\nContent-Type: application/json\r\n\r\n{}more";
        let request = of(text).expect("a request").expect("not empty");
        assert_eq!((&*request.method, &*request.path), ("POST", "/x/do"));
        assert_eq!(request.host.as_deref(), Some("127.0.0.1:1"));
        assert_eq!(request.origin.as_deref(), Some("http://a"));
        assert_eq!(request.body, b"{}");
    }

    #[test]
    fn what_is_no_request_or_too_long_is_refused() {
        assert_eq!(of(""), Ok(None));
        assert_eq!(of("GET / HTT"), Err(NO_REQUEST));
        assert_eq!(of("\u{1}\u{2}\r\n\r\n"), Err(NO_REQUEST));
        let long = format!("GET /{} HTTP/1.1\r\n", "a".repeat(2 * HEAD));
        assert_eq!(of(&long), Err(TOO_LONG));
        let many = format!("GET / HTTP/1.1\r\n{}\r\n", "a: b\r\n".repeat(HEADERS + 1));
        assert_eq!(of(&many), Err(NO_REQUEST));
        let body = |length: &str| format!("POST / HTTP/1.1\r\nContent-Length: {length}\r\n\r\n");
        assert_eq!(of(&body("99999999999")), Err(TOO_LONG));
        assert_eq!(of(&body("-1")), Err(NO_REQUEST));
        // A body that is shorter than it says.
        assert_eq!(of(&body("5")), Err(NO_REQUEST));
        let chunked = "POST / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n";
        assert_eq!(of(chunked), Err(NO_REQUEST));
    }
}
