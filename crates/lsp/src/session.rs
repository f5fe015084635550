//! Session with an editor: open documents, requests and diagnostics.

use std::collections::BTreeMap;
use std::io::{self, BufRead, Write};
use std::sync::mpsc::{Receiver, TryRecvError, sync_channel};
use std::thread;

use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::cursor::Cursor;
use crate::document::Document;
use crate::expansion::Expansion;
use crate::frame::{FrameError, read_frame, write_frame};
use crate::language::{CheckedText, KnownName, WorldLanguage};
use crate::messages::{
    ChangeParams, Diagnostic, DocumentParams, INVALID_PARAMS, INVALID_REQUEST, InitializeParams,
    METHOD_NOT_FOUND, MessageHead, NOT_INITIALIZED, OpenParams, PARSE_ERROR, PlaceParams,
    WithParams, answer, capabilities, completions, diagnostics, hover, refusal, shown_warning,
};
use crate::uri::file_of_uri;

/// Messages that are read ahead, so that edits in a row are checked once.
const READ_AHEAD: usize = 4;
/// Greatest size of all open texts together, in bytes.
const MAX_OPEN_BYTES: usize = 64 << 20;
/// Greatest number of open documents.
const MAX_DOCUMENTS: usize = 10_000;
/// Most bytes that the edits of one notification may go through, about a second of work.
const MAX_EDITED_BYTES: u64 = 1 << 30;
/// Greatest number of problems of a document, of which a person reads a few.
const MOST_DIAGNOSTICS: usize = 200;

/// End of a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SessionEnd {
    /// The editor ended it with `shutdown` and `exit`.
    Orderly,
    /// The editor left without `shutdown`, or sent no messages of the protocol.
    Abrupt,
}

/// Serves an editor until it leaves.
///
/// Wrong messages are answered with an error. A frame without a length ends the session.
///
/// # Errors
///
/// Returns an error if the output cannot be written.
pub fn serve(
    mut input: impl BufRead + Send + 'static,
    output: &mut impl Write,
    language: &dyn WorldLanguage,
) -> io::Result<SessionEnd> {
    // Bounded, so that a fast client cannot fill the memory with frames.
    let (sender, frames) = sync_channel(READ_AHEAD);
    // A thread of its own, because a check has to wait until no edit is waiting. It ends
    // with the process if the editor keeps the input open.
    thread::spawn(move || {
        loop {
            let frame = read_frame(&mut input);
            // After a broken header no next frame can be found.
            let is_last = match &frame {
                Ok(message) => message.is_none(),
                Err(error) => !error.is_skipped(),
            };
            if sender.send(frame).is_err() || is_last {
                return;
            }
        }
    });
    let mut session = Session {
        language,
        output,
        stage: SessionStage::Fresh,
        has_snippets: false,
        open: BTreeMap::new(),
    };
    session.run(&frames)
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum SessionStage {
    Fresh,
    Running,
    ShutDown,
}

struct OpenWorld {
    document: Document,
    version: Option<i64>,
    /// True if it was not checked since its last change.
    is_changed: bool,
    /// True if the editor shows problems of it.
    has_problems: bool,
    /// Names of the last version without a mistake.
    names: Vec<KnownName>,
}

struct Session<'a, W> {
    language: &'a dyn WorldLanguage,
    output: &'a mut W,
    stage: SessionStage,
    has_snippets: bool,
    /// Documents by their URIs.
    open: BTreeMap<String, OpenWorld>,
}

/// Frame as it was read.
type ReadFrame = Result<Option<Vec<u8>>, FrameError>;

/// Answer to a request: its result, or the code and the reason of a refusal.
type RequestResult = Result<Value, (i32, String)>;

impl<W: Write> Session<'_, W> {
    fn run(&mut self, frames: &Receiver<ReadFrame>) -> io::Result<SessionEnd> {
        loop {
            // With a check outstanding the session does not wait: an empty
            // queue is the time to check.
            let next = match self.changed() {
                None => frames.recv().map_err(|_| TryRecvError::Disconnected),
                Some(_) => frames.try_recv(),
            };
            let message = match (next, self.changed()) {
                (Ok(Ok(Some(message))), _) => message,
                // The id of the request is unknown, so the answer has none.
                (Ok(Err(error)), _) => {
                    let what = error.to_string();
                    self.send(&refusal(None, PARSE_ERROR, &what))?;
                    continue;
                }
                (Err(TryRecvError::Empty), Some(uri)) => {
                    self.check(&uri)?;
                    continue;
                }
                // The end of the input, without `exit`.
                (_, Some(uri)) => {
                    self.check(&uri)?;
                    continue;
                }
                (_, None) => return Ok(SessionEnd::Abrupt),
            };
            if let Some(end) = self.receive(&message)? {
                return Ok(end);
            }
        }
    }

    fn send(&mut self, message: &Value) -> io::Result<()> {
        write_frame(self.output, &message.to_string())
    }

    /// A document that has to be checked.
    fn changed(&self) -> Option<String> {
        if self.stage == SessionStage::ShutDown {
            return None;
        }
        // In the order of URIs, so that equal sessions give equal output.
        let mut all = self.open.iter();
        all.find(|(_, it)| it.is_changed)
            .map(|(uri, _)| uri.clone())
    }

    /// Answers a message. `Some` if it ends the session.
    fn receive(&mut self, message: &[u8]) -> io::Result<Option<SessionEnd>> {
        let head: MessageHead = match serde_json::from_slice(message) {
            Ok(head) => head,
            Err(error) => {
                // JSON-RPC 2.0, §5.1 has one code for wrong JSON and one for a
                // wrong message.
                let code = if error.is_data() {
                    INVALID_REQUEST
                } else {
                    PARSE_ERROR
                };
                self.send(&refusal(None, code, &error.to_string()))?;
                return Ok(None);
            }
        };
        match (head.method.as_deref(), head.id) {
            // A request named `exit` is answered below, because every request
            // needs an answer.
            (Some("exit"), None) => {
                return Ok(Some(match self.stage {
                    SessionStage::ShutDown => SessionEnd::Orderly,
                    // The protocol asks for exit code 1 without a `shutdown`
                    // before.
                    SessionStage::Fresh | SessionStage::Running => SessionEnd::Abrupt,
                }));
            }
            (Some(method), Some(id)) => {
                let reply = match self.request(method, message) {
                    Ok(result) => answer(&id, &result),
                    Err((code, what)) => refusal(Some(&id), code, &what),
                };
                self.send(&reply)?;
            }
            (Some(method), None) => self.notification(method, message)?,
            // An answer: the server asks nothing.
            (None, Some(_)) => {}
            (None, None) => {
                let what = "a message has a `method` or an `id`";
                self.send(&refusal(None, INVALID_REQUEST, what))?;
            }
        }
        Ok(None)
    }

    fn request(&mut self, method: &str, message: &[u8]) -> RequestResult {
        match (self.stage, method) {
            (SessionStage::Fresh, "initialize") => {
                let params: InitializeParams = params_of(message)?;
                self.has_snippets = params.has_snippets();
                self.stage = SessionStage::Running;
                Ok(capabilities())
            }
            (SessionStage::Fresh, _) => {
                Err((NOT_INITIALIZED, "`initialize` comes first".to_owned()))
            }
            (SessionStage::ShutDown, _) => {
                let what = format!("`{method}` after `shutdown`");
                Err((INVALID_REQUEST, what))
            }
            (SessionStage::Running, "shutdown") => {
                self.stage = SessionStage::ShutDown;
                Ok(Value::Null)
            }
            (SessionStage::Running, "textDocument/hover") => self
                .at_place(message, |document, cursor| {
                    hover(document, cursor.and_then(|it| it.hover()))
                }),
            (SessionStage::Running, "textDocument/completion") => {
                let has_snippets = self.has_snippets;
                self.at_place(message, |document, cursor| {
                    cursor.map_or(Value::Null, |it| {
                        completions(document, &it.completions(), has_snippets)
                    })
                })
            }
            (SessionStage::Running, _) => {
                Err((METHOD_NOT_FOUND, format!("unknown method `{method}`")))
            }
        }
    }

    /// Answers a request about a place.
    fn at_place(
        &self,
        message: &[u8],
        then: impl FnOnce(&Document, Option<Cursor<'_>>) -> Value,
    ) -> RequestResult {
        let params: PlaceParams = params_of(message)?;
        let uri = &params.text_document.uri;
        // An error and no empty answer, which would hide a client that forgot
        // `didOpen`.
        let Some(world) = self.open.get(uri) else {
            return Err((INVALID_PARAMS, format!("`{uri}` is not open")));
        };
        let document = &world.document;
        let at = document.offset(params.position);
        let cursor = Cursor::new(document.text(), at, self.language, &world.names);
        Ok(then(document, cursor))
    }

    /// Follows a notification. Unknown and wrong ones have no answer.
    fn notification(&mut self, method: &str, message: &[u8]) -> io::Result<()> {
        if self.stage != SessionStage::Running {
            return Ok(());
        }
        match method {
            "textDocument/didOpen" => match params_of::<OpenParams>(message) {
                Ok(params) => self.begin(params),
                Err(_) => Ok(()),
            },
            "textDocument/didChange" => match params_of::<ChangeParams>(message) {
                Ok(params) => self.change(params),
                Err(_) => Ok(()),
            },
            "textDocument/didSave" => {
                // Any world may include the saved file.
                for world in self.open.values_mut() {
                    world.is_changed = true;
                }
                Ok(())
            }
            "textDocument/didClose" => match params_of::<DocumentParams>(message) {
                Ok(params) => self.end(&params.text_document.uri),
                Err(_) => Ok(()),
            },
            _ => Ok(()),
        }
    }

    fn begin(&mut self, params: OpenParams) -> io::Result<()> {
        let opened = params.text_document;
        // Empty documents have no bytes, so the limit of bytes alone would not
        // hold.
        if self.open.len() >= MAX_DOCUMENTS {
            return self.send(&shown_warning("too many open worlds: close some"));
        }
        let world = OpenWorld {
            document: Document::new(opened.text),
            version: opened.version,
            is_changed: true,
            has_problems: false,
            names: Vec::new(),
        };
        self.open.insert(opened.uri.clone(), world);
        // After the insertion, because a document may replace one with the
        // same URI.
        self.limit(&opened.uri)
    }

    fn change(&mut self, params: ChangeParams) -> io::Result<()> {
        let uri = params.text_document.uri;
        let Some(world) = self.open.get_mut(&uri) else {
            return Ok(());
        };
        world.version = params.text_document.version;
        world.is_changed = true;
        // Each edit goes through the whole text, because its places are those of the text
        // after the edit before it. Many edits of a large text would take hours.
        let changes = || params.content_changes.iter();
        let edits = changes().filter(|it| it.range.is_some()).count();
        let added: usize = changes().map(|it| it.text.len()).sum();
        let bytes = world.document.text().len() + added;
        if edits as u64 * bytes as u64 > MAX_EDITED_BYTES {
            self.end(&uri)?;
            let what = format!("{edits} edits of a world of {bytes} bytes at once: open it again");
            return self.send(&shown_warning(&what));
        }
        for change in params.content_changes {
            world.document.apply(change);
        }
        self.limit(&uri)
    }

    /// Forgets a document with which the texts are too large together.
    fn limit(&mut self, uri: &str) -> io::Result<()> {
        let bytes: usize = self.open.values().map(|it| it.document.text().len()).sum();
        if bytes <= MAX_OPEN_BYTES {
            return Ok(());
        }
        self.end(uri)?;
        let what = format!("the open worlds have more than {MAX_OPEN_BYTES} bytes: close some");
        self.send(&shown_warning(&what))
    }

    /// Closes a document, whose problems the editor forgets.
    fn end(&mut self, uri: &str) -> io::Result<()> {
        match self.open.remove(uri) {
            Some(world) if world.has_problems => self.send(&diagnostics(uri, None, &[])),
            _ => Ok(()),
        }
    }

    /// Checks a document and publishes its problems.
    fn check(&mut self, uri: &str) -> io::Result<()> {
        let Some(world) = self.open.get_mut(uri) else {
            return Ok(());
        };
        // Before the check, so that one that fails is not repeated for ever.
        world.is_changed = false;
        let text = world.document.text();
        let result = self.language.check(&file_of_uri(uri), text);
        let is_world = result.is_some();
        let mut checked = result.unwrap_or_default();
        // A text with a mistake has no names, and those of the last good
        // version are kept.
        if let Some(names) = checked.names.take() {
            world.names = names;
        }
        let list = shown_problems(&world.document, &checked);
        // A file that is no world and shows nothing is not this server's.
        if !is_world && !world.has_problems {
            return Ok(());
        }
        world.has_problems = !list.is_empty();
        let version = world.version;
        // An empty list is sent as well, because it removes the problems of the version
        // before.
        self.send(&diagnostics(uri, version, &list))
    }
}

fn params_of<P: DeserializeOwned>(message: &[u8]) -> Result<P, (i32, String)> {
    let whole: Result<WithParams<P>, _> = serde_json::from_slice(message);
    match whole {
        Ok(whole) => Ok(whole.params),
        Err(error) => Err((INVALID_PARAMS, error.to_string())),
    }
}

/// Problems at their places in the text that the user sees.
fn shown_problems(document: &Document, checked: &CheckedText) -> Vec<Diagnostic> {
    let text = document.text();
    let own = text.strip_prefix('\u{feff}').unwrap_or(text);
    // The check leaves a byte order mark out, and the editor counts it.
    let mark = text.len() - own.len();
    let expansion = (own != checked.text).then(|| Expansion::new(own, &checked.text));
    // Before their places are computed, whose cost grows with the text.
    let first = checked.problems.iter().take(MOST_DIAGNOSTICS);
    let list = first.map(|problem| {
        let span = problem.span.clone();
        let own = match &expansion {
            Some(expansion) => expansion.own_span(span),
            None => span,
        };
        Diagnostic {
            range: document.span(own.start + mark..own.end + mark),
            severity: if problem.is_warning { 2 } else { 1 },
            source: "brakecheck",
            message: match &problem.help {
                Some(help) => format!("{}\nhelp: {help}", problem.what),
                None => problem.what.clone(),
            },
        }
    });
    list.collect()
}
