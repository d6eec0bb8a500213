//! The web server of `grainspan watch`.
//!
//! It listens on the loopback interface only. Other users of the machine can reach that too, so every path begins with a key that
//! cannot be guessed, as part of the address that is printed; no other path is answered. Files are served from the output folder alone.

use crate::cell;
use crate::controls::{Action, Controls};
use crate::data;
use crate::error::PageError;
use crate::folder::RunFolder;
use crate::program::Program;
use crate::report::{asset, live_page};
use rand::TryRng;
use rand::rngs::SysRng;
use serde_json::Value;
use std::collections::BTreeMap;
use std::io::Write;
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use tiny_http::{Method, Request};

/// Requests that are answered at the same time: a browser opens some six connections.
const THREADS: usize = 4;

/// Bytes that the buffers of a connection take at once, whether its reader reads or not.
const AT_ONCE: usize = 32 * 1024;

/// Longer answers that are under way at the same time, each with a thread of its own: their readers may wait as long as they like.
const MOST_UNDER_WAY: usize = 32;

/// Where a server listens.
#[derive(Clone, Copy, Debug)]
pub struct ServerSettings {
    /// Port on 127.0.0.1; 0: a free one.
    pub port: u16,
    /// Whether a port that is taken is replaced by a free one.
    pub any_if_taken: bool,
}

/// A server that listens; see [`Server::run`].
pub struct Server {
    listener: tiny_http::Server,
    place: SocketAddr,
    site: Site,
}

impl Server {
    /// Listens for requests about a folder.
    ///
    /// # Errors
    /// The port is taken, or the system gives no random numbers.
    pub fn bind(folder: RunFolder, program: Program, settings: ServerSettings) -> Result<Self, PageError> {
        let listen = |port: u16| tiny_http::Server::http(SocketAddr::from((Ipv4Addr::LOCALHOST, port)));
        let listener = listen(settings.port)
            .or_else(|error| if settings.any_if_taken { listen(0) } else { Err(error) })
            .map_err(|error| {
                PageError(format!(
                    "cannot listen on port {}: {error}\nhint: choose another one with --port",
                    settings.port
                ))
            })?;
        let place =
            listener.server_addr().to_ip().ok_or_else(|| PageError("the server has no address".to_owned()))?;
        let key = random_key()?;
        Ok(Self {
            listener,
            place,
            site: Site { folder, program, key, mesh: Mutex::default(), under_way: AtomicUsize::new(0) },
        })
    }

    /// Address of the page, key included.
    pub fn address(&self) -> String {
        format!("http://{}/{}/", self.place, self.site.key)
    }

    /// Port that it listens on.
    pub fn port(&self) -> u16 {
        self.place.port()
    }

    /// Answers requests until the process ends.
    pub fn run(self) {
        let (listener, site) = (Arc::new(self.listener), Arc::new(self.site));
        let serve = |listener: Arc<tiny_http::Server>, site: Arc<Site>| {
            while let Ok(request) = listener.recv() {
                if has_body(&request) {
                    // The library waits for all of a body before it lets a request go. The page sends none; whoever does waits alone.
                    let site = Arc::clone(&site);
                    thread::spawn(move || respond(&site, request));
                } else {
                    respond(&site, request);
                }
            }
        };
        let others: Vec<_> = (1..THREADS)
            .map(|_| {
                let (listener, site) = (Arc::clone(&listener), Arc::clone(&site));
                thread::spawn(move || serve(listener, site))
            })
            .collect();
        serve(listener, site);
        for other in others {
            // A thread that has ended otherwise has said so already.
            let _ = other.join();
        }
    }
}

fn has_body(request: &Request) -> bool {
    let is_chunked = || request.headers().iter().any(|header| header.field.equiv("Transfer-Encoding"));
    request.body_length().map_or_else(is_chunked, |length| length > 0)
}

fn respond(site: &Arc<Site>, request: Request) {
    let answer = answered(|| site.answer(request.method() == &Method::Post, request.url()));
    if answer.body.len() <= AT_ONCE {
        return write(&answer, request);
    }
    if site.under_way.fetch_add(1, Ordering::Relaxed) < MOST_UNDER_WAY {
        let done = Arc::clone(site);
        let write_and_leave = move || {
            write(&answer, request);
            done.under_way.fetch_sub(1, Ordering::Relaxed);
        };
        if thread::Builder::new().spawn(write_and_leave).is_err() {
            // The system gives no thread: the request is dropped with what was to answer it.
            site.under_way.fetch_sub(1, Ordering::Relaxed);
        }
    } else {
        site.under_way.fetch_sub(1, Ordering::Relaxed);
        write(&Answer::new(503, "text/plain", "too many long answers are under way whose readers wait\n"), request);
    }
}

fn write(answer: &Answer, request: Request) {
    let text = match answer.status {
        200 => "OK",
        404 => "Not Found",
        409 => "Conflict",
        503 => "Service Unavailable",
        _ => "Internal Server Error",
    };
    // The server library gives each connection a thread of a pool for as long as it lasts, and lets further ones wait. Browsers keep
    // several open, so every connection ends with its answer; the library's own responses cannot say that.
    let head = format!(
        "HTTP/1.1 {} {text}\r\nContent-Type: {}\r\nContent-Length: {}\r\nConnection: close\r\nCache-Control: no-store\r\n\
         Referrer-Policy: no-referrer\r\nX-Content-Type-Options: nosniff\r\n\
         Content-Security-Policy: default-src 'self' 'unsafe-inline' data:\r\n\r\n",
        answer.status,
        answer.kind,
        answer.body.len()
    );
    let mut writer = request.into_writer();
    // A browser that has gone away needs no answer.
    let _ =
        writer.write_all(head.as_bytes()).and_then(|()| writer.write_all(&answer.body)).and_then(|()| writer.flush());
}

/// What is answered; a file that no part of this program has written may be damaged in any way, and the next request is not to suffer from it.
fn answered(answer: impl FnOnce() -> Answer) -> Answer {
    let failed = |_| Answer::new(500, "text/plain", "the answer could not be made; the error is on the terminal");
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(answer)).unwrap_or_else(failed)
}

/// 128 random bits in hexadecimal digits.
fn random_key() -> Result<String, PageError> {
    let mut bytes = [0_u8; 16];
    SysRng
        .try_fill_bytes(&mut bytes)
        .map_err(|error| PageError(format!("the system gives no random numbers: {error}")))?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// What is answered to a request.
#[derive(Clone, Debug, PartialEq)]
struct Answer {
    status: u16,
    kind: &'static str,
    body: Vec<u8>,
}

impl Answer {
    fn new(status: u16, kind: &'static str, body: impl Into<Vec<u8>>) -> Self {
        Self { status, kind, body: body.into() }
    }

    fn json(value: &Value) -> Self {
        Self::new(200, "application/json", value.to_string())
    }

    fn missing(what: &str) -> Self {
        Self::new(404, "text/plain; charset=utf-8", format!("{what}\n"))
    }

    fn done(result: Result<(), PageError>) -> Self {
        match result {
            Ok(()) => Self::json(&Value::Bool(true)),
            Err(error) => Self::new(500, "text/plain; charset=utf-8", format!("{error}\n")),
        }
    }
}

/// What is served.
struct Site {
    folder: RunFolder,
    program: Program,
    key: String,
    /// The mesh and the run that it belongs to: a folder may get another one.
    mesh: Mutex<Option<(String, Value)>>,
    /// Long answers that are being written.
    under_way: AtomicUsize,
}

impl Site {
    fn answer(&self, posts: bool, url: &str) -> Answer {
        let (path, query) = url.split_once('?').unwrap_or((url, ""));
        let Some(path) = path.strip_prefix('/').and_then(|path| path.strip_prefix(self.key.as_str())) else {
            return Answer::missing("nothing is here: use the address that `grainspan watch` has printed");
        };
        let Some(path) = path.strip_prefix('/') else {
            return Answer::missing("nothing is here: the address ends with a slash");
        };
        let query = parameters(query);
        match (posts, path.split_once('/').unwrap_or((path, ""))) {
            (false, ("", "")) => Answer::new(200, "text/html; charset=utf-8", live_page(&self.folder.name())),
            (false, ("assets", name)) => asset(name).map_or_else(
                || Answer::missing("no such part of the page"),
                |(kind, text)| Answer::new(200, kind, text),
            ),
            (false, ("api", name)) => self.data(name, &query),
            (false, ("files", relative)) => self.file(&decoded(relative)),
            (true, ("api", name)) => self.carry_out(name, &query),
            _ => Answer::missing("nothing is here"),
        }
    }

    fn data(&self, name: &str, query: &BTreeMap<String, String>) -> Answer {
        let number = |key: &str| query.get(key).and_then(|text| text.parse::<u64>().ok());
        let found = match name {
            "state" => Some(data::state(&self.folder, &self.program)),
            "history" => Some(data::history(&self.folder)),
            "log" => Some(data::log(&self.folder)),
            "mesh" => Some(self.mesh()),
            "frame" => number("step")
                .and_then(|step| data::frame(&self.folder, step, query.get("field").map(String::as_str))),
            "cell" => number("point").and_then(|point| {
                let point = usize::try_from(point).ok()?;
                let steps = cell::available(&self.folder).remove(&point)?;
                cell::read(&self.folder, point, cell::nearest(&steps, number("step").unwrap_or(u64::MAX))?)
            }),
            _ => return Answer::missing("no such data"),
        };
        Answer::json(&found.unwrap_or_default())
    }

    fn mesh(&self) -> Value {
        let run = self.folder.run();
        let mut known = self.mesh.lock().unwrap_or_else(PoisonError::into_inner);
        if known.as_ref().is_none_or(|(of, _)| *of != run) {
            *known = Some((run, data::mesh(&self.folder)));
        }
        known.as_ref().map(|(_, mesh)| mesh.clone()).unwrap_or_default()
    }

    fn file(&self, relative: &str) -> Answer {
        match self.folder.file(relative).map(std::fs::read) {
            Some(Ok(bytes)) => {
                let kind = match relative.rsplit('.').next() {
                    Some("svg") => "image/svg+xml",
                    Some("json") => "application/json",
                    Some("csv" | "toml" | "jsonl" | "pvd" | "vtu" | "vtp") => "text/plain; charset=utf-8",
                    _ => "application/octet-stream",
                };
                Answer::new(200, kind, bytes)
            }
            Some(Err(error)) => Answer::missing(&error.to_string()),
            None => Answer::missing("no such file in the folder of the run"),
        }
    }

    fn carry_out(&self, name: &str, query: &BTreeMap<String, String>) -> Answer {
        if (self.program.live)(self.folder.path()).is_none() {
            return Answer::new(409, "text/plain; charset=utf-8", "no run writes to this folder now\n");
        }
        let controls = Controls::of(self.folder.path());
        match name {
            "control" => {
                let wanted = query.get("action").map(String::as_str);
                match Action::ALL.into_iter().find(|action| Some(action.keyword()) == wanted) {
                    Some(action) => Answer::done(controls.request(action)),
                    None => Answer::missing("no such action"),
                }
            }
            "cell" => match query.get("point").and_then(|text| text.parse().ok()) {
                Some(point) => Answer::done(controls.request_cell(point)),
                None => Answer::missing("no such Gauss point"),
            },
            _ => Answer::missing("no such request"),
        }
    }
}

/// `a=1&b=2` by name.
fn parameters(query: &str) -> BTreeMap<String, String> {
    query
        .split('&')
        .filter_map(|pair| pair.split_once('='))
        .map(|(key, value)| (decoded(key), decoded(value)))
        .collect()
}

/// Text without percent signs; a sequence that is none stays.
fn decoded(text: &str) -> String {
    let bytes = text.as_bytes();
    let mut found = Vec::with_capacity(bytes.len());
    let mut place = 0;
    while let Some(&byte) = bytes.get(place) {
        let digits = text.get(place + 1..place + 3).filter(|_| byte == b'%');
        match digits.and_then(|digits| u8::from_str_radix(digits, 16).ok()) {
            Some(value) => {
                found.push(value);
                place += 3;
            }
            None => {
                found.push(byte);
                place += 1;
            }
        }
    }
    String::from_utf8_lossy(&found).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::io::Read;
    use std::net::{IpAddr, TcpStream};
    use std::path::Path;
    use std::time::Duration;

    const PROGRAM: Program = Program {
        live: |path| path.join("alive").exists().then(|| Value::from(1)),
        counter: |name, _| (name.to_owned(), false),
    };

    fn site(path: &Path) -> Site {
        fs::write(path.join("scene.toml"), "").unwrap();
        fs::write(path.join("history.csv"), "step,time\n0,0\n1,").unwrap();
        fs::write(path.join(".hidden"), "no").unwrap();
        let folder = RunFolder::open(path).unwrap();
        Site { folder, program: PROGRAM, key: "key".into(), mesh: Mutex::default(), under_way: AtomicUsize::new(0) }
    }

    #[test]
    fn only_paths_with_the_key_and_below_the_folder_are_answered() {
        let place = tempfile::tempdir().unwrap();
        let site = site(place.path());
        let status = |url: &str| site.answer(false, url).status;
        for good in [
            "/key/",
            "/key/assets/page.js",
            "/key/api/state",
            "/key/api/history",
            "/key/api/log",
            "/key/api/mesh",
            "/key/api/frame?step=1",
            "/key/api/frame",
            "/key/api/cell?point=99999999999999999999&step=-1",
            "/key/files/history.csv",
        ] {
            assert_eq!(status(good), 200, "{good}");
        }
        for bad in [
            "/",
            "/api/state",
            "/kex/",
            "/key",
            "/keyapi/state",
            "/key/files/../scene.toml",
            "/key/files/%2e%2e/x",
            "/key/files//etc/passwd",
            "/key/files/.hidden",
            "/key/assets/../server.rs",
            "/key/api/none",
            "/key/%",
            "*",
            "",
        ] {
            assert_eq!(status(bad), 404, "{bad}");
        }
        assert_eq!(site.answer(false, "/key/api/frame?step=1").body, b"null");
    }

    #[test]
    fn requests_are_passed_on_to_living_runs_only() {
        let place = tempfile::tempdir().unwrap();
        let site = site(place.path());
        let controls = Controls::of(place.path());
        assert_eq!(site.answer(true, "/key/api/control?action=pause").status, 409);
        fs::write(place.path().join("alive"), "").unwrap();
        assert_eq!(site.answer(true, "/key/api/control?action=explode").status, 404);
        assert_eq!(site.answer(true, "/key/api/cell?point=../x").status, 404);
        assert_eq!(site.answer(false, "/key/api/control?action=pause").status, 404);
        assert!(!controls.asks(Action::Pause));
        assert_eq!(site.answer(true, "/key/api/control?action=pause").status, 200);
        assert_eq!(site.answer(true, "/key/api/cell?point=4").status, 200);
        assert!(controls.asks(Action::Pause) && controls.cells() == [4]);
    }

    #[test]
    fn the_server_listens_on_the_loopback_interface() {
        let place = tempfile::tempdir().unwrap();
        fs::write(place.path().join("scene.toml"), "").unwrap();
        fs::write(place.path().join("large.csv"), vec![b'0'; 30_000_000]).unwrap();
        let folder = RunFolder::open(place.path()).unwrap();
        let settings = ServerSettings { port: 0, any_if_taken: false };
        let server = Server::bind(folder.clone(), PROGRAM, settings).unwrap();
        assert_eq!(server.place.ip(), IpAddr::from(Ipv4Addr::LOCALHOST));
        let taken = ServerSettings { port: server.port(), any_if_taken: false };
        assert!(Server::bind(folder.clone(), PROGRAM, taken).err().unwrap().0.contains("--port"));
        let other = Server::bind(folder, PROGRAM, ServerSettings { any_if_taken: true, ..taken }).unwrap();
        assert_ne!(other.port(), server.port());
        let (place, address) = (server.place, server.address());
        thread::spawn(move || server.run());
        let get = |path: &str| {
            let mut stream = TcpStream::connect(place).unwrap();
            stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
            write!(stream, "GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n").unwrap();
            let mut text = Vec::new();
            stream.read_to_end(&mut text).expect("an answer in time");
            String::from_utf8_lossy(&text).into_owned()
        };
        // Others have come first.
        let in_time = |path: &str| {
            thread::sleep(Duration::from_millis(200));
            get(path)
        };
        assert!(get("/").starts_with("HTTP/1.1 404"));
        let page = get(address.trim_start_matches(&format!("http://{place}")));
        assert!(page.starts_with("HTTP/1.1 200") && page.contains("<!DOCTYPE html>"), "{page}");
        let pending = |request: &str| -> Vec<TcpStream> {
            let mut streams: Vec<_> = (0..=THREADS).map(|_| TcpStream::connect(place).unwrap()).collect();
            streams.iter_mut().for_each(|stream| write!(stream, "{request}\r\nHost: localhost\r\n\r\n").unwrap());
            streams
        };
        // Bodies that never come occupied every thread, and so did answers that nobody reads.
        let key = address.trim_start_matches(&format!("http://{place}"));
        let unread = format!("GET {key}files/large.csv HTTP/1.1");
        for request in ["POST / HTTP/1.1\r\nContent-Length: 5000", &unread] {
            let streams = pending(request);
            assert!(in_time("/").starts_with("HTTP/1.1 404"), "{request}");
            drop(streams);
        }
    }

    #[test]
    fn percent_signs_are_decoded() {
        assert_eq!(decoded("a%20b%2Fc%zz%4"), "a b/c%zz%4");
        assert_eq!(decoded("%e2%82"), "\u{fffd}");
        assert_eq!(decoded("%é1"), "%é1");
        assert_eq!(parameters("a=1&b&c=%31"), BTreeMap::from([("a".into(), "1".into()), ("c".into(), "1".into())]));
    }
}
