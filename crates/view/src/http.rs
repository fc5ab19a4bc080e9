//! The part of HTTP/1.1 that a page on this machine needs, with bounds on sizes and times that a client controls.

use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Maximum bytes of a request's head, and of its body.
const MAX_HEAD: usize = 1 << 13;
pub(super) const MAX_BODY: usize = 1 << 16;

/// Maximum number of headers.
const MAX_HEADERS: usize = 64;

/// Time limits of a silent connection, of the arrival of a request, and of sending an answer.
const SILENCE: Duration = Duration::from_secs(30);
const ARRIVAL: Duration = Duration::from_secs(5);
const READING: Duration = Duration::from_secs(20);

/// Minimum rate at which a body arrives, in bytes per second.
const SLOWEST: usize = 1 << 22;

/// Bytes of one read or write: time limits are checked between two of them.
const PIECE: usize = 1 << 16;

/// A request.
#[derive(Debug, Default)]
pub(super) struct Request {
    pub(super) method: String,
    /// Path without the query.
    pub(super) path: String,
    query: String,
    pub(super) host: Option<String>,
    pub(super) origin: Option<String>,
    pub(super) content_type: Option<String>,
    /// The body, once it is read.
    pub(super) body: Vec<u8>,
    /// Lengths of head and body.
    lengths: (usize, usize),
}

impl Request {
    /// The value of a key of the query.
    pub(super) fn asks(&self, key: &str) -> Option<&str> {
        let pairs = self
            .query
            .split('&')
            .filter_map(|pair| pair.split_once('='));
        pairs.into_iter().find(|(k, _)| *k == key).map(|(_, v)| v)
    }
}

/// An answer.
#[derive(Debug)]
pub(super) struct Answer {
    pub(super) status: u16,
    pub(super) kind: &'static str,
    /// Name under which a browser saves the body.
    pub(super) file: Option<String>,
    pub(super) parts: Vec<std::sync::Arc<[u8]>>,
}

impl Answer {
    pub(super) fn new(status: u16, kind: &'static str, body: impl Into<Vec<u8>>) -> Self {
        Self {
            status,
            kind,
            file: None,
            parts: vec![body.into().into()],
        }
    }

    pub(super) fn text(status: u16, text: impl Into<String>) -> Self {
        Self::new(status, "text/plain; charset=utf-8", text.into())
    }

    pub(super) fn json(status: u16, value: &serde_json::Value) -> Self {
        Self::new(status, "application/json", value.to_string())
    }

    fn head(&self, stays: bool) -> String {
        let words = match self.status {
            200 => "OK",
            400 => "Bad Request",
            403 => "Forbidden",
            404 => "Not Found",
            405 => "Method Not Allowed",
            408 => "Request Timeout",
            411 => "Length Required",
            413 => "Content Too Large",
            415 => "Unsupported Media Type",
            431 => "Request Header Fields Too Large",
            503 => "Service Unavailable",
            _ => "Error",
        };
        let length: usize = self.parts.iter().map(|part| part.len()).sum();
        let mut head = format!(
            "HTTP/1.1 {} {words}\r\nContent-Type: {}\r\nContent-Length: {length}\r\n{HEADERS}",
            self.status, self.kind
        );
        if let Some(file) = &self.file {
            head += &format!("Content-Disposition: attachment; filename=\"{file}\"\r\n");
        }
        head += match stays {
            true => "Connection: keep-alive\r\n\r\n",
            false => "Connection: close\r\n\r\n",
        };
        head
    }
}

/// Headers of every answer. The page loads nothing from elsewhere; other pages of this machine may embed it in a frame,
/// as notebooks do, if they have its address.
const HEADERS: &str = "Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' \
blob: data:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'self' http://localhost:* \
http://127.0.0.1:* vscode-webview:\r\n\
X-Content-Type-Options: nosniff\r\n\
Referrer-Policy: no-referrer\r\n\
Cross-Origin-Resource-Policy: same-origin\r\n\
Cross-Origin-Opener-Policy: same-origin\r\n\
Cache-Control: no-store\r\n";

/// Reason for which a connection ends.
pub(super) enum End {
    /// The client closed the connection, or sent nothing for long.
    Gone,
    /// The request was refused; the answer has the reason.
    Refused(Answer),
}

impl From<io::Error> for End {
    fn from(_: io::Error) -> Self {
        Self::Gone
    }
}

fn refused(status: u16, why: &str) -> End {
    End::Refused(Answer::text(status, why))
}

/// A connection of a client.
pub(super) struct Connection {
    stream: TcpStream,
    /// Bytes read so far of the next request.
    ahead: Vec<u8>,
}

impl Connection {
    pub(super) fn new(stream: TcpStream) -> io::Result<Self> {
        stream.set_nodelay(true)?;
        Ok(Self {
            stream,
            ahead: Vec::new(),
        })
    }

    /// The next request, without its body.
    pub(super) fn next(&mut self) -> Result<Request, End> {
        let mut deadline = Instant::now() + SILENCE;
        if !self.ahead.is_empty() {
            deadline = Instant::now() + ARRIVAL;
        }
        loop {
            if let Some(request) = parsed(&self.ahead)? {
                return Ok(request);
            }
            if self.ahead.len() >= MAX_HEAD {
                return Err(refused(431, "the head of the request is too long"));
            }
            let first = self.ahead.is_empty();
            self.more(deadline, MAX_HEAD)?;
            if first {
                deadline = Instant::now() + ARRIVAL;
            }
        }
    }

    /// Reads the body of a request; refuses a body of more than `most` bytes.
    pub(super) fn body(&mut self, request: &mut Request, most: usize) -> Result<(), End> {
        let (head, body) = request.lengths;
        if body > most {
            return Err(refused(413, "the message is too long"));
        }
        let deadline = Instant::now() + ARRIVAL + Duration::from_secs((body / SLOWEST) as u64);
        while self.ahead.len() < head + body {
            self.more(deadline, head + body)?;
        }
        let rest = self.ahead.split_off(head + body);
        request.body = std::mem::replace(&mut self.ahead, rest);
        request.body.drain(..head);
        Ok(())
    }

    /// Reads once, up to `most` bytes in all; fails at the deadline.
    fn more(&mut self, deadline: Instant, most: usize) -> Result<(), End> {
        let left = deadline.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(End::Gone);
        }
        self.stream.set_read_timeout(Some(left))?;
        let mut piece = [0; PIECE];
        let room = (most - self.ahead.len().min(most)).clamp(1, piece.len());
        match self.stream.read(&mut piece[..room])? {
            0 => Err(End::Gone),
            read => {
                self.ahead.extend_from_slice(&piece[..read]);
                Ok(())
            }
        }
    }

    /// Sends an answer; `stays` keeps the connection open.
    pub(super) fn send(&mut self, answer: &Answer, stays: bool) -> io::Result<()> {
        let deadline = Instant::now() + READING;
        self.send_bytes(answer.head(stays).as_bytes(), deadline)?;
        (answer.parts.iter()).try_for_each(|part| self.send_bytes(part, deadline))
    }

    fn send_bytes(&mut self, bytes: &[u8], deadline: Instant) -> io::Result<()> {
        for piece in bytes.chunks(PIECE) {
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(io::ErrorKind::TimedOut.into());
            }
            self.stream.set_write_timeout(Some(left))?;
            self.stream.write_all(piece)?;
        }
        Ok(())
    }

    /// Ends the connection after a refusal. Input is read for half a second more, so that the client reads the answer.
    pub(super) fn close(mut self) {
        let _ = self.stream.shutdown(std::net::Shutdown::Write);
        let deadline = Instant::now() + Duration::from_millis(500);
        let mut piece = [0; 4096];
        while Instant::now() < deadline {
            let _ = self
                .stream
                .set_read_timeout(Some(Duration::from_millis(100)));
            if !matches!(self.stream.read(&mut piece), Ok(1..)) {
                break;
            }
        }
    }
}

/// Parses the head of a request; `None` if it is incomplete.
fn parsed(bytes: &[u8]) -> Result<Option<Request>, End> {
    let mut headers = [httparse::EMPTY_HEADER; MAX_HEADERS];
    let mut parsed = httparse::Request::new(&mut headers);
    let head = match parsed.parse(bytes) {
        Ok(httparse::Status::Complete(head)) => head,
        Ok(httparse::Status::Partial) => return Ok(None),
        Err(httparse::Error::TooManyHeaders) => return Err(refused(431, "too many headers")),
        Err(_) => return Err(refused(400, "not a request of HTTP")),
    };
    let target = parsed.path.unwrap_or_default();
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
    let mut request = Request {
        method: parsed.method.unwrap_or_default().to_owned(),
        path: path.to_owned(),
        query: query.to_owned(),
        ..Request::default()
    };
    let mut length = None;
    for header in parsed.headers {
        let value = String::from_utf8_lossy(header.value).into_owned();
        let once = |slot: &mut Option<String>| match slot.replace(value.clone()) {
            None => Ok(()),
            Some(_) => Err(refused(400, "a header that is there twice")),
        };
        match header.name.to_ascii_lowercase().as_str() {
            "host" => once(&mut request.host)?,
            "origin" => once(&mut request.origin)?,
            "content-type" => once(&mut request.content_type)?,
            "content-length" => once(&mut length)?,
            "transfer-encoding" => return Err(refused(411, "a message needs its length")),
            _ => {}
        }
    }
    let body = match length {
        None => 0,
        Some(text) => text
            .parse()
            .map_err(|_| refused(400, "a length that is no number"))?,
    };
    request.lengths = (head, body);
    Ok(Some(request))
}
