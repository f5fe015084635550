//! The page's server: on this machine only, for whoever knows its address.

use std::io::{self, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use serde::Deserialize;
use serde_json::json;

use super::error::DriveError;
use super::http::{self, HttpRequest, RefusedRequest};
use super::hub::Hub;
use super::message::DriveRequest;
use super::real_time::{DriveSettings, PageEvent, RealTime};
use super::sandbox::Sandbox;

/// Connections at a time.
const MOST_CONNECTIONS: usize = 32;
/// Requests per second of all pages.
const MOST_REQUESTS: u32 = 400;
/// Longest wait for a byte of a request, and for room in a page's buffer.
const PATIENCE: Duration = Duration::from_secs(5);
/// Time without a message after which a stream says that it still is there.
const QUIET: Duration = Duration::from_secs(1);
/// Time between two looks at whether the program ends.
const LOOK: Duration = Duration::from_millis(100);

/// A file of the page, with its type.
const FILES: [(&str, &str, &[u8]); 5] = [
    (
        "",
        "text/html; charset=utf-8",
        include_bytes!("../../page/index.html"),
    ),
    (
        "style.css",
        "text/css",
        include_bytes!("../../page/style.css"),
    ),
    (
        "drive.js",
        "text/javascript",
        include_bytes!("../../page/drive.js"),
    ),
    (
        "panel.js",
        "text/javascript",
        include_bytes!("../../page/panel.js"),
    ),
    (
        "scene3d.js",
        "text/javascript",
        include_bytes!("../../page/scene3d.js"),
    ),
];

/// Counts of a drive that ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DriveEnded {
    /// Pages that listened.
    pub pages: usize,
}

/// What all connections share.
struct DriveServer {
    token: String,
    address: SocketAddr,
    hub: Hub,
    events: Sender<PageEvent>,
    connections: AtomicUsize,
    pages: AtomicUsize,
    rate: Mutex<Rate>,
}

/// Requests in the present second.
struct Rate {
    since: Instant,
    requests: u32,
}

/// Request of a page, with the number that it got when it came.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct NumberedRequest {
    page: u64,
    ask: DriveRequest,
}

/// Plays in real time for the pages of a browser on this machine, until `stop`.
///
/// `ready` is called with the address of the page, which holds a random word: whoever does
/// not know it gets nothing. `port` 0 takes any that is free.
///
/// # Errors
/// The port is taken, or the first episode cannot begin.
pub fn serve(
    sandbox: Sandbox,
    settings: DriveSettings,
    port: u16,
    stop: &AtomicBool,
    ready: &dyn Fn(&str),
    note: &(dyn Fn(&str) + Sync),
) -> Result<DriveEnded, DriveError> {
    let refused = |source| DriveError::Server { port, source };
    // Never on another interface: the page has no password.
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(refused)?;
    // So that the program can end while nobody comes.
    listener.set_nonblocking(true).map_err(refused)?;
    let hub = Hub::default();
    // Before the address is shown, so that a page finds an episode.
    let clock = RealTime::new(sandbox, settings, hub.clone(), note)?;
    let (events, received) = channel();
    let shared = Arc::new(DriveServer {
        token: token()?,
        address: listener.local_addr().map_err(refused)?,
        hub,
        events: events.clone(),
        connections: AtomicUsize::new(0),
        pages: AtomicUsize::new(0),
        rate: Mutex::new(Rate {
            since: Instant::now(),
            requests: 0,
        }),
    });
    ready(&format!("http://{}/{}/", shared.address, shared.token));
    thread::scope(|scope| {
        scope.spawn(move || clock.run(&received));
        let accepted = accept(&listener, &shared, stop);
        // The clock ends first, whatever happened to the listener.
        let _ = events.send(PageEvent::End);
        accepted
    })
    .map_err(refused)?;
    Ok(DriveEnded {
        pages: shared.pages.load(Ordering::Relaxed),
    })
}

/// Returns 128 random bits as a word.
fn token() -> Result<String, DriveError> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

fn accept(listener: &TcpListener, shared: &Arc<DriveServer>, stop: &AtomicBool) -> io::Result<()> {
    while !stop.load(Ordering::Relaxed) {
        match listener.accept() {
            Ok((stream, _)) => {
                let shared = Arc::clone(shared);
                // Not in the scope: a page that never reads must not hold up the end.
                thread::spawn(move || connection(stream, &shared));
            }
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => thread::sleep(LOOK / 20),
            // The browser has given up, which is no fault of the listener.
            Err(error) if error.kind() == io::ErrorKind::ConnectionAborted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

fn connection(mut stream: TcpStream, shared: &DriveServer) {
    // Counted before the check, so that two connections at once cannot both be
    // the last.
    let before = shared.connections.fetch_add(1, Ordering::Relaxed);
    // A connection that breaks is the page's loss only.
    let _ = if before >= MOST_CONNECTIONS {
        refuse(&mut stream, RefusedRequest(503, "too many connections"))
    } else {
        handle(&mut stream, shared)
    };
    shared.connections.fetch_sub(1, Ordering::Relaxed);
}

fn refuse(stream: &mut TcpStream, RefusedRequest(status, why): RefusedRequest) -> io::Result<()> {
    http::answer(stream, status, "text/plain; charset=utf-8", why.as_bytes())
}

fn handle(stream: &mut TcpStream, shared: &DriveServer) -> io::Result<()> {
    // Some systems pass the mode of the listener on.
    stream.set_nonblocking(false)?;
    // Frames are small, and delayed they would arrive in bursts.
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    // A page that is suspended must not hold its thread for ever.
    stream.set_write_timeout(Some(PATIENCE))?;
    let request = match http::read(stream) {
        Ok(Some(request)) => request,
        Ok(None) => return Ok(()),
        Err(refused) => return refuse(stream, refused),
    };
    match shared.admit(&request) {
        Err(refused) => refuse(stream, refused),
        Ok(("events", _)) => listen(stream, shared),
        Ok(("do", body)) => match shared.ask(body) {
            Ok(()) => http::answer(stream, 200, "application/json", b"{}"),
            Err(why) => {
                let body = json!({ "error": why }).to_string();
                http::answer(stream, 400, "application/json", body.as_bytes())
            }
        },
        Ok((name, _)) => match FILES.iter().find(|(file, ..)| *file == name) {
            Some((_, kind, content)) => http::answer(stream, 200, kind, content),
            None => refuse(stream, RefusedRequest(404, "the page has no such file")),
        },
    }
}

/// Sends messages until the page or the program is gone.
fn listen(stream: &mut TcpStream, shared: &DriveServer) -> io::Result<()> {
    let Some((page, messages)) = shared.hub.join() else {
        return refuse(stream, RefusedRequest(503, "too many pages"));
    };
    shared.pages.fetch_add(1, Ordering::Relaxed);
    let mut stream_to = || -> io::Result<()> {
        http::begin_events(stream)?;
        write!(stream, "data: {{\"page\":{page}}}\n\n")?;
        stream.flush()?;
        // After the number of the page, which has to be its first message.
        let _ = shared.events.send(PageEvent::Joined(page));
        loop {
            match messages.recv_timeout(QUIET) {
                // JSON has no line break, which would end the message.
                Ok(message) => write!(stream, "data: {message}\n\n")?,
                Err(RecvTimeoutError::Timeout) => write!(stream, ": here\n\n")?,
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            }
            stream.flush()?;
        }
    };
    let ended = stream_to();
    // Before the event, so that the clock sees the next page at the wheel.
    shared.hub.leave(page);
    let _ = shared.events.send(PageEvent::Left);
    ended
}

impl DriveServer {
    /// Returns what a request is for, with its body, if it comes from the page.
    fn admit<'r>(&self, request: &'r HttpRequest) -> Result<(&'r str, &'r [u8]), RefusedRequest> {
        let address = self.address.to_string();
        let local = format!("localhost:{}", self.address.port());
        // A name of another site that leads here (DNS rebinding) is in `Host`.
        let host = request.host.as_deref();
        if host != Some(&address) && host != Some(&local) {
            return Err(RefusedRequest(403, "another host was asked for"));
        }
        // A script of another site says so in `Origin`.
        let is_own = |origin: &str| {
            let origin = origin.strip_prefix("http://");
            origin == Some(&address) || origin == Some(&local)
        };
        if request.origin.as_deref().is_some_and(|it| !is_own(it)) {
            return Err(RefusedRequest(403, "another site asks"));
        }
        let path = request.path.strip_prefix('/').unwrap_or_default();
        let Some((token, name)) = path.split_once('/') else {
            return Err(RefusedRequest(
                404,
                "open the address that the terminal shows",
            ));
        };
        // After host and origin: a foreign site learns nothing about the word.
        if token != self.token {
            return Err(RefusedRequest(
                404,
                "open the address that the terminal shows",
            ));
        }
        // After the token, so that strangers cannot use up the page's share.
        if !self.is_within_rate() {
            return Err(RefusedRequest(429, "too many requests"));
        }
        match (&*request.method, name) {
            ("POST", "do") => {
                // A form of another site cannot have this type.
                let kind = request.content_type.as_deref().unwrap_or_default();
                if !kind.starts_with("application/json") {
                    return Err(RefusedRequest(400, "the body is no JSON"));
                }
                Ok(("do", &request.body))
            }
            ("GET", "do") | ("POST", _) => Err(RefusedRequest(405, "the page does not do that")),
            ("GET", name) => Ok((name, &[])),
            _ => Err(RefusedRequest(405, "the page does not do that")),
        }
    }

    fn is_within_rate(&self) -> bool {
        let mut rate = self.rate.lock().unwrap_or_else(PoisonError::into_inner);
        if rate.since.elapsed() >= Duration::from_secs(1) {
            *rate = Rate {
                since: Instant::now(),
                requests: 0,
            };
        }
        rate.requests += 1;
        rate.requests <= MOST_REQUESTS
    }

    /// Passes a request on to the clock.
    fn ask(&self, body: &[u8]) -> Result<(), String> {
        let request: NumberedRequest =
            serde_json::from_slice(body).map_err(|error| error.to_string())?;
        // Answered at once. The clock checks again, since the wheel may pass
        // on meanwhile.
        if self.hub.wheel() != Some(request.page) {
            return Err("another page is at the wheel".to_owned());
        }
        let event = PageEvent::Asked(request.page, request.ask);
        self.events
            .send(event)
            .map_err(|_| "the drive has ended".to_owned())
    }
}
