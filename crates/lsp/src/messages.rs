//! Messages of the protocol: the few that the server reads and writes.

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::cursor::Explained;
use crate::document::{Document, TextChange, TextPosition, TextRange};
use crate::items::{Completions, Item, ItemKind};

/// Code of a text that is no JSON.
pub const PARSE_ERROR: i32 = -32700;
/// Code of JSON that is no message.
pub const INVALID_REQUEST: i32 = -32600;
/// Code of an unknown method.
pub const METHOD_NOT_FOUND: i32 = -32601;
/// Code of wrong parameters.
pub const INVALID_PARAMS: i32 = -32602;
/// Code of a request before `initialize`.
pub const NOT_INITIALIZED: i32 = -32002;

/// Number of a request, which its answer repeats.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum RequestId {
    /// Number.
    Number(i64),
    /// Text.
    Text(String),
}

/// Head of a message, without its parameters.
#[derive(Debug, Deserialize)]
pub struct MessageHead {
    /// Number of a request. `None` for a notification.
    pub id: Option<RequestId>,
    /// Method. `None` for an answer.
    pub method: Option<String>,
}

/// Message with parameters of a known form.
#[derive(Deserialize)]
pub struct WithParams<P> {
    /// Parameters.
    pub params: P,
}

/// Parameters of `initialize`, as far as they matter.
#[derive(Default, Deserialize)]
#[serde(default)]
pub struct InitializeParams {
    /// Abilities of the editor.
    pub capabilities: Value,
}

impl InitializeParams {
    /// Returns whether the editor moves its cursor into what it inserts.
    pub fn has_snippets(&self) -> bool {
        let path = "/textDocument/completion/completionItem/snippetSupport";
        self.capabilities.pointer(path) == Some(&Value::Bool(true))
    }
}

/// Name of a document.
#[derive(Deserialize)]
pub struct DocumentId {
    /// URI, mostly of a file.
    pub uri: String,
    /// Version that the editor counts.
    pub version: Option<i64>,
}

/// Opened document.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct OpenParams {
    /// The document.
    pub text_document: OpenedDocument,
}

/// Opened document with its text.
#[derive(Deserialize)]
pub struct OpenedDocument {
    /// URI, mostly of a file.
    pub uri: String,
    /// Version that the editor counts.
    pub version: Option<i64>,
    /// Text.
    pub text: String,
}

/// Changed document.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct ChangeParams {
    /// The document.
    pub text_document: DocumentId,
    /// Edits, in order.
    pub content_changes: Vec<TextChange>,
}

/// Saved or closed document.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct DocumentParams {
    /// The document.
    pub text_document: DocumentId,
}

/// Place of a hover or completion.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct PlaceParams {
    /// The document.
    pub text_document: DocumentId,
    /// The place.
    pub position: TextPosition,
}

/// Diagnostic of a document.
#[derive(Debug, PartialEq, Eq, Serialize)]
pub struct Diagnostic {
    /// Range with the problem.
    pub range: TextRange,
    /// 1 for an error, 2 for a warning.
    pub severity: u8,
    /// Name of this program.
    pub source: &'static str,
    /// Statement and fix.
    pub message: String,
}

/// Returns the abilities of the server.
pub fn capabilities() -> Value {
    json!({
        "capabilities": {
            // The only encoding that every client knows.
            "positionEncoding": "utf-16",
            // 2 is the incremental kind: clients send edits instead of whole
            // texts.
            "textDocumentSync": { "openClose": true, "change": 2, "save": true },
            "hoverProvider": true,
            "completionProvider": { "triggerCharacters": ["(", "[", "\"", "."] },
        },
        "serverInfo": { "name": "brakecheck", "version": env!("CARGO_PKG_VERSION") },
    })
}

/// Returns an answer.
pub fn answer(id: &RequestId, result: &Value) -> Value {
    json!({ "jsonrpc": "2.0", "id": id, "result": result })
}

/// Returns an answer that refuses. Without a number, the message had none that is known.
pub fn refusal(id: Option<&RequestId>, code: i32, what: &str) -> Value {
    json!({ "jsonrpc": "2.0", "id": id, "error": { "code": code, "message": what } })
}

/// Returns the notification of all problems of a document.
pub fn diagnostics(uri: &str, version: Option<i64>, list: &[Diagnostic]) -> Value {
    let mut params = json!({ "uri": uri, "diagnostics": list });
    if let Some(version) = version {
        // A `null` is no version to older clients, so the key is left out.
        params["version"] = json!(version);
    }
    json!({ "jsonrpc": "2.0", "method": "textDocument/publishDiagnostics", "params": params })
}

/// Returns a warning that the editor shows.
pub fn shown_warning(what: &str) -> Value {
    let params = json!({ "type": 2, "message": what });
    json!({ "jsonrpc": "2.0", "method": "window/showMessage", "params": params })
}

/// Returns the answer to a hover.
pub fn hover(document: &Document, explained: Option<Explained>) -> Value {
    explained.map_or(Value::Null, |it| {
        let contents = json!({ "kind": "markdown", "value": it.markdown });
        json!({ "contents": contents, "range": document.span(it.span) })
    })
}

/// Returns the answer to a completion.
pub fn completions(document: &Document, all: &Completions, has_snippets: bool) -> Value {
    let range = document.span(all.span.clone());
    let items = all
        .items
        .iter()
        .map(|item| shown(item, range, has_snippets));
    json!({ "isIncomplete": false, "items": items.collect::<Vec<_>>() })
}

fn shown(item: &Item, range: TextRange, has_snippets: bool) -> Value {
    // 2 is a snippet, whose `$0` is the cursor. Without it, the bracket stays open.
    let (format, text) = match item.behind {
        "" => (1, item.before.clone()),
        _ if !has_snippets => (1, item.before.clone()),
        behind => (2, format!("{}$0{behind}", item.before)),
    };
    let mut shown = json!({
        "label": item.label,
        // Numbers of `CompletionItemKind`: field, enum member, variable,
        // keyword.
        "kind": match item.kind {
            ItemKind::Field => 5,
            ItemKind::Variant => 20,
            ItemKind::Name => 6,
            ItemKind::Word => 14,
        },
        "insertTextFormat": format,
        "textEdit": { "range": range, "newText": text },
    });
    if !item.detail.is_empty() {
        shown["detail"] = json!(item.detail);
    }
    if !item.about.is_empty() {
        shown["documentation"] = json!({ "kind": "markdown", "value": item.about });
    }
    shown
}
